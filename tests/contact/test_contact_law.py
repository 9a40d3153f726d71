"""The normal force of a contact follows from where its bodies are, and from nothing else."""

import mufe_fenicsx  # noqa: F401, before dolfinx: it loads MPI

# isort: split
import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.contact.pairs.facet_pairs import Pairs
from mufe_fenicsx.contact.search import connect
from mufe_fenicsx.contact.walls import rotation_of
from mufe_fenicsx.explicit.simulation import Simulation
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.mesh import create_grain_mesh
from mufe_fenicsx.verification.sliding_normal import WIDE, H, frustum
from tests.bodies import RADIUS, sphere

QUARTZ = Elastic(100e9, 0.15, 2650.0)
DEPTH = 0.008 * H


def simulation_of_bodies(bodies, **options):
    """Bodies (points, cells) with labels 1, 2, … on this rank."""
    offset = np.cumsum([0] + [len(points) for points, _ in bodies])
    mesh = create_grain_mesh(
        MPI.COMM_SELF,
        np.concatenate([points for points, _ in bodies]),
        np.concatenate([cells + o for (_, cells), o in zip(bodies, offset, strict=False)]),
        np.repeat(np.arange(len(bodies)), [len(cells) for _, cells in bodies]),
        np.arange(1, len(bodies) + 1),
        np.zeros(len(bodies), dtype=int),
    )
    return Simulation(mesh, [QUARTZ] * len(bodies), **options)


class Slider:
    """A rigid slider over a rigid base, moved by hand."""

    def __init__(self, angle, place, friction=0.0, graded=False):
        base = box((14 * H, 9 * H, H), (28, 18, 2), (-7 * H, -4.5 * H, -H))
        if graded:
            base[0][:, 0] += 2 * H * np.cos(base[0][:, 0] * np.pi / (14 * H))
        points, cells = frustum(angle)
        turned = points @ rotation_of(np.array([0, 0, 0.3])).T
        s = simulation_of_bodies(
            [base, (turned + place + [0, 0, 0.01 * H], cells)], friction=friction
        )
        self.contact, self.x, self.above = s.contact, s.mesh.x.copy(), s.mesh.grain_of_node == 1
        self.work, self.last = 0.0, np.zeros(3)
        self.move([0, 0, -0.01 * H - DEPTH], 40)

    def move(self, way, steps=1):
        """Forces on all nodes after so many steps of a way [m], shape (num_nodes, 3)."""
        step = np.asarray(way) / steps
        for _ in range(steps):
            self.x[self.above] += step
            f = np.zeros_like(self.x)
            self.contact.begin_step(self.x)
            self.contact.add_forces(f, self.x)
            now = f[self.above].sum(axis=0)
            self.work -= 0.5 * (now + self.last) @ step
            self.last = now
        return f


@pytest.mark.parametrize("graded", [False, True])
@pytest.mark.parametrize("angle", [90.0, 60.0, 22.0, 15.0])
def test_drawn_bodies_carry_what_they_carry_pressed_anew(angle, graded):
    """There and back and aside over facets and edges, with sharp and blunt edges of its own."""
    start = np.array([-1.3 * H, 0.05 * H, 0.0])
    ways = H * np.array([[2.0, 0.9, 0.0], [-0.7, -1.3, 0.0], [1.1, 0.2, 0.0]])
    drawn = Slider(angle, start, graded=graded)
    for way in ways:
        f = drawn.move(way, 150)
    anew = Slider(angle, start + ways.sum(axis=0), graded=graded)
    # Rounding of positions over the depth of contact.
    np.testing.assert_allclose(f, anew.move(np.zeros(3)), atol=1e-9 * np.abs(f).max())
    assert drawn.contact.dissipation.total == 0.0
    of_facets = drawn.contact.pairs.node < drawn.contact.points.num_in_facets
    assert not drawn.contact.pairs.offset[of_facets].any()


def test_a_pair_has_the_share_that_its_facet_gives_it_now():
    """Of the contact's area, by both facets in the reference: the two sides add up to one."""
    slider = Slider(90.0, np.array([-2.0 * H, 0.0, 0.0]), graded=True)
    slider.move([3.0 * H, 0.4 * H, 0.0], 150)
    c, p = slider.contact, slider.contact.pairs
    on = np.flatnonzero(p.closed)
    facet, point = p.candidate[p.closest[on]], p.node[on]
    own, other = c.points.facet_area[point], c.surface.area_of_facet[facet]
    share = other**2 / (own**2 + other**2)
    assert np.ptp(share) > 0.3 and on.size > WIDE**2
    layers = c.points.layer[point] + c.surface.layer_of_facet[facet]
    np.testing.assert_allclose(p.stiffness[on], share * c.points.area[point] / layers, rtol=1e-14)
    np.testing.assert_allclose(c.areas(on), share * c.points.area[point], rtol=1e-14)


def test_what_springs_gain_and_lose_at_edges_is_counted():
    """Work, stored energy and what switching took close but for the steps of the sum."""
    slider = Slider(90.0, np.array([-1.3 * H, 0.05 * H, 0.0]))
    before = slider.work - slider.contact.energy()[0]
    slider.move([0.8 * H, 0.3 * H, 0.0], 1600)
    stored = slider.contact.energy()[0]
    left = slider.work - before - stored - slider.contact.dissipation.switched
    assert abs(slider.contact.dissipation.switched) > 1e-3 * stored
    # Of the first order in a step, 0.07 of the depth: so far a point is behind the side it passed.
    assert abs(left) < 0.07 * abs(slider.contact.dissipation.switched)


def test_contact_of_smooth_surfaces_is_the_slope_of_their_energy():
    """Nodes of coarse balls moved at random: facets tilt, and points stand over them."""
    points, cells = sphere(RADIUS, 0.35 * RADIUS)
    turned = points @ rotation_of(np.array([0.4, 0.3, 0.2])).T + [[0.0, 0.0, 2.01 * RADIUS]]
    s = simulation_of_bodies([(points, cells), (turned, cells)])
    contact, x, above = s.contact, s.mesh.x.copy(), s.mesh.grain_of_node == 1
    way = np.random.default_rng(1).normal(size=x.shape)

    def energy_at(part):
        forces = np.zeros_like(x)
        contact.begin_step(x + part * way)
        contact.add_forces(forces, x + part * way)
        return contact.energy()[0], forces

    small = 1e-8 * RADIUS
    for _ in range(20):
        x[above] -= [0.0, 0.0, 0.005 * RADIUS]
        energy_at(0.0)
    forces, closed = energy_at(0.0)[1], contact.pairs.closed.copy()
    more, less = energy_at(small)[0], energy_at(-small)[0]
    assert closed.sum() > 5 and np.array_equal(closed, contact.pairs.closed)
    # Differences of energies that are rounded to 1e-15, over parts of some 1e-6 of them.
    assert -np.vdot(forces, way) == pytest.approx((more - less) / (2.0 * small), rel=1e-7)


@pytest.mark.parametrize("edge", [0.12e-3, 0.7e-3])
def test_a_grain_far_away_changes_no_bit(edge):
    """Two balls pressed deep, and a third one of finer or coarser facets five radii away."""
    points, cells = sphere(1e-3, 0.35e-3)
    balls = [(points, cells), (points + np.array([0.0, 0.0, 2.02e-3]), cells)]
    far = sphere(1e-3, edge, (7e-3, 0.0, 0.0))
    found = []
    for bodies in (balls, [*balls, far]):
        s = simulation_of_bodies(bodies, friction=0.3)
        grain = s.mesh.grain_of_node
        s.state.v[grain == 0], s.state.v[grain == 1] = (40.0, 0.0, 400.0), (0.0, 0.0, -400.0)
        s.dt, s.update_time_step = 4e-9, lambda **_: None
        for _ in range(100):
            s.step()
        assert s.contact.pairs.closed.any()
        of_balls = np.flatnonzero(grain < 2)
        found.append(s.state.x[of_balls[np.lexsort(s.mesh.x[of_balls].T)]])
    np.testing.assert_array_equal(*found)


def test_a_facet_that_is_found_alone_tells_no_side():
    """Points before a cube are behind its far facets, the only ones that are candidates here."""
    points, cells = box((H, H, H), (2, 2, 2))
    s = simulation_of_bodies([(points, cells), (points + np.array([1.3 * H, 0, 0]), cells)])
    contact, x = s.contact, s.mesh.x.copy()
    corner = x[contact.own.nodes[contact.own.facets]]
    far = np.flatnonzero((corner[..., 0] > 2.29 * H).all(axis=1)).astype(np.int32)
    node = np.flatnonzero(contact.points.body_of_point == 0).astype(np.int32)
    contact.pairs = Pairs(
        node, np.ones_like(node), far.size * np.arange(node.size + 1), np.tile(far, node.size),
        contact.points, 2, contact.motion.bound, False,
    )  # fmt: skip
    connect(contact)
    for _ in range(2):
        f = np.zeros_like(x)
        contact.begin_step(x)
        contact.add_forces(f, x)
    assert far.size == 8 and not contact.pairs.closed.any() and not f.any()
