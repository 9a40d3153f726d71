"""How far the nodes of grains are from the surfaces of other grains, and inside which they lie."""

import numpy as np

from ...kernels.contact.gaps import find_gaps
from ...kernels.contact.search import find_candidates, group_by_grain, sort_into_cells


def surface_gaps(points, triangles, grain_of_node, reach):
    """Gaps between nodes and the surfaces of other grains near them.

    Args:
        points: Nodes of all surfaces, none in two of them, shape (num_nodes, 3).
        triangles: Closed surfaces seen from outside, shape (num_facets, 3).
        grain_of_node: Shape (num_nodes,).
        reach: Largest distance.

    Returns:
        node, gap (negative inside) and unit vector from the other surface outward, of each
        pair of a node and another grain.
    """
    triangles = np.ascontiguousarray(triangles, dtype=np.int64)
    grain_of_node = np.ascontiguousarray(grain_of_node, dtype=np.int64)
    grain_of_facet = np.ascontiguousarray(grain_of_node[triangles[:, 0]])
    n, low = len(points), points.min(axis=0) - reach
    cell = 2 * reach
    shape = np.ceil((points.max(axis=0) + reach - low) / cell).astype(np.int64) + 1
    cells = sort_into_cells(points, n, low, cell, shape)
    use = np.ones(len(triangles), dtype=bool)
    found = find_candidates(
        points, grain_of_node, triangles, grain_of_facet, use, np.full(len(triangles), reach),
        np.zeros(n), low, cell, shape, *cells,
    )  # fmt: skip
    node, _, first = group_by_grain(*found, grain_of_facet)
    gap, normal = np.empty(len(node)), np.empty((len(node), 3))
    order = np.argsort(triangles.ravel(), kind="stable")
    offset = np.concatenate([[0], np.cumsum(np.bincount(triangles.ravel(), minlength=n))])
    across = _across(triangles, n)
    faceted = np.zeros((len(triangles), 6))
    find_gaps(
        gap, normal, points[node], points, first, found[1], triangles, faceted, across, offset,
        order // 3,
    )  # fmt: skip
    return node, gap, normal


def _across(triangles, num_nodes):
    """The facet beyond each edge 0-1, 1-2, 2-0 of a closed surface, shape (num_facets, 3)."""
    start, end = triangles, np.roll(triangles, -1, axis=1)
    here, there = (start * num_nodes + end).ravel(), (end * num_nodes + start).ravel()
    order = np.argsort(here)
    place = np.minimum(np.searchsorted(here[order], there), len(here) - 1)
    return np.where(here[order][place] == there, order[place] // 3, -1).reshape(-1, 3)
