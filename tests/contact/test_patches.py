"""Patches of contact: their area, how facets resolve them, and which points belong together."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.analysis.contact_resolution import of_patches
from mufe_fenicsx.bulk.strength import surface_strength
from mufe_fenicsx.contact.results.network import find_network
from mufe_fenicsx.contact.results.patches import find_patches
from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.kernels.contact.patches import mean_depth
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.run.from_bodies import build, distribute
from mufe_fenicsx.verification.case import on_first_ranks
from tests.bodies import RADIUS, simulation_of, sphere_near_contact

COMM = MPI.COMM_WORLD
QUARTZ = Elastic(100e9, 0.15, 2650.0)
#: Blocks of bricks of this edge, whose facets are halves of squares: two edges and a diagonal.
BRICK = 1 / 16
EDGE = BRICK * (2 + np.sqrt(2)) / 3
#: Radii of the two bumps under a block, their places, and the radii of their patches.
BUMPS = ((4.0, 0.5, 0.35), (2.0, 1.5, 0.2))


def bumpy(base, bumps):
    """A block whose lower face z = base has paraboloids, their tips as deep as patches need."""
    points, cells = box((2.0, 1.0, 0.5), (32, 16, 1), (0.0, 0.0, base))
    below = points[:, 2] == base
    x, y = points[below, :2].T
    # Where it is moved down to z = base, the paraboloid is below it within the radius a.
    tips = [((x - at) ** 2 + (y - 0.5) ** 2 - a**2) / (2 * R) for R, at, a in bumps]
    points[below, 2] += np.min([*tips, np.full(x.size, 0.05)], axis=0)
    return points, cells


def pressed_blocks(comm, points="facets"):
    """Three blocks one on another: two bumps on the first, one on the second, and a floor."""
    flat = box((2.0, 1.0, 0.5), (32, 16, 1), (0.0, 0.0, -0.5))
    lift = 0.05
    bodies = [flat, bumpy(0.0, BUMPS), bumpy(0.5, BUMPS[:1])]
    bodies = [(x + np.array([0.0, 0.0, k * lift]), cells) for k, (x, cells) in enumerate(bodies)]
    mesh = distribute(comm, bodies)
    floor = Wall("floor", np.array([0.0, 0.0, -0.5109]), np.array([0.0, 0.0, 1.0]))
    s = simulation_of(mesh, QUARTZ, [floor], points=points)
    grain = mesh.grains[mesh.grain_of_node]
    x = mesh.x - np.array([0.0, 0.0, 1.0]) * (lift * grain[:, None] + 0.011)
    s.contact.begin_step(x)
    s.contact.add_forces(np.zeros_like(x), x)
    return s, x


def patches_of(comm, points="facets"):
    s, x = pressed_blocks(comm, points)
    return find_patches(s.contact, s.mesh, x)


@pytest.mark.parametrize("points", ["facets", "facets4", "nodes"])
def test_two_bumps_are_two_patches_of_known_radius(points):
    """A paraboloid that reaches a²/2R through a plane meets it in a circle of radius a."""
    p = patches_of(MPI.COMM_SELF, points)
    assert list(zip(p.a, p.b, strict=True)) == [(0, 1), (0, 1), (0, 3), (1, 2)]
    for k, (_, _, a) in ((0, BUMPS[0]), (1, BUMPS[1]), (3, BUMPS[0])):
        # A point counts whole. The square grid under a circle of N bricks is off by less than
        # √N bricks, the mean of both sides less than each.
        bricks = np.pi * (a / BRICK) ** 2
        assert p.area[k] == pytest.approx(np.pi * a**2, rel=bricks**-0.5)
        assert p.edge[k] == pytest.approx(EDGE, rel=1e-3)  # the bumps' facets are inclined
        n = a / EDGE
        assert p.elements_per_radius[k] == pytest.approx(n, rel=0.5 * bricks**-0.5)
        assert p.elements_across[k] == pytest.approx(2 * n, rel=bricks**-0.5)
    for k, (R, _, a) in ((0, BUMPS[0]), (1, BUMPS[1]), (3, BUMPS[0])):
        # The cap of a paraboloid; its depth vanishes at the rim, where points count whole or not.
        assert p.overlap[k] == pytest.approx(np.pi * a**4 / (4 * R), rel=(BRICK / a) ** 2)
    if points != "nodes":  # those on the rim of a face have the area of its sides as well
        assert p.area[2] == pytest.approx(2.0, rel=1e-12)
        assert p.edge[2] == pytest.approx(EDGE, rel=1e-12)
        # A face of 2 by 1 is 1 across, where it is narrowest: 4 √(1/12) in elements.
        assert p.elements_across[2] == pytest.approx(4 * np.sqrt(1 / 12) / EDGE, rel=5e-3)
    assert p.force_share[[0, 1, 3]].sum() == pytest.approx(1.0, rel=1e-12) and p.force_share[2] == 1


def test_mean_depth_of_a_triangle_that_a_plane_cuts():
    """One corner 3 beneath, others 0 and 3 over: a third of 3 over a half of the triangle."""
    assert mean_depth(np.array([-3.0, 0.0, 3.0])) == pytest.approx(0.5, rel=1e-14)
    # What lies below less what lies above is the mean.
    for gap in np.random.default_rng(0).normal(size=(100, 3)):
        assert mean_depth(gap) - mean_depth(-gap) == pytest.approx(-gap.mean(), abs=1e-14)
    some = [-1.0] * 3, [0.0] * 3, [0.0, 0.0, 2.0]
    assert [mean_depth(np.array(gap)) for gap in some] == [1.0, 0.0, 0.0]


def test_bumps_nearer_than_a_facet_are_one_patch():
    """Each two points of the union of two circles that overlap are connected."""
    s, x = pressed_blocks(MPI.COMM_SELF)
    grain = s.mesh.grains[s.mesh.grain_of_node]
    x[grain == 1, 2] -= 0.04  # now √(a² + 2R 0.04): 0.67 and 0.45, which are 1.0 apart
    s.contact.begin_step(x)
    s.contact.add_forces(np.zeros_like(x), x)
    p = find_patches(s.contact, s.mesh, x)
    assert ((p.a == 0) & (p.b == 1)).sum() == 1


@pytest.mark.mpi
def test_patches_are_the_same_on_all_ranks():
    """Two sides of a contact on different ranks; sums differ by rounding alone."""
    found = on_first_ranks(COMM, 3, patches_of)
    alone = on_first_ranks(COMM, 1, patches_of)
    for name in ("a", "b", "num_points", "between_grains"):
        assert np.array_equal(getattr(found, name), getattr(alone, name)), name
    names = "area", "area_deformed", "edge", "elements_per_radius", "normal_force", "overlap"
    for name in names:
        # Round-off of sums of a thousand terms.
        assert getattr(found, name) == pytest.approx(getattr(alone, name), rel=1e-12), name
    # Differences of squares of places, 1 against 0.1.
    assert found.elements_across == pytest.approx(alone.elements_across, rel=1e-10)


def meeting_balls(comm):
    """Two balls that run into each other: contacts, patches, resolution."""
    axis, h = np.array([0.48, -0.6, 0.64]), 0.02 * RADIUS
    lower = sphere_near_contact(RADIUS, h, 0.35, tuple(axis), 4 * h)
    points, cells = sphere_near_contact(RADIUS, h, 0.35, tuple(-axis), 4 * h)
    speed, depth = 20.0, 5e-3 * RADIUS
    s = build(
        comm, [lower, (points + (2 + 1e-6) * RADIUS * axis, cells)], QUARTZ, np.zeros(3),
        np.zeros(3), axes="", time_step_factor=0.6,
        velocity=lambda x, grain: np.where(grain[:, None] == 0, axis, -axis) * speed,
    )  # fmt: skip
    while s.state.t < depth / speed:
        s.step()
    network = find_network(s.contact, s.mesh, s.solid.mass, s.state.x)
    return network and (network.contacts, network.patches, of_patches(network.patches))


def test_patch_of_two_balls_is_that_of_hertz():
    """a³ = 3 F R*/(4 E*) (Johnson 1985, eq. 4.22), in edges of the mesh that was asked for."""
    contacts, p, resolution = on_first_ranks(COMM, 2, meeting_balls)
    E = QUARTZ.E / (1 - QUARTZ.nu**2) / 2
    a = np.cbrt(3 * contacts.normal_force[0] * RADIUS / 2 / (4 * E))
    # Of some 70 facets a side, those that the rim cuts count whole or not at all.
    assert p.area.size == 1 and p.area[0] == pytest.approx(np.pi * a**2, rel=0.06)
    assert p.area[0] == pytest.approx(contacts.area[0], rel=1e-12)
    # Edges of an even mesh are some per cents off what the mesher was asked for.
    assert p.edge[0] == pytest.approx(0.02 * RADIUS, rel=0.05)
    assert p.elements_per_radius[0] == pytest.approx(a / p.edge[0], rel=0.03)
    assert p.elements_across[0] == pytest.approx(2 * a / p.edge[0], rel=0.05)
    assert p.num_points[0] == contacts.num_points[0] and p.force_share[0] == 1.0
    assert resolution.half == p.elements_per_radius[0] and resolution.num_patches == 1


def test_strength_is_that_of_the_element_under_each_facet():
    """A table that hardens from 1e8 Pa at no strain to 3e8 at 0.2, and stays; each cell its own."""
    mesh = distribute(MPI.COMM_SELF, [box((1.0, 1.0, 1.0), (3, 2, 2))] * 1
                      + [box((1.0, 1.0, 1.0), (2, 2, 2), (0.0, 0.0, 2.0))])  # fmt: skip
    s = simulation_of(mesh, J2(100e9, 0.2, 2650.0, ((0.0, 1e8), (0.2, 3e8))))
    strain = np.random.default_rng(3).uniform(0.0, 0.3, mesh.num_cells)
    own = s.contact.own
    found = surface_strength(s.solid, own, strain)
    for facet, value in zip(own.nodes[own.facets], found, strict=True):
        cell = np.flatnonzero(np.isin(mesh.cells, facet).sum(axis=1) == 3)
        assert cell.size == 1
        assert value == pytest.approx(1e8 + 2e8 * min(strain[cell[0]] / 0.2, 1), rel=1e-12)
    elastic = simulation_of(mesh, QUARTZ)
    assert np.isinf(surface_strength(elastic.solid, own, strain)).all()
