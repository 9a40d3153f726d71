"""What moves freely beside rigid grains, as the rows of a vector: nodes, and motions of grains."""

import numpy as np

from ..kernels.bulk import rigid as kernels


class FreeRows:
    """Rows of vectors for the highest frequency, of one rank. Collective when made.

    Rows are the nodes that deform now or later, then force and turn (about principal axes) of
    each grain in turn that stays rigid and that forces move.

    Args:
        rigid: :class:`~mufe_fenicsx.bulk.rigid.RigidGrains`.

    Attributes:
        are_nodes: Whether rows are the nodes, on all ranks.
    """

    def __init__(self, rigid):
        self.rigid, self.mesh = rigid, rigid.mesh
        free = np.ones(self.mesh.num_nodes, dtype=bool)
        free[rigid.lists.nodes[: rigid.lists.offset[rigid.num_always]]] = False
        self._free = np.flatnonzero(free)  # nodes that deform now or later
        self._q = self._y = None  # room for products with the stiffness
        self.are_nodes = not self.mesh.comm.allreduce(rigid.num_always)

    def masses(self, mass):
        """Masses of what moves freely, and places to tell these rows apart. Local.

        Args:
            mass: Nodal masses [kg], shape (num_nodes,).

        Returns:
            Masses and moments, shape (num_rows, 3); places [m], shape (num_rows, 3).
        """
        rigid, n, free = self.rigid, self.rigid.num_moved, self._free
        if not self.rigid.num_always:
            return mass, self.mesh.x
        rows, places = np.empty((2, free.size + 2 * n, 3))
        rows[: free.size] = mass[free, None]
        rows[free.size :: 2], rows[free.size + 1 :: 2] = rigid.mass[:n, None], rigid.inertia[:n]
        places[: free.size] = self.mesh.x[free]
        places[free.size :: 2] = rigid.centre[:n]
        places[free.size + 1 :: 2] = rigid.centre[:n] + rigid.radius[:n, None]
        return rows, places

    def turned(self):
        """Rows about principal axes, and these axes as columns. Local.

        Returns:
            Rows, shape (n,); axes, shape (n, 3, 3).
        """
        n = self.rigid.num_moved
        return self._free.size + 1 + 2 * np.arange(n), self.rigid.axes[:n]

    def constrained(self, add_stiffness, state):
        """``add(y, q)`` in these rows from one at nodes: Bᵀ K B q, B rigid motions.

        Args:
            add_stiffness: ``add_stiffness(y, q)`` with y, q of shape (num_nodes, 3); may be
                collective.
            state: :class:`~mufe_fenicsx.state.State`, whose positions are the present ones.
        """
        rigid, n, free = self.rigid, self.rigid.num_moved, self._free
        if not self.rigid.num_always:
            return add_stiffness
        if self._q is None:
            self._q, self._y = np.zeros((2, self.mesh.num_nodes, 3))
        at_nodes, at_nodes_y = self._q, self._y
        surface_offset = rigid.lists.surface_offset[: n + 1]
        surface = rigid.lists.surface[: surface_offset[-1]]
        force, torque = np.zeros((2, n, 3))

        def add(y, q):
            centre, axes = rigid.centre[:n], rigid.axes[:n]
            at_nodes[free] = q[: free.size]
            kernels.expand_motion(
                at_nodes, q[free.size :], state.x, surface, surface_offset, centre, axes
            )
            at_nodes_y[:] = 0.0
            add_stiffness(at_nodes_y, at_nodes)
            y[: free.size] += at_nodes_y[free]
            kernels.gather_loads(
                force, torque, at_nodes_y, state.x, surface, surface_offset, centre
            )
            y[free.size :: 2] += force
            kernels.reduce_loads(y[free.size :], torque, axes)

        return add

    def unpacked(self, rows):
        """Values of rows at nodes and of rigid grains. Local."""
        n, free = self.rigid.num_moved, self._free
        of_grains = np.zeros((self.rigid.num_grains, 2, 3))
        if not self.rigid.num_always:
            return rows, of_grains
        at_nodes = np.zeros((self.mesh.num_nodes, 3))
        at_nodes[free] = rows[: free.size]
        of_grains[:n] = rows[free.size :].reshape(n, 2, 3)
        return at_nodes, of_grains

    def packed(self, at_nodes, of_grains):
        """The reverse of :meth:`unpacked`. Local."""
        n = self.rigid.num_moved
        if not self.rigid.num_always:
            return at_nodes
        return np.concatenate([at_nodes[self._free], of_grains[:n].reshape(-1, 3)])
