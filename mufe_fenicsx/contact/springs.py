"""All springs of contact as one list, whose product with many vectors is wanted."""

from dataclasses import dataclass

import numpy as np

from ..kernels.spring_lists import list_pairs, list_walls
from ..kernels.springs import add_springs
from ..kernels.walls import add_rows, gather_rows


@dataclass(frozen=True)
class Springs:
    """Springs of a rank at its surface nodes, ghosts included. Arrays as in kernels.springs.

    Sliding pairs count with their tangential spring: an upper bound.
    """

    contact: object  #: :class:`~mufe_fenicsx.contact.assemble.Contact`
    nodes: np.ndarray  #: int32, shape (n, 6)
    share: np.ndarray  #: shape (n, 6)
    normal: np.ndarray  #: shape (n, 3)
    kn: np.ndarray  #: along the normal [N/m], shape (n,)
    kt: np.ndarray  #: across it [N/m], shape (n,)
    present: np.ndarray  #: scratch: positions of contact that a product puts aside

    def add(self, y, q):
        """Add the forces that resist displacements ``q`` to ``y``, (num_nodes, 3). Collective.

        What is on its way in contact's forces is lost.
        """
        c = self.contact
        vector = c.lend()
        positions, forces = c.positions.array[c.num_before :], vector.array[c.num_before :]
        np.copyto(self.present, positions)
        gather_rows(c.positions.own, q, c.own.nodes)
        c.positions.begin_forward()
        c.positions.end_forward()
        forces[:] = 0.0
        add_springs(forces, positions, self.nodes, self.share, self.normal, self.kn, self.kt)
        vector.add_back()
        add_rows(y, c.own.nodes, vector.own)
        positions[:] = self.present

    def bounds(self):
        """Bounds of the springs at own surface nodes [N/m], shape (num_nodes,). Collective.

        The sum over all springs of stiffness times the absolute values of their row (Gershgorin):
        the highest frequency of springs alone is at most the root of the largest bound over mass.
        What is on its way in contact's forces is lost.
        """
        part = np.abs(self.share)
        rows = self.kn[:, None] * part * part.sum(axis=1, keepdims=True)
        number = self.contact.num_nodes_with_ghosts
        at_nodes = np.zeros((number, 3))
        at_nodes[:, 0] = np.bincount(self.nodes.ravel(), rows.ravel(), number)
        return self.contact.back_to_owners(at_nodes)[:, 0]


def list_springs(contact, margin, expected=False):
    """Springs of what is closed and of what a motion of ``margin`` [m] can close. Local.

    Args:
        contact: :class:`~mufe_fenicsx.contact.assemble.Contact`.
        margin: The motion.
        expected: Of two grains no more motion than their clock is expected to show.
    """
    pairs = contact.pairs
    soon = pairs.due - pairs.clocks.now < margin
    if expected:
        soon &= pairs.clocks.can_reach(pairs.due)
    return _joined(
        contact, _of_pairs(contact, soon), _of_edges(contact, margin), _of_walls(contact, margin)
    )


def list_edge_springs(contact, margin):
    """Those of crossing edges alone. Local."""
    return _joined(contact, _of_edges(contact, margin))


def _joined(contact, *parts):
    nodes, share, normal, kn, kt = (np.concatenate(some) for some in zip(*parts, strict=True))
    present = np.empty_like(contact.positions.array[contact.num_before :])
    return Springs(contact, nodes, share, normal, kn, kt, present)


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


def _of_walls(contact, margin):
    walls, points = contact.walls.pairs, contact.points
    on = np.flatnonzero(walls.closed | (walls.due - contact.clock < margin))
    rows = _rows(on.size)
    list_walls(
        *rows, on, walls.node, walls.wall, *_corners(points), contact.walls.normal, points.area,
        contact.layer, contact.ratio,
    )  # fmt: skip
    return rows
