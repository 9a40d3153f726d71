"""Patches of contact: the connected closed points of each two bodies, and how facets resolve them.

Two grains may touch at several places. Closed points belong to one patch where their facets share
a vertex, or where one point lies on the facet that another one's side has there. Of a patch of the
area A with facets of the mean edge h there are

    a/h = √(A/π)/h       elements per contact radius,
    4√(λ + h²/24)/h      elements across it where it is narrowest,

λ the smaller second moment of its points in its plane, over its area, and h²/24 that of a facet
itself. Across a circle there are 2a/h. Of a patch on a mirror, the part within counts.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csr_array
from scipy.sparse.csgraph import connected_components

from ...kernels.contact.patches import join_points
from ..surface.points import entries
from .edge_contacts import closed_crossings


@dataclass(frozen=True)
class Patches:
    """Patches in increasing order of ``a``, then ``b``; of two bodies the most loaded first."""

    a: np.ndarray  #: index of the grain, shape (num_patches,)
    b: np.ndarray  #: index of the other grain, or the number of grains + that of the wall
    num_points: np.ndarray  #: closed points of both sides, and crossings of edges
    area: np.ndarray  #: in the reference configuration [m²]
    area_deformed: np.ndarray  #: the same now [m²]
    edge: np.ndarray  #: mean edge h of the facets there, of both sides by area [m]
    elements_per_radius: np.ndarray  #: a/h
    moment: np.ndarray  #: second moments of their points over the area [m²], (num_patches, 3, 3)
    normal_force: np.ndarray  #: sum of its points [N]
    force_share: np.ndarray  #: of the force of all between grains, or of all with walls
    overlap: np.ndarray  #: volume within both bodies, beneath facets whose points are closed [m³]
    #: Reached in the elements of its facets [Pa], the lower one of both sides; inf: none yields.
    yield_stress: np.ndarray
    between_grains: np.ndarray  #: whether b is a grain

    @property
    def elements_across(self):
        """Elements across each patch where it is narrowest, shape (num_patches,)."""
        if not self.area.size:
            return self.area
        # The smallest moment is that across the plane of the patch.
        narrow = np.linalg.eigvalsh(np.nan_to_num(self.moment))[:, 1]
        return 4.0 * np.sqrt(np.maximum(narrow, 0.0) + self.edge**2 / 24.0) / self.edge


#: Columns of the sums over points.
_COUNT, _AREA, _DEFORMED, _FORCE, _EDGE = range(5)
_PLACE, _MOMENT = slice(5, 8), slice(8, 17)
#: Area of each side whose yield stress is known, and that area times the stress.
_KNOWN, _STRENGTH = slice(17, 19), slice(19, 21)
_OVERLAP = 21
_NUM_COLUMNS = 22


def find_patches(contact, mesh, x, strength=None):
    """The patches of all ranks at the positions of the last forces. Collective: one gather.

    Each rank joins its own points, and rank 0 what two ranks have of the same two grains.

    Args:
        contact: :class:`~mufe_fenicsx.contact.contact.Contact`.
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        x: Positions of the nodes [m], shape (num_nodes, 3).
        strength: Yield stress reached under the facets of this rank's surface [Pa], inf where
            nothing yields, shape (num_facets,); None: not known.

    Returns:
        :class:`Patches` on rank 0, None on the others.
    """
    parts = contact.comm.gather(_own_patches(contact, mesh, x, strength))
    if contact.comm.rank:
        return None
    pair, sums = _joined(parts)
    of_grains = pair[:, 0] < mesh.num_sample_grains
    return _patches(pair[of_grains], sums[of_grains], mesh.num_sample_grains)


def _own_patches(contact, mesh, x, strength):
    """This rank's patches: bodies (num, 2), sums over points, and what other ranks may join. Local.

    The last is (patch, vertex) in rows, vertices by their numbers on all ranks: where one of the
    two bodies is on another rank.
    """
    pair, vertices, sums = _terms(contact, x, strength)
    num_bodies = contact.dissipation.num_grains + len(contact.walls.names)
    bodies = pair[:, 0] * num_bodies + pair[:, 1]
    order = np.argsort(bodies, kind="stable")
    patch = join_points(bodies, order, vertices, contact.ghosts.num_nodes)
    of_patch, total = _sums_of(patch, pair, sums)
    rank = np.append(mesh.rank_of_grain, np.full(len(contact.walls.names), contact.comm.rank))
    abroad = (rank[pair] != contact.comm.rank).any(axis=1)
    point, which = np.nonzero((vertices >= 0) & abroad[:, None])
    numbers = _numbers_on_all_ranks(contact)[vertices[point, which]]
    return of_patch, total, np.column_stack([patch[point], numbers])


def _sums_of(patch, pair, sums):
    """Bodies and sums over the rows of each patch, whose number is in ``patch``."""
    num = int(patch.max(initial=-1)) + 1
    of_patch = np.zeros((num, 2), dtype=np.int64)
    of_patch[patch] = pair
    rows = csr_array((np.ones(patch.size), (patch, np.arange(patch.size))), (num, patch.size))
    return of_patch, rows @ sums


def _terms(contact, x, strength):
    """Bodies, vertices (-1: none) and terms of the sums of each closed point and crossing."""
    p, w, points = contact.pairs, contact.walls.pairs, contact.points
    num_bodies = contact.dissipation.num_grains
    on, at = np.flatnonzero(p.closed), np.flatnonzero(w.closed)
    opposite = contact.surface.facets[p.candidate[p.closest[on]]]
    corners, corners_at = (points.carriers(node)[0] for node in (p.node[on], w.node[at]))
    surface, own = contact.ghosts.positions.array[contact.ghosts.num_before :], contact.own.nodes
    over = _over_planes(x[own[corners]], surface[opposite])
    off = [contact.walls.gaps(x[own[corner]], w.wall[at])[0] for corner in corners_at.T]
    off = np.stack(off, axis=1)
    crossings = closed_crossings(contact)
    grain = points.grain_of_point
    groups = (
        (grain[p.node[on]], p.grain[on], np.hstack([corners, opposite]),
         _terms_of_points(contact, x, strength, p, on, contact.areas(on), over)),
        (grain[w.node[at]], w.wall[at] + num_bodies, corners_at,
         _terms_of_points(contact, x, strength, w, at, points.area[w.node[at]], off)),
        (crossings.grain, crossings.partner, crossings.nodes,
         _terms_of_crossings(crossings)),
    )  # fmt: skip
    vertices = np.full((sum(len(g[0]) for g in groups), 6), -1, dtype=np.int64)
    first = 0
    for _, _, some, _ in groups:
        vertices[first : first + len(some), : some.shape[1]] = some
        first += len(some)
    one, other, terms = (np.concatenate([g[k] for g in groups]) for k in (0, 1, 3))
    swap = other < one
    terms[swap, _KNOWN], terms[swap, _STRENGTH] = (
        terms[swap, some][:, ::-1] for some in (_KNOWN, _STRENGTH)
    )
    pair = np.column_stack([np.minimum(one, other), np.maximum(one, other)]).astype(np.int64)
    if points.are_nodes:
        links = _links_of_nodes(
            points, pair[: on.size + at.size], np.append(p.node[on], w.node[at])
        )
        pair, vertices = np.vstack([pair, links[0]]), np.vstack([vertices, links[1]])
        terms = np.vstack([terms, np.zeros((len(links[0]), _NUM_COLUMNS))])
    return pair, vertices, terms


def _links_of_nodes(points, pair, node):
    """Edges between closed nodes, where points are nodes: their bodies and vertices."""
    _, of_pair = np.unique(pair, axis=0, return_inverse=True)
    first, count = points.around_of[node].T.astype(np.int64)
    begin = np.cumsum(count) - count
    near = points.around[np.repeat(first - begin, count) + np.arange(count.sum())]
    here = np.repeat(of_pair.reshape(-1), count)
    closed = of_pair.reshape(-1) * np.int64(points.num_points) + node
    both = np.isin(here * np.int64(points.num_points) + near, closed)
    vertices = np.full((int(both.sum()), 6), -1, dtype=np.int64)
    vertices[:, 0], vertices[:, 1] = np.repeat(node, count)[both], near[both]
    return np.repeat(pair, count, axis=0)[both], vertices


def _over_planes(corners, facets):
    """Heights of points over the planes of facets, each (num, 3, 3) [m], shape (num, 3)."""
    a, b, c = facets.transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    return np.einsum("nki,ni->nk", corners - a[:, None], normal)


def mean_depth(gaps):
    """Mean over a triangle of what lies below zero of a linear field, shape (num,).

    Args:
        gaps: At its corners [m], shape (num, 3).
    """
    low, middle, high = np.sort(gaps, axis=1).T
    mean = np.where(high <= 0.0, -gaps.mean(axis=1), 0.0)
    # A corner below zero cuts a pyramid from the prism, and so does one above.
    one, two = (low < 0.0) & (middle >= 0.0), (middle < 0.0) & (high > 0.0)
    cut = -low * low * low, 3.0 * (middle - low) * (high - low)
    np.divide(*cut, out=mean, where=one)
    rest = high * high * high, 3.0 * (high - low) * (high - middle)
    above = np.divide(*rest, out=np.zeros_like(mean), where=two)
    return np.where(two, above - gaps.mean(axis=1), mean)


def _terms_of_points(contact, x, strength, pairs, on, area, gaps):
    """Terms of the sums for pairs ``on``, whose own side is the first; ``gaps``: at its corners."""
    own, points = contact.own, contact.points
    node = pairs.node[on]
    place = points.places(contact.ghosts.positions.own, node)
    terms = np.zeros((on.size, _NUM_COLUMNS))
    terms[:, _COUNT] = 1
    terms[:, _AREA] = area
    terms[:, _DEFORMED] = area * points.stretch(own, x, node)
    terms[:, _FORCE] = pairs.normal_force[on]
    # Sharp vertices stand on the area of the facets around.
    counts = points.are_nodes | (node < points.num_in_facets)
    terms[:, _OVERLAP] = counts * terms[:, _DEFORMED] * mean_depth(gaps)
    facet, begin, count = _facets_around(contact, node)

    def mean(values):
        return np.add.reduceat(values, begin) / count if node.size else np.zeros(0)

    terms[:, _EDGE] = area * mean(own.facet_edge[facet])
    terms[:, _PLACE] = area[:, None] * place
    terms[:, _MOMENT] = (area[:, None, None] * place[:, :, None] * place[:, None]).reshape(-1, 9)
    if strength is not None:
        terms[:, _KNOWN.start] = area
        terms[:, _STRENGTH.start] = area * mean(strength[facet])
    return terms


def _facets_around(contact, node):
    """Own facets at each point ``node``, one after another, and the first of each and how many."""
    at, begin, count = entries(contact.points.ring_offset, node)
    return contact.points.ring[at], begin, count


def _terms_of_crossings(crossings):
    """Terms of the sums for crossings; edges are as long as they are now."""
    c, place = crossings, crossings.place
    terms = np.zeros((c.normal_force.size, _NUM_COLUMNS))
    terms[:, _COUNT] = 1
    terms[:, _AREA] = terms[:, _DEFORMED] = c.area
    terms[:, _FORCE] = c.normal_force
    lengths = np.linalg.norm(c.ends[:, 1::2] - c.ends[:, ::2], axis=2)
    terms[:, _EDGE] = c.area * lengths.mean(axis=1)
    terms[:, _PLACE] = c.area[:, None] * place
    terms[:, _MOMENT] = (c.area[:, None, None] * place[:, :, None] * place[:, None]).reshape(-1, 9)
    return terms


def _numbers_on_all_ranks(contact):
    """Numbers of this rank's surface nodes and its ghosts that all ranks use, (num,). Local."""
    forces = contact.ghosts.forces
    first = 0 if forces.vector is None else forces.vector.getOwnershipRange()[0] // 3
    return np.append(first + np.arange(len(forces.own)), forces.numbers)


def _components(row, column, num_rows, num_columns):
    """Number of the connected part that each row belongs to, shape (num_rows,)."""
    size = num_rows + num_columns
    graph = coo_matrix((np.ones(row.size, np.int8), (row, num_rows + column)), shape=(size, size))
    part = connected_components(graph, directed=False)[1][:num_rows]
    return np.unique(part, return_inverse=True)[1].reshape(-1)


def _joined(parts):
    """Bodies and sums of the patches of all ranks, those of the same two bodies joined."""
    pair = np.concatenate([part[0] for part in parts])
    sums = np.concatenate([part[1] for part in parts])
    first = np.cumsum([0, *(len(part[0]) for part in parts)])
    shared = np.concatenate([part[2] + [[at, 0]] for part, at in zip(parts, first, strict=False)])
    named = np.column_stack([pair[shared[:, 0]], shared[:, 1]])
    known, column = np.unique(named, axis=0, return_inverse=True)
    patch = _components(shared[:, 0], column.reshape(-1), len(pair), len(known))
    return _sums_of(patch, pair, sums)


def _patches(pair, sums, num_grains):
    """:class:`Patches` from the sums over all of their points."""
    order = np.lexsort((-sums[:, _FORCE], pair[:, 1], pair[:, 0]))
    pair, sums = pair[order], sums[order]
    area, force = sums[:, _AREA], sums[:, _FORCE]
    edge, mean = sums[:, _EDGE] / area, sums[:, _PLACE] / area[:, None]
    moment = sums[:, _MOMENT].reshape(-1, 3, 3) / area[:, None, None]
    moment -= mean[:, :, None] * mean[:, None]
    between, share = pair[:, 1] < num_grains, np.zeros(len(area))
    for kind in (between, ~between):
        share[kind] = force[kind] / (force[kind].sum() or 1.0)
    known, strength = sums[:, _KNOWN], sums[:, _STRENGTH]
    each = np.divide(strength, known, out=np.full(known.shape, np.inf), where=known > 0)
    return Patches(
        a=pair[:, 0],
        b=pair[:, 1],
        num_points=sums[:, _COUNT].astype(np.int64),
        area=area,
        area_deformed=sums[:, _DEFORMED],
        edge=edge,
        elements_per_radius=np.sqrt(area / np.pi) / edge,
        moment=moment,
        normal_force=force,
        force_share=share,
        overlap=sums[:, _OVERLAP],
        yield_stress=each.min(axis=1),
        between_grains=between,
    )
