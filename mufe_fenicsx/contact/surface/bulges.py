"""How far a smooth surface stands above its facets.

Between the nodes of a facet the surface is a parabola. With the normals m of the surface at the
nodes a, b, c at ``x``, and the barycentric coordinates w of a point, its height over the facet is

    z(w) = q_ab w_a w_b + q_bc w_b w_c + q_ca w_c w_a - Σ o_v w_v ,
    q_ab = ½ (m_b - m_a)·(x_b - x_a) .

2 q_ab is the curvature along the edge times the square of its length. The offset o of a node is the
mean of (q_ab + q_bc + q_ca)/12 over its facets, by area: the surface then encloses the volume that
the facets enclose. At the ends of sharp edges o vanishes, as q does along all edges that end there,
so that the surface has no jumps. The normal of a node is the sum of those of its facets, each times
its angle there, over the facets that no edge parts where the surface turns by more than
``SHARP_EDGE``, in or out. Where all are flat, q and o vanish.
"""

from dataclasses import dataclass, replace

import numpy as np

from ...kernels.geometry.boxes import grown_by
from ...kernels.geometry.rings import neighbours, rings
from .surface import SHARP_EDGE

#: As in kernels/contact/pairs.h.
XI = 0.104
#: Part of an edge below which a height is rounding.
NONE = 1e-12


@dataclass(frozen=True)
class Bulges:
    """The smooth surface over own facets."""

    bulge: np.ndarray  #: q_ab, q_bc, q_ca, o_a, o_b, o_c of facets [m], shape (num_facets, 6)
    #: Determinant [1/m²] and trace [1/m] of the curvature, of a convex surface positive; and the
    #: mean curvature [1/m] across sharp edges too,
    curvature: np.ndarray  #: shape (num_facets, 3)
    slope: np.ndarray  #: against the facets, at most, shape (num_facets,)

    def some(self, rows):
        """Those of the facets ``rows``. Local."""
        return Bulges(self.bulge[rows], self.curvature[rows], self.slope[rows])

    def joined(self, other, rows):
        """Those that ``rows`` makes of both, field by field. Local."""
        fields = (self.bulge, other.bulge), (self.curvature, other.curvature)
        return Bulges(*(rows(*both) for both in (*fields, (self.slope, other.slope))))

    def put(self, rows, found):
        """Take those that are ``found`` for the facets ``rows``. Local."""
        self.bulge[rows], self.curvature[rows] = found.bulge, found.curvature
        self.slope[rows] = found.slope


def no_bulges(own):
    """Facets that are what they are: no smooth surface over them. Local."""
    num = len(own.facets)
    return Bulges(np.zeros((num, 6)), np.zeros((num, 3)), np.zeros(num))


def bulges_beside_cracks(own, x, known, wanted):
    """The smooth surface over own facets, of which cracks have cut some. Local.

    Facets that were surface at the start stay as curved as they were: a body does not move where it
    is cut. Those of a crack are as flat as they lie.

    Args:
        own, x: As of :func:`bulges_of`.
        known: :class:`Bulges` of all facets but those that are ``wanted``; changed in place.
        wanted: Whether the bulge of a facet of a crack is to be found, shape (num_facets,).
    """
    # A bulge hangs on the facets around its nodes, and on those around the nodes of these.
    marked = np.zeros(len(own.nodes), bool)
    marked[own.facets[wanted]] = True
    rows = np.flatnonzero(grown_by(own.facets, marked, 2))
    row = np.full(len(own.facets) + 1, -1)  # the last one is that of no neighbour
    row[rows] = np.arange(rows.size)
    part = replace(
        own, facets=own.facets[rows], neighbour=row[own.neighbour[rows]],
        facet_area=own.facet_area[rows], mirror=own.mirror[rows],
    )  # fmt: skip
    wanted = np.flatnonzero(wanted)
    known.put(wanted, bulges_of(part, x).some(row[wanted]))
    return known


def bulges_of_the_start(own, x, origin, old):
    """The smooth surface over facets that were surface at the start, none over others. Local.

    Args:
        own, x: As of :func:`bulges_of`.
        origin: Node at the start of each own surface node, shape (num_nodes,).
        old: Whether a facet was surface then, shape (num_facets,).
    """
    names = origin[own.facets[old]]
    nodes, one, facets = np.unique(names, return_index=True, return_inverse=True)
    facets = facets.reshape(-1, 3).astype(np.int32)
    whole = replace(
        own, nodes=nodes, facets=facets, neighbour=neighbours(facets, *rings(facets, nodes.size)),
        facet_area=own.facet_area[old], mirror=own.mirror[old],
    )  # fmt: skip
    found = no_bulges(own)
    found.put(old, bulges_of(whole, x[own.facets[old].ravel()[one]]))
    return found


def bulges_of(own, x):
    """The smooth surface over own facets. Local.

    Args:
        own: :class:`~.surface.OwnSurface`.
        x: Reference positions of its nodes [m], shape (num_nodes, 3).
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    facets, num = own.facets, len(own.facets)
    if not num:
        return no_bulges(own)
    corner = x[facets]
    area_vector = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal = area_vector / np.linalg.norm(area_vector, axis=1, keepdims=True)
    to_next = np.roll(corner, -1, axis=1) - corner
    to_last = np.roll(corner, 1, axis=1) - corner
    cosine = np.einsum("fki,fki->fk", to_next, to_last)
    cosine /= np.linalg.norm(to_next, axis=2) * np.linalg.norm(to_last, axis=2)
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    # Corners of facets at a node belong together where the edge between these is not sharp.
    turn = np.einsum("fi,fki->fk", normal, normal[own.neighbour])
    facet, edge = np.nonzero((own.neighbour >= 0) & (turn >= np.cos(SHARP_EDGE)))
    other = own.neighbour[facet, edge]
    pairs = []
    for end in (edge, (edge + 1) % 3):
        node = facets[facet, end]
        across = (facets[other] == node[:, None]).argmax(axis=1)
        pairs.append((3 * facet + end, 3 * other + across))
    row, column = (np.concatenate(part) for part in zip(*pairs, strict=True))
    graph = coo_array((np.ones(row.size, bool), (row, column)), (3 * num, 3 * num))
    count, group = connected_components(graph, directed=False)
    group = group.reshape(num, 3)
    total = np.zeros((count, 3))
    np.add.at(total, group, angle[:, :, None] * normal[:, None, :])
    _mirror(own, group, total)
    node = np.empty(count, np.int64)
    node[group] = facets
    of_node = np.zeros((len(own.nodes), 3))
    np.add.at(of_node, node, total)
    of_node /= np.maximum(np.linalg.norm(of_node, axis=1, keepdims=True), NONE)
    total /= np.linalg.norm(total, axis=1, keepdims=True)
    q, bent = (_rises(normals, to_next) for normals in (total[group], of_node[facets]))
    q[np.abs(q) < NONE * np.sqrt(own.facet_area)[:, None]] = 0.0
    # Nothing stands above sharp edges, nor above others that end there.
    facet, edge = np.nonzero((own.neighbour >= 0) & (turn < np.cos(SHARP_EDGE)))
    at_sharp = np.zeros(len(own.nodes), bool)
    at_sharp[facets[facet, edge]] = at_sharp[facets[facet, (edge + 1) % 3]] = True
    corners = at_sharp[facets]
    q[corners | np.roll(corners, -1, axis=1)] = 0.0
    weight = np.bincount(group.ravel(), np.repeat(own.facet_area, 3), count)
    mean = np.bincount(group.ravel(), np.repeat(own.facet_area * q.sum(axis=1) / 12, 3), count)
    mean[at_sharp[node]] = 0.0
    curvature = [*_curvature(q, to_next, to_last), 0.5 * _curvature(bent, to_next, to_last)[1]]
    o = (mean / weight)[group]
    slope = _steepest(q, o, to_next[:, 0], -to_next[:, 2])
    return Bulges(np.hstack([q, o]), np.stack(curvature, axis=1), slope)


def _steepest(q, o, u, v):
    """Largest slope over facets with edges ``u`` and ``v`` from their first corner, (num,)."""
    uu, vv, uv = (np.einsum("fi,fi->f", *of) for of in ((u, u), (v, v), (u, v)))
    largest = np.zeros(len(q))
    for w in np.eye(3):
        by = q * np.roll(w, -1) + np.roll(q * w, 1, axis=1) - o
        b, c = by[:, 1] - by[:, 0], by[:, 2] - by[:, 0]
        square = (b * b * vv - 2 * b * c * uv + c * c * uu) / (uu * vv - uv * uv)
        np.maximum(largest, square, out=largest)
    return np.sqrt(largest)


def _rises(normals, to_next):
    """q of the edges of facets with normals at their corners, shape (num_facets, 3)."""
    return 0.5 * np.einsum("fki,fki->fk", np.roll(normals, -1, axis=1) - normals, to_next)


def _curvature(q, to_next, to_last):
    """Determinant and trace of the curvature of facets, each of shape (num_facets,)."""
    u, v = to_next[:, 0], to_last[:, 0]
    uu, vv, uv = (np.einsum("fi,fi->f", *of) for of in ((u, u), (v, v), (u, v)))
    k_uu, k_vv = 2.0 * q[:, 0], 2.0 * q[:, 2]
    k_uv = 0.5 * (k_uu + k_vv - 2.0 * q[:, 1])
    det = k_uu * k_vv - k_uv**2
    trace = k_uu * vv - 2.0 * k_uv * uv + k_vv * uu
    return det / (uu * vv - uv**2), trace / (uu * vv - uv**2)


def _mirror(own, group, total):
    """Take what is across a mirror from the normals of the corners on it, in place."""
    for wall, m in enumerate(own.mirror_normal):
        facet, edge = np.nonzero(own.mirror == wall)
        at = np.unique(np.concatenate([group[facet, edge], group[facet, (edge + 1) % 3]]))
        total[at] -= np.outer(total[at] @ m, m)


def highest(bulge):
    """Heights over facets are no larger [m], as w_a w_b + w_b w_c + w_c w_a <= 1/3, shape (n,).

    Args:
        bulge: As of :class:`Bulges`, shape (n, 6).
    """
    q, o = bulge[:, :3], bulge[:, 3:]
    return np.maximum(np.maximum(q.max(axis=1), 0.0) / 3 - o.min(axis=1), 0.0)


def height(bulge, w):
    """Height of the surface over facets [m], shape (n,).

    Args:
        bulge: As of :class:`Bulges`, shape (n, 6).
        w: Barycentric coordinates, shape (n, 3) or (3,).
    """
    w = np.broadcast_to(w, (len(bulge), 3))
    return (bulge[:, :3] * w * np.roll(w, -1, axis=1)).sum(axis=1) - (bulge[:, 3:] * w).sum(axis=1)


def against_walls(curvature, area, bend, cylinder):
    """Length m of the contact law of points with walls [m], shape (num,).

    XI h² √det with the determinant of the curvature of the gap, as in kernels/contact/pairs.h.

    Args:
        curvature: Of the surface, as of :class:`Bulges`, shape (num, 3).
        area: Of the facets [m²], shape (num,).
        bend: Curvature of the walls, positive where the sample is inside [1/m], shape (num,).
        cylinder: Whether it is that across an axis alone, shape (num,).
    """
    det, trace, _ = curvature.T
    det = det - 0.5 * trace * bend * np.where(cylinder, 1.0, 2.0)
    det += np.where(cylinder, 0.0, bend**2)
    trace = trace - bend * np.where(cylinder, 1.0, 2.0)
    convex = (det > 0.0) & (trace > 0.0)
    return XI * 4.0 / np.sqrt(3.0) * area * np.sqrt(np.where(convex, det, 0.0))


def bend_at_walls(curvature, bend, cylinder):
    """Mean curvature of the gaps of points and walls [1/m]; args as of :func:`against_walls`."""
    return curvature[:, 2] - bend * np.where(cylinder, 0.5, 1.0)
