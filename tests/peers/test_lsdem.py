"""Files of LS-DEM codes, read as these codes do: grains, and contact of two of them."""

import numpy as np
import pytest

from mufe_fenicsx.geometry.bodies.shapes import sphere
from mufe_fenicsx.geometry.grains import Grains
from mufe_fenicsx.peers.body import bodies_of
from mufe_fenicsx.peers.level_set_files import export_level_sets
from tests.peers.lsdem_reader import read_grain
from tests.peers.samples import RADIUS, ball_and_brick, brick_distance

#: From the first ball to the second, whose surfaces overlap by DEPTH.
AXIS = np.array([2.0, -1.0, 2.0]) / 3
DEPTH = 0.1 * RADIUS
SPACING = 0.1 * RADIUS


@pytest.fixture(scope="module")
def balls(tmp_path_factory):
    """Two balls as these codes read them, and how far facets lie within their spheres [m]."""
    folder = tmp_path_factory.mktemp("lsdem") / "ls"
    points, cells = sphere(RADIUS, 0.2 * RADIUS)
    other = points + (2 * RADIUS - DEPTH) * AXIS
    grains = Grains.from_list([5, 7], [(points, cells), (other, cells)], 0.2 * RADIUS)
    export_level_sets(folder, grains, spacing=SPACING)
    body = next(iter(bodies_of(grains)))
    a, b, c = (body.points[body.triangles[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    inner = np.einsum("ij,ij->i", a, normal).min() - np.linalg.norm(body.in_sample(np.zeros(3)))
    assert 0.95 * RADIUS < inner < 0.999 * RADIUS
    return [read_grain(folder / "lsdem", i) for i in (1, 2)], RADIUS - inner


def test_a_ball_has_its_mass_inertia_and_distances(balls):
    """Mass and moments lie between those of the spheres through the nodes and in the facets."""
    (grain, _), sagitta = balls
    part = 1 - sagitta / RADIUS
    mass = grain.mass * SPACING**3 / (4 / 3 * np.pi * RADIUS**3)
    moments = grain.moments * SPACING**5 / (8 / 15 * np.pi * RADIUS**5)
    assert part**3 < mass < 1 and (part**5 < moments).all() and (moments < 1).all()
    excess = grain.values * SPACING - (np.linalg.norm(grain.nodes * SPACING, axis=1) - RADIUS)
    # Single precision of distances up to two radii; the centroid is that far from the origin.
    assert excess.min() > -1e-6 * RADIUS and excess.max() < sagitta + 1e-6 * RADIUS
    assert np.allclose(np.linalg.norm(grain.surface, axis=1) * SPACING, RADIUS, rtol=1e-7)
    assert grain.radius == pytest.approx(np.linalg.norm(grain.points, axis=1).max(), rel=1e-8)


def test_two_balls_meet_where_they_are(balls):
    """Points of one within the other: as deep as the sphere says, normals away from its centre.

    Tolerances: facets within the sphere; the interpolation of distances, whose second derivatives
    are 1/r along two axes, over cells of the spacing (1/8 of each; its slope 1/2).
    """
    (first, second), sagitta = balls
    centre = (2 * RADIUS - DEPTH) * AXIS / SPACING
    found = [(at, second.depth(at)) for at in first.surface]
    at = np.array([p for p, contact in found if contact])
    depth, normal = (np.array([c[k] for _, c in found if c]) for k in (0, 1))
    exact = np.linalg.norm(first.surface - centre, axis=1) - RADIUS / SPACING
    rounding = SPACING**2 / (4 * 0.8 * RADIUS)
    assert len(at) >= 5
    # Those that it does not take for contacts are no deeper than what both tolerances allow.
    missed = [exact[i] for i, (_, contact) in enumerate(found) if contact is None]
    assert min(missed) * SPACING > -sagitta - rounding
    difference = (depth + RADIUS / SPACING - np.linalg.norm(at - centre, axis=1)) * SPACING
    assert np.abs(difference).max() < sagitta + rounding
    assert -depth.min() * SPACING == pytest.approx(DEPTH, abs=sagitta + rounding)
    outward = (at - centre) / np.linalg.norm(at - centre, axis=1)[:, None]
    # Facets are turned from the sphere by their edge over its diameter and more: 0.2.
    assert np.einsum("ij,ij->i", normal, outward).min() > np.cos(0.2)
    force = (depth[:, None] * normal).sum(axis=0)
    assert force @ AXIS / np.linalg.norm(force) > np.cos(0.1)


def test_a_brick_lies_where_it_lies_in_the_sample(tmp_path):
    """Turned and away from the origin: volume, moments, nodes and surface in closed form.

    Tolerance: nine digits are written of lengths up to 20 spacings, distances kept in single
    precision.
    """
    spacing = 2.5e-5
    export_level_sets(tmp_path / "ls", ball_and_brick(), spacing=spacing)
    brick = read_grain(tmp_path / "ls" / "lsdem", 2)
    assert brick.mass * spacing**3 == pytest.approx(6e-12, rel=1e-7, abs=0.0)
    a, b, c = np.array([3e-4, 2e-4, 1e-4]) ** 2
    exact = 6e-12 / 12 * np.array([b + c, a + c, a + b])
    assert np.allclose(brick.moments * spacing**5, exact, rtol=1e-7)
    difference = brick.values * spacing - brick_distance(brick.nodes * spacing)
    assert np.abs(difference).max() < 1e-7 * spacing * 20
    assert np.abs(brick_distance(brick.surface * spacing)).max() < 1e-7 * spacing * 20
