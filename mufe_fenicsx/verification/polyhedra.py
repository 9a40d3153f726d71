"""Grains that are polyhedra: meshes of any size have the same shape, and the same gaps."""

import numpy as np
from scipy.spatial import ConvexHull, HalfspaceIntersection
from scipy.spatial.transform import Rotation

from ..geometry.measure import compact
from ..geometry.tets.fill import fill
from ..geometry.tets.gmsh_model import gmsh_model, tetrahedra

#: Sample, the seed of the random numbers: of 1 to 12 the one that gives the longest shortest edge
#: (a tenth of half of the distance of grains), since a short edge makes small elements on all
#: meshes.
SAMPLE = 3
#: Rounds of Lloyd's iteration, after which centres hardly move.
ROUNDS = 30


def polyhedral_grains(
    element_size, number=20, box=(4.0, 4.0, 10.0), radius=1e-3, sample=SAMPLE, inner=1.0
):
    """Voronoi cells that fill a box, each a little smaller than its room and turned in it.

    Centres are spread evenly by Lloyd's iteration (IEEE Trans. Inf. Theory 28, 1982). A cell
    keeps 0.97 to 0.995 of its size and is turned by at most 1 degree about each axis, so that
    grains touch at corners and edges first and lie face to face when pressed together.

    Args:
        element_size: Length of edges [radius].
        number: Grains.
        box: Lengths of the box's sides [radius].
        radius: Half of about the distance of grains [m].
        sample: Seed of the random numbers.
        inner: Length of edges far inside over that on the surface.

    Returns:
        List of (points [m], cells).
    """
    box, rng = np.asarray(box, dtype=float), np.random.default_rng(sample)
    centres = rng.uniform(0, 1, (number, 3)) * box
    for _ in range(ROUNDS):
        centres = np.array([_centroid(*_cell(centres, k, box)) for k in range(number)])
    rng, bodies = np.random.default_rng(sample + 100), []
    for k in range(number):
        vertices, faces = _cell(centres, k, box)
        size, turn = rng.uniform(0.97, 0.995), np.deg2rad(rng.uniform(-1, 1, 3))
        middle = vertices.mean(axis=0)
        vertices = middle + size * (vertices - middle) @ Rotation.from_rotvec(turn).as_matrix().T
        points, cells = _mesh(vertices, faces, element_size, inner)
        bodies.append((radius * points, cells))
    return bodies


def _cell(centres, k, box):
    """Vertices of a Voronoi cell within the box, and those around each face in their order."""
    to = np.delete(centres, k, axis=0) - centres[k]
    normal = to / np.linalg.norm(to, axis=1)[:, None]
    middle = centres[k] + 0.5 * to
    planes = np.vstack([
        np.column_stack([normal, -(normal * middle).sum(axis=1)]),
        np.column_stack([np.eye(3), -box]),
        np.column_stack([-np.eye(3), np.zeros(3)]),
    ])  # fmt: skip
    corners = HalfspaceIntersection(planes, centres[k]).intersections
    vertices = np.unique(np.round(corners, 9), axis=0)
    faces = []
    for plane in planes:
        on = np.flatnonzero(np.abs(vertices @ plane[:3] + plane[3]) < 1e-8)
        if on.size >= 3:
            arm = vertices[on] - vertices[on].mean(axis=0)
            across = np.cross(plane[:3], arm[0])
            faces.append(on[np.argsort(np.arctan2(arm @ across, arm @ arm[0]))])
    return vertices, faces


def _centroid(vertices, _):
    """Of the volume of a convex polyhedron."""
    top = vertices.mean(axis=0)
    a, b, c = (vertices[ConvexHull(vertices).simplices[:, i]] for i in range(3))
    volume = np.abs(np.einsum("ij,ij->i", a - top, np.cross(b - top, c - top)))
    return volume @ (a + b + c + top) / (4 * volume.sum())


def _mesh(vertices, faces, size, inner):
    """Tetrahedra of a polyhedron whose faces stay flat: points and cells."""
    with gmsh_model() as gmsh:
        geo, lines, surfaces = gmsh.model.geo, {}, []
        for tag, point in enumerate(vertices, 1):
            geo.addPoint(*point, size, tag)
        for face in faces:
            loop = []
            for a, b in zip(face, np.roll(face, -1), strict=True):
                if (b, a) not in lines:
                    lines[a, b] = geo.addLine(a + 1, b + 1)
                loop.append(lines[a, b] if (a, b) in lines else -lines[b, a])
            surfaces.append(geo.addPlaneSurface([geo.addCurveLoop(loop)]))
        geo.addVolume([geo.addSurfaceLoop(surfaces)])
        geo.synchronize()
        if inner == 1.0:
            gmsh.model.mesh.generate(3)
            return tetrahedra()
        gmsh.model.mesh.generate(2)
        tags, places, _ = gmsh.model.mesh.getNodes()
        triangles = gmsh.model.mesh.getElementsByType(2)[1].reshape(-1, 3)
    row = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    row[tags.astype(np.int64)] = np.arange(len(tags))
    points, triangles = compact(places.reshape(-1, 3) / size, row[triangles.astype(np.int64)])
    # No node of the surface moves: faces stay flat.
    points, cells = fill(points, triangles, inner=inner, fixed=np.arange(len(points)))
    return size * points, cells
