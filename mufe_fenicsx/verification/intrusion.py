"""How deep bodies lie in each other, found by other means than those of the contact.

Edges that pierce facets of another body and distances come from the library ipctk (IPC
Toolkit, https://ipctk.xyz); inside is where the surface's winding number is one (A. Jacobson,
L. Kavan, O. Sorkine-Hornung, ACM Trans. Graph. 32(4), 2013). Neither candidates, closest
features nor pseudo-normals are shared with mufe_fenicsx.contact.
"""

import subprocess
import sys
from dataclasses import dataclass
from functools import cache

import numpy as np

from ..errors import InputError
from ..machine.mpi_launcher import environment_without_launcher

#: What ends a process where the library was built for other processors than this one.
TRIAL = """
import ipctk
import numpy as np

x = np.asfortranarray(np.random.default_rng(0).random((12, 3)))
facets = np.asfortranarray(np.arange(12, dtype=np.int32).reshape(4, 3))
found = ipctk.LBVH()
found.can_vertices_collide = ipctk.make_vertex_patches_filter(np.arange(12, dtype=np.int32) // 6)
found.build(x, np.asfortranarray(ipctk.edges(facets)), facets, 0.0)
found.detect_edge_face_candidates()
"""
#: Points looked at along an edge between one pierced facet and the next, or its end.
NUM_SAMPLES = 9


@dataclass(frozen=True)
class Intrusion:
    """What of the bodies' surfaces lies inside other bodies."""

    depth: float  #: of the deepest point below the other body's surface [m]
    vertex_depth: float  #: of the deepest vertex [m]
    num_vertices: int  #: vertices inside another body
    num_edges: int  #: edges that pierce a facet of another body
    place: np.ndarray | None  #: the deepest point [m], shape (3,); None without any
    bodies: tuple | None  #: the body it belongs to and the body it is inside of


@cache
def what_is_missing():
    """Why the library ipctk cannot be used here, or "". Local."""
    tried = subprocess.run(  # noqa: S603, a program of this file
        [sys.executable, "-c", TRIAL], env=environment_without_launcher(), capture_output=True,
        check=False,
    )  # fmt: skip
    if tried.returncode < 0:
        return "the library ipctk does not run on this processor, expected one that it is built for"
    if tried.returncode:
        return "the library ipctk is not installed, expected pip install 'mufe-fenicsx[test]'"
    return ""


def find_intrusion(x, facets, body, reach):
    """The deepest point of a body's surface inside another body. Local.

    Looked at are all vertices, and points along edges that pierce a facet, within ``reach`` of
    the other surface. What lies deeper got there through that layer and shows in it.

    Args:
        x: Positions of surface nodes [m], shape (num_nodes, 3).
        facets: Closed, outward surfaces of all bodies, shape (num_facets, 3).
        body: Body of each node, shape (num_nodes,).
        reach: Distance [m].

    Returns:
        :class:`Intrusion`.

    Raises:
        InputError: ipctk is not installed, or does not run on this processor.
    """
    missing = what_is_missing()
    if missing:
        raise InputError(missing)
    import ipctk

    ipctk.set_num_threads(1)  # ranks share the cores
    # Its tolerances mean lengths of order one.
    scale = 1.0 / np.ptp(x, axis=0).max()
    facets = np.asfortranarray(facets, dtype=np.int32)
    edges = np.asfortranarray(ipctk.edges(facets))
    body = np.asarray(body, dtype=np.int32)

    found = _candidates(ipctk, x * scale, edges, facets, body, 0.0).detect_edge_face_candidates()
    edge, facet = _ids(found, "edge_id", "face_id")
    crosses = body[edges[edge, 0]] != body[facets[facet, 0]]
    edge, facet = edge[crosses], facet[crosses]
    pierces = [
        ipctk.is_edge_intersecting_triangle(*(scale * x[n] for n in (*edges[e], *facets[f])))
        for e, f in zip(edge, facet, strict=True)
    ]
    edge, facet = edge[pierces], facet[pierces]
    if not edge.size:
        return Intrusion(0.0, 0.0, 0, 0, None, None)
    # Bodies can be inside each other only where a surface goes through the other.
    pairs = np.unique(
        np.sort(np.column_stack([body[edges[edge, 0]], body[facets[facet, 0]]]), axis=1), axis=0
    )
    num_edges = np.unique(edge).size
    edge, part = _between(x, edges, facets, edge, facet)
    along = (1 - part)[:, None] * x[edges[edge, 0]] + part[:, None] * x[edges[edge, 1]]
    samples = np.concatenate([x, along])
    owner = np.concatenate([body, body[edges[edge, 0]]])

    # A box grows by its inflation, those of sample and facet by half of the reach each.
    found = _candidates(ipctk, samples * scale, edges, facets, owner, 0.5 * reach * scale)
    sample, facet = _ids(found.detect_face_vertex_candidates(), "vertex_id", "face_id")
    base = int(body.max()) + 1
    both = np.sort(np.column_stack([owner[sample], body[facets[facet, 0]]]), axis=1)
    near = np.isin(both @ [base, 1], pairs @ [base, 1]) & (both[:, 0] != both[:, 1])
    sample, facet = sample[near], facet[near]
    depth, vertex_depth, place, bodies, vertices = 0.0, 0.0, None, None, 0
    for other in np.unique(body[facets[facet, 0]]):
        of_other = body[facets[facet, 0]] == other
        wanted, row = np.unique(sample[of_other], return_inverse=True)
        inside = is_inside(samples[wanted], x[facets[body[facets[:, 0]] == other]])
        vertices += np.count_nonzero(wanted[inside] < len(x))
        distance = np.full(wanted.size, np.inf)
        for k, f in zip(row, facet[of_other], strict=True):
            if inside[k]:
                square = ipctk.point_triangle_distance(samples[wanted[k]], *x[facets[f]])
                distance[k] = min(distance[k], np.sqrt(square))
        distance[~inside | np.isinf(distance)] = 0.0
        vertex_depth = max(vertex_depth, distance[wanted < len(x)].max(initial=0.0))
        k = np.argmax(distance)
        if distance[k] > depth:
            depth, place = float(distance[k]), samples[wanted[k]]
            bodies = int(owner[wanted[k]]), int(other)
    return Intrusion(depth, float(vertex_depth), int(vertices), num_edges, place, bodies)


def _between(x, edges, facets, edge, facet):
    """Samples of edges, between the facets that they pierce: edge, and where along it."""
    start, along = x[edges[edge, 0]], x[edges[edge, 1]] - x[edges[edge, 0]]
    a, b, c = (x[facets[facet, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    with np.errstate(invalid="ignore", divide="ignore"):  # an edge may lie in the facet
        part = np.einsum("ij,ij->i", a - start, normal) / np.einsum("ij,ij->i", along, normal)
    part = np.clip(np.nan_to_num(part, nan=0.5), 0.0, 1.0)
    ends = np.unique(edge)
    edge = np.concatenate([edge, ends, ends])
    part = np.concatenate([part, np.zeros(ends.size), np.ones(ends.size)])
    order = np.lexsort((part, edge))
    edge, part = edge[order], part[order]
    same = edge[1:] == edge[:-1]
    first, last = part[:-1][same], part[1:][same]
    share = np.arange(1, NUM_SAMPLES + 1) / (NUM_SAMPLES + 1)
    places = first[:, None] + (last - first)[:, None] * share
    return np.repeat(edge[1:][same], NUM_SAMPLES), places.ravel()


def is_inside(points, triangles, chunk=20_000):
    """Whether points lie inside a closed surface, by its winding number.

    The solid angle of a triangle is that of A. van Oosterom and J. Strackee, IEEE Trans.
    Biomed. Eng. 30, 1983, 125-126; scalar products are expanded into products of matrices.

    Args:
        points: Shape (num_points, 3).
        triangles: Corners of outward triangles, shape (num_triangles, 3, 3).
        chunk: Pairs of point and triangle at a time.

    Returns:
        Booleans, shape (num_points,).
    """
    middle = triangles.mean(axis=(0, 1))
    corners = np.moveaxis(triangles - middle, 1, 0)
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    height = np.einsum("ij,ij->i", normal, corners[0])
    products = {
        (i, j): np.einsum("ij,ij->i", corners[i], corners[j]) for i in range(3) for j in range(i, 3)
    }
    sums = {(i, j): (corners[i] + corners[j]).T for i, j in products}
    inside = np.empty(len(points), dtype=bool)
    step = max(chunk // len(triangles), 1)
    for start in range(0, len(points), step):
        p = points[start : start + step] - middle
        own = np.einsum("ij,ij->i", p, p)[:, None]
        dot = {ij: product - p @ sums[ij] + own for ij, product in products.items()}
        a, b, c = (np.sqrt(np.maximum(dot[i, i], 0.0)) for i in range(3))
        spread = a * b * c + dot[0, 1] * c + dot[1, 2] * a + dot[0, 2] * b
        angle = 2 * np.arctan2(height - p @ normal.T, spread)
        inside[start : start + step] = angle.sum(axis=1) > 2 * np.pi
    return inside


def _candidates(ipctk, x, edges, facets, body, inflation):
    """A broad phase over boxes, of different bodies only."""
    found = ipctk.LBVH()
    found.can_vertices_collide = ipctk.make_vertex_patches_filter(body)
    found.build(np.asfortranarray(x), edges, facets, inflation)
    return found


def _ids(candidates, *names):
    return tuple(
        np.fromiter((getattr(c, name) for c in candidates), np.int64, len(candidates))
        for name in names
    )
