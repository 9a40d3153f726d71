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

from ...kernels.contact.patches import (
    AREA,
    COUNT,
    DEFORMED,
    EDGE,
    FORCE,
    KNOWN,
    MOMENT,
    NUM_COLUMNS,
    OVERLAP,
    PLACE,
    STRENGTH,
    heights_over_facets,
    join_points,
    terms_of_points,
)
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
    #: Of the force of all between grains, of all with walls, or of all between pieces of grains.
    force_share: np.ndarray
    overlap: np.ndarray  #: volume within both bodies, beneath facets whose points are closed [m³]
    #: Reached in the elements of its facets [Pa], the lower one of both sides; inf: none yields.
    yield_stress: np.ndarray
    between_grains: np.ndarray  #: whether b is another grain

    @property
    def with_walls(self):
        """Whether b is a wall, shape (num_patches,); the rest is between pieces of one grain."""
        return ~self.between_grains & (self.a != self.b)

    @property
    def elements_across(self):
        """Elements across each patch where it is narrowest, shape (num_patches,)."""
        if not self.area.size:
            return self.area
        # The smallest moment is that across the plane of the patch.
        narrow = np.linalg.eigvalsh(np.nan_to_num(self.moment))[:, 1]
        return 4.0 * np.sqrt(np.maximum(narrow, 0.0) + self.edge**2 / 24.0) / self.edge


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
    abroad = np.flatnonzero((rank[of_patch] != contact.comm.rank).any(axis=1)[patch])
    point, which = np.nonzero(vertices[abroad] >= 0)
    point = abroad[point]
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
    corners, corners_at = points.corner[p.node[on]], points.corner[w.node[at]]
    surface, x = contact.ghosts.positions.array[contact.ghosts.num_before :], x[contact.own.nodes]
    over = np.empty((on.size, 3))
    heights_over_facets(over, x, corners, surface, opposite)
    off = [contact.walls.gaps(x[corner], w.wall[at])[0] for corner in corners_at.T]
    off = np.stack(off, axis=1)
    crossings = closed_crossings(contact)
    grain = points.grain_of_point
    groups = (
        (grain[p.node[on]], p.grain[on], np.hstack([corners, opposite]),
         _terms_of_points(contact, x, strength, p, on, contact.areas(on), over, p.grain[on])),
        (grain[w.node[at]], w.wall[at] + num_bodies, corners_at,
         _terms_of_points(
             contact, x, strength, w, at, points.area[w.node[at]], off, w.wall[at] + num_bodies)),
        (crossings.grain, crossings.partner, crossings.nodes,
         _terms_of_crossings(crossings)),
    )  # fmt: skip
    vertices = np.full((sum(len(g[0]) for g in groups), 6), -1, dtype=np.int64)
    first = 0
    for _, _, some, _ in groups:
        vertices[first : first + len(some), : some.shape[1]] = some
        first += len(some)
    one, other, terms = (np.concatenate([g[k] for g in groups]) for k in (0, 1, 3))
    pair = np.column_stack([np.minimum(one, other), np.maximum(one, other)]).astype(np.int64)
    if points.are_nodes:
        links = _links_of_nodes(
            points, pair[: on.size + at.size], np.append(p.node[on], w.node[at])
        )
        pair, vertices = np.vstack([pair, links[0]]), np.vstack([vertices, links[1]])
        terms = np.vstack([terms, np.zeros((len(links[0]), NUM_COLUMNS))])
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


def _terms_of_points(contact, x, strength, pairs, on, area, gap, opposite):
    """Terms of the sums for pairs ``on``.

    Args:
        contact, strength: As above.
        x: Positions of own surface nodes [m], shape (num_nodes, 3).
        pairs, on: Table of pairs, and those of it that are closed.
        area: That they carry in the reference configuration [m²], shape (num,).
        gap: At the corners of their facets [m], shape (num, 3).
        opposite: The other body of each, shape (num,).
    """
    own, points = contact.own, contact.points
    node = pairs.node[on]
    at, begin, _ = entries(points.ring_offset, node)
    # Sharp vertices stand on the area of the facets around.
    counts = points.are_nodes | (node < points.num_in_facets)
    terms = np.zeros((on.size, NUM_COLUMNS))
    known = np.full(len(own.facets), np.nan) if strength is None else strength
    terms_of_points(
        terms, points.grain_of_point[node] > opposite, counts, area, pairs.normal_force[on], gap,
        *points.carriers(node), x, points.ring[at], np.append(begin, at.size),
        own.facets, np.column_stack([own.facet_area, own.facet_edge, known]),
    )  # fmt: skip
    return terms


def _terms_of_crossings(crossings):
    """Terms of the sums for crossings; edges are as long as they are now."""
    c, place = crossings, crossings.place
    terms = np.zeros((c.normal_force.size, NUM_COLUMNS))
    terms[:, COUNT] = 1
    terms[:, AREA] = terms[:, DEFORMED] = c.area
    terms[:, FORCE] = c.normal_force
    lengths = np.linalg.norm(c.ends[:, 1::2] - c.ends[:, ::2], axis=2)
    terms[:, EDGE] = c.area * lengths.mean(axis=1)
    terms[:, PLACE:MOMENT] = c.area[:, None] * place
    moment = c.area[:, None, None] * place[:, :, None] * place[:, None]
    terms[:, MOMENT:KNOWN] = moment.reshape(-1, 9)
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
    order = np.lexsort((-sums[:, FORCE], pair[:, 1], pair[:, 0]))
    pair, sums = pair[order], sums[order]
    area, force = sums[:, AREA], sums[:, FORCE]
    edge, mean = sums[:, EDGE] / area, sums[:, PLACE:MOMENT] / area[:, None]
    moment = sums[:, MOMENT:KNOWN].reshape(-1, 3, 3) / area[:, None, None]
    moment -= mean[:, :, None] * mean[:, None]
    within, share = pair[:, 1] == pair[:, 0], np.zeros(len(area))
    between = (pair[:, 1] < num_grains) & ~within
    for kind in (between, within, ~between & ~within):
        share[kind] = force[kind] / (force[kind].sum() or 1.0)
    known, strength = sums[:, KNOWN:STRENGTH], sums[:, STRENGTH:OVERLAP]
    each = np.divide(strength, known, out=np.full(known.shape, np.inf), where=known > 0)
    return Patches(
        a=pair[:, 0],
        b=pair[:, 1],
        num_points=sums[:, COUNT].astype(np.int64),
        area=area,
        area_deformed=sums[:, DEFORMED],
        edge=edge,
        elements_per_radius=np.sqrt(area / np.pi) / edge,
        moment=moment,
        normal_force=force,
        force_share=share,
        overlap=sums[:, OVERLAP],
        yield_stress=each.min(axis=1),
        between_grains=between,
    )
