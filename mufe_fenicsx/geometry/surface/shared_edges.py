"""A complex of facets made of even triangles: edges split, collapsed and flipped face by face."""

import numpy as np
import scipy.sparse
import scipy.sparse.csgraph

from ...kernels.geometry import retriangulate as kernel
from .remesh import SurfaceError

#: Lengths of edges over the wanted one beyond which they are halved or shrunk.
LONGEST, SHORTEST = 1.45, 0.72
#: Altitude of facets over the wanted edge below which they are flat.
FLAT = 0.45


def evened(x, facets, sides, bits, size):
    """Edges of a complex brought to a length.

    Args:
        x: Nodes, shape (num_nodes, 3).
        facets, sides: As of `shared_surface.SharedSurface`.
        bits: Faces of the image that facets lie on, 1, 2, 4 for its axes, shape (num_facets,).
        size: Wanted length of edges.

    Returns:
        The same four; nodes that are gone are left out.
    """
    x, facets, sides, bits = _split(x, facets, sides, bits, LONGEST * size)
    ring, count = _rings(facets, len(x))
    start, end, length = _edges(x, facets)
    pairs = np.column_stack([start, end])[np.argsort(length, kind="stable")]
    kernel.collapse(
        x, facets, sides, bits, ring, count, pairs, SHORTEST * size, LONGEST * size, FLAT * size
    )
    there = facets[:, 0] >= 0
    facets, sides, bits = facets[there], sides[there], bits[there]
    ring, count = _rings(facets, len(x))
    for _ in range(5):
        start, end, length = _edges(x, facets)
        pairs = np.column_stack([start, end])[np.argsort(-length, kind="stable")]
        if not kernel.flip(x, facets, sides, bits, ring, count, pairs):
            break
    used, numbered = np.unique(facets, return_inverse=True)
    return x[used], numbered.reshape(-1, 3).astype(np.int64), sides, bits


def _split(x, facets, sides, bits, longest):
    """Edges halved that are longer than a length."""
    start, end, length = _edges(x, facets)
    order = np.argsort(-length, kind="stable")[: np.count_nonzero(length > longest)]
    n, m, more = len(x), len(facets), len(order)
    x = np.concatenate([x, np.zeros((more, 3))])
    facets = np.concatenate([facets, np.full((4 * more, 3), -1)])
    sides = np.concatenate([sides, np.zeros((4 * more, 2), dtype=np.int64)])
    bits = np.concatenate([bits, np.zeros(4 * more, dtype=np.int64)])
    ring, count = _rings(facets[:m], len(x))
    pairs = np.column_stack([start, end])[order]
    n, m = kernel.split(x, facets, sides, bits, ring, count, pairs, n, m, longest)
    return x[:n], facets[:m], sides[:m], bits[:m]


def _rings(facets, num_nodes):
    ring = np.full((num_nodes, kernel.MOST), -1, dtype=np.int32)
    count = np.zeros(num_nodes, dtype=np.int32)
    if not kernel.fill_rings(ring, count, facets):
        raise SurfaceError(f"a node has more than {kernel.MOST} facets")
    return ring, count


def _edges(x, facets):
    """Ends of each edge once, start < end, and lengths."""
    ends = np.concatenate([facets[:, [i, j]] for i, j in ((0, 1), (1, 2), (2, 0))])
    key = np.sort(ends.min(axis=1) * len(x) + ends.max(axis=1))
    start, end = np.divmod(key[np.diff(key, prepend=-1) > 0], len(x))
    return start, end, np.linalg.norm(x[start] - x[end], axis=1)


def opened(x, facets, sides, bits, least):
    """Faces between two grains smaller than an area become two that lie on each other.

    Where grains touch without a common face, along an edge or at a node, each gets its own nodes.

    Args:
        x, facets, sides, bits: As of :func:`evened`.
        least: Area of a face.

    Returns:
        The same four.
    """
    base = sides.max() + 1
    open_ = np.flatnonzero(
        _small_faces(x, facets, sides, least) | _thin_ears(x, facets, sides, least)
    )
    other = sides[open_].copy()
    other[:, 0] = 0
    sides = np.concatenate([sides, other])
    sides[open_, 1] = 0
    facets = np.concatenate([facets, facets[open_]])
    bits = np.concatenate([bits, bits[open_]])

    # A node for each set of grains around it that have common faces there.
    first = sides.max(axis=1)
    second = np.where(sides.min(axis=1) > 0, sides.min(axis=1), first)
    node = facets.ravel()
    one, two = (node * base + np.repeat(side, 3) for side in (first, second))
    known, number = np.unique(np.concatenate([one, two]), return_inverse=True)
    one, two = number[: len(node)], number[len(node) :]
    part = _parts(one, two)
    start = np.zeros(part.max() + 1, dtype=np.int64)
    start[part] = known // base
    return x[start], part[one].reshape(-1, 3).astype(np.int64), sides, bits


def _small_faces(x, facets, sides, least):
    """Facets of faces between two grains whose area is less."""
    shared = np.flatnonzero((sides > 0).all(axis=1))
    face, edge = _edges_of_faces(facets[shared], sides[shared], len(x))
    patch = _parts(face, len(shared) + edge)[: len(shared)]
    a, b, c = (x[facets[shared, i]] for i in range(3))
    area = np.bincount(patch, np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)
    small = np.zeros(len(facets), dtype=bool)
    if len(shared):
        small[shared] = area[patch] < least
    return small


def _thin_ears(x, facets, sides, least):
    """Flat facets between two grains with two edges where their face ends at the void."""
    shared = np.flatnonzero((sides > 0).all(axis=1))
    face, edge = _edges_of_faces(facets[shared], sides[shared], len(x))
    ends = np.bincount(face, np.bincount(edge)[edge] == 1, len(shared)) >= 2
    a, b, c = (x[facets[shared, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    longest = np.max([((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    void = np.zeros(len(x), dtype=bool)
    void[facets[(sides == 0).any(axis=1)]] = True
    thin = np.zeros(len(facets), dtype=bool)
    thin[shared] = ends & void[facets[shared]].all(axis=1) & (area < 0.25 * longest)
    return thin


def _edges_of_faces(facets, sides, num_nodes):
    """Facets, each three times, and a number for each edge of a face between two labels."""
    pair = sides.min(axis=1) * (sides.max(initial=0) + 1) + sides.max(axis=1)
    ends = np.concatenate([facets[:, [i, j]] for i, j in ((0, 1), (1, 2), (2, 0))])
    key = np.column_stack([np.tile(pair, 3), ends.min(axis=1) * num_nodes + ends.max(axis=1)])
    _, edge = np.unique(key, axis=0, return_inverse=True)
    return np.tile(np.arange(len(facets)), 3), edge.ravel()


def _parts(one, two):
    """Connected parts of a graph with these edges, a number for each of its nodes."""
    n = max(one.max(initial=-1), two.max(initial=-1)) + 1
    graph = scipy.sparse.coo_matrix((np.ones(len(one), dtype=bool), (one, two)), shape=(n, n))
    return scipy.sparse.csgraph.connected_components(graph, directed=False)[1]
