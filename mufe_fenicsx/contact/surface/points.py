"""Points of a surface that carry contact: its nodes, or quadrature points of its facets.

The traction at a point acts on the nodes of its facet with their shape functions, so
that an even pressure between surfaces that do not match stays even, which forces at
nodes cannot do. A facet's centroid alone would let a sharp vertex sink in before it
feels anything: sharp vertices carry contact as well.
"""

from dataclasses import dataclass

import numpy as np

from ...errors import InputError, shown
from ...kernels.geometry.rings import nodes_around
from ..laws import edge_of_area
from .bulges import height

#: Barycentric coordinates of the quadrature points of a facet, of equal weight; none where all
#: points are nodes.
RULES = {
    "nodes": np.empty((0, 3)),
    "facets": np.full((1, 3), 1 / 3),
    "facets4": np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4], [2, 2, 2]]) / 6,
}
KINDS = tuple(RULES)
#: A vertex is sharp where facets around it turn by more [rad]: between smoother ones a
#: vertex reaches 2/3 · 0.87 h tan(angle/2) <= 0.1 h beyond the centroids.
SHARP = np.radians(20.0)
#: A sharp vertex carries contact once it is this part of an edge deep: after the
#: centroids where the contact is flat (depth over edge about half of p/E), so that it adds
#: nothing there.
RECESS = 0.01


@dataclass(frozen=True)
class Points:
    """Points of this rank's surface: those in facets, then those at nodes."""

    corner: (
        np.ndarray
    )  #: own surface nodes around each point, int32, (num_points, 3); a node thrice
    rule: np.ndarray  #: weights of the points of one facet, shape (num, 3)
    grain_of_point: np.ndarray  #: global index of the grain, int32, shape (num_points,)
    body_of_point: np.ndarray  #: as of :class:`~.surface.OwnSurface`, shape (num_points,)
    local_grain: np.ndarray  #: local index of the grain, shape (num_points,)
    area: np.ndarray  #: [m²], shape (num_points,)
    layer: np.ndarray  #: compliance of the layer [m/Pa], shape (num_points,)
    facet_area: np.ndarray  #: area of the facets there [m²], shape (num_points,)
    depth: np.ndarray  #: part in the largest depth of pairs [m], shape (num_points,)
    ring_offset: np.ndarray  #: compressed rows of the own facets around each point
    ring: np.ndarray
    #: Nodes around each point that is a node: surface nodes, int32, one after another;
    around: np.ndarray
    around_of: np.ndarray  #: the first there and how many, int32, shape (num_points, 2)
    #: Of the surface there, as of surface.bulges.Bulges; vertices have the last number alone,
    curvature: np.ndarray  #: shape (num_points, 3)
    cell: np.ndarray  #: of the mesh, beneath the point, int32, shape (num_points,)
    #: Height of the smooth surface over the facet, at which the point is [m], none of a vertex;
    stands: np.ndarray  #: shape (num_points,)
    recess: np.ndarray  #: depth at which contact of a vertex begins [m], shape (num_points,)
    num_in_facets: int  #: points in facets, which come first

    @property
    def num_points(self):
        """Points on this rank."""
        return self.area.size

    @property
    def are_nodes(self):
        """Whether all points are nodes, in their order."""
        return not len(self.rule)

    @property
    def weight(self):
        """Weights of ``corner``, shape (num_points, 3), made anew."""
        return self.carriers(np.arange(self.num_points))[1]

    @property
    def rules(self):
        """Weights of the corners of each kind of point; the last is of nodes, (num_rules, 3)."""
        return np.vstack([self.rule, [[1.0, 0.0, 0.0]]])

    def is_vertex(self, points):
        """Whether the given points are nodes, shape (num,)."""
        return points >= self.num_in_facets

    def rule_of(self, points):
        """Rows of :attr:`rules` that the given points have, shape (num,)."""
        n = len(self.rule)
        return np.where(self.is_vertex(points), n, points % max(n, 1))

    def carriers(self, points):
        """Surface nodes that carry the given points and their weights, both of shape (num, 3)."""
        weight = self.rules.take(self.rule_of(points), axis=0)
        return self.corner.take(points, axis=0), weight

    def places(self, x, points):
        """Where the given points are [m], shape (num, 3), with own surface nodes at ``x``."""
        nodes, weight = self.carriers(points)
        return np.einsum("pc,pci->pi", weight, x[nodes])

    def stand(self, x, points, height):
        """As :meth:`places`, where they stand over their facets by a ``height`` [m], (num,)."""
        a, b, c = x[self.corner[points]].transpose(1, 0, 2)
        normal = np.cross(b - a, c - a)
        size = np.linalg.norm(normal, axis=1)
        up = height / np.where(size > 0.0, size, 1.0)  # vertices have no facet
        return self.places(x, points) + up[:, None] * normal

    def stretch(self, own, x, points):
        """Area of the facets around ``points`` now over the reference one, shape (num,).

        Args:
            own: :class:`~.OwnSurface` that the points belong to.
            x: Positions of the mesh's nodes [m], shape (num_nodes, 3).
            points: Of this rank, shape (num,).
        """
        at, begin, _ = entries(self.ring_offset, points)
        facet = self.ring[at]
        a, b, c = (x[own.nodes[own.facets[facet, i]]] for i in range(3))
        now = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
        return _sums(now, begin) / _sums(own.facet_area[facet], begin)

    def to_nodes(self, values, num_nodes):
        """Values at points, shape (num_points, k), spread to surface nodes (num_nodes, k)."""
        at_nodes = np.zeros((num_nodes, values.shape[1]))
        for corner, weight in zip(self.corner.T, self.weight.T, strict=True):
            for k in range(values.shape[1]):  # one at a time needs less room
                np.add.at(at_nodes[:, k], corner, weight * values[:, k])
        return at_nodes


def surface_points(kind, mesh, own, x, node_layer, layer, node_depth, depth, smooth):
    """Points of a surface. Local.

    Args:
        kind: One of ``KINDS``: the nodes, or one or four points of each facet.
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        own: Its :class:`~mufe_fenicsx.contact.surface.surface.OwnSurface`.
        x: Reference positions of the mesh's nodes [m], shape (num_nodes, 3).
        node_layer, layer: Compliance of the layer of nodes and of facets [m/Pa].
        node_depth, depth: Their parts in the largest depth of pairs [m].
        smooth: :class:`~.bulges.Bulges` of the own facets.

    Raises:
        InputError: There is no such kind.
    """
    if kind not in KINDS:
        raise InputError(f"points of contact = {shown(kind)}, expected one of {', '.join(KINDS)}")
    rule = RULES[kind]
    n = len(rule)
    vertex = np.flatnonzero(sharp_vertices(own, x)) if n else np.arange(own.nodes.size)

    def both(of_facets, of_nodes):
        return np.concatenate([np.repeat(of_facets, n, axis=0), of_nodes[vertex]])

    nodes = np.arange(own.nodes.size, dtype=np.int32)
    return Points(
        corner=both(own.facets, np.stack([nodes] * 3, axis=1)),
        rule=rule,
        grain_of_point=both(own.grain_of_facet, own.grain_of_node),
        body_of_point=both(own.body_of_facet, own.body_of_node),
        local_grain=both(own.local_grain_of_facet, mesh.grain_of_node[own.nodes]),
        area=both(own.facet_area / max(n, 1), own.area),
        layer=both(layer, node_layer),
        facet_area=both(own.facet_area, 0.5 * own.whole_area),
        depth=both(depth, node_depth),
        curvature=both(smooth.curvature, _bend_of_nodes(own, smooth)),
        # At a node, of one of the facets around.
        cell=both(own.cell_of_facet, own.cell_of_facet[own.ring[own.ring_offset[:-1]]]),
        stands=np.append(
            np.array([height(smooth.bulge, w) for w in rule]).T.ravel(), np.zeros(vertex.size)
        ),
        recess=np.append(
            np.zeros(n * len(own.facets)),
            (RECESS if n else 0.0) * edge_of_area(own.whole_area, 2)[vertex],
        ),
        num_in_facets=n * len(own.facets),
        **point_lists(own, vertex, n * len(own.facets)),
    )


def point_lists(own, vertex, num_in_facets):
    """Facets and nodes around points, fields of :class:`Points` by name. Local.

    Args:
        own: :class:`~mufe_fenicsx.contact.surface.surface.OwnSurface`.
        vertex: Its nodes that are points, increasing.
        num_in_facets: Number of points in facets, as many in each.
    """
    around, _, num_around = entries(own.ring_offset, vertex)
    each = num_in_facets // max(len(own.facets), 1)
    facets = np.repeat(np.arange(len(own.facets), dtype=np.int32), each)
    num_around = np.concatenate([np.ones(num_in_facets), num_around])
    nodes, nodes_of = nodes_around(own.facets, own.ring_offset, own.ring, vertex)
    return {
        "ring_offset": np.concatenate([[0], np.cumsum(num_around)]).astype(np.int32),
        "ring": np.concatenate([facets, own.ring[around]]).astype(own.ring.dtype),
        "around": nodes,
        "around_of": np.concatenate([np.zeros((num_in_facets, 2), np.int32), nodes_of]),
    }


def _bend_of_nodes(own, smooth):
    """Curvature of surface nodes: nothing, nothing, the mean of the facets around, (num, 3)."""
    facet, count = own.facets.ravel(), np.diff(own.ring_offset)
    total = np.bincount(facet, np.repeat(smooth.curvature[:, 2], 3), own.nodes.size)
    return np.stack([np.zeros(own.nodes.size)] * 2 + [total / np.maximum(count, 1)], axis=1)


def entries(offset, rows):
    """Where the entries of some compressed rows are, the first of each row there, and how many."""
    first, count = offset[rows], offset[rows + 1] - offset[rows]
    begin = np.cumsum(count) - count
    return np.repeat(first - begin, count) + np.arange(count.sum()), begin, count


def _sums(values, first):
    """Sums over rows of compressed rows, none of them empty, shape (num_rows,)."""
    return np.add.reduceat(values, first) if values.size else np.zeros(0)


def sharp_vertices(own, x):
    """Whether facets around each node of a surface turn by more than ``SHARP``, (num_nodes,).

    A facet that ends on a mirror has its image for a neighbour.
    """
    a, b, c = (x[own.nodes[own.facets[:, i]]] for i in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    across = own.neighbour
    sharp = np.zeros(own.nodes.size, dtype=bool)
    for i in range(3):
        other = across[:, i]
        cosine = np.einsum("ij,ij->i", normal, normal[other])
        at = np.flatnonzero(own.mirror[:, i] >= 0)
        plane = own.mirror_normal[own.mirror[at, i]]
        cosine[at] = 1.0 - 2.0 * np.einsum("ij,ij->i", normal[at], plane) ** 2
        turned = ((other < 0) & (own.mirror[:, i] < 0)) | (cosine < np.cos(SHARP))
        sharp[own.facets[turned, i]] = True
        sharp[own.facets[turned, (i + 1) % 3]] = True
    return sharp
