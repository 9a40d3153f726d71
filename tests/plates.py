"""Spheres and the surface of a plate, which is a tool of scenes."""

from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.geometry.grains import save_grains
from mufe_fenicsx.geometry.measure import boundary_triangles
from mufe_fenicsx.geometry.tets.foreign import write_surface
from tests.bodies import RADIUS, packed_grains

#: Of the spheres, in a scene.
ROCK = """
[material]
model = "elastic"
E = "100 GPa"
nu = 0.15
rho = 2650
"""


def write_plate_and_spheres(path):
    """Two layers of spheres in ``grains``, and a plate above them in plate.stl [mm]."""
    save_grains(path / "grains", packed_grains((2, 2, 2), h=0.7 * RADIUS))
    points, cells = box((5.0, 5.0, 0.5), (1, 1, 1))
    write_surface(path / "plate.stl", points, boundary_triangles(cells))
