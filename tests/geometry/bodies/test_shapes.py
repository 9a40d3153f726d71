"""Test bodies have the volumes and sizes that they should."""

import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry import measure
from mufe_fenicsx.geometry.bodies import shapes
from mufe_fenicsx.geometry.bodies.block import block
from mufe_fenicsx.geometry.bodies.half_ball import half_ball
from mufe_fenicsx.geometry.bodies.half_cylinder import half_cylinder
from mufe_fenicsx.geometry.bodies.half_ellipsoid import half_ellipsoid
from mufe_fenicsx.geometry.bodies.half_space import half_space
from mufe_fenicsx.geometry.bodies.hollow import hollow
from mufe_fenicsx.geometry.bodies.sleeve import sleeve
from mufe_fenicsx.geometry.bodies.slit_plate import slit_plate
from mufe_fenicsx.synthetic.formula_grains import Superquadric, mesh_formula
from tests.bodies import euler_characteristic

R, H = 1e-3, 2.5e-4

SHAPES = {
    # Flat facets of edge h inside a sphere lose about (h/R)²/3 of its volume.
    "sphere": (lambda: shapes.sphere(R, H), 4 / 3 * np.pi * R**3, 0.03),
    "cylinder": (lambda: shapes.cylinder(R, 2 * R, H), 2 * np.pi * R**3, 0.03),
    "tetrahedron": (lambda: shapes.tetrahedron(R), R**3 / np.sqrt(72), 1e-12),
    "slit plate": (lambda: slit_plate(4 * R, 2 * R, H, (2 * R, 0.7 * R)), 8 * R**2 * H, 1e-12),
    "box": (lambda: shapes.box((R, 2 * R, 3 * R), (2, 3, 4)), 6 * R**3, 1e-12),
    "half ball": (lambda: half_ball(R, R / 20, 0.3), 2 / 3 * np.pi * R**3, 0.008),
    # These keep the volume of the curved part, but for the next order in h/R (h up to R/3) and
    # for the polygon of the rim. Cap: π h² (R - h/3).
    "cap": (
        lambda: half_ball(R, R / 20, 0.3, height=0.4 * R),
        np.pi * 0.16 * R**3 * 13 / 15,
        0.015,
    ),
    "contact": (lambda: shapes.sphere_near_contact(R, R / 20, 0.3), 4 / 3 * np.pi * R**3, 0.003),
}


@pytest.mark.parametrize("name", SHAPES)
def test_bodies_are_sound(name):
    make, volume, tolerance = SHAPES[name]
    points, cells = make()
    boundary = measure.boundary_triangles(cells)
    assert measure.tet_volumes(points, cells).min() > 0
    assert np.array_equal(np.unique(cells), np.arange(len(points)))
    assert measure.surface_defect(points, boundary) == ""
    assert euler_characteristic(boundary) == 2
    assert measure.tet_volumes(points, cells).sum() == pytest.approx(volume, rel=tolerance)


def test_sphere_is_fine_at_its_contact_and_grows_from_there():
    h, growth, a = R / 40, 0.3, 4 * R / 40
    direction = np.array([1.0, -2.0, 2.0]) / 3
    points, cells = shapes.sphere_near_contact(R, h, growth, direction, a)
    pole = R * direction
    distance = np.linalg.norm(points - pole, axis=1)
    # The pole is a node, as far outside as facets between nodes on the sphere are inside;
    # edges around one node are off by up to 20 %, and this goes with their square.
    assert distance.min() == pytest.approx(h**2 / (8 * R), rel=0.4)
    triangles = measure.boundary_triangles(cells)
    edges = np.unique(np.sort(triangles[:, :2], axis=1), axis=0)
    length = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
    reach = distance[edges].mean(axis=1)
    # gmsh meets a size on average to about 10 %.
    assert length[reach < 1.5 * a].mean() == pytest.approx(h, rel=0.1)
    ring = (reach > 4 * a) & (reach < 5 * a)
    assert length[ring].mean() == pytest.approx(h + growth * 3 * a, rel=0.1)


def test_a_slit_plate_has_one_layer_whose_sides_follow_the_slit():
    points, cells = slit_plate(4 * R, 2 * R, H, (2 * R, 0.7 * R))
    on = (np.abs(points[:, 1] - 0.7 * R) < 1e-9 * R) & (points[:, 0] < (2 + 1e-9) * R)
    assert np.isin(points[:, 2], [0.0, H]).all()
    faces = np.sort(cells[:, [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]].reshape(-1, 3), axis=1)
    faces, count = np.unique(faces[on[faces].all(axis=1)], axis=0, return_counts=True)
    assert (count == 2).all()  # between two cells each, and the slit is covered by them
    u, v = (points[faces[:, k]] - points[faces[:, 0]] for k in (1, 2))
    area = 0.5 * np.linalg.norm(np.cross(u, v), axis=1).sum()
    assert area == pytest.approx(2 * R * H, rel=1e-12)


def test_both_poles_are_nodes():
    points, _ = shapes.sphere_near_contact(R, R / 15, 0.4, (0, 0, 1), both_poles=True)
    for z in (-R, R):
        distance = np.linalg.norm(points - [0, 0, z], axis=1)
        assert distance.min() == pytest.approx((R / 15) ** 2 / (8 * R), rel=0.4)


@pytest.mark.parametrize("height", [R, 0.4 * R])
def test_half_ball_has_a_fine_pole_and_a_flat_base(height):
    h, growth, a = R / 40, 0.3, 4 * R / 40
    direction = np.array([1.0, -2.0, 2.0]) / 3
    points, cells = half_ball(R, h, growth, direction, a, height=height)
    depth = points @ direction
    distance = np.linalg.norm(points - R * direction, axis=1)
    assert distance.min() == pytest.approx(h**2 / (8 * R), rel=0.4)
    triangles = measure.boundary_triangles(cells)
    on_base = np.abs(depth - (R - height)) < 1e-12 * R
    base = triangles[on_base[triangles].all(axis=1)]
    # Edges reach R/3 where no contact is: R/3² / 8 = 0.014 R.
    on_sphere = np.abs(np.linalg.norm(points, axis=1) - 1.007 * R) < 0.0075 * R
    assert np.all((on_base | on_sphere)[triangles])
    # The polygon of the rim lies inside its circle of radius √(2Rh - h²) by (edge/radius)²/6.
    u, v = points[base[:, 1]] - points[base[:, 0]], points[base[:, 2]] - points[base[:, 0]]
    area = 0.5 * np.linalg.norm(np.cross(u, v), axis=1).sum()
    assert area == pytest.approx(np.pi * (2 * R * height - height**2), rel=0.03)
    edges = np.unique(np.sort(triangles[:, :2], axis=1), axis=0)
    length = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
    # gmsh meets a size on average to about 10 %.
    assert length[distance[edges].mean(axis=1) < 1.5 * a].mean() == pytest.approx(h, rel=0.1)


def test_sizes_have_to_be_positive():
    with pytest.raises(InputError, match="radius of sphere = -1"):
        shapes.sphere(-1, 0.1)
    with pytest.raises(InputError, match="h = nan"):
        shapes.sphere(1, float("nan"))
    with pytest.raises(InputError, match="height of half ball"):
        half_ball(1.0, 0.1, height=1.5)


#: Bodies of which a length of edges says how many tetrahedra there are, once even, once near a
#: contact alone.
FINE = {
    "sphere": lambda h: shapes.sphere(1.0, h),
    "cylinder": lambda h: shapes.cylinder(1.0, 2.0, h),
    "sphere_near_contact": lambda h: shapes.sphere_near_contact(1.0, h, 1e-6),
    "half_ball": lambda h: half_ball(1.0, h, contact_radius=0.5),
    "quarter": lambda h: half_ball(1.0, 0.1, h_max=h, quarter=True),
    "half_cylinder": lambda h: half_cylinder(1.0, 1.0, h, contact_radius=0.5, line=True),
    "half_ellipsoid": lambda h: half_ellipsoid((1.0, 2.0, 3.0), h, contact_radius=0.5),
    "block": lambda h: block(1.0, 0.5, h, 0.1, 0.3),
    "hollow": lambda h: hollow(1.0, h, 0.1, 0.3),
    "half_space": lambda h: half_space(1.0, h, 1e-6, 0.1),
    "slit_plate": lambda h: slit_plate(1.0, 1.0, 0.1 * h, (0.5, 0.3)),
    "sleeve": lambda h: sleeve(1.0, 0.01, 1.0, h),
    "mesh_formula": lambda h: mesh_formula(Superquadric((1.0, 1.0, 1.0), 2.5), h),
}


@pytest.mark.parametrize("name", FINE)
@pytest.mark.parametrize("h", [3e-4, 1e-9])
def test_a_mesh_that_no_memory_holds_is_refused_before_it_is_begun(name, h):
    with pytest.raises(InputError, match=r"takes .* GB, expected at most the .* longer edges"):
        FINE[name](h)
