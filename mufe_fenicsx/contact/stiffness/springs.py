"""All springs of contact as one list, whose product with many vectors is wanted."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...kernels.build.rows import add_rows, gather_rows
from ...kernels.contact.spring_lists import list_pairs
from ...kernels.contact.springs import add_springs
from ..surface.exchange import SurfaceVector


class SpringList(NamedTuple):
    """Springs that have as many nodes each, as in kernels.contact.springs."""

    nodes: np.ndarray  #: int32, shape (n, num)
    share: np.ndarray  #: shape (n, num)
    normal: np.ndarray  #: shape (n, 3)
    kn: np.ndarray  #: along the normal [N/m], shape (n,)
    kt: np.ndarray  #: across it [N/m], shape (n,)

    @classmethod
    def empty(cls, size, num):
        """A list to be filled, of ``size`` springs with ``num`` nodes each."""
        shapes = (size, num), (size, num), (size, 3), size, size
        types = np.int32, float, float, float, float
        return cls(*(np.empty(*one) for one in zip(shapes, types, strict=True)))

    def rows(self, begin, end):
        """A part of it, to be filled."""
        return SpringList(*(values[begin:end] for values in self))


@dataclass(frozen=True)
class Springs:
    """Springs of a rank between nodes that one touches, numbered in a row, ghosts last.

    Sliding pairs count with their tangential spring: an upper bound.
    """

    at: np.ndarray  #: nodes of the mesh that a spring of any rank touches, int32, shape (num,)
    lists: tuple  #: :class:`SpringList`, whose nodes are rows of the vectors
    moves: SurfaceVector  #: displacements of a product
    forces: SurfaceVector  #: and what they cause

    def add(self, y, q):
        """Add the forces that resist displacements ``q`` to ``y``, (num_nodes, 3). Collective."""
        gather_rows(self.moves.own, q, self.at)
        self._multiply()
        add_rows(y, self.at, self.forces.own)

    def add_compact(self, y, q):
        """The same where both have the rows ``at`` alone. Collective."""
        self.moves.own[:] = q
        self._multiply()
        y += self.forces.own

    def _multiply(self):
        self.moves.forward()
        self.forces.array[:] = 0.0
        for listed in self.lists:
            add_springs(self.forces.array, self.moves.array, *listed)
        self.forces.add_back()

    def bounds(self, num_nodes):
        """Bounds of the springs at the nodes of the mesh [N/m], shape (num_nodes,). Collective.

        The sum over all springs of stiffness times the absolute values of their row (Gershgorin):
        the highest frequency of springs alone is at most the root of the largest bound over mass.
        """
        at_nodes = self.forces.array
        at_nodes[:, 0] = 0.0
        for listed in self.lists:
            part = np.abs(listed.share)
            part *= np.maximum(listed.kn, listed.kt)[:, None] * part.sum(axis=1, keepdims=True)
            at_nodes[:, 0] += np.bincount(listed.nodes.ravel(), part.ravel(), len(at_nodes))
        self.forces.add_back()
        bounds = np.zeros(num_nodes)
        bounds[self.at] = self.forces.own[:, 0]
        return bounds

    def destroy(self):
        """Free the PETSc vectors. Collective."""
        self.moves.destroy()
        self.forces.destroy()


class AllSprings:
    """Springs of contact, which it owns, and those that added terms have. As :class:`Springs`.

    Args:
        of_contact, of_terms: :class:`Springs`, and those of each term.
    """

    def __init__(self, of_contact, of_terms):
        self._of_contact, self._parts = of_contact, (of_contact, *of_terms)
        self.at = np.unique(np.concatenate([part.at for part in self._parts]))
        self._rows = [np.searchsorted(self.at, part.at).astype(np.int32) for part in self._parts]

    def add(self, y, q):
        """As of :meth:`Springs.add`. Collective."""
        for part in self._parts:
            part.add(y, q)

    def add_compact(self, y, q):
        """As of :meth:`Springs.add_compact`. Collective."""
        for part, rows in zip(self._parts, self._rows, strict=True):
            some = y[rows]
            part.add_compact(some, q[rows])
            y[rows] = some

    def bounds(self, num_nodes):
        """As of :meth:`Springs.bounds`. Collective."""
        return sum(part.bounds(num_nodes) for part in self._parts)

    def destroy(self):
        """Free the PETSc vectors of contact. Collective."""
        self._of_contact.destroy()


def all_springs(specimen, margin, expected=False):
    """Springs of contact, by :func:`list_springs`, and of added terms. Collective."""
    state = specimen.state
    of_terms = [specimen.ask(term, "springs", state, margin) for term in specimen.added_terms]
    of_terms = [of_term for of_term in of_terms if of_term is not None]
    of_contact = list_springs(specimen.contact, margin, expected)
    return AllSprings(of_contact, of_terms) if of_terms else of_contact


def list_springs(contact, margin, expected=False):
    """Springs of what is closed and of what a motion of ``margin`` [m] can close. Collective.

    What is on its way in contact's forces is lost.

    Args:
        contact: :class:`~mufe_fenicsx.contact.contact.Contact`.
        margin: The motion.
        expected: Of two grains, or a grain and a wall, no more motion than is expected
            of both.
    """
    pairs, walls = contact.pairs, contact.walls.pairs
    near = (pairs.closed | _soon(pairs, margin, expected)) & (pairs.closest >= 0)
    at_walls = walls.closed | _soon(walls, margin, expected)
    return _listed(contact, margin, np.flatnonzero(near), np.flatnonzero(at_walls))


def list_edge_springs(contact, margin):
    """Those of crossing edges alone. Collective."""
    none = np.empty(0, dtype=np.int64)
    return _listed(contact, margin, none, none)


def _soon(pairs, margin, expected):
    """Which pairs with facets, or with walls, a motion of ``margin`` can close."""
    soon = pairs.next_check - pairs.motion_bounds.now < margin
    return soon & pairs.motion_bounds.can_reach(pairs.next_check) if expected else soon


def _listed(contact, margin, pairs, walls):
    """Springs of pairs, of crossing edges and of pairs with walls. Collective."""
    contact.bind()
    edges = contact.edges.springs(margin, contact.motion.bound)
    # As large as they come to be from the start: to join parts takes as long as to fill them.
    between = SpringList.empty(pairs.size + edges[-1].size, 6)
    with_walls = SpringList.empty(walls.size, 3)
    _fill_pairs(contact, pairs, *between.rows(0, pairs.size))
    _fill_edges(edges, *between.rows(pairs.size, None))
    _fill_walls(contact, walls, *with_walls)
    return _numbered(contact, between, with_walls)


def _fill_pairs(contact, on, nodes, share, normal, kn, kt):
    pairs, points, surface = contact.pairs, contact.points, contact.surface
    nodes[:, :3], share[:, :3] = points.carriers(pairs.node[on])
    list_pairs(
        nodes, share, normal, kn, kt, on, pairs.node, pairs.candidate, pairs.closest,
        surface.facets, pairs.weights, pairs.normal, pairs.closed, pairs.stiffness,
        points.facet_area, surface.area_of_facet, points.area, contact.points.layer,
        surface.layer_of_facet, contact.layers.ratio,
    )  # fmt: skip


def _fill_edges(edges, nodes, share, normal, kn, kt):
    of_edges, shares, normal[:], kn[:], kt[:] = edges
    nodes[:, :4], nodes[:, 4:] = of_edges, of_edges[:, :2]
    share[:, :4], share[:, 4:] = shares, 0.0


def _fill_walls(contact, on, nodes, share, normal, kn, kt):
    walls, points = contact.walls.pairs, contact.points
    nodes[:], share[:] = points.carriers(walls.node[on])
    # Between searches steps place the nodes alone.
    x = contact.ghosts.positions.array[contact.ghosts.num_before :]
    places = points.places(x, walls.node[on])
    normal[:] = contact.walls.gaps(places, walls.wall[on])[1]
    kn[:] = points.area[walls.node[on]] / points.layer[walls.node[on]]
    kt[:] = kn * contact.layers.ratio[walls.node[on]]


def _numbered(contact, *lists):
    """The lists with their nodes numbered in a row. Collective."""
    own, num_own = contact.own.nodes, contact.own.nodes.size
    vector = contact.ghosts.scratch_vector()
    touched = vector.array[contact.ghosts.num_before :]
    touched[:] = 0.0
    for listed in lists:
        touched[listed.nodes.ravel(), 0] = 1.0
    ghosts = num_own + np.flatnonzero(touched[num_own:, 0])
    vector.largest_back()
    rows = np.flatnonzero(vector.own[:, 0]).astype(np.int32)
    # Their numbers over all ranks, which those learn that have them as ghosts.
    first = contact.comm.exscan(rows.size) or 0
    vector.own[rows, 0] = first + np.arange(rows.size)
    vector.forward()
    far = touched[ghosts, 0].astype(np.int64)
    place = np.empty(len(touched), np.int32)
    place[np.concatenate([rows, ghosts])] = np.arange(rows.size + ghosts.size)
    for listed in lists:
        place.take(listed.nodes, out=listed.nodes, mode="clip")
    vectors = (SurfaceVector(contact.comm, rows.size, far) for _ in range(2))
    return Springs(own[rows], lists, *vectors)
