"""Volumes, altitudes and angles of tetrahedra; closedness and volume of surfaces."""

import numpy as np

from ..kernels.geometry.topology import surface_pinch
from ..units import with_unit

#: The four faces of a tetrahedron, each seen from outside counter-clockwise.
FACES = ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1))
#: Cells that are worked on at once: what lies between stays in the processor's cache.
BLOCK = 16384


def tet_volumes(points, cells):
    """Signed volumes V = det(x₁-x₀, x₂-x₀, x₃-x₀)/6 [m³], shape (num_cells,)."""
    volumes = np.empty(len(cells))
    for at in range(0, len(cells), BLOCK):
        x = points[cells[at : at + BLOCK]]
        a, b, c = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0], x[:, 3] - x[:, 0]
        volumes[at : at + BLOCK] = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
    return volumes


def centroid_of(points, cells):
    """Centre of volume of a body of tetrahedra [m], shape (3,)."""
    volumes = tet_volumes(points, cells)
    return volumes @ points[cells].mean(axis=1) / volumes.sum()


def face_normals(points, cells):
    """Outward area vectors of the four faces [m²], shape (num_cells, 4, 3)."""
    x = points[cells]
    normals = np.empty((len(cells), 4, 3))
    for i, (a, b, c) in enumerate(FACES):
        normals[:, i] = np.cross(x[:, b] - x[:, a], x[:, c] - x[:, a]) / 2
    return normals


def smallest_altitudes(points, cells):
    """Smallest altitude of each tetrahedron, 3V over its largest face [m]."""
    largest_face = np.linalg.norm(face_normals(points, cells), axis=2).max(axis=1)
    return 3 * tet_volumes(points, cells) / largest_face


def mean_edges(points, cells):
    """Mean length of the six edges of each tetrahedron [m]."""
    x = points[cells]
    i, j = np.triu_indices(4, 1)
    return np.linalg.norm(x[:, i] - x[:, j], axis=2).mean(axis=1)


def smallest_angle(points, triangles):
    """Smallest angle of a triangle surface [degrees]."""
    x = points[triangles]
    a, b = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
    sine = np.linalg.norm(np.cross(a, b), axis=2)
    return float(np.degrees(np.arctan2(sine, (a * b).sum(axis=2)).min()))


def worst_share_costs(altitudes, share=1e-3):
    """How many times longer the element-bound time step would be without the worst elements.

    The bound is altitude / wave speed of the smallest altitude, so the speed drops out.

    Args:
        altitudes: Smallest altitude of each tetrahedron [m].
        share: Of the elements that are left out.
    """
    return float(np.quantile(altitudes, share, method="lower") / altitudes.min())


def smallest_dihedral_angles(points, cells):
    """Smallest angle between two faces of each tetrahedron [degrees]."""
    normals = face_normals(points, cells)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    cosines = np.einsum("cik,cjk->cij", normals, normals)
    i, j = np.triu_indices(4, 1)
    return np.degrees(np.arccos(np.clip(-cosines[:, i, j], -1, 1))).min(axis=1)


def positively_oriented(points, cells):
    """The cells with two vertices swapped where the volume is negative."""
    cells = np.array(cells, dtype=np.int64)
    inside_out = tet_volumes(points, cells) < 0
    cells[inside_out, 2:] = cells[inside_out, :1:-1]
    return cells


def compact(points, cells):
    """Points that some cell uses, and the cells in their numbering."""
    used, numbered = renumbered(cells)
    return np.ascontiguousarray(points[used]), numbered


def renumbered(cells):
    """Nodes that occur, increasing, and the cells (or faces) in their numbering."""
    cells = np.asarray(cells)
    there = np.zeros(cells.max(initial=-1) + 1, dtype=bool)
    there[cells] = True
    return np.flatnonzero(there), (np.cumsum(there) - 1)[cells]


def surface_volume(points, triangles):
    """Volume inside a closed surface [m³]; negative where it is inside out."""
    x = points[triangles] - points[triangles[:1]].mean(axis=1)
    return np.einsum("ij,ij->", x[:, 0], np.cross(x[:, 1], x[:, 2])) / 6


def surface_area(points, triangles):
    """Area of a triangle surface [m²]."""
    x = points[triangles]
    return np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1).sum() / 2


def area_on_cylinder(points, cells, cylinder, near=1e-6):
    """Area of the facets of a body whose corners lie on a cylinder along z [m²].

    Args:
        points, cells: Tetrahedra of the body.
        cylinder: x and y of the axis and radius [m].
        near: Distance of corners from it that counts as none, over the radius.
    """
    triangles = boundary_triangles(cells)
    x, y, radius = cylinder
    off = np.abs(np.hypot(points[:, 0] - x, points[:, 1] - y) - radius)
    return surface_area(points, triangles[(off[triangles] <= near * radius).all(axis=1)])


def surface_defect(points, triangles):
    """What is wrong with a triangle surface, in words; empty if it bounds a body.

    A surface bounds a body if each directed edge occurs once, together with
    its reverse, and the triangles around each node make one ring: then it is
    closed, manifold and consistently oriented. One that is inside out is told
    by its negative volume.
    """
    n = len(points)
    start = triangles.astype(np.int64).ravel()
    end = np.roll(triangles, -1, axis=1).astype(np.int64).ravel()
    forward, backward = np.sort(start * n + end), np.sort(end * n + start)
    if np.any(start == end):
        return "degenerate triangles"
    if np.any(forward[1:] == forward[:-1]):
        return "edges with more than two triangles, or triangles of mixed orientation"
    if not np.array_equal(forward, backward):
        return "open edges"
    if surface_volume(points, triangles) <= 0:
        return "inside out"
    return surface_pinch(triangles)


def boundary_triangles(cells):
    """Triangles that belong to one tetrahedron only, seen from outside."""
    triangles = np.concatenate([np.asarray(cells)[:, list(face)] for face in FACES])
    low, middle, high = np.sort(triangles, axis=1).astype(np.int64).T
    order = np.lexsort((high, middle, low))
    low, middle, high = low[order], middle[order], high[order]
    same = (low[1:] == low[:-1]) & (middle[1:] == middle[:-1]) & (high[1:] == high[:-1])
    single = ~(np.append(False, same) | np.append(same, False))
    return triangles[np.sort(order[single])]


def assumed_unit(path, points):
    """A line on the unit of length of a file that states none.

    Args:
        path: Of the file.
        points: Of all grains [m].
    """
    size = " × ".join(with_unit(float(length), "m") for length in np.ptp(points, axis=0))
    return f"lengths in {path} are taken as metres: the grains fill {size}; --scale states a unit"
