"""Rigid grains of one rank: six degrees of freedom each, on the mesh of all grains."""

from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from ..errors import InputError
from ..kernels.bulk import rigid as kernels
from ..materials.auto import Auto
from ..materials.rigid import Rigid, ToolSolid
from ..state import Constraint
from .mass_properties import mass_properties, point_properties, quaternion_of
from .rigid_nodes import list_nodes

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


class RigidGrains(Constraint):
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
    }  # fmt: skip

    def __init__(self, mesh, materials, node_mass, mass_factor=None):
        self.mesh = mesh
        # Those that stay rigid come first, of them those that forces move.
        kinds = _moves_freely, _is_led, lambda m: isinstance(m, Auto)
        chosen = [g for kind in kinds for g, m in enumerate(materials) if kind(m)]
        #: :class:`~mufe_fenicsx.bulk.rigid_nodes.RigidNodes`
        self.lists = list_nodes(mesh, np.array(chosen, dtype=np.int64))
        n = self.grains.size
        self.any = mesh.comm.allreduce(n) > 0  #: whether any rank has rigid grains at the start
        self._node_mass = node_mass.copy() if n else node_mass
        self.num_always = sum(isinstance(m, Rigid) for m in materials)  #: that never deform
        #: Whether velocities along and turns about x, y, z are told, shape (n, 6).
        self.told = np.zeros((n, 6), dtype=bool)
        self.mass, self.inertia = np.empty(n), np.empty((n, 3))
        self.centre, self.turn, self.axes = np.empty((n, 3)), np.empty((n, 4)), np.empty((n, 3, 3))
        self.place = np.empty((self.lists.nodes.size, 3))
        self.radius = np.empty(n)  #: of the ball of equal volume [m]
        for b, g in enumerate(self.grains):
            # In an order that knows no ranks: equal moments leave the axes to rounding.
            cells = mesh.cells[mesh.named_cells[slice(*mesh.cell_offset[g : g + 2])]]
            rho = materials[g].rho
            mass, centre, inertia = mass_properties(
                mesh.x, cells, np.array([0, len(cells)]), np.array([rho])
            )
            nodes = self.lists.of(b)
            if b >= self.num_always:
                mass, centre, inertia = point_properties(mesh.x[nodes], node_mass[nodes])
            factor = 1.0 if mass_factor is None else mass_factor[nodes[0]]
            self.radius[b] = np.cbrt(0.75 / np.pi * mass[0] / rho)
            self.mass[b], self.centre[b] = factor * mass[0], centre[0]
            if isinstance(materials[g], ToolSolid):
                self.told[b] = materials[g].told
                self.centre[b], inertia[0] = _about_point(
                    materials[g], mass[0], centre[0], inertia[0]
                )
            moments, axes = np.linalg.eigh(factor * inertia[0])
            axes[:, 2] *= np.linalg.det(axes)  # right-handed
            self.inertia[b], self.turn[b] = moments, quaternion_of(axes)
        kernels.set_axes(self.axes, self.turn)
        for b in range(n):
            x = mesh.x[self.lists.of(b)] - self.centre[b]
            self.place[slice(*self.lists.offset[b : b + 2])] = x @ self.axes[b]
        self.velocity, self.momentum, self.spin, self.force, self.torque = np.zeros((5, n, 3))
        self._followed = None

    def state_dict(self):
        """Places of the nodes in their grains too, and which follow at each step."""
        kept = super().state_dict()
        if not self.any:
            return kept
        place, followed = np.zeros((self.mesh.num_nodes, 3)), np.zeros(self.mesh.num_nodes, bool)
        place[self.lists.nodes] = self.place
        followed[self.followed.nodes if self.chosen else self.lists.surface] = True
        nodes = {"place": place, "followed": followed}
        return kept | {"largest": {"chosen": self.chosen}, "nodes": nodes}

    def load_state_dict(self, kept):
        """Become what :meth:`state_dict` told."""
        super().load_state_dict({"rigid": kept["rigid"]})
        if self.any:
            self.place[:] = kept["nodes"]["place"][self.lists.nodes]
            if kept["largest"]["chosen"]:
                self.follow(kept["nodes"]["followed"])

    @property
    def grains(self):
        """Local index of each rigid grain."""
        return self.lists.grains

    @property
    def num_grains(self):
        """Rigid grains of this rank."""
        return self.grains.size

    @property
    def num_moved(self):
        """Those that never deform and that forces move: the first ones."""
        return int(np.count_nonzero(~self.told[: self.num_always].all(axis=1)))

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
        places = np.split(self.place, self.lists.offset[1:-1])
        grains = self.grains[~which]
        for name in (*self.STATE["rigid"], "told"):
            setattr(self, name, np.ascontiguousarray(getattr(self, name)[~which]))
        kept = [p for p, gone in zip(places, which, strict=True) if not gone]
        self.place = np.concatenate([np.empty((0, 3)), *kept])
        self.lists = list_nodes(self.mesh, grains)

    def follow(self, near):
        """Choose the nodes that follow at each step, out of those on the surface. Local.

        Args:
            near: True for those, shape (num_nodes,).
        """
        lists, surface = self.lists, np.zeros(self.mesh.num_nodes, dtype=bool)
        surface[lists.surface] = True
        chosen = near[lists.surface]
        at = np.flatnonzero(surface[lists.nodes])[chosen]
        offset = np.concatenate([[0], np.cumsum(chosen)])[lists.surface_offset]
        distance = np.sqrt((self.place**2).sum(axis=1))
        reach = np.maximum.reduceat(distance, lists.offset[:-1]) if self.num_grains else distance
        nodes = lists.surface[chosen]
        self._followed = _Followed(lists.surface, nodes, offset, self.place[at], reach)

    @property
    def chosen(self):
        """Whether :meth:`follow` was called for the grains that are rigid now."""
        return self._followed is not None and self._followed.surface is self.lists.surface

    @property
    def followed(self):
        """What follows at each step, :class:`_Followed`; all of the surface by default."""
        if not self.chosen:
            self.follow(np.ones(self.mesh.num_nodes, dtype=bool))
        return self._followed

    def place_all(self, x, u):
        """Put all nodes where their grains are. Local."""
        nodes, offset = self.lists.nodes, self.lists.offset
        kernels.place_nodes(x, u, self.mesh.x, nodes, offset, self.place, self.centre, self.axes)

    def complete(self, state):
        """Bring positions, displacements and velocities of all nodes up to date. Local."""
        self.place_all(state.x, state.u)
        self._give_velocities(state.v, state.x)

    def _give_velocities(self, v, x):
        """Velocities of all nodes at the positions ``x``."""
        nodes, offset = self.lists.nodes, self.lists.offset
        kernels.node_velocities(v, x, nodes, offset, self.centre, self.velocity, self.spin)

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
                nodes = self.lists.of(b)
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
        self.kick(None, 0.0, 0.0)
        self._give_velocities(v, self.mesh.x)

    # --- stepping -------------------------------------------------------------------------

    def drift(self, state, dt, damping, moves, field):
        """Half a kick, then the motion over a step ``dt``; chosen nodes follow. Local."""
        if not self.grains.size:
            return 0.0
        near = self.followed
        moved = kernels.kick_and_drift(
            self.centre, self.velocity, self.momentum, self.turn, self.axes, self.force,
            self.torque, self.mass, self.inertia, self.told, near.reach, dt, damping,
        )  # fmt: skip
        kernels.place_nodes(
            state.x, state.u, self.mesh.x, near.nodes, near.offset, near.place, self.centre,
            self.axes,
        )  # fmt: skip
        return moved

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

    def kick(self, mass, dt, damping):
        """Half a kick at the end of a step; the energy that the damping took [J]. Local."""
        if not self.grains.size:
            return 0.0
        return kernels.kick(
            self.velocity, self.momentum, self.spin, self.force, self.torque, self.axes, self.mass,
            self.inertia, self.told, dt, damping,
        )  # fmt: skip

    def kinetic_energy(self, dt, damping=0.0):
        """Kinetic energy [J] of the rigid grains by steps of ``dt`` [s]; damping [1/s]. Local."""
        energy = np.empty(self.num_grains)
        kernels.kinetic_energies(
            energy, self.velocity, self.momentum, self.force, self.torque, self.axes,
            self.mass, self.inertia, self.told, dt, damping,
        )  # fmt: skip
        return float(energy.sum())

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
        for b, g in enumerate(self.grains[: self.num_moved]):
            if self.mesh.is_tool[g]:  # beside whose mass that of what it meets is small
                continue
            place = self.place[slice(*self.lists.offset[b : b + 2])]
            reach = (place**2).sum(axis=1).max()
            inverse_mass = 1 / self.mass[b] + reach / self.inertia[b, 0]
            best = min(best, np.sqrt(2 / (CONTACTS * stiffest[g] * inverse_mass)))
        return best


def _moves_freely(material):
    """Whether a material is that of bodies that stay rigid and that forces move."""
    led = isinstance(material, ToolSolid) and all(material.told)
    return isinstance(material, Rigid) and not led


def _is_led(material):
    """Whether it is that of a tool all of whose motion is told."""
    return isinstance(material, Rigid) and not _moves_freely(material)


def _about_point(solid, mass, centre, inertia):
    """What a tool turns about [m], and its inertia there [kg m²].

    Told turns need equal moments, for the turn by an angular momentum to be about that axis; of one
    free turn they are that about its axis.
    """
    point = centre if solid.point is None else np.asarray(solid.point, dtype=float)
    r = point - centre
    inertia = inertia + mass * (r @ r * np.eye(3) - np.outer(r, r))
    free = [i for i in range(3) if not solid.told[3 + i]]
    if len(free) < 3:
        inertia = np.eye(3) * (inertia[free[0], free[0]] if free else np.trace(inertia) / 3)
    return point, inertia


def check_rigid(comm, rigid, glued, kinematic, mass_factor):
    """What rigid grains cannot be used with, said on all ranks together. Collective.

    Args:
        comm: MPI communicator.
        rigid: :class:`RigidGrains`.
        glued: Nodes glued to walls, shape (num_glued,).
        kinematic: Whether the normal law of contact is the kinematic one.
        mass_factor: As of :class:`RigidGrains`.

    Raises:
        InputError: The kinematic law, glued nodes, or a mass factor that is not the same all
            over a rigid grain.
    """
    uneven = [label for labels in comm.allgather(_uneven(rigid, mass_factor)) for label in labels]
    if uneven:
        raise InputError(
            f"mass_factor varies over the rigid grain {uneven[0]}, expected the same all over it"
        )
    num_glued = np.intersect1d(glued, rigid.lists.nodes).size
    num, num_glued = comm.allreduce(np.array([rigid.num_grains, num_glued]), op=MPI.SUM)
    if not num:
        return
    if kinematic:
        raise InputError('normal law of contact = kinematic, expected "matched" for rigid grains')
    if num_glued:
        raise InputError(
            f"nodes of rigid grains on bonded walls = {num_glued}, expected none: deformable grains"
        )


def _uneven(rigid, mass_factor):
    """Labels of rigid grains whose mass factor varies. Local."""
    if mass_factor is None:
        return []
    factors = [mass_factor[rigid.lists.of(b)] for b in range(rigid.num_grains)]
    labels = rigid.mesh.labels[rigid.mesh.grains[rigid.grains]]
    return [
        int(label)
        for label, factor in zip(labels, factors, strict=True)
        if np.ptp(factor) > 1e-12 * factor[0]
    ]
