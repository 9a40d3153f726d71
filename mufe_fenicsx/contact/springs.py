"""All springs of contact as one list, whose product with many vectors is wanted."""

from dataclasses import dataclass

import numpy as np

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

    def add(self, y, q):
        """Add the forces that resist displacements ``q`` to ``y``, (num_nodes, 3). Collective.

        What is on its way in contact's forces is lost.
        """
        c = self.contact
        positions, forces = c.positions.array[c.num_before :], c.forces.array[c.num_before :]
        present = positions.copy()
        gather_rows(c.positions.own, q, c.own.nodes)
        c.positions.begin_forward()
        c.positions.end_forward()
        forces[:] = 0.0
        add_springs(forces, positions, self.nodes, self.share, self.normal, self.kn, self.kt)
        c.forces.add_back()
        add_rows(y, c.own.nodes, c.forces.own)
        positions[:] = present

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


def list_springs(contact, margin):
    """Springs of what is closed and of what a motion of ``margin`` [m] can close. Local."""
    return _joined(
        contact, _of_pairs(contact, margin), _of_edges(contact, margin), _of_walls(contact, margin)
    )


def list_edge_springs(contact, margin):
    """Those of crossing edges alone. Local."""
    return _joined(contact, _of_edges(contact, margin))


def _joined(contact, *parts):
    nodes, share, normal, kn, kt = (np.concatenate(some) for some in zip(*parts, strict=True))
    return Springs(contact, nodes.astype(np.int32), share, normal, kn, kt)


def _corners(contact, points):
    """Nodes that points stand for and their weights, both of shape (num_points, 3)."""
    if contact.points.corner is None:
        return np.repeat(points[:, None], 3, axis=1), np.tile([1.0, 0.0, 0.0], (points.size, 1))
    return contact.points.corner[points], contact.points.weight[points]


def _of_pairs(contact, margin):
    pairs, points = contact.pairs, contact.points
    on = np.flatnonzero(
        (pairs.closed | (pairs.due - contact.clock < margin)) & (pairs.closest >= 0)
    )
    facet, point = pairs.candidate[pairs.closest[on]], pairs.node[on]
    vertices = contact.surface.facets[facet]
    x = contact.positions.array[contact.num_before :]
    a, b, c = (x[vertices[:, i]] for i in range(3))
    other = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    # As pairs.c shares a contact between both sides when it closes.
    part = other**2 / (other**2 + points.facet_area[point] ** 2)
    layer = contact.layer[point] + contact.surface.layer_of_facet[facet]
    kn = np.where(pairs.closed[on], pairs.stiffness[on], part * points.area[point] / layer)
    corners, weights = _corners(contact, point)
    return (
        np.concatenate([corners, vertices], axis=1),
        np.concatenate([weights, -pairs.weights[on]], axis=1),
        pairs.normal[on],
        kn,
        kn * contact.ratio[point],
    )


def _of_edges(contact, margin):
    nodes, share, normal, kn, kt = contact.edges.springs(margin, contact.clock)
    none = np.zeros((kn.size, 2))
    return (
        np.concatenate([nodes, nodes[:, :2]], axis=1),
        np.concatenate([share, none], axis=1),
        normal,
        kn,
        kt,
    )


def _of_walls(contact, margin):
    walls, points = contact.walls.pairs, contact.points
    on = np.flatnonzero(walls.closed | (walls.due - contact.clock < margin))
    point = walls.node[on]
    kn = points.area[point] / contact.layer[point]
    corners, weights = _corners(contact, point)
    return (
        np.concatenate([corners, corners], axis=1),
        np.concatenate([weights, np.zeros_like(weights)], axis=1),
        contact.walls.normal[walls.wall[on]],
        kn,
        kn * contact.ratio[point],
    )
