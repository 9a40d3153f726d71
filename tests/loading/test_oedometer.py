"""The oedometer test: where its stages end, by steps and by increments, and why one fails."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.errors import SolverError
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.loading import oedometer
from mufe_fenicsx.loading.oedometer import LOADING, SEATED, OedometerLoading
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.run.from_bodies import axis_planes, build
from mufe_fenicsx.run.seating import hold_of
from mufe_fenicsx.scene import Oedometer

SIZE, STUFF = 1e-3, Elastic(1e9, 0.2, 2650.0)
SEATING_STRESS, STRAIN = 2e5, 4e-3


def cube(increment=None, **options):
    """A cube with room above it, a hundredth of its size."""
    return build(
        MPI.COMM_SELF, [box((SIZE,) * 3, (2, 2, 2))], STUFF, np.zeros(3),
        np.array([1.0, 1.0, 1.01]) * SIZE, increment=increment, **options,
    )  # fmt: skip


def load(sim, speed, most=400):
    """To the end; the loading, and forces at the end of its seating."""
    force = SEATING_STRESS * SIZE**2
    loading = OedometerLoading(sim, STRAIN, speed, 0.1 * STRAIN, force, speed)
    seated = None
    while not loading.finished:
        loading.before_step()
        if loading.stage == LOADING and seated is None:
            seated = sim.wall_forces()
        sim.step()
        assert sim.state.num_steps < most
    return loading, seated


@pytest.mark.parametrize("damping", [0.0, 1e4])
def test_seating_ends_at_rest(damping):
    """The platen strikes the cube, and holds it until both platens carry the stress at rest."""
    sim = cube(damping=damping)
    test = Oedometer(STRAIN, 0.2, 0.1 * STRAIN, SEATING_STRESS, 5.0, seating_at_rest=True)
    force, hold = SEATING_STRESS * SIZE**2, hold_of(sim, test)
    loading = OedometerLoading(sim, STRAIN, 0.2, 0.1 * STRAIN, force, 5.0, make_hold=hold)
    fastest = 0.0
    while loading.stage != LOADING:
        loading.before_step()
        fastest = max(fastest, loading.speed_now)
        if loading.stage != LOADING:
            sim.step()
        assert sim.state.num_steps < 4000
    energies, forces = sim.energies(), sim.wall_forces()
    assert fastest == pytest.approx(5.0)
    assert energies["kinetic"] < 0.03 * energies["elastic"]
    assert forces[4:] == pytest.approx([force, force], rel=0.12)  # means are within 0.1
    assert sim.damping == damping
    assert loading.speed_now < 0.01 * test.speed  # the ramp begins at rest


def test_a_hold_without_rest_ends_and_is_told(monkeypatch):
    """Of a cube that the platen strikes, given up at once."""
    monkeypatch.setattr(oedometer, "LONGEST", 0.0)
    sim = cube()
    test = Oedometer(STRAIN, 0.2, 0.1 * STRAIN, SEATING_STRESS, 5.0, seating_at_rest=True)
    force, hold = SEATING_STRESS * SIZE**2, hold_of(sim, test)
    loading = OedometerLoading(sim, STRAIN, 0.2, 0.1 * STRAIN, force, 5.0, make_hold=hold)
    while loading.stage != LOADING:
        loading.before_step()
        sim.step()
        assert sim.state.num_steps < 400
    assert "of the seating stress after 0 times that a wave travels" in loading.take_notice()
    assert loading.take_notice() is None and sim.damping == 0.0


def test_increments_end_where_the_stages_of_loading_do():
    """The seating by bisection, the strain by a last increment that is cut.

    One increment takes the platen over 2 % of the height: without an end it would pass both.
    """
    speed = 1.0
    sim = cube(increment=0.02 * SIZE / speed)
    loading, seated = load(sim, speed)
    wanted = SEATING_STRESS * SIZE**2
    top, bottom = seated[5], seated[4]
    assert wanted <= min(top, bottom) <= (1 + SEATED) * wanted
    assert loading.strain == pytest.approx(STRAIN, rel=1e-9)
    # Linear: the same place as by short increments, both within the force's tolerance.
    fine = load(cube(increment=0.0004 * SIZE / speed), speed)[0].reference_height
    assert fine == pytest.approx(loading.reference_height, abs=SEATED * 3e-4 * SIZE)


def test_walls_hold_their_stress_over_their_present_area():
    """The top comes down by a tenth: the force of a side wall does too, its stress does not."""
    stress, area = 3e4, 1.01 * SIZE**2
    side = Wall("x_min", np.zeros(3), np.array([1.0, 0.0, 0.0]), target=stress * area, speed=0.1)
    size = np.array([1.0, 1.0, 1.01]) * SIZE
    walls = [Wall(n, *p) for n, p in axis_planes(np.zeros(3), size).items() if n != "x_min"]
    sim = build(MPI.COMM_SELF, [box((SIZE,) * 3, (1, 1, 1))], STUFF, np.zeros(3), size, axes="",
                walls=[side, *walls])  # fmt: skip
    loading = OedometerLoading(sim, STRAIN, 1.0, 0.0, 1.0, 1.0)
    loading.before_step()
    assert side.target == pytest.approx(stress * area, rel=1e-12)
    sim.walls.point[5, 2] -= 0.1 * size[2]
    loading.before_step()
    assert side.target == pytest.approx(0.9 * stress * area, rel=1e-12)


def test_damping_keeps_below_its_step_and_its_energies_above_zero():
    """Damping of thrice the limit of the step: steps are shorter, not velocities turned round."""
    free = cube().dt
    sim = cube(damping=3.0 / free)
    assert sim.damping * sim.dt <= 1.0
    sim.walls.velocity[5, 2] = -5.0
    kinetic = []
    for _ in range(100):
        sim.step()
        kinetic.append(sim.energies()["kinetic"])
    # Where a node is first touched the damping of half a step is missing, of what is little then.
    assert max(kinetic) > 0.0 and min(kinetic) > -1e-3 * max(kinetic)


def test_a_seating_that_fails_by_damping_says_so():
    sim = cube(damping=1e9)
    sim.update_time_step()
    with pytest.raises(SolverError, match=r"seating force of 0\.2 N: solver\.damping = 1e\+09 1/s"):
        loading = OedometerLoading(sim, STRAIN, 20.0, 0.0, 0.2, 20.0)
        loading.first_height = loading.reference_height = 10 * SIZE  # as if it had come so far
        sim.energies = lambda: {"damping": 0.9, "work": 1.0}
        loading.before_step()
