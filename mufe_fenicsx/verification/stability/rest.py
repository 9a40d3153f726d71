"""A packing at rest: what rounding does to energy and forces over a million steps."""

from types import SimpleNamespace

import numpy as np

from ..soak import advance, packing_to_hold


def at_rest(
    comm, steps=1_000_000, strain=0.02, speed=1.0, element_size=0.9, records=60, settle=0.5
):
    """The grains of `verification.soak`, compressed, held and watched. Collective.

    Args:
        comm: MPI communicator.
        steps: After the platen has stopped and the grains have come to rest.
        strain, speed, element_size: Of `soak`.
        records: How many, evenly in the logarithm of the steps.
        settle: Time steps of rest before, over the steps that loading took.

    Returns:
        Steps, and drifts since the first of them: of elastic and contact energy and of the
        residual over the elastic energy, of the largest wall force over the mean, kinetic over
        elastic energy; number of grains, simulation.
    """
    s, loading = packing_to_hold(comm, strain, speed, element_size)
    while not loading.finished:
        advance(s, loading)
    for _ in range(int(settle * s.state.num_steps)):
        advance(s, loading)
    at = np.unique(np.round(np.geomspace(1, steps, records)).astype(int))
    first, forces = s.energies(), s.wall_forces()
    begin, rows = s.state.num_steps, []
    for due in at:
        while s.state.num_steps - begin < due:
            s.step(everywhere=False)
        e, now = s.energies(), s.wall_forces()
        scale = first["elastic"]
        rows.append(
            (
                due,
                abs(e["elastic"] + e["contact"] - first["elastic"] - first["contact"]) / scale,
                abs(e["residual"] - first["residual"]) / scale,
                np.abs(now - forces).max() / forces.mean(),
                e["kinetic"] / scale,
            )
        )
    s.check()
    columns = np.array(rows).T
    return SimpleNamespace(
        steps=columns[0], elastic=columns[1], residual=columns[2], force=columns[3],
        kinetic=columns[4], num_grains=int(s.mesh.labels.size), simulation=s,
    )  # fmt: skip
