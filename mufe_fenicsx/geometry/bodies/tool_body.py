"""Bodies of tools: tetrahedra in a closed surface, or a sheet behind an open one.

A tool is one of the bodies of the mesh of all grains, which needs tetrahedra. They carry neither
stress nor motion of their own, so any that fill the surface will do. An open surface (a funnel, a
plate) has no inside. It gets a thickness, as what it stands for has: the given surface stays the
side that its normals look out of, and a copy of it, moved against them, is the other side. Where a
fold of the surface is sharper than the thickness allows, the sheet would cut itself; that is said.
"""

from pathlib import Path

import numpy as np

from ...errors import InputError
from ...machine.doing import Doing
from ..measure import compact, positively_oriented, surface_defect
from ..surface.given_surfaces import FORMATS, read_triangles, welded
from ..surface.remesh import oriented
from ..surface.shells import shells
from ..tets.fill import DELAUNAY, fill

#: Facets of the surface of a tool: as fine as grains, few tools have more than some thousands.
MOST_FACETS = 100_000
#: Edges far inside over those of the surface.
COARSE = 4.0


def read_tool(path, scale=1.0, thickness=None):
    """The body of a tool from a file of its surface.

    Args:
        path: STL, PLY, OBJ, OFF, VTK, VTU or MSH.
        scale: Metres a unit of length of the file.
        thickness: Of the sheet [m], where the surface is open; None: it is closed.

    Returns:
        Nodes [m], shape (num_nodes, 3), and tetrahedra, shape (num_cells, 4).

    Raises:
        InputError: It cannot be read; it is open and there is no thickness, or the other way round;
            it bounds no body.
    """
    if Path(path).suffix.lower() not in FORMATS:
        raise InputError(f"surface {path}, expected a file of {', '.join(FORMATS)}")
    points, triangles = read_triangles(path, [])
    if len(triangles) > MOST_FACETS:
        raise InputError(
            f"surface {path} has {len(triangles)} facets, expected at most {MOST_FACETS}: thin "
            "them out, to the size of the facets of grains"
        )
    doing = Doing.innermost()
    if doing is not None:
        doing.what = f"making a body of the {len(triangles)} facets of {path}"
    return tool_body(points * scale, triangles, thickness, f"surface {path}")


def tool_body(points, triangles, thickness=None, name="surface"):
    """The body of a tool from triangles of its surface.

    Args:
        points: Its points [m], shape (num_points, 3), doubles allowed.
        triangles: Seen from outside, or all from inside, shape (num_triangles, 3).
        thickness, name: As of :func:`read_tool`, and for messages.

    Returns, Raises:
        As :func:`read_tool`.
    """
    points = np.asarray(points, dtype=float)
    lost = len(points) - int(np.isfinite(points).all(axis=1).sum())
    if lost:
        raise InputError(f"{name} has {lost} points that are not finite, expected none")
    points, triangles = welded(points, triangles)
    a, b, c = triangles.T
    points, triangles = compact(points, triangles[(a != b) & (b != c) & (c != a)])
    if not len(triangles):
        raise InputError(f"{name} has 0 triangles with an area, expected a surface")
    if thickness is not None:
        return _sheet(points, triangles, thickness, name)
    if surface_defect(points, triangles):
        triangles = oriented(points, triangles)
    defect = surface_defect(points, triangles)
    if defect == "open edges":
        raise InputError(f"{name} is open, expected a closed one, or a thickness beside it")
    if defect:
        raise InputError(f"{name} has {defect}, expected one that bounds a body")
    num_bodies = int((shells(points, triangles)[1] % 2 == 0).sum())
    if num_bodies > 1:
        raise InputError(f"{name} has {num_bodies} parts, expected one body: a tool each")
    return _filled(points, triangles, name)


def _filled(points, triangles, name):
    """Tetrahedra in a closed surface; its nodes stay."""
    corner = points[triangles]
    middle = points.mean(axis=0)
    size = float(np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).mean())
    scaled = (points - middle) / size
    try:
        found, cells = fill(scaled, triangles, algorithm=DELAUNAY, optimiser=None, inner=COARSE)
    except Exception as error:
        reason = " ".join(str(error).split())
        raise InputError(
            f"{name} cannot be filled ({reason}), expected one that does not cross itself"
        ) from error
    found = found * size + middle
    found[: len(points)] = points
    return found, cells


def _sheet(points, triangles, thickness, name):
    """A sheet of that thickness behind an open surface, three tetrahedra a triangle.

    Prisms are cut along diagonals from their nodes of lower numbers, so that neighbours fit
    (J. Dompierre et al., How to subdivide pyramids, prisms and hexahedra into tetrahedra, 1999).
    """
    if not 0.0 < thickness < np.inf:
        raise InputError(f"thickness = {thickness} m, expected > 0 m")
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    forward = start * len(points) + end
    backward = end * len(points) + start
    if np.unique(forward).size < forward.size:
        raise InputError(
            f"{name} has edges of more than two triangles, or some turned, expected all normals on "
            "one side"
        )
    if np.isin(forward, backward).all():
        raise InputError(f"{name} is closed, expected no thickness")
    corner = points[triangles]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    outward = _vertex_normals(triangles, normal, len(points))
    n = len(points)
    low = np.sort(triangles, axis=1)
    a, b, c = low.T
    cells = np.concatenate(
        [
            np.column_stack([a, b, c, c + n]),
            np.column_stack([a, b, c + n, b + n]),
            np.column_stack([a, b + n, c + n, a + n]),
        ]
    )
    both = np.vstack([points, points - thickness * outward])
    x = both[cells]
    volume = np.linalg.det(x[:, 1:] - x[:, :1])
    # All prisms of the sheet are passed from the front to the back.
    front = np.sign(np.einsum("ij,ij->i", _normals(points[low]), normal))
    if (volume * np.tile(front, 3) >= 0.0).any() and (volume * np.tile(front, 3) <= 0.0).any():
        raise InputError(
            f"thickness = {thickness:g} m is more than {name} has room for where it bends, "
            "expected less"
        )
    return both, positively_oriented(both, cells)


def _normals(corner):
    return np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])


def _vertex_normals(triangles, normal, num_points):
    """Direction at each point in which all its triangles move by one, by least squares."""
    matrix, rhs = np.zeros((num_points, 3, 3)), np.zeros((num_points, 3))
    for corner in triangles.T:
        np.add.at(matrix, corner, np.einsum("ti,tj->tij", normal, normal))
        np.add.at(rhs, corner, normal)
    # The least one where triangles leave it open: along a plane or an edge.
    return np.einsum("pij,pj->pi", np.linalg.pinv(matrix, rcond=1e-6, hermitian=True), rhs)
