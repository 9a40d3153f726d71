"""Which grains can touch which grains and planes, and how stiff those contacts are."""

from dataclasses import dataclass

import numpy as np

from ..contact.laws import edge_of_area
from ..kernels.contact.search import find_candidates, sort_into_cells

#: Cells of the grid of the search along the longest side of the sample.
MOST_CELLS = 256


@dataclass(frozen=True)
class Surfaces:
    """Surfaces of all grains and the compliance of their facets."""

    points: np.ndarray  #: nodes, those inside the grains included [m], shape (num_nodes, 3)
    triangles: np.ndarray  #: seen from outside, shape (num_facets, 3)
    grain_of_node: np.ndarray  #: shape (num_nodes,)
    layer: np.ndarray  #: compliance of the contact layer of each facet [m/Pa], (num_facets,)
    area: np.ndarray  #: of each facet [m²], shape (num_facets,)

    @property
    def grain_of_facet(self):
        """Grain of each facet, shape (num_facets,)."""
        return self.grain_of_node[self.triangles[:, 0]]


def surfaces_of(points, triangles, grain_of_node, compliance, modulus):
    """:class:`Surfaces` with layers c h/E*, see :func:`~mufe_fenicsx.contact.laws.matched_layers`.

    Args:
        points, triangles, grain_of_node: Nodes, facets and grains.
        compliance: The constant c.
        modulus: E/(1 - nu²) of each grain [Pa], shape (num_grains,).
    """
    a, b, c = (points[triangles[:, i]] for i in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    layer = compliance * edge_of_area(area, 1) / modulus[grain_of_node[triangles[:, 0]]]
    return Surfaces(points, triangles, grain_of_node, layer, area)


def touching_grains(surfaces, reach, near):
    """Pairs of grains with a gap of at most ``reach``, and the layers where they face each other.

    Args:
        surfaces: :class:`Surfaces`.
        reach: Largest gap [m].
        near: Layers are means, by area, over the facets within this distance of the other grain
            [m]; over those within ``reach`` where there are none.

    Returns:
        A list of (first grain, second grain, layer of the first, layer of the second [m/Pa],
        mean area of those facets of each [m²]), the first below the second.
    """
    within, closer = _facing(surfaces, reach), _facing(surfaces, min(near, reach))
    pairs = []
    for pair, sides in within.items():
        means = [_means(surfaces, facets) for facets in closer.get(pair, sides)]
        (layer, area), (layer2, area2) = means
        pairs.append((*pair, layer, layer2, area, area2))
    return pairs


def touching_planes(surfaces, point, normal, reach, near):
    """Grains within ``reach`` of a plane: a list of (grain, its layer there [m/Pa])."""
    s = surfaces
    height = ((s.points - point) @ normal)[s.triangles].min(axis=1)
    found = []
    for grain in np.unique(s.grain_of_facet[height <= reach]).tolist():
        mine = s.grain_of_facet == grain
        closer = mine & (height <= near)
        found.append((grain, _means(s, closer if closer.any() else mine & (height <= reach))[0]))
    return found


def _facing(s, reach):
    """{(first, second): facets of each of these grains that are within ``reach`` of the other}."""
    node, facet = _near(s, reach)
    if not len(node):
        return {}
    sides = np.column_stack([s.grain_of_node[node], s.grain_of_facet[facet]])
    found, number = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True)
    number, faces = number.ravel(), {}
    for k, pair in enumerate(found.tolist()):
        here = number == k
        at, near = np.zeros(len(s.points), dtype=bool), np.zeros(len(s.triangles), dtype=bool)
        at[node[here]] = near[facet[here]] = True
        near |= at[s.triangles].any(axis=1)
        faces[tuple(pair)] = [near & (s.grain_of_facet == grain) for grain in pair]
    return faces


def _near(s, reach):
    """Nodes and facets of other grains within ``reach`` of each other."""
    on_surface, triangles = np.unique(s.triangles, return_inverse=True)
    triangles = np.ascontiguousarray(triangles.reshape(-1, 3), dtype=np.int64)
    points = np.ascontiguousarray(s.points[on_surface])
    own = np.ascontiguousarray(s.grain_of_node[on_surface], dtype=np.int64)
    low, high = points.min(axis=0) - reach, points.max(axis=0) + reach
    cell = max(2 * reach, (high - low).max() / MOST_CELLS)
    shape = np.ceil((high - low) / cell).astype(np.int64) + 1
    cells = sort_into_cells(points, len(points), low, cell, shape)
    grain_of_facet = np.ascontiguousarray(own[triangles[:, 0]])
    use = np.ones(len(triangles), dtype=bool)
    offset, facet = find_candidates(
        points, own, triangles, grain_of_facet, use, np.full(len(triangles), reach),
        np.zeros(own.size), low, cell, shape, *cells,
    )  # fmt: skip
    node = np.repeat(on_surface, np.diff(offset))
    return node, facet[: len(node)]


def _means(s, which):
    """Mean layer, by area, and mean area of some facets."""
    return np.average(s.layer[which], weights=s.area[which]), float(s.area[which].mean())
