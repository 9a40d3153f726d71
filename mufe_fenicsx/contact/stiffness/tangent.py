"""The derivative of the contact forces, as blocks of two nodes over all ranks."""

import numpy as np

from ...errors import InputError
from ...kernels.contact.tangents import edge_tangent, pair_tangent, wall_tangent


class ContactTangent:
    """Blocks of the tangent by all closed contacts, of rows and columns on any rank.

    Args:
        contact: :class:`~mufe_fenicsx.contact.contact.Contact`.
        mesh: Its :class:`~mufe_fenicsx.mesh.GrainMesh`.

    Raises:
        InputError: The contact law has no springs.
    """

    def __init__(self, contact, mesh):
        if contact.layers.kinematic:
            raise InputError(
                'contact.law = "kinematic", expected "matched" for an implicit or static solver'
            )
        self.contact, self._searched = contact, -1
        self._own = mesh.first_node + contact.own.nodes.astype(np.int64)

    def global_nodes(self):
        """Numbers over all ranks of surface nodes, ghosts included. Collective after a search."""
        contact = self.contact
        if self._searched != contact.num_searches:
            self._searched = contact.num_searches
            self._global = self.forward(self._own[:, None].astype(np.float64))[:, 0]
            self._global = np.rint(self._global).astype(np.int64)
        return self._global

    def forward(self, values):
        """Values at own surface nodes and at ghosts, from those at own ones. Collective.

        Args:
            values: Shape (num_own, k), k <= 3.
        """
        vector = self.contact.ghosts.scratch_vector()
        vector.array[:] = 0.0
        vector.own[:, : values.shape[1]] = values
        vector.forward()
        return vector.array[self.contact.ghosts.num_before :, : values.shape[1]].copy()

    def __call__(self, mark):
        """Blocks of the last evaluation, from the state of ``mark`` on. Collective after a search.

        Args:
            mark: :class:`~mufe_fenicsx.contact.mark.ContactMark` at the start of the increment.

        Returns:
            rows and columns, local surface nodes, int32, shape (num_blocks,), and blocks [N/m],
            (num_blocks, 3, 3): minus the derivative of the forces.
        """
        c, p, w, e = self.contact, self.contact.pairs, self.contact.walls, self.contact.edges
        counts = [36 * np.count_nonzero(p.closed), 16 * np.count_nonzero(e.pairs.closed)]
        counts.append(9 * np.count_nonzero(w.pairs.closed))
        end = np.cumsum(counts)
        rows, columns = np.empty((2, end[-1]), np.int32)
        blocks = np.empty((end[-1], 3, 3))
        parts = [
            (rows[a:b], columns[a:b], blocks[a:b]) for a, b in zip(end - counts, end, strict=True)
        ]
        g, friction, points = c.ghosts, c.friction.coefficients, c.points
        x, before = g.positions.array, g.num_before
        pair_tangent(parts[0], x, before, p, mark.pairs, points, friction)
        edge_tangent(parts[1], x[before:], e.pairs, mark.edges, e.edges, friction)
        wall_tangent(parts[2], x, before, w.pairs, mark.walls, points, w)
        return rows, columns, blocks
