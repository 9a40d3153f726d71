"""Poisson's ratio towards 0.5: plain tetrahedra lock, the time step falls as √(1 - 2ν)."""

import math
from types import SimpleNamespace

import numpy as np

from ...contact.walls import Wall
from ...geometry.bodies.shapes import box
from ...materials.elastic import Elastic
from ...run.from_bodies import build, distribute, simulate
from ..case import case, compare
from .limits import NEVER, RHO, SIZE, E, Snapshot, bisect, growth, highest_frequency

RATIOS = (0.15, 0.3, 0.4, 0.45, 0.49, 0.499, 0.4999, 0.49999)
#: Bricks of the glued block along its sides and its height: two bricks high, all but its middle
#: nodes are glued.
TWO, COARSE, FINE = (4, 4, 2), (8, 8, 4), (12, 12, 6)


def stiffness(comm, nu, element, divisions=COARSE, strain=1e-5):
    """Stress over strain of a flat block glued between two platens, over E; one static increment.

    Returns:
        It, and the root mean square of the elements' pressure about a smooth one over its mean.
    """
    height, up = 0.5 * SIZE, np.eye(3)[2]
    mesh = distribute(comm, [box((SIZE, SIZE, height), divisions)])
    walls = [
        Wall("base", np.zeros(3), up, bonded=True),
        Wall("platen", height * up, -up, bonded=True, velocity=-strain * height * up),
    ]
    s = simulate(mesh, [Elastic(E, nu, RHO)], walls, increment=1.0, element=element)
    s.step()
    stress = 0.5 * np.abs(s.walls.force[:, 2]).sum() / SIZE**2
    # A plane and a paraboloid through the pressures of the elements.
    x = s.state.x[mesh.cells].mean(axis=1) / SIZE - 0.5
    p = -s.solid.mean_stress(s.state)
    powers = [(i, j, k) for i in range(5) for j in range(5) for k in range(3) if i + j + k < 5]
    A = np.stack([x[:, 0] ** i * x[:, 1] ** j * x[:, 2] ** k for i, j, k in powers], axis=1)
    rest = p - A @ np.linalg.lstsq(A, p, rcond=None)[0]
    return stress / (strain * E), float(rest.std() / p.mean()), s


def locking_map(comm, ratios=RATIOS):
    """One row for each ratio: stiffness with plain and averaged elements, fine, two bricks high."""
    rows, simulations = [], []
    for nu in ratios:
        row = SimpleNamespace(nu=nu)
        for name, element, divisions in (
            ("p1", "p1", COARSE), ("averaged", "averaged", COARSE), ("fine", "averaged", FINE),
            ("two", "averaged", TWO),
        ):  # fmt: skip
            value, uneven, s = stiffness(comm, nu, element, divisions)
            setattr(row, name, value)
            setattr(row, f"{name}_uneven", uneven)
            simulations.append(s)
        rows.append(row)
    return rows, simulations


def step_map(comm, ratios=RATIOS, trials=10):
    """Limits of the step of a free cube against Poisson's ratio.

    A row for each ratio has the limits [s], exact and measured, of both elements.
    """
    rows, simulations = [], []
    for nu in ratios:
        row = SimpleNamespace(nu=nu)
        for element in ("p1", "averaged"):
            s = build(
                comm, [box((SIZE,) * 3, (2, 2, 2))], Elastic(E, nu, RHO), np.zeros(3), np.zeros(3),
                axes="", element=element, refresh=NEVER,
            )  # fmt: skip
            exact = 2.0 / highest_frequency(s, springs=False)
            start = Snapshot(s)
            factor = bisect(
                lambda f, s=s, a=start, e=exact: growth(s, a, f * e)[1], 0.5, 1.5, trials
            )
            setattr(row, element, exact)
            setattr(row, f"{element}_measured", factor * exact)
            setattr(row, f"{element}_bound", s.dt_element)
            simulations.append(s)
        rows.append(row)
    return rows, simulations


@case("stability-incompressible", num_bodies=1)
def incompressible(comm):
    """ν to 0.49999: the step falls as √(1 - 2ν), averaged pressure does not lock, plain ones do.

    Args:
        comm: MPI communicator.
    """
    steps, simulations = step_map(comm, (0.499, 0.49999), 8)
    results = {}
    for element in ("p1", "averaged"):
        ratio = getattr(steps[1], element) / getattr(steps[0], element)
        # Shear adds 1 - 2ν to the bulk modulus.
        results[f"{element}: step at ν = 0.49999 over that at 0.499"] = compare(
            ratio, math.sqrt(0.01), 0.01
        )
        results[f"{element}: measured limit over 2/ω"] = compare(
            getattr(steps[1], f"{element}_measured") / getattr(steps[1], element), 1.0, 0.01
        )
    rows, more = locking_map(comm, (0.3, 0.4999))
    # Both converge from above, with the stress at the glued edges.
    results["glued block, ν = 0.3: averaged over fine"] = compare(
        rows[0].averaged / rows[0].fine, 1.0, 0.05
    )
    results["glued block, ν = 0.4999: averaged over fine"] = compare(
        rows[1].averaged / rows[1].fine, 1.0, 0.2
    )
    results["glued block, ν = 0.4999: plain over fine, 3 at least"] = compare(
        min(rows[1].p1 / rows[1].fine, 3.0), 3.0, 0.0
    )
    return results, [*simulations, *more]
