"""The one pass between two steps against the two kernels that do its halves."""

import platform

import numpy as np
import pytest

from mufe_fenicsx.kernels.build.native import load
from mufe_fenicsx.kernels.bulk import kick_drift
from mufe_fenicsx.kernels.bulk.kick_drift import KickAndDrift
from mufe_fenicsx.kernels.bulk.motion import accelerate_and_half_kick, half_kick_and_drift
from mufe_fenicsx.state import Constraint
from tests.contact.test_contact import collision

FOUR_LANES = pytest.param(
    ["-mno-avx512f"],
    marks=pytest.mark.skipif(platform.machine() != "x86_64", reason="an option of x86_64"),
)
NODES = 1037
#: Grains of sizes that are no multiple of the lanes; nodes 400 to 404 are of a rigid one.
RUNS = np.array([[0, 400, 1], [405, 700, 0], [700, NODES, 3]])


def random_motion(rng):
    """Positions, displacements, velocities, forces and first positions of all nodes."""
    scales = {"x": 1e-3, "u": 1e-6, "v": 1.0, "f": 1e-3, "x0": 1e-3}
    return {name: scale * rng.normal(size=(NODES, 3)) for name, scale in scales.items()}


@pytest.mark.parametrize("options", [[], FOUR_LANES])
@pytest.mark.parametrize("damping", [0.0, 2e3])
def test_one_pass_gives_the_bits_of_two(options, damping, monkeypatch):
    """Steps that are written out part a run into two kernels: it must go on as if they were not."""
    monkeypatch.setattr(kick_drift, "load", lambda name: load(name, *options))
    rng = np.random.default_rng(1)
    one = random_motion(rng)
    two = {name: values.copy() for name, values in one.items()}
    mass, field, last, dt = rng.uniform(1e-10, 1e-9, NODES), rng.normal(size=(4, 3)), 1e-6, 2e-6
    moves = np.full((2, 4), np.inf)

    lost, moved = KickAndDrift()(
        *(one[name] for name in ("x", "u", "v", "f")), mass, one["x0"], RUNS, last, dt, damping,
        field, moves[0],
    )  # fmt: skip
    a = np.zeros((NODES, 3))
    expected = accelerate_and_half_kick(a, two["v"], two["f"], mass, RUNS, last, damping)
    assert lost == expected and (lost > 0.0) == (damping > 0.0)
    assert moved == half_kick_and_drift(
        two["x"], two["u"], two["v"], a, two["f"], two["x0"], RUNS, dt, damping, field, moves[1]
    )

    for name in one:
        assert np.array_equal(one[name], two[name])
    assert not one["f"][:400].any() and one["f"][400:405].all()  # the rigid grain's stay
    assert np.array_equal(*moves) and np.isinf(moves[0, 2])


@pytest.mark.parametrize("at", [3, NODES - 1])
def test_a_node_that_is_not_finite_is_noticed(at):
    rng = np.random.default_rng(2)
    motion = random_motion(rng)
    motion["f"][at, 1] = np.nan
    _, moved = KickAndDrift()(
        *(motion[name] for name in ("x", "u", "v", "f")), np.ones(NODES), motion["x0"], RUNS,
        1.0, 1.0, 0.0, np.zeros((4, 3)), np.zeros(4),
    )  # fmt: skip
    assert moved == np.inf


@pytest.mark.parametrize(
    "friction, damping", [pytest.param(0.3, 0.0, marks=pytest.mark.mpi), (0.0, 1e4)]
)
def test_steps_that_leave_nodes_behind_bring_the_same_bits(friction, damping):
    """By the one pass through a collision, now and then by two, and by two throughout."""
    found = []
    for everywhere in (True, False):
        s = collision(friction=friction, damping=damping)
        for n in range(150):
            s.step(everywhere or n % 37 == 0)
        s.complete()
        bits = [s.state.x, s.state.u, s.state.v, s.state.a, s.force.x.array, s.walls.force]
        energies = s.energies()
        found.append(([values.copy() for values in bits], energies, s.contact.num_searches))
    one, two = found
    assert all(map(np.array_equal, one[0], two[0]))
    assert one[1:] == two[1:]
    assert one[1]["contact"] > 0.0 and one[2] > 1


class Asked(Constraint):
    """A constraint that notes what it is asked for."""

    def __init__(self, number, asked):
        self._number, self._asked = number, asked

    def drift(self, state, dt, damping, moves, field):
        self._asked.append(("drift", self._number))
        return 0.0

    def kick(self, mass, dt, damping):
        self._asked.append(("kick", self._number))
        return 3.0

    def complete(self, state):
        self._asked.append(("complete", self._number))

    def kinetic_energy(self, dt, damping):
        return 5.0


def test_constraints_are_asked_in_turn_and_back():
    """A step leaves the state halfway; one door brings it to the end, once."""
    s, asked = collision(friction=0.0), []
    before = s.kinetic_energy()
    s.specimen.constraints += Asked(1, asked), Asked(2, asked)
    assert s.kinetic_energy() == before + 10.0 and not asked
    s.step(everywhere=False)
    assert asked == [("drift", 1), ("drift", 2), ("kick", 2), ("kick", 1)]
    assert s.state.halfway and s.specimen.damped == 0.5 * 6.0  # a trapezium from none
    for _ in range(2):
        s.complete()
        assert asked[4:] == [("complete", 1), ("complete", 2)] and not s.state.halfway
