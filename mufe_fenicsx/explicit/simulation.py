"""Grains, contact and walls, stepped together by central differences."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from ..bulk.release import LoadWatch
from ..bulk.rigid import RigidGrains, check_rigid
from ..bulk.solid import Solid
from ..contact.bonded import Bonded
from ..contact.contact import Contact
from ..contact.laws import COMPLIANCE
from ..contact.mirrors import Mirrors
from ..contact.pairs.motion_bounds import linear_field
from ..contact.results.network import num_active_pairs
from ..contact.start.overlap import check_start, too_deep
from ..contact.stiffness.springs import list_springs
from ..contact.surface.active_nodes import near_nodes
from ..contact.walls import Wall, Walls
from ..errors import SolverError, UnstableError
from ..kernels.energy import kinetic_energy
from ..kernels.kick_drift import KickAndDrift
from ..kernels.motion import (
    accelerate_and_half_kick,
    half_kick_and_drift,
    predict,
)
from ..kernels.rigid import clear
from ..materials.elastic import IsotropicSolid
from ..mesh import GrainMesh
from ..solvers.central_difference import central_difference
from ..state import initial_state
from .mass_scaling import FALLEN, MassScaling
from .stable_step import StableStep
from .step_schedule import Refresh

#: Names of the terms of the energy balance, in the order of history.csv.
ENERGIES = (
    "kinetic", "elastic", "plastic", "friction", "switching", "contact", "damping", "work",
    "residual",
)  # fmt: skip

#: Largest damping times step. At 2 a step would leave no velocity to damp, and the kinetic energy
#: of a node that falls at its final speed, m/2 v² (1 - (damping step)²/4), would be none.
MOST_DAMPED = 1.0
#: The limit is found early where single elements ask for this part of their step then.
SHORTER = 0.98


class Simulation:
    """A set of grains between walls, on all ranks of ``mesh.comm``. Collective.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        materials: A material for each grain of this rank.
        walls: List of :class:`~mufe_fenicsx.contact.walls.Wall`.
        friction: Coefficient of friction between grains.
        friction_kinetic: Coefficient while a contact slips; ``friction`` if None.
        compliance: Constant c of the contact layer.
        points: Where contact acts, one of contact.surface.points.KINDS.
        law: Normal law of contact, one of contact.laws.law_names().
        element: One of solid.ELEMENTS: "averaged", "p1" or "composite".
        damping: Force -damping m v on every node [1/s]; steps are at most one over it.
        assembled: Time step from the assembled system (True) or from single elements.
        time_step_factor: Time step over the limit of stability.
        refresh: Steps between two evaluations of that limit, where none waits longer.
        velocity: Initial velocities [m/s], shape (num_nodes, 3); rest if None.
        mass_factor: Nodal masses times this, shape (num_nodes,), where only slow loading is
            of interest; 1 if None. Not seen by the time step of single elements.
        self_contact: Concave grains meet themselves too: nodes with facets.
        mass_scaling: Settings of mass added for a longer step (scene.MassScaling), or None.
    """

    static = False  #: whether increments leave inertia out; steps in time do not
    increments = False  #: whether a step is an increment that takes Newton's method

    def __init__(
        self,
        mesh: GrainMesh,
        materials: Sequence[IsotropicSolid],
        walls: Sequence[Wall] = (),
        *,
        friction: float = 0.0,
        friction_kinetic: float | None = None,
        compliance: float = COMPLIANCE,
        points: str = "facets",
        law: str = "matched",
        element: str = "averaged",
        damping: float = 0.0,
        assembled: bool = True,
        time_step_factor: float = 0.9,
        refresh: int = 150,
        velocity: np.ndarray | None = None,
        mass_factor: np.ndarray | None = None,
        self_contact: bool = False,
        mass_scaling: Any = None,
    ):
        self.mesh, self.comm = mesh, mesh.comm
        self.damping = float(damping)
        self.time_step_factor, self.refresh = time_step_factor, Refresh(refresh)
        self.solid = Solid(mesh, materials, element)
        self.rigid = RigidGrains(mesh, materials, self.solid.mass, mass_factor)
        self._watch = LoadWatch(self.rigid, materials)
        if mass_factor is not None:
            self.solid.mass *= mass_factor
        self.scaling = None
        if mass_scaling is not None:
            rho = np.array([m.rho for m in materials])
            self.scaling = MassScaling(self.solid, rho, mass_scaling)
        self.walls = Walls(walls)
        self.contact = Contact(
            mesh,
            mesh.x,
            self.solid.contact_modulus,
            self.solid.tangential_ratio,
            friction,
            compliance,
            self.walls,
            points,
            law,
            self.solid.mass,
            friction_kinetic,
            self_contact,
            self.rigid.layers(materials),
            self.solid.edge_compliance,
        )
        self.bonded = Bonded(
            self.comm, self.walls, self.contact.own.nodes, self.walls.bonded, mesh.x
        )
        self.mirrors = Mirrors(
            self.comm, self.walls, mesh.x, self.bonded.nodes, self.rigid.nodes,
            self.contact.kinematic,
        )  # fmt: skip
        check_rigid(self.comm, self.rigid, self.bonded.nodes, self.contact.kinematic, assembled)
        self._free_mass = self.bonded.free_mass(self.solid.mass)
        if self.contact.kinematic:
            self._predicted = mesh.x.copy()
            # Glued nodes go where their wall goes, whatever acts on them.
            self._inertia = np.where(self._free_mass > 0, self.solid.mass, np.inf)
        # Displacement, velocity and force live in PETSc-backed DOLFINx functions.
        self.u, self.v, self.force = (fem.Function(mesh.V) for _ in range(3))
        self._f = self.force.x.array.reshape(-1, 3)
        self.state = initial_state(
            mesh.x, mesh.num_cells, self.u.x.array.reshape(-1, 3), self.v.x.array.reshape(-1, 3)
        )
        if velocity is not None:
            self.state.v[:] = velocity
            self.rigid.set_velocity(self.state.v)
            self.mirrors.project(self.state.v)
        self.damped = 0.0  #: energy taken by the damping on this rank [J]
        self.initial_kinetic = 0.0
        self._inverted = -1
        # The second half of the last step's kick waits for the next step, or is to wait.
        self._kick_waits = self._may_wait = False
        self._kick_and_drift = KickAndDrift()
        self._moved = 0.0  # how far a deformable node moved in this step [m]
        # Of each grain, beside a field that fits all velocities; those of rigid ones stay unknown.
        self._moves = np.full(mesh.num_grains, np.inf)
        self.set_field(np.zeros((4, 3)))
        self.stable = StableStep(self, assembled, time_step_factor)
        self.dt = math.nan
        self.dt_element = math.nan
        self._start()

    def _start(self):
        """Forces and accelerations of the initial state; overlaps there are adopted."""
        s = self.state
        self._any_rigid = self.comm.allreduce(self.rigid.num_grains) > 0
        self._followed_search = 0
        if self._any_rigid:
            self.contact.before_search = lambda: self.rigid.place_all(s.x, s.u)
        self.contact.begin(s.x)
        self._f[:] = 0.0
        self.solid.add_internal_forces(self._f, s, 0.0)
        self.contact.add_forces(self._f, s.x, adopt=True)
        check_start(self.mesh, self.contact)
        self.bonded.take_forces(self._f, s.v, s.x)
        self.mirrors.take_forces(self._f, s.x)
        self.rigid.take_forces(self._f, s.x)
        s.a[self.rigid.soft] = (self._f / self.solid.mass[:, None])[self.rigid.soft]
        self.update_time_step()
        self.initial_kinetic = self.comm.allreduce(self._kinetic())

    # --- stepping -------------------------------------------------------------------------

    def step(self, everywhere: bool = True) -> None:
        """Advance by one stable time step. Collective.

        Args:
            everywhere: Bring all nodes up to date, by :meth:`complete`. Without, a step costs
                less; it leaves velocities at its middle, accelerations as they were, and of rigid
                grains the nodes that contact does not read where they were.
        """
        if self._watch.num_waiting:
            self._release_loaded()
        # Early where contacts may close that the last evaluation did not count.
        refresh, now = self.refresh, self.state.num_steps
        moved = self.contact.clock - refresh.clock > refresh.margin
        moved |= self.contact.overrun_of_all > 0.0 and refresh.margin < math.inf
        waited = refresh.waited(now)
        if moved or refresh.due(now):
            self.update_time_step(early=2 * waited < refresh.steps, of_elements=self.check())
        elif waited and not waited % refresh.steps:
            of_elements = self.check()
            if self.stable.of_elements(of_elements) < SHORTER * self.dt_element:
                self.update_time_step(of_elements=of_elements)
        self._may_wait = not everywhere and not self.bonded.nodes.size
        central_difference(self.state, self.dt, self._drift, self._forces, self._kick)
        if everywhere:
            self.complete()

    def complete(self) -> None:
        """Bring all nodes up to date, after steps that did not. Local."""
        self.finish_kick()
        if self.rigid.num_grains:
            self.rigid.complete(self.state.x, self.state.u, self.state.v)

    def _follow_search(self):
        """Only nodes that contact reads until its next search follow rigid grains. Collective."""
        contact, rigid = self.contact, self.rigid
        if not self._any_rigid or contact.num_searches == self._followed_search:
            return
        self._followed_search = contact.num_searches
        near = np.zeros(self.mesh.num_nodes, dtype=bool)
        near[contact.own.nodes[near_nodes(contact)]] = True
        rigid.follow(near)
        near[rigid.soft] = True
        contact.moving = np.flatnonzero(near[contact.own.nodes])

    def _release_loaded(self):
        """Let grains deform that carry more than they may as rigid ones. Local.

        Contact, places, velocities and kinetic energy stay as they are, and so does the time
        step: contact layer, lumped masses and limit are those of the deformable grain already.
        """
        which = self._watch.loaded(self._f)
        if not which.any():
            return
        s, rigid = self.state, self.rigid
        self.complete()
        s.a[rigid.nodes[np.repeat(which, np.diff(rigid.offset))]] = 0.0
        near = rigid.followed  # other nodes carry no force
        nodes = near.nodes[np.repeat(which, np.diff(near.offset))]
        s.a[nodes] = self._f[nodes] / self.solid.mass[nodes, None]
        rigid.release(which)
        self.contact.follow_all(s.x)
        self._watch.release(which)
        grains = np.arange(self.mesh.num_grains)
        self.solid.set_deforming(grains[~np.isin(grains, rigid.grains)])

    def _drift(self, dt):
        s, runs = self.state, self.rigid.runs
        if self._kick_waits:
            self._kick_waits = False
            damped, self._moved = self._kick_and_drift(
                s.x, s.u, s.v, self._f, self.solid.mass, self.mesh.x, runs, s.dt, dt, self.damping,
                self._field, self._moves,
            )  # fmt: skip
            self.damped += damped
        else:
            self._moved = half_kick_and_drift(
                s.x, s.u, s.v, s.a, self._f, self.mesh.x, runs, dt, self.damping, self._field,
                self._moves,
            )  # fmt: skip
        self.rigid.drift(s.x, s.u, dt, self.damping)

    def _forces(self, dt):
        s = self.state
        moved = max(self.walls.move(dt), self.rigid.moved, self._moved)
        self.walls.add_work()
        self.bonded.move(s.x, s.u, s.v, self.mesh.x, dt)
        positions = s.x
        if not self.contact.kinematic:
            # Glued nodes go where their wall goes.
            known = () if self.bonded.nodes.size else (self._moves, self._field, self._slope, dt)
            self.contact.begin(positions, moved, known)
        if self.rigid.num_grains:
            every = self.contact.moving is None
            clear(self._f, self.rigid.nodes if every else self.rigid.followed.nodes)
        bad = self.solid.add_internal_forces(self._f, s, dt)
        if bad >= 0:
            self._inverted = bad
        if self.contact.kinematic:
            positions = self._predicted
            predict(positions, s.x, s.v, self._f, self._inertia, dt)
            self.contact.begin(positions, moved)
        try:
            self.contact.add_forces(self._f, positions)
        except FloatingPointError:
            self.check(diverged=True)
        self._follow_search()
        self.bonded.take_forces(self._f, s.v, s.x)
        self.mirrors.take_forces(self._f, s.x)
        self.rigid.take_forces(self._f, s.x)
        self.walls.add_work()
        if self.walls.has_servo:
            self.walls.adjust(self.comm, dt)

    def _kick(self, dt):
        self._kick_waits = True
        self.damped += self.rigid.kick(dt, self.damping)
        if not self._may_wait:
            self.finish_kick()

    def finish_kick(self):
        """Velocities and accelerations of the deformable grains at the end of the step. Local."""
        if not self._kick_waits:
            return
        self._kick_waits = False
        s = self.state
        self.damped += accelerate_and_half_kick(
            s.a, s.v, self._f, self.solid.mass, self.rigid.runs, s.dt, self.damping
        )
        self.bonded.give_velocity(s.v)

    def take_over(self):
        """Go on from a state that another integrator left. Collective."""
        s = self.state
        s.a[:] = self._f / self.solid.mass[:, None]
        s.dt, self.dt = 0.0, math.nan
        self.refresh.clock = self.contact.clock
        self.update_time_step()

    def check(self, diverged=False):
        """Stop where an element fails or a value is not finite. Collective.

        Returns:
            Proven bound of the stable time step from single elements of this rank [s].

        Raises:
            UnstableError: An element turned inside out or collapsed, or the motion is not
                finite; on all ranks.
            SolverError: An element left its table of yield stresses, or a grain is too deep in
                another one; on all ranks.
        """
        finite = math.isfinite(self._kinetic()) and not diverged
        failure = None
        self.complete()
        worst = self.solid.worst_element(self.state.x)
        if finite or self._inverted >= 0:
            failure = self.solid.failure(self.state, worst, self._inverted)
        found = self.comm.allgather((failure, finite))
        failures = [failure for failure, _ in found if failure]
        if failures:
            message, unstable = failures[0]
            raise (UnstableError if unstable else SolverError)(message)
        if not all(ok for _, ok in found):
            raise UnstableError(
                f"the motion is no longer finite at step {self.state.num_steps}: reduce "
                "solver.time_step_factor or oedometer.speed"
            )
        deep = too_deep(self.mesh, self.contact)
        if deep is not None:
            raise SolverError(deep)
        return worst[0]

    # --- time step ------------------------------------------------------------------------

    def update_time_step(self, early=False, of_elements=None):
        """Set ``dt`` from the limit of stability at the present state. Collective.

        An ``early`` call, soon after the last one for contacts that may close, only shortens it.
        ``of_elements`` is what :meth:`check` found at this state, None where it was not called.
        """
        s = self.state
        self.complete()
        self.set_field(linear_field(self.comm, s.x, s.v))
        self.dt_element = self.stable.of_elements(of_elements)
        # The first step is counted too, by its speed: an assembled step is up to 3 times longer.
        speed = np.sqrt(max(np.einsum("ni,ni->n", s.v, s.v).max(), (self.walls.velocity**2).sum()))
        ahead = 6.0 * self.dt_element * self.comm.allreduce(float(speed), op=MPI.MAX)
        least = max(ahead, 1e-3 * self.contact.edge)
        self.refresh.begin(self.contact.clock, s.num_steps, early)
        limit = self._limit_ahead(least)
        if self.refresh.too_far(limit):
            limit = self._limit_ahead(least)
        self.refresh.end(limit, self.stable.slack)
        self.contact.mark()
        if self.scaling is not None and not early and limit < FALLEN * self.scaling.reached:
            if self._add_mass():
                limit = self.stable(self.refresh.margin, self.dt_element)
            self.scaling.reached = limit
        elif self.scaling is not None and not self.scaling.reached:
            self.scaling.reached = limit
        if self.damping > 0.0:
            limit = min(limit, MOST_DAMPED / self.damping)
        dt = _rounded_down(self.time_step_factor * limit)
        # A change costs accuracy of the energies: small ones are not worth it.
        if not 0.99 * self.dt <= dt <= (math.inf if early else 1.05 * self.dt):
            self.dt = dt
            self.contact.set_time_step(dt)

    def _limit_ahead(self, least):
        """Limit until the next evaluation [s], in which grains move by ``least`` [m] at least."""
        # Pairs that can close before the next evaluation count as closed.
        margin, factor = self.refresh.look_ahead(least, self.contact.known_ahead)
        self.contact.expect(margin, least, factor)
        if self.scaling is not None and not self.scaling.reached:
            # What is within an edge now, the walls above all, is held some time.
            self.scale_masses(max(margin, self.contact.edge))
        return self.stable(margin, self.dt_element)

    def set_field(self, field):
        """Measure the motion of grains beside another velocity field, as in kernels.motion."""
        self._field, self._slope = field, float(np.linalg.norm(field[1:]))

    def _add_mass(self):
        """Adjust the added mass to the present geometry; whether there is more. Collective."""
        before = self._kinetic()
        changed = self.scale_masses(self.refresh.margin)
        self.damped += before - self._kinetic()
        return changed

    def scale_masses(self, margin):
        """Add mass for elements and contacts nearer than ``margin`` [m]; whether any was added.

        Of a simulation with mass scaling. Collective.
        """
        listed = list_springs(self.contact, margin)
        bounds = listed.bounds()
        listed.destroy()
        springs = self.contact.own.nodes, bounds
        changed = self.scaling.adjust(self.state.x, springs)
        self.take_masses()
        return changed

    def take_masses(self):
        """Follow a change of the nodal masses; velocities and forces stay. Local."""
        s, mass = self.state, self.solid.mass
        self._free_mass = self.bonded.free_mass(mass)
        s.a[:] = self._f / mass[:, None]
        self.stable.set_mass(mass)

    def stable_step_within(self, margin):
        """Limit of stability [s] if all pairs within ``margin`` [m] were closed. Collective."""
        return self.stable.afresh(margin, self.dt_element)

    def limits_with_and_without_added_mass(self):
        """Stable steps of the present state [s], each estimated from scratch. Collective."""
        masses = self.solid.mass, self.scaling.first_mass
        return [self.stable.afresh(self.refresh.margin, self.dt_element, mass) for mass in masses]

    # --- numbers --------------------------------------------------------------------------

    def wall_forces(self) -> np.ndarray:
        """Normal forces of the grains on the walls [N], compression positive. Collective."""
        normal = self.walls.normal_forces()
        return self.comm.allreduce(normal) if self.comm.size > 1 else normal

    def _kinetic(self):
        self.finish_kick()
        s = self.state
        deformable = kinetic_energy(s.v, s.a, s.dt, self._free_mass, self.rigid.runs)
        return deformable + self.rigid.kinetic_energy(s.dt)

    def energies(self) -> dict[str, float]:
        """Terms of the energy balance [J], a dict with the keys of ``ENERGIES``. Collective."""
        contact, num_contacts = self.contact.energy()
        local = np.array(
            [
                self._kinetic(),
                self.solid.elastic_energy(self.state).sum(),
                self.state.plastic_work.sum(),
                self.contact.dissipated,
                self.contact.switched,
                contact,
                self.damped,
                self.walls.work,
                num_contacts,
            ]
        )
        total = self.comm.allreduce(local)
        self.num_contacts = int(total[8])
        energies = dict(zip(ENERGIES, total[:8], strict=False))
        energies["residual"] = self.initial_kinetic + total[7] - total[:7].sum()
        return energies

    def num_active_grains(self) -> int:
        """Grains with at least one closed contact. Collective."""
        active = np.zeros(self.mesh.labels.size, dtype=bool)
        p, w, points = self.contact.pairs, self.walls.pairs, self.contact.points
        active[points.grain_of_point[p.node[p.closed]]] = True
        active[p.grain[p.closed]] = True
        active[points.grain_of_point[w.node[w.closed]]] = True
        active[self.contact.edges.closed_grains()] = True
        self.comm.Allreduce(MPI.IN_PLACE, active, op=MPI.LOR)
        return int(active.sum())

    def mean_active_contacts(self) -> float:
        """Mean number of neighbours that press on a grain, walls left out. Collective."""
        return 2.0 * num_active_pairs(self.contact) / self.mesh.labels.size


def _rounded_down(value):
    """The value to 10 binary digits: the order in which ranks add up seldom changes it.

    Each iteration for the highest frequency begins from the vector of the last one: where balls
    are alike, frequencies are too, and rounding grows to 1e-5 of the limit in ten of them.
    """
    mantissa, exponent = math.frexp(value)
    return math.ldexp(math.floor(mantissa * 2**10), exponent - 10)
