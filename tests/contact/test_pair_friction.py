"""Static and kinetic friction by pair of materials: facets, edges, steps and increments."""

import mufe_fenicsx  # noqa: F401, before dolfinx: it loads MPI

# isort: split
import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.contact.friction import PairFriction
from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.explicit.simulation import Simulation
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.implicit.simulation import ImplicitSimulation
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.run.from_bodies import distribute
from mufe_fenicsx.verification.tets import rotation
from tests.bodies import sphere
from tests.contact.test_edge_contacts import NUM_PAIRS, Ridges

COMM = MPI.COMM_WORLD
QUARTZ = Elastic(100e9, 0.15, 2650.0)
UP = np.array([0.0, 0.0, 1.0])
UPPER = ("quartz", "steel", "glass")
#: Static and kinetic coefficients of these on quartz: of two pairs, and of none.
EXPECTED = np.array([(0.5, 0.3), (0.2, 0.2), (0.4, 0.35)])
PAIRS = {("quartz", "quartz"): (0.5, 0.3), ("steel", "quartz"): 0.2, ("steel", "glass"): 0.9}
KINETIC = 0.35  #: of no pair


class Blocks:
    """Blocks of several materials on one base, or on a plane, moved by hand; rigid. Collective."""

    def __init__(self, points, walls=()):
        side = (0.3,) * 3
        bodies = [box((2.0, 1.0, 0.2), (8, 4, 1), (0, 0, -0.2 if not walls else 1.0))]
        bodies += [box(side, (2, 2, 2), (0.2 + 0.6 * k, 0.33, 0.0)) for k in range(len(UPPER))]
        self.mesh = distribute(COMM, bodies)
        friction = PairFriction(0.4, ["quartz", *UPPER], PAIRS)
        self.contact = Simulation(
            self.mesh, [QUARTZ] * self.mesh.num_grains, walls, friction=friction,
            friction_kinetic=KINETIC, points=points,
        ).contact  # fmt: skip
        self.x = self.mesh.x.copy()
        self.grain = self.mesh.grains[self.mesh.grain_of_node]

    def move(self, vector):
        """Friction over normal force on each block."""
        self.x[self.grain > 0] += vector
        f, force = np.zeros_like(self.x), np.zeros((1 + len(UPPER), 3))
        self.contact.begin_step(self.x)
        self.contact.add_forces(f, self.x)
        np.add.at(force, self.grain, f)
        force = COMM.allreduce(force)[1:]
        return np.hypot(force[:, 0], force[:, 1]) / force[:, 2]


def check_slip(ratios, expected, step):
    """What is dragged rises to the static coefficient, then stays at the kinetic one.

    Args:
        ratios: Friction over normal force, shape (num_steps, num_contacts).
        expected: Static and kinetic coefficients, shape (num_contacts, 2).
        step: By how much a step raises a ratio, at most.
    """
    for ratio, (static, kinetic) in zip(np.transpose(ratios), expected, strict=True):
        # Rounding of depths a thousandth of the bodies.
        slips = np.isclose(ratio, kinetic, rtol=1e-9)
        first = len(ratio) - int(np.argmin(slips[::-1]))
        assert slips[-1] and 1 < first < len(ratio) - 5
        assert static - step < ratio[:first].max() <= static * (1 + 1e-9)


@pytest.mark.parametrize("points", [pytest.param("facets", marks=pytest.mark.mpi), "nodes"])
def test_blocks_slip_at_the_coefficients_of_their_pairs(points):
    """Three materials on one: two pairs, and one that the table does not name."""
    blocks = Blocks(points)
    blocks.move(-1e-3 * UP)
    ratios = [blocks.move(np.array([3e-5, 1e-5, 0.0])) for _ in range(40)]
    # The spring grows by 3.2e-5 over a depth of 1e-3, its stiffness is less than the normal one.
    check_slip(ratios, EXPECTED, 0.032)


def test_walls_keep_their_own_coefficients():
    wall = Wall("plane", np.zeros(3), UP, 0.45, friction_kinetic=0.25)
    blocks = Blocks("facets", [wall])
    blocks.move(-1e-3 * UP)
    ratios = [blocks.move(np.array([3e-5, 1e-5, 0.0])) for _ in range(40)]
    check_slip(ratios, [(0.45, 0.25)] * len(UPPER), 0.032)


@pytest.mark.mpi
def test_edges_slip_at_the_coefficients_of_their_pairs():
    """Crossed ridges, the two of a pair on different ranks; of each the one closed crossing."""
    materials = [name for upper in UPPER for name in ("quartz", upper)]
    ridges = Ridges(1e-3, PairFriction(0.4, materials, PAIRS), KINETIC)
    ridges.move(np.array([0.0, 0.0, -6e-3]), 6)
    ratios = []
    for _ in range(40):
        ridges.move(np.array([7.5e-5, 5e-5, 0.0]), 1)
        p, ratio = ridges.contact.edges.pairs, np.zeros(NUM_PAIRS)
        on = np.flatnonzero(p.closed)
        depth = np.minimum(p.offset[on] - p.gap[on] - p.recess[on], p.largest_depth[on])
        shear = np.linalg.norm(p.shear[on], axis=1)
        np.add.at(ratio, p.grain[on] // 2, shear / (p.stiffness[on] * depth))
        ratios.append(COMM.allreduce(ratio))
    # The spring grows by 9e-5 over a depth of 2.3e-3, its stiffness is less than the normal one.
    check_slip(ratios, EXPECTED, 0.04)


@pytest.mark.parametrize("spectral_radius", [None, 0.5])
def test_increments_slip_at_the_coefficients_of_their_pairs(spectral_radius):
    """Two stacks pressed and sheared by one platen, by static and by implicit increments."""
    shapes = [((1.0,) * 3, (2, 2, 2)), ((0.9, 0.9, 1.0), (3, 3, 3))]
    bodies = []
    for k in range(2):
        for (size, divisions), place in zip(shapes, ((0, 0, 0), (0.07, 0.02, 1.0)), strict=True):
            points, cells = box(size, divisions)
            bodies.append((points + np.array(place) + [2.0 * k, 0, 0], cells))
    mesh = distribute(COMM, bodies)
    soft = Elastic(1e9, 0.3, 2650.0)
    walls = [Wall("low", np.zeros(3), UP, friction=0.9), Wall("top", 2 * UP, -UP, friction=0.9)]
    names = ["quartz", "quartz", "quartz", "steel"]
    pairs = {("quartz", "quartz"): (0.1, 0.08), ("quartz", "steel"): (0.05, 0.03)}
    sim = ImplicitSimulation(
        mesh, [soft] * mesh.num_grains, walls, friction=PairFriction(0.9, names, pairs),
        first_step=1.0, spectral_radius=spectral_radius, stabilisation=1e-3,
    )  # fmt: skip
    for push, side in ((-0.01, 0.0), (-0.01, 0.002), (-0.001, 0.004), (-0.001, 0.004)):
        sim.walls.velocity[1], sim.dt = [side, 0.3 * side, push], 1.0
        sim.step()
    p = sim.contact.pairs
    ratio = np.linalg.norm(p.shear, axis=1) / np.where(p.closed, p.normal_force, 1.0)
    lower = np.minimum(p.grain, sim.contact.points.grain_of_point[p.node])
    for grain, (static, kinetic) in ((0, (0.1, 0.08)), (2, (0.05, 0.03))):
        here = p.closed & (lower == grain)
        assert COMM.allreduce(int((here & p.sliding).sum())) > 5
        # Rounding: springs are shortened to the limit.
        np.testing.assert_allclose(ratio[here & p.sliding], kinetic, rtol=1e-12)
        assert np.all(ratio[here] <= static * (1 + 1e-12))


def tumbled(friction, friction_kinetic):
    """Positions after eight balls and boxes were thrown together, and how many contacts slid."""
    rng, bodies = np.random.default_rng(3), []
    for k in range(8):
        points, cells = box((0.95,) * 3, (2, 2, 2), (-0.475,) * 3) if k % 3 else sphere(0.5, 0.35)
        turn = rotation(rng.normal(size=3), 0.01 + 0.03 * rng.random())
        place = 0.975 * np.array([k % 2, k // 2 % 2, k // 4])
        bodies.append((1e-3 * (points @ turn.T + place), cells))
    mesh = distribute(MPI.COMM_SELF, bodies)
    grain = mesh.grain_of_node
    velocity = -3e4 * mesh.x + 12.0 * np.sin(np.outer(grain, [1.0, 2.0, 3.0]))
    s = Simulation(
        mesh, [QUARTZ] * mesh.num_grains, friction=friction, friction_kinetic=friction_kinetic,
        velocity=velocity,
    )  # fmt: skip
    slid = np.zeros(2, dtype=int)
    for _ in range(200):
        s.step()
        slid += s.contact.pairs.sliding.sum(), s.contact.edges.pairs.sliding.sum()
    return s.state.x.copy(), slid


def test_equal_pairs_are_one_coefficient_and_their_order_is_none():
    """Bit by bit; and with other coefficients the motion is another one."""
    names = ["a", "b", "c", "a", "b", "c", "a", "b"]
    both = [(a, b) for a in "abc" for b in "abc" if a <= b]
    alone, slid = tumbled(0.3, 0.2)
    assert slid.min() > 0
    equal = dict.fromkeys(both, (0.3, 0.2))
    np.testing.assert_array_equal(tumbled(PairFriction(0.9, names, equal), None)[0], alone)
    mixed = {pair: (0.1 * k, 0.05 * k) for k, pair in enumerate(both, start=1)}
    turned = {(b, a): mixed[a, b] for a, b in reversed(both)}
    first = tumbled(PairFriction(0.9, names, mixed), None)[0]
    np.testing.assert_array_equal(tumbled(PairFriction(0.9, names, turned), None)[0], first)
    assert np.abs(first - alone).max() > 0.0


@pytest.mark.parametrize(
    "materials, pairs, said",
    [
        (["a", "b"], {("a", "c"): 0.2}, r"friction of a-c = 0.2, expected materials .*: a, b"),
        (["a", "b"], {("a", "b"): 0.2, ("b", "a"): 0.3}, r"of b-a = 0.3, expected one entry"),
        (["a", "b"], {("a", "b"): -0.2}, r"friction of a-b = -0.2, expected >= 0"),
        (["a", "b"], {("a", "b"): (0.2, 0.3)}, r"kinetic friction of a-b = 0.3, expected 0 <="),
    ],
)
def test_a_pair_that_cannot_be_is_refused(materials, pairs, said):
    with pytest.raises(InputError, match=said):
        PairFriction(0.1, materials, pairs)


def test_materials_are_those_of_all_grains():
    mesh = distribute(MPI.COMM_SELF, [box((1.0,) * 3, (2, 2, 2))])
    friction = PairFriction(0.1, ["a", "b"], {("a", "b"): 0.2})
    with pytest.raises(InputError, match="materials = 2, expected one a grain, 1"):
        Simulation(mesh, [QUARTZ], friction=friction)
