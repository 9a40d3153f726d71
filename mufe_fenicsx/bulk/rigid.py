"""Rigid grains of one rank: six degrees of freedom each, on the mesh of all grains."""

from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from ..errors import InputError
from ..kernels import rigid as kernels
from ..materials.auto import Auto
from ..materials.rigid import Rigid
from ..state import ForceTerm
from .mass_properties import mass_properties, point_properties, quaternion_of

#: Points in contact that the step of free rigid grains allows for. With fewer the step has to
#: be cut in the middle of the first contact, which costs accuracy of the energy.
CONTACTS = 4


class _Followed(NamedTuple):
    """Surface nodes that follow at each step, and what belongs to them."""

    surface: np.ndarray  #: all surface nodes, of which they were chosen
    nodes: np.ndarray  #: shape (n,)
    offset: np.ndarray  #: first entry of each grain in ``nodes``, shape (num_grains + 1,)
    place: np.ndarray  #: in the principal axes [m], shape (n, 3)
    reach: np.ndarray  #: of the farthest node of each grain from its centre [m]


class RigidGrains(ForceTerm):
    """Motion of the rigid grains of one rank; the state's nodes follow it.

    At each step only those nodes do that contact reads, see :meth:`follow`, and only their
    positions; :meth:`complete` brings the others up to date and gives all their velocities.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        materials: A material for each grain of this rank; those that are
            :class:`~mufe_fenicsx.materials.rigid.Rigid` or
            :class:`~mufe_fenicsx.materials.auto.Auto` are taken.
        node_mass: Lumped masses of the nodes [kg], shape (num_nodes,). Grains that will
            deform later have the moments of these, so that they keep their energy then.
        mass_factor: Masses times this, at the nodes, shape (num_nodes,); 1 if None.
    """

    STATE = {
        "rigid": (
            "mass", "inertia", "centre", "turn", "axes", "radius", "velocity", "momentum", "spin",
            "force", "torque",
        ),
        "largest": ("moved",),
    }  # fmt: skip

    def __init__(self, mesh, materials, node_mass, mass_factor=None):
        self.mesh = mesh
        # Those that stay rigid come first, whatever the others do.
        chosen = [
            g for kind in (Rigid, Auto) for g, m in enumerate(materials) if isinstance(m, kind)
        ]
        self.grains = np.array(chosen, dtype=np.int64)  #: local index of each rigid grain
        n = self.grains.size
        self.any = mesh.comm.allreduce(n) > 0  #: whether any rank has rigid grains at the start
        self._node_mass = node_mass.copy() if n else node_mass
        self.num_always = sum(isinstance(m, Rigid) for m in materials)  #: that never deform
        self._list_nodes()
        free = np.ones(mesh.num_nodes, dtype=bool)
        free[self.nodes[: self.offset[self.num_always]]] = False
        #: Nodes that deform now or later.
        self.unconstrained = np.flatnonzero(free) if n else self.soft

        self.mass, self.inertia = np.empty(n), np.empty((n, 3))
        self.centre, self.turn, self.axes = np.empty((n, 3)), np.empty((n, 4)), np.empty((n, 3, 3))
        self.place = np.empty((self.nodes.size, 3))
        self.uneven = None  #: label of a grain whose mass factor varies
        self.radius = np.empty(n)  #: of the ball of equal volume [m]
        for b, g in enumerate(self.grains):
            # In an order that knows no ranks: equal moments leave the axes to rounding.
            cells = mesh.cells[mesh.named_cells[slice(*mesh.cell_offset[g : g + 2])]]
            rho = materials[g].rho
            mass, centre, inertia = mass_properties(
                mesh.x, cells, np.array([0, len(cells)]), np.array([rho])
            )
            here = slice(*self.offset[b : b + 2])
            if b >= self.num_always:
                mass, centre, inertia = point_properties(
                    mesh.x[self.nodes[here]], node_mass[self.nodes[here]]
                )
            factor = 1.0
            if mass_factor is not None:
                factor = mass_factor[self.nodes[here]]
                if np.ptp(factor) > 1e-12 * factor[0]:
                    self.uneven = int(mesh.labels[mesh.grains[g]])
                factor = factor[0]
            self.radius[b] = np.cbrt(0.75 / np.pi * mass[0] / rho)
            self.mass[b], self.centre[b] = factor * mass[0], centre[0]
            moments, axes = np.linalg.eigh(factor * inertia[0])
            axes[:, 2] *= np.linalg.det(axes)  # right-handed
            self.inertia[b], self.turn[b] = moments, quaternion_of(axes)
        kernels.set_axes(self.axes, self.turn)
        for b in range(n):
            here = slice(*self.offset[b : b + 2])
            self.place[here] = (mesh.x[self.nodes[here]] - self.centre[b]) @ self.axes[b]
        self.velocity, self.momentum, self.spin, self.force, self.torque = np.zeros((5, n, 3))
        self._energy = np.zeros(n)
        self._q = self._y = self._followed = None
        self.moved = 0.0  #: bound of the distance that a node moved in the last step [m]

    def state_dict(self):
        """Places of the nodes in their grains too, and which follow at each step."""
        kept = super().state_dict()
        if not self.any:
            return kept
        place, followed = np.zeros((self.mesh.num_nodes, 3)), np.zeros(self.mesh.num_nodes, bool)
        place[self.nodes] = self.place
        followed[self.followed.nodes if self.chosen else self.surface] = True
        kept["largest"]["chosen"] = self.chosen
        return kept | {"nodes": {"place": place, "followed": followed}}

    def load_state_dict(self, kept):
        """Become what :meth:`state_dict` told."""
        largest = dict(kept.get("largest", {}))
        chosen = largest.pop("chosen", False)
        super().load_state_dict({"rigid": kept["rigid"], "largest": largest})
        if self.any:
            self.place[:] = kept["nodes"]["place"][self.nodes]
            if chosen:
                self.follow(kept["nodes"]["followed"])

    def unpacked(self, rows):
        """Rows of :meth:`free_masses` as values at nodes and of rigid grains. Local."""
        n, free = self.num_always, self.unconstrained
        of_grains = np.zeros((self.num_grains, 2, 3))
        if not n:
            return rows, of_grains
        at_nodes = np.zeros((self.mesh.num_nodes, 3))
        at_nodes[free] = rows[: free.size]
        of_grains[:n] = rows[free.size :].reshape(n, 2, 3)
        return at_nodes, of_grains

    def packed(self, at_nodes, of_grains):
        """The reverse of :meth:`unpacked`. Local."""
        if not self.num_always:
            return at_nodes
        of_grains = of_grains[: self.num_always]
        return np.concatenate([at_nodes[self.unconstrained], of_grains.reshape(-1, 3)])

    def _list_nodes(self):
        """Nodes of the rigid grains, and of all others."""
        mesh = self.mesh
        at = [mesh.nodes[slice(*mesh.node_offset[g : g + 2])] for g in self.grains]
        self.nodes, self.offset = _rows(at)
        surface = np.zeros(mesh.num_nodes, dtype=bool)
        surface[mesh.facets] = True
        self.surface, self.surface_offset = _rows([n[surface[n]] for n in at])
        soft = np.ones(mesh.num_nodes, dtype=bool)
        soft[self.nodes] = False
        self.soft = np.flatnonzero(soft)  #: nodes of all other grains
        #: The same grain by grain, whose nodes are numbered in a row: first and end of each and its
        #: local grain, shape (num_runs, 3).
        self.runs = _runs(mesh, self.grains)

    @property
    def num_grains(self):
        """Rigid grains of this rank."""
        return self.grains.size

    def pushes(self, f):
        """Sum of the magnitudes of the nodal forces ``f`` on each grain [N], shape (num,). Local.

        Args:
            f: Contact forces, shape (num_nodes, 3).
        """
        near = self.followed
        size = np.sqrt((f[near.nodes] ** 2).sum(axis=1))
        return np.diff(np.concatenate([[0.0], np.cumsum(size)])[near.offset])

    def release(self, which):
        """Let rigid grains go; their nodes keep their places and velocities. Local.

        Args:
            which: True for those that deform from now on, shape (num_grains,).
        """
        if not which.any():
            return
        places = np.split(self.place, self.offset[1:-1])
        for name in ("grains", "mass", "inertia", "centre", "turn", "axes", "radius",
                     "velocity", "momentum", "spin", "force", "torque", "_energy"):  # fmt: skip
            setattr(self, name, np.ascontiguousarray(getattr(self, name)[~which]))
        kept = [p for p, gone in zip(places, which, strict=True) if not gone]
        self.place = np.concatenate([np.empty((0, 3)), *kept])
        self._list_nodes()

    def follow(self, near):
        """Choose the nodes that follow at each step, out of those on the surface. Local.

        Args:
            near: True for those, shape (num_nodes,).
        """
        surface = np.zeros(self.mesh.num_nodes, dtype=bool)
        surface[self.surface] = True
        chosen = near[self.surface]
        at = np.flatnonzero(surface[self.nodes])[chosen]
        offset = np.concatenate([[0], np.cumsum(chosen)])[self.surface_offset]
        distance = np.sqrt((self.place**2).sum(axis=1))
        reach = np.maximum.reduceat(distance, self.offset[:-1]) if self.num_grains else distance
        self._followed = _Followed(
            self.surface, self.surface[chosen], offset, self.place[at], reach
        )

    @property
    def chosen(self):
        """Whether :meth:`follow` was called for the grains that are rigid now."""
        return self._followed is not None and self._followed.surface is self.surface

    @property
    def followed(self):
        """What follows at each step, :class:`_Followed`; all of the surface by default."""
        if not self.chosen:
            self.follow(np.ones(self.mesh.num_nodes, dtype=bool))
        return self._followed

    def place_all(self, x, u):
        """Put all nodes where their grains are. Local."""
        kernels.place_nodes(
            x, u, self.mesh.x, self.nodes, self.offset, self.place, self.centre, self.axes
        )

    def complete(self, x, u, v):
        """Bring positions, displacements and velocities of all nodes up to date. Local."""
        self.place_all(x, u)
        kernels.node_velocities(
            v, x, self.nodes, self.offset, self.centre, self.velocity, self.spin
        )

    def layers(self, materials):
        """Compliance of the contact layer of each grain [m/Pa], nan where it deforms."""
        layer = np.full(self.mesh.num_grains, np.nan)
        for b in range(self.num_always):
            g = self.grains[b]
            layer[g] = materials[g].layer(self.radius[b])
        return layer

    def set_velocity(self, v):
        """Take momentum and angular momentum from nodal velocities ``v`` [m/s], linear in cells.

        Those of a rigid motion are found again to rounding.
        """
        for b, g in enumerate(self.grains):
            if b >= self.num_always:
                nodes = self.nodes[slice(*self.offset[b : b + 2])]
                m, r = self._node_mass[nodes], self.mesh.x[nodes] - self.centre[b]
                m = m * (self.mass[b] / m.sum())
                self.velocity[b] = m @ v[nodes] / self.mass[b]
                self.momentum[b] = m @ np.cross(r, v[nodes])
                continue
            cells = self.mesh.cells[self.mesh.cell_offset[g] : self.mesh.cell_offset[g + 1]]
            r, w = self.mesh.x[cells] - self.centre[b], v[cells]
            volume = np.linalg.det(r[:, 1:] - r[:, :1])
            part = self.mass[b] * volume / volume.sum()
            self.velocity[b] = part @ w.mean(axis=1) / self.mass[b]
            turning = np.cross(r, w).sum(axis=1) + np.cross(r.sum(axis=1), w.sum(axis=1))
            self.momentum[b] = part @ turning / 20
        self.kick(0.0, 0.0)
        kernels.node_velocities(
            v, self.mesh.x, self.nodes, self.offset, self.centre, self.velocity, self.spin
        )

    # --- stepping -------------------------------------------------------------------------

    def drift(self, x, u, dt, damping):
        """Half a kick, then the motion over a step ``dt``; chosen nodes follow. Local."""
        if not self.grains.size:
            self.moved = 0.0
            return
        near = self.followed
        self.moved = kernels.kick_and_drift(
            self.centre, self.velocity, self.momentum, self.turn, self.axes, self.force,
            self.torque, self.mass, self.inertia, near.reach, dt, damping,
        )  # fmt: skip
        kernels.place_nodes(
            x, u, self.mesh.x, near.nodes, near.offset, near.place, self.centre, self.axes
        )

    def begin_forces(self, f, state, dt):
        """No forces yet on the nodes that follow. Local."""
        if self.grains.size:
            kernels.clear(f, self.followed.nodes)

    def add_forces(self, f, state, dt):
        """Force and torque of each grain from the nodal forces ``f`` on its surface. Local."""
        if self.grains.size:
            near = self.followed
            kernels.gather_loads(
                self.force, self.torque, f, state.x, near.nodes, near.offset, self.centre
            )

    def kick(self, dt, damping):
        """Half a kick at the end of a step. Local.

        Returns:
            Energy that the damping took [J].
        """
        if not self.grains.size:
            return 0.0
        return kernels.kick(
            self.velocity, self.momentum, self.spin, self.force, self.torque, self.axes, self.mass,
            self.inertia, dt, damping,
        )  # fmt: skip

    def kinetic_energy(self, dt):
        """Kinetic energy of the rigid grains after a step of ``dt`` [J]. Local."""
        kernels.kinetic_energies(
            self._energy, self.velocity, self.momentum, self.force, self.torque, self.axes,
            self.mass, self.inertia, dt,
        )  # fmt: skip
        return float(self._energy.sum())

    # --- time step ------------------------------------------------------------------------

    def contact_step(self, points):
        """Smallest step √2/ω of a rigid grain with ``CONTACTS`` points in contact [s]. Local.

        A force k g at a distance r from the centre accelerates its own point by at most
        k g (1/m + r²/J₁), J₁ the smallest moment. A grain that flies freely, without a limit
        of its own, steps no faster: inf only where there is no rigid grain.

        Args:
            points: :class:`~mufe_fenicsx.contact.surface.points.Points`.
        """
        stiffest = np.zeros(self.mesh.num_grains)
        np.maximum.at(stiffest, points.local_grain, points.area / points.layer)
        best = np.inf
        for b, g in enumerate(self.grains[: self.num_always]):
            reach = (self.place[self.offset[b] : self.offset[b + 1]] ** 2).sum(axis=1).max()
            inverse_mass = 1 / self.mass[b] + reach / self.inertia[b, 0]
            best = min(best, np.sqrt(2 / (CONTACTS * stiffest[g] * inverse_mass)))
        return best

    def free_masses(self, mass):
        """Masses of what moves freely, and places to tell these rows apart. Local.

        Rows are the nodes that deform now or later, then force and turn (about principal axes) of
        each grain that stays rigid in turn.

        Args:
            mass: Nodal masses [kg], shape (num_nodes,).

        Returns:
            Masses and moments, shape (num_rows, 3); places [m], shape (num_rows, 3).
        """
        n, free = self.num_always, self.unconstrained
        if not n:
            return mass, self.mesh.x
        rows, places = np.empty((2, free.size + 2 * n, 3))
        rows[: free.size] = mass[free, None]
        rows[free.size :: 2], rows[free.size + 1 :: 2] = self.mass[:n, None], self.inertia[:n]
        places[: free.size] = self.mesh.x[free]
        places[free.size :: 2] = self.centre[:n]
        places[free.size + 1 :: 2] = self.centre[:n] + self.radius[:n, None]
        return rows, places

    def turned_rows(self):
        """Rows of `free_masses` about principal axes, and these axes as columns. Local.

        Returns:
            Rows, shape (n,); axes, shape (n, 3, 3).
        """
        n, free = self.num_always, self.unconstrained
        return free.size + 1 + 2 * np.arange(n), self.axes[:n]

    def constrained(self, add_stiffness, state):
        """``add(y, q)`` in the rows of `free_masses` from one at nodes: Bᵀ K B q, B rigid motions.

        Args:
            add_stiffness: ``add_stiffness(y, q)`` with y, q of shape (num_nodes, 3); may be
                collective.
            state: :class:`~mufe_fenicsx.state.State`, whose positions are the present ones.
        """
        n, free = self.num_always, self.unconstrained
        if not n:
            return add_stiffness
        if self._q is None:
            self._q, self._y = np.zeros((2, self.mesh.num_nodes, 3))
        at_nodes, at_nodes_y = self._q, self._y
        surface_offset = self.surface_offset[: n + 1]
        surface = self.surface[: surface_offset[-1]]
        force, torque = np.zeros((2, n, 3))

        def add(y, q):
            centre, axes = self.centre[:n], self.axes[:n]
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


def check_rigid(comm, rigid, bonded, kinematic):
    """What rigid grains cannot be used with, said on all ranks together. Collective.

    Args:
        comm: MPI communicator.
        rigid: :class:`RigidGrains`.
        bonded: Nodes glued to walls, shape (num_bonded,).
        kinematic: Whether the normal law of contact is the kinematic one.

    Raises:
        InputError: The kinematic law, glued nodes, or a mass factor that is not the same all
            over a rigid grain.
    """
    uneven = [label for label in comm.allgather(rigid.uneven) if label is not None]
    if uneven:
        raise InputError(
            f"mass_factor varies over the rigid grain {uneven[0]}, expected the same all over it"
        )
    glued = np.intersect1d(bonded, rigid.nodes).size
    num, glued = comm.allreduce(np.array([rigid.num_grains, glued]), op=MPI.SUM)
    if not num:
        return
    if kinematic:
        raise InputError('normal law of contact = kinematic, expected "matched" for rigid grains')
    if glued:
        raise InputError(
            f"nodes of rigid grains on bonded walls = {glued}, expected none: deformable grains"
        )


def _rows(parts):
    """Lists of nodes one after the other, int32, and where each begins."""
    offset = np.cumsum([0] + [p.size for p in parts])
    return np.concatenate([np.empty(0, np.int32), *parts]).astype(np.int32), offset


def _runs(mesh, without):
    """Ranges of nodes of all grains but those ``without``, increasing, shape (num_runs, 3)."""
    grains = np.setdiff1d(np.arange(mesh.num_grains), without)
    first = mesh.nodes[mesh.node_offset[grains]].astype(np.int64)
    runs = np.column_stack([first, first + np.diff(mesh.node_offset)[grains], grains])
    return runs[np.argsort(first)]
