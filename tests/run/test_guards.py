"""A computation that goes wrong stops and says which element of which grain, and what to change."""

import mufe_fenicsx  # noqa: F401, before dolfinx: it loads MPI

# isort: split
import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.errors import SolverError
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.kernels.hardening import yield_stress_at
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.run.energy_guard import EnergyGuard
from mufe_fenicsx.run.from_bodies import build, drive

SIZE = 1e-3
TABLE = ((0.0, 10e6), (0.05, 110e6))


def squeezed(material, strain, steps_per_check=20):
    """Three cubes side by side on as many ranks, squeezed between their walls."""
    count = max(MPI.COMM_WORLD.size, 1)
    cubes = [box((SIZE,) * 3, (2, 2, 2), (2 * k * SIZE, 0, 0)) for k in range(count)]
    s = build(
        MPI.COMM_WORLD, cubes, material, (0, 0, 0), (2 * count * SIZE, SIZE, SIZE), axes="z",
        refresh=steps_per_check,
    )  # fmt: skip
    drive(s, {"z_max": (0, 0, -strain * SIZE)}, 20 * SIZE / material.wave_speed)
    return s


@pytest.mark.mpi
def test_a_table_that_must_not_be_left_stops_the_computation():
    with pytest.raises(SolverError, match=r"grain 1 .*plastic strain of .* ends at 0.05"):
        squeezed(J2(100e9, 0.15, 2650.0, TABLE, beyond="stop"), 0.2)
    assert squeezed(J2(100e9, 0.15, 2650.0, TABLE, beyond="flat"), 0.2).state.num_steps


@pytest.mark.mpi
def test_a_crushed_element_is_named():
    with pytest.raises(SolverError, match=r"element of grain \d+ .*(lost its volume|collapsed)"):
        squeezed(Elastic(100e9, 0.15, 2650.0), 1.2)


@pytest.mark.mpi
def test_energy_from_nowhere_stops_the_computation():
    """Steps beyond the limit of stability: the grain with the fastest elements is named."""
    count = max(MPI.COMM_WORLD.size, 2)
    divisions = [4 if k == count - 1 else 2 for k in range(count)]
    cubes = [box((SIZE,) * 3, (n, n, n), (2 * k * SIZE, 0, 0)) for k, n in enumerate(divisions)]
    s = build(
        MPI.COMM_WORLD, cubes, Elastic(100e9, 0.15, 2650.0), (0, 0, 0),
        (2 * count * SIZE, SIZE, SIZE), axes="z", refresh=400,
        velocity=lambda x, grain: np.sin(x / SIZE) * [0.1, 0.0, 0.0],
    )  # fmt: skip
    guard = EnergyGuard(s, 0.1)
    for _ in range(20):
        s.step()
    guard.check(s.energies(), "at the start")
    s.time_step_factor = 1.6  # of the springs of contact alone 1.4 is the limit
    s.update_time_step()
    with pytest.raises(
        SolverError, match=rf"came from nowhere soon, .* is in grain {count}, .*time_step_factor"
    ):
        for _ in range(200):
            s.step()
            guard.check(s.energies(), "soon")
    # Gains count before the sample carries load too, but not those of static increments.
    energies = s.energies()
    with pytest.raises(SolverError, match="came from nowhere"):
        guard.check(energies, "before", loaded=False)
    s.static = True
    EnergyGuard(s, 0.1).check(energies, "before", loaded=False)
    with pytest.raises(SolverError, match="came from nowhere"):
        EnergyGuard(s, 0.1).check(energies, "after")


def test_hardening_goes_on_with_the_last_slope_where_asked():
    row = J2(100e9, 0.15, 2650.0, TABLE, beyond="slope").parameters()
    # Linear through both points; round-off.
    assert yield_stress_at(0.1, row) == pytest.approx(210e6, rel=1e-12)
    assert yield_stress_at(0.1, J2(100e9, 0.15, 2650.0, TABLE).parameters()) == 110e6
    assert np.isfinite(row).all()
