"""All springs of contact as one list, whose product with many vectors is wanted."""

from dataclasses import dataclass

import numpy as np

from ..kernels.spring_lists import list_pairs, list_walls
from ..kernels.springs import add_springs
from ..kernels.walls import add_rows, gather_rows
from .exchange import SurfaceVector


@dataclass(frozen=True)
class Springs:
    """Springs of a rank between nodes that one touches, numbered in a row, ghosts last.

    Arrays as in kernels.springs. Sliding pairs count with their tangential spring: an upper bound.
    """

    rows: np.ndarray  #: own surface nodes that a spring of any rank touches, int32, shape (num,)
    at: np.ndarray  #: the same as nodes of the mesh, shape (num,)
    num_surface: int  #: own surface nodes
    nodes: np.ndarray  #: int32, shape (n, 6)
    share: np.ndarray  #: shape (n, 6)
    normal: np.ndarray  #: shape (n, 3)
    kn: np.ndarray  #: along the normal [N/m], shape (n,)
    kt: np.ndarray  #: across it [N/m], shape (n,)
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
        self.moves.begin_forward()
        self.moves.end_forward()
        self.forces.array[:] = 0.0
        q = self.moves.array
        add_springs(self.forces.array, q, self.nodes, self.share, self.normal, self.kn, self.kt)
        self.forces.add_back()

    def bounds(self):
        """Bounds of the springs at own surface nodes [N/m], shape (num_nodes,). Collective.

        The sum over all springs of stiffness times the absolute values of their row (Gershgorin):
        the highest frequency of springs alone is at most the root of the largest bound over mass.
        """
        part = np.abs(self.share)
        rows = self.kn[:, None] * part * part.sum(axis=1, keepdims=True)
        at_nodes = self.forces.array
        at_nodes[:, 0] = np.bincount(self.nodes.ravel(), rows.ravel(), len(at_nodes))
        self.forces.add_back()
        bounds = np.zeros(self.num_surface)
        bounds[self.rows] = self.forces.own[:, 0]
        return bounds

    def destroy(self):
        """Free the PETSc vectors. Collective."""
        self.moves.destroy()
        self.forces.destroy()


def list_springs(contact, margin, expected=False):
    """Springs of what is closed and of what a motion of ``margin`` [m] can close. Collective.

    What is on its way in contact's forces is lost.

    Args:
        contact: :class:`~mufe_fenicsx.contact.assemble.Contact`.
        margin: The motion.
        expected: Of two grains, or a grain and a wall, no more motion than their clock is
            expected to show.
    """
    return _joined(
        contact,
        _of_pairs(contact, _soon(contact.pairs, margin, expected)),
        _of_edges(contact, margin),
        _of_walls(contact, _soon(contact.walls.pairs, margin, expected)),
    )


def list_edge_springs(contact, margin):
    """Those of crossing edges alone. Collective."""
    return _joined(contact, _of_edges(contact, margin))


def _joined(contact, *parts):
    nodes, share, normal, kn, kt = (np.concatenate(some) for some in zip(*parts, strict=True))
    own, num_own = contact.own.nodes, contact.own.nodes.size
    touched = np.zeros((contact.num_nodes_with_ghosts, 3))
    touched[nodes.ravel(), 0] = 1.0
    ghosts = num_own + np.flatnonzero(touched[num_own:, 0])
    rows = np.flatnonzero(contact.back_to_owners(touched, largest=True)[:, 0]).astype(np.int32)
    # Their numbers over all ranks, which those learn that have them as ghosts.
    first = contact.comm.exscan(rows.size) or 0
    vector = contact.lend()
    vector.own[rows, 0] = first + np.arange(rows.size)
    vector.begin_forward()
    vector.end_forward()
    far = vector.array[contact.num_before + ghosts, 0].astype(np.int64)
    place = np.empty(len(touched), np.int32)
    place[np.concatenate([rows, ghosts])] = np.arange(rows.size + ghosts.size)
    vectors = (SurfaceVector(contact.comm, rows.size, far) for _ in range(2))
    return Springs(rows, own[rows], num_own, place[nodes], share, normal, kn, kt, *vectors)


def _rows(number):
    """An empty list of springs, as kernels.spring_lists fills it."""
    return (
        np.empty((number, 6), np.int32), np.empty((number, 6)), np.empty((number, 3)),
        np.empty(number), np.empty(number),
    )  # fmt: skip


def _corners(points):
    """Nodes that points stand for and their weights, both of shape (num_points, 3)."""
    if points.corner is not None:
        return points.corner, points.weight
    nodes = np.arange(points.num_points, dtype=np.int32)
    return np.repeat(nodes[:, None], 3, axis=1), np.tile([1.0, 0.0, 0.0], (nodes.size, 1))


def _soon(pairs, margin, expected):
    """Which pairs with facets, or with walls, a motion of ``margin`` can close."""
    soon = pairs.due - pairs.clocks.now < margin
    return soon & pairs.clocks.can_reach(pairs.due) if expected else soon


def _of_pairs(contact, soon):
    pairs, points, surface = contact.pairs, contact.points, contact.surface
    on = np.flatnonzero((pairs.closed | soon) & (pairs.closest >= 0))
    rows = _rows(on.size)
    list_pairs(
        *rows, on, pairs.node, pairs.candidate, pairs.closest, *_corners(points), surface.facets,
        contact.positions.array[contact.num_before :], pairs.weights, pairs.normal, pairs.closed,
        pairs.stiffness, points.facet_area, points.area, contact.layer, surface.layer_of_facet,
        contact.ratio,
    )  # fmt: skip
    return rows


def _of_edges(contact, margin):
    nodes, share, normal, kn, kt = contact.edges.springs(margin, contact.clock)
    none = np.zeros((kn.size, 2))
    nodes = np.concatenate([nodes, nodes[:, :2]], axis=1).astype(np.int32)
    return nodes, np.concatenate([share, none], axis=1), normal, kn, kt


def _of_walls(contact, soon):
    walls, points = contact.walls.pairs, contact.points
    on = np.flatnonzero(walls.closed | soon)
    rows = _rows(on.size)
    list_walls(
        *rows, on, walls.node, walls.wall, *_corners(points), contact.walls.normal, points.area,
        contact.layer, contact.ratio,
    )  # fmt: skip
    return rows
