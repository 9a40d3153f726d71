"""Even triangles on a surface with creases, which stay where they are.

Nodes are set along the creases first. Each takes the part of the surface that is closest to it, up
to some distance; clusters (pyacvd) share what is left of each face. A triangle then stands for
each place where three of these parts meet. Only parts of nodes on a crease reach over it, so every
crease becomes a chain of edges.
"""

import warnings

import numpy as np
import pyacvd
import pyvista
import scipy.sparse
from scipy.sparse.csgraph import connected_components, dijkstra

from ..measure import compact, surface_defect
from .creases import crease_chains, sides
from .remesh import (
    SurfaceError,
    closed,
    in_largest_surface,
    nodes_wanted,
    oriented,
    without_fins,
)

#: How far nodes on creases reach into the faces: the rows of even triangles are 0.87 apart, and
#: the clusters of the next one begin half a row before it [edge length].
REACH = 0.4
#: Smaller faces are joined to those around them [edge length squared].
SMALLEST_FACE = 0.2
#: Points of the surface for each node that it is to have, at least.
POINTS_PER_NODE = 15


def remesh_creased(points, triangles, tags, sizes):
    """Triangles of the wanted size on a surface with creases.

    Args:
        points, triangles: The surface, finer than the wanted size.
        tags: Face that each triangle belongs to.
        sizes: `Sizes`, the wanted length of edges.

    Returns:
        points, triangles, tags.

    Raises:
        SurfaceTooSmall: the surface takes too few triangles of this size.
        SurfaceError: no closed surface came out.
    """
    wanted = nodes_wanted(points, triangles, sizes)
    tags = _without_small_faces(points, triangles, tags, sizes)
    while len(points) < POINTS_PER_NODE * wanted:
        points, triangles, tags = _subdivided(points, triangles, tags)
    graph = _lengths(points, triangles, sizes)
    chains = crease_chains(triangles, tags)
    for factor in (1.0, 1.04, 0.96, 1.1, 1.2):
        part, places = _parts_of_creases(points, chains, sizes, factor**0.5)
        part = _spread(graph, part, REACH)
        part, places = _clusters_between(points, triangles, graph, part, places, sizes, factor)
        part = _spread(graph, part, np.inf)
        vertices, faces, face_tags = _where_parts_meet(places, part[triangles], tags)
        defect = surface_defect(vertices, faces) if len(faces) else "no triangles"
        if not defect:
            return vertices, faces, face_tags
    raise SurfaceError(f"remeshed surface has {defect}")


def _without_small_faces(points, triangles, tags, sizes):
    """Tags, where faces that are too small for triangles of their own take a tag around them."""
    order = np.argsort(sides(triangles)[0], axis=None, kind="stable")
    owner = (order // 3).reshape(-1, 2)  # both triangles of each edge of a closed surface
    inner = tags[owner[:, 0]] == tags[owner[:, 1]]
    n = len(triangles)
    graph = scipy.sparse.coo_matrix((np.ones(inner.sum()), owner[inner].T), shape=(n, n))
    num_faces, face = connected_components(graph, directed=False)
    area = np.bincount(face, _areas(points, triangles, sizes), minlength=num_faces)
    new = tags.copy()
    for small in np.flatnonzero(area < SMALLEST_FACE):
        here = face == small
        if tags[here][0] > 0:
            new[here] = 0
            continue
        across = owner[~inner & here[owner].any(axis=1)]
        around = tags[across[~here[across]]]
        if len(around):
            new[here] = np.bincount(around).argmax()
    return new


def _parts_of_creases(points, chains, sizes, factor):
    """Nodes along creases, and which of them each point on a crease belongs to (-1: none)."""
    part, places = np.full(len(points), -1), []

    def node(at):
        places.append(at)
        return len(places) - 1

    ends = [tuple(sorted((chain[0], chain[-1]))) for chain in chains]
    for chain, end in zip(chains, ends, strict=True):
        x = points[chain]
        length = np.linalg.norm(np.diff(x, axis=0), axis=1) / sizes(0.5 * (x[1:] + x[:-1]))
        s = np.concatenate([[0], np.cumsum(length)])
        ring = end[0] == end[1]
        # Two chains between the same ends may not both be one edge.
        least = 3 if ring else 1 + (ends.count(end) > 1)
        num = max(round(s[-1] * factor), least)
        at = s[-1] * np.arange(1, num) / num
        inner = np.column_stack([np.interp(at, s, x[:, i]) for i in range(3)])
        for v in (chain[0], chain[-1]):
            if part[v] < 0:
                part[v] = node(points[v])
        numbers = np.array([part[chain[0]], *[node(p) for p in inner], part[chain[-1]]])
        nearest = np.rint(s * (num / s[-1])).astype(int)
        part[chain[1:-1]] = numbers[nearest[1:-1]]
    return part, places


def _clusters_between(points, triangles, graph, part, places, sizes, factor):
    """Clusters of about one edge length among the points that have no part yet."""
    part, places = part.copy(), list(places)
    free = part < 0
    rest = triangles[free[triangles].all(axis=1)]
    used, local = np.unique(rest, return_inverse=True)
    local = local.reshape(-1, 3)
    if len(used) == 0:
        return part, np.array(places)
    weight = np.zeros(len(points))
    np.add.at(weight, triangles, _areas(points, triangles, sizes)[:, None] / 3)
    num_patches, patch = connected_components(graph[used][:, used], directed=False)
    for p in range(num_patches):
        here = np.flatnonzero(patch == p)
        num = round(weight[used[here]].sum() * 2 / np.sqrt(3) * factor)
        if num == 0:
            continue
        x = points[used[here]]
        if num == 1:
            part[used[here]] = len(places)
            places.append(np.average(x, axis=0, weights=weight[used[here]]))
            continue
        faces = np.searchsorted(here, local[patch[local[:, 0]] == p])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            clusters = pyacvd.Clustering(pyvista.PolyData.from_regular_faces(x, faces))
        clusters.area = weight[used[here]]
        clusters.wcent = clusters.area[:, None] * x
        number = np.asarray(clusters.cluster(num)).astype(np.int64)
        number = np.unique(number, return_inverse=True)[1]
        mass = np.bincount(number, clusters.area)
        centre = [np.bincount(number, clusters.wcent[:, i]) / mass for i in range(3)]
        part[used[here]] = len(places) + number
        places += list(np.column_stack(centre))
    return part, np.array(places)


def _spread(graph, part, reach):
    """Parts, where each point without one takes that of the closest point, if within reach."""
    sources = np.flatnonzero(part >= 0)
    _, _, source = dijkstra(
        graph, indices=sources, min_only=True, limit=reach, return_predecessors=True
    )
    return np.where(source >= 0, part[np.maximum(source, 0)], -1)


def _where_parts_meet(places, corners, tags):
    """A triangle for each three parts that meet: nodes, triangles and tags."""
    ordered = np.sort(corners, axis=1)
    meet = (np.diff(ordered, axis=1) > 0).all(axis=1)
    _, first = np.unique(ordered[meet], axis=0, return_index=True)
    faces, tags = corners[meet][first], tags[meet][first]
    tag_of, tags_at = {}, {}
    for face, tag in zip(faces.tolist(), tags.tolist(), strict=True):
        tag_of[tuple(sorted(face))] = tag
        for v in face:
            tags_at.setdefault(v, set()).add(tag)
    faces = closed(without_fins(faces))
    if len(faces) == 0:
        return places, faces, tags[:0]
    faces = faces[in_largest_surface(places, faces)]
    faces = oriented(places, faces)
    # Holes that were closed belong to the face that all their corners lie in.
    tags = []
    for face in map(sorted, faces.tolist()):
        common = set.intersection(*(tags_at[v] for v in face)) or {0}
        tags.append(tag_of.get(tuple(face), min(common)))
    return *compact(places, faces), np.array(tags)


def _subdivided(points, triangles, tags):
    """Each triangle split into four at the middles of its edges."""
    number, n = sides(triangles)
    edges, number = np.unique(number, return_inverse=True)
    edges = np.column_stack(np.divmod(edges, n))
    middle = len(points) + number.reshape(-1, 3)
    (a, b, c), (ab, bc, ca) = triangles.T, middle.T
    new = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    triangles = np.concatenate([np.column_stack(t) for t in new])
    return np.concatenate([points, points[edges].mean(axis=1)]), triangles, np.tile(tags, 4)


def _lengths(points, triangles, sizes):
    """Sparse matrix of the lengths of edges over the wanted ones."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    x = points[edges]
    length = np.linalg.norm(x[:, 1] - x[:, 0], axis=1) / sizes(x.mean(axis=1))
    n = len(points)
    # Each edge occurs once in each direction; zeros would count as no edge.
    return scipy.sparse.csr_matrix((np.maximum(length, 1e-12), edges.T), shape=(n, n))


def _areas(points, triangles, sizes):
    """Areas of triangles over the square of the wanted length of edges."""
    x = points[triangles]
    area = np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1) / 2
    return area / sizes(x.mean(axis=1)) ** 2
