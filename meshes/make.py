"""Make the meshes of this folder anew: `python meshes/make.py [NAME ...] [-o FOLDER]`.

Each name is a function below that returns the grains. Seeds are fixed; lengths are in metres.
"""

import argparse
from pathlib import Path

import numpy as np

from mufe_fenicsx.geometry.bodies.half_ball import half_ball
from mufe_fenicsx.geometry.bodies.shapes import box, sphere_near_contact
from mufe_fenicsx.geometry.grains import Grains, save_grains
from mufe_fenicsx.geometry.settings import MeshSettings
from mufe_fenicsx.geometry.tets.foreign_meshes import export_grains
from mufe_fenicsx.geometry.tets.jobs import surface_jobs
from mufe_fenicsx.geometry.tets.mesher import mesh_grains
from mufe_fenicsx.synthetic.packing import pack
from mufe_fenicsx.synthetic.shapes import make_grains, sizes
from mufe_fenicsx.synthetic.triangulated import icosphere

UP = np.array([0.0, 0.0, 1.0])


def two_spheres():
    """Two balls of 1 mm on top of each other, fine at their poles."""
    R, h, contact = 0.5e-3, 20e-6, 50e-6
    points, cells = sphere_near_contact(R, h, 0.3, UP, contact, both_poles=True)
    half = 0.5 * np.ptp(points[:, 2]) * UP
    return Grains.from_list([1, 2], [(points - half, cells), (points + half, cells)], h)


def cube_on_cube():
    """Two cubes of 1 mm whose meshes do not match where they touch, for a patch test."""
    edge = 1e-3
    lower = box((edge,) * 3, (5, 5, 5))
    upper = box((edge,) * 3, (4, 4, 4), edge * UP)
    return Grains.from_list([1, 2], [lower, upper], edge / 5)


def hemisphere_graded():
    """Half a ball of 1 mm radius, its pole up, with four edges over a contact of 20 um."""
    R, contact = 1e-3, 20e-6
    return Grains.from_list([1], [half_ball(R, contact / 4, 0.25, UP, contact)], contact / 4)


def one_stone():
    """An angular stone of 1 mm, as rough as crushed rock."""
    stone = make_grains(np.random.default_rng(1), [1e-3], [0.7], [0.75], 0.1, 1.45, 15)
    directions, triangles = icosphere(5)
    return meshed(stone.surface(directions), triangles, size=70e-6)


def twelve_grains():
    """Grains of sand with a median diameter of 300 um, packed until they touch."""
    rng, number = np.random.default_rng(1), 12
    form = [np.clip(rng.normal(mean, 0.08, number), 0.5, 1.0) for mean in (0.75, 0.8)]
    grains = make_grains(rng, sizes(rng, number, 300e-6, 1.3), *form, 0.06, 1.7, 15)
    packing = pack(grains, rng, np.ones(3), 2e-6)
    directions, triangles = icosphere(4)
    turned = np.einsum("gij,gkj->gki", packing.axes, grains.surface(directions))
    return meshed(packing.centre[:, None] + turned, triangles, size=40e-6)


def meshed(surfaces, triangles, **settings):
    """Grains of closed surfaces, as `mufe mesh` makes them.

    Args:
        surfaces: Nodes of each, shape (num_grains, num_nodes, 3).
        triangles: Of each, shape (num_triangles, 3).
        settings: Of `MeshSettings`.
    """
    settings = MeshSettings(**settings)
    bodies = [(label, points, triangles) for label, points in enumerate(surfaces, 1)]
    meshes = mesh_grains(surface_jobs(bodies, settings))
    return Grains.from_list(
        [mesh.label for mesh in meshes],
        [(mesh.points, mesh.cells) for mesh in meshes],
        settings.size,
    )


MESHES = {
    function.__name__: function
    for function in (two_spheres, cube_on_cube, hemisphere_graded, one_stone, twelve_grains)
}
#: Those that are there in formats of other programs, too.
FOREIGN = {"two_spheres": (".msh", ".inp", ".vtu")}


def make(name, folder):
    """Write the mesh of a name into a folder; its grains."""
    grains = MESHES[name]()
    save_grains(folder / name, grains)
    for ending in FOREIGN.get(name, ()):
        export_grains(folder / f"{name}{ending}", grains, overwrite=True)
    return grains


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"one of {', '.join(MESHES)}")
    parser.add_argument("-o", "--output", type=Path, default=Path(__file__).parent)
    given = parser.parse_args()
    if unknown := set(given.names) - set(MESHES):
        parser.error(f"NAME = {unknown.pop()}, expected one of {', '.join(MESHES)}")
    for name in given.names or MESHES:
        made = make(name, given.output)
        print(f"{name}: {made.num_grains} grains, {len(made.cells)} tetrahedra")
