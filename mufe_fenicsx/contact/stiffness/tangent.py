"""The derivative of the contact forces, as blocks of two nodes over all ranks."""

import numpy as np

from ...errors import InputError
from ...kernels.contact_tangent import edge_tangent, pair_tangent, wall_tangent


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
        first = mesh.V.dofmap.index_map.local_range[0]
        self._own = first + contact.own.nodes.astype(np.int64)

    def global_nodes(self):
        """Number over all ranks of each surface node, ghosts included. Collective after a search.

        Nodes are numbered as those of ``mesh.V``.
        """
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
            mark: :class:`~.rewind.ContactMark` at the start of the increment.

        Returns:
            rows and columns, local surface nodes, int32, shape (num_blocks,), and blocks [N/m],
            (num_blocks, 3, 3): minus the derivative of the forces.
        """
        c, p, w, e = (self.contact, self.contact.pairs, self.contact.walls, self.contact.edges)
        slip, edge_slip, wall_slip = mark.before("slip")
        closed, edge_closed, wall_closed = mark.before("closed")
        counts = [36 * np.count_nonzero(p.closed), 16 * np.count_nonzero(e.pairs.closed)]
        counts.append(9 * np.count_nonzero(w.pairs.closed))
        end = np.cumsum(counts)
        rows, columns = np.empty((2, end[-1]), np.int32)
        blocks = np.empty((end[-1], 3, 3))
        parts = [
            (rows[a:b], columns[a:b], blocks[a:b]) for a, b in zip(end - counts, end, strict=True)
        ]
        dent, wall_dent = mark.of_points("dent")
        g, friction, ratio = c.ghosts, c.friction.coefficients, c.layers.ratio
        x, before = g.positions.array, g.num_before
        pair_tangent(
            *parts[0], x, before, *g.corners(), p.node, p.candidate, p.closest, p.closed, closed,
            p.weights, p.normal, p.gap, p.offset, p.stiffness, p.stick_point, p.shear, p.slip, slip,
            p.normal_force, p.sliding, g.facets, c.points.area, c.points.recess, ratio,
            friction, p.friction_row, p.largest_depth, p.facing, p.height, p.bulge, p.softer,
            p.dent, np.where(p.dent > dent, p.slope_left, 1.0),
        )  # fmt: skip
        q = e.pairs
        edge_tangent(
            *parts[1], x[before:], q.first, q.second, e.edges.ends, q.closed, edge_closed, q.place,
            q.normal, q.gap, q.offset, q.recess, q.stiffness, q.stick_point, q.shear, q.slip,
            edge_slip, e.edges.area, e.edges.layer, e.edges.share, e.edges.compliance,
            e.edges.ratio, friction, q.friction_row, q.largest_depth,
        )  # fmt: skip
        v = w.pairs
        wall_tangent(
            *parts[2], before, *g.corners(), v.node, v.wall, v.closed, wall_closed,
            *w.normals_and_curvature(c.points.places(x[before:], v.node), v.wall), w.normal,
            v.shear, v.slip,
            wall_slip, v.normal_force, v.sliding, c.points.layer, c.points.area, ratio,
            w.friction_kinetic, v.offset - v.gap, v.softer,
            np.where(v.dent > wall_dent, v.slope_left, 1.0),
        )  # fmt: skip
        return rows, columns, blocks
