"""Contact where surfaces have edges and corners, and where bodies come fast."""

import mufe_fenicsx  # noqa: F401, before dolfinx: it loads MPI

# isort: split
import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.explicit.simulation import Simulation
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.mesh import create_grain_mesh
from mufe_fenicsx.verification.sliding_normal import ridge
from mufe_fenicsx.verification.tets import feature_up, rotation
from tests.bodies import sphere

QUARTZ = Elastic(100e9, 0.15, 2650.0)
TURN = rotation([1.0, 2.0, -0.7], 1.1)


class TwoBodies:
    """Two rigid bodies on this rank, the second one moved by hand."""

    def __init__(self, first, second, friction=0.0, contact_at="nodes"):
        points = np.vstack([first[0], second[0]]) @ TURN.T
        cells = np.vstack([first[1], second[1] + len(first[0])])
        grain = np.repeat([0, 1], [len(first[1]), len(second[1])])
        mesh = create_grain_mesh(
            MPI.COMM_SELF, points, cells, grain, np.array([1, 2]), np.array([0, 0])
        )
        self.contact = Simulation(mesh, [QUARTZ] * 2, friction=friction, points=contact_at).contact
        self.x = mesh.x.copy()
        self.second = mesh.grain_of_node == np.flatnonzero(mesh.grains == 1)[0]

    def move(self, vector):
        """Force on the second body after it has moved on, in axes that turn with the bodies."""
        self.x[self.second] += TURN @ vector
        f = np.zeros_like(self.x)
        self.contact.begin_step(self.x)
        self.contact.add_forces(f, self.x)
        # Round-off of the sums.
        size = np.abs(f).sum()
        assert np.abs(f.sum(axis=0)).max() <= 1e-14 * size
        assert np.abs(np.cross(self.x, f).sum(axis=0)).max() <= 1e-12 * size
        return TURN.T @ f[self.second].sum(axis=0)


@pytest.mark.parametrize("points", ["nodes", "facets", "edges"])
def test_energy_is_the_work_of_the_force_beyond_the_largest_depth(points):
    """There the force grows no more: k D (d - D/2) of each spring, there and back."""
    if points == "edges":
        lower, (x, cells) = ridge(4), ridge(4)
        # Upside down and crosswise, the edges cross at their middles.
        turn = np.array([[0, 1.0, 0], [1, 0, 0], [0, 0, -1]])
        bodies = TwoBodies(lower, (x @ turn + [0.125, 0.125, 1e-3], cells), contact_at="facets")
    else:
        bodies = TwoBodies(
            box((1.0, 1.0, 1.0), (4, 4, 4), (0, 0, 0)),
            box((0.6, 0.6, 1.0), (2, 2, 3), (0.21, 0.19, 1.001)),
            contact_at=points,
        )
    contact = bodies.contact
    # Of the edges of 1/4 here, and in the other case of these with edges of 0.3.
    largest = {"nodes": 0.038, "facets": 0.038, "edges": 0.026}[points]
    steps, way = 500, 2 * largest + 1e-3
    work, force, plateau = 0.0, 0.0, 0.0
    for direction in (-1.0, 1.0):
        for _ in range(steps):
            before = force
            force = bodies.move([0, 0, direction * way / steps])[2]
            work -= 0.5 * (before + force) * direction * way / steps
            plateau = max(plateau, force)
        if direction < 0:
            assert force == pytest.approx(plateau, rel=1e-9) and contact.counts()[2] > 0
            # Trapezoidal rule: at the two kinks up to (way/steps)²/8 of each spring is missing.
            assert contact.energy()[0] == pytest.approx(work, rel=1e-5)
            stored = work
    assert contact.energy() == (0.0, 0)
    assert abs(work) < 1e-5 * stored
    assert contact.dissipation.total == 0 and contact.overlaps.num_accepted == 0


def tip(at, direction):
    """A tetrahedron of edge 1 with its vertex at a point and all else along a direction."""
    direction = np.asarray(direction) / np.linalg.norm(direction)
    axis = np.cross([0.0, 0.0, -1.0], direction)
    x = feature_up("V")
    if np.linalg.norm(axis) < 1e-12:
        axis = np.array([1.0, 0.0, 0.0])  # straight up or down: any level one
    x = x @ rotation(axis, np.arccos(-direction[2])).T
    return x + at, np.array([[0, 1, 2, 3]])


@pytest.mark.parametrize(
    "place, direction",
    [
        ((0.5, 0.5, 1.0), (0, 0, 1)),  # above the diagonal of a face
        ((0.5, 0.0, 1.0), (0, -1, 1)),  # above an edge
        ((0.0, 0.0, 1.0), (-1, -1, 1)),  # above a corner
    ],
)
def test_a_node_straight_above_a_feature(place, direction):
    """Open before it touches, pressed back the way it came, in whatever direction."""
    direction = np.array(direction) / np.linalg.norm(direction)
    at = np.array(place) + 1e-3 * direction
    bodies = TwoBodies(box((1.0, 1.0, 1.0), (1, 1, 1), (0, 0, 0)), tip(at, direction))
    for _ in range(9):
        assert not bodies.move(-1e-4 * direction).any()
    force = bodies.move(-2e-4 * direction)
    # Just through the feature the nearest face is one of those around it, whose normal has this
    # cosine with the direction; the edges that cross push straight back.
    cosine = np.count_nonzero(direction) ** -0.5
    assert force @ direction > (cosine - 1e-9) * np.linalg.norm(force) > 0
    assert bodies.contact.overlaps.num_accepted == 0


def test_a_node_beside_a_sharp_edge_is_pressed_back_through_its_face():
    """A block on an equal one, 0.002 beside it and five times as deep.

    The sides are nearer to its corners than the top, but it cannot rest on those sides.
    """
    lower = box((1.0, 1.0, 1.0), (2, 2, 2), (0, 0, 0))
    upper = box((1.0, 1.0, 1.0), (2, 2, 2), (-0.002, -0.002, 1.001))
    bodies = TwoBodies(lower, upper)
    for _ in range(11):
        force = bodies.move([0, 0, -1e-3])
    # Crossings are pushed along their edges, away from the nodes that they meet 0.002 beside.
    assert force[2] > 0 and np.abs(force[:2]).max() < 1e-3 * force[2]
    # Each block has 4 of its 9 nodes above or below the other, the corner's among them.
    pairs = bodies.contact.pairs
    assert np.abs(pairs.normal[pairs.closed] @ TURN)[:, :2].max() < 1e-9
    assert pairs.closed.sum() == 2 * 4
    assert pairs.gap[pairs.closed] == pytest.approx(-0.01, rel=1e-6)


def test_equal_blocks_on_each_other_meet_with_all_their_nodes():
    """Edges on edges and corners on corners: none slips past."""
    bodies = TwoBodies(
        box((1.0, 1.0, 1.0), (3, 3, 3), (0, 0, 0)),
        box((1.0, 1.0, 1.0), (3, 3, 3), (0, 0, 1.001)),
    )
    for _ in range(12):
        bodies.move([0, 0, -1e-4])
    pairs = bodies.contact.pairs
    assert pairs.closed.sum() == 2 * 4 * 4
    assert pairs.gap[pairs.closed] == pytest.approx(-2e-4, rel=1e-6)
    assert bodies.contact.overlaps.num_accepted == 0


def notched(at, direction, friction):
    """Three cubes around a notch with its edge at (1, 1, z), and the tip of a tetrahedron."""
    points, cells = box((2.0, 2.0, 1.0), (2, 2, 1))
    centre = points[cells].mean(axis=1)
    cells = cells[~((centre[:, 0] > 1) & (centre[:, 1] > 1))]
    nodes, cells = np.unique(cells, return_inverse=True)
    # Minus: turned by a right angle, the body of `tip` lies on the other side of its vertex.
    return TwoBodies((points[nodes], cells.reshape(-1, 4)), tip(at, -direction), friction)


OUT = np.array([1.0, 1.0, 0.0]) / np.sqrt(2)


def test_friction_in_a_notch_does_no_work_at_rest():
    """A tip in the bottom of a notch, past its edge: it slips once, then nothing moves."""
    # Off the bisector, so that the normal is that of no facet.
    bodies = notched(np.array([1.0, 1.0, 0.4]) + 1e-3 * OUT, OUT + np.array([0.3, 0.0, 0.0]), 0.3)
    for _ in range(10):
        bodies.move(-3e-4 * OUT)
    for _ in range(10):
        bodies.move([1e-4, -1e-4, 2e-4])
    slipped = bodies.contact.dissipation.total
    assert slipped > 0
    for _ in range(20):
        force = bodies.move(np.zeros(3))
    assert force @ OUT > 0
    # Rounding of the stick point's place.
    assert bodies.contact.dissipation.total - slipped < 1e-9 * slipped


def test_friction_into_a_notch_keeps_the_angular_momentum():
    """Along a flank into the bottom: there friction has a part across the facet it acts on."""
    bodies = notched(np.array([1.001, 1.004, 0.4]), OUT, 0.3)
    for _ in range(4):
        bodies.move([-5e-4, 0.0, 0.0])
    for _ in range(20):
        force = bodies.move([0.0, -3e-4, 0.0])  # momenta are checked at each move
    # Past the edge by 0.001 and 0.002: the closest feature is the edge.
    normals = bodies.contact.pairs.normal[bodies.contact.pairs.closed] @ TURN
    assert (np.abs(normals[:, :2]).min(axis=1) > 0.1).any() and force[1] > 0


@pytest.mark.parametrize("phase", np.linspace(0, 0.9, 4))
def test_fast_bodies_are_seen_before_they_touch(phase):
    """A ball that speeds up to a tenth of an edge a step: no contact is first seen deep."""
    h = 0.4
    points, cells = sphere(1.0, h)
    gap = 0.6 * h
    bodies = TwoBodies((points, cells), (points + np.array([0, 0, 2.0 + gap]), cells))
    step, way, force = 0.01 * h, 0.0, np.zeros(3)
    step *= 1 + phase
    while not force.any():
        force = bodies.move([0, 0, -step])
        way += step
        step = min(2 * step, 0.1 * h)
        assert way < gap + 0.2 * h
    assert bodies.contact.overlaps.num_accepted == 0
    assert force[2] > 0
    # The poles are nodes of no mesh: facets lie up to h²/8 below the sphere, on both.
    assert way > gap - 1e-12
