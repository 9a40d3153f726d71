"""Grains, contact and walls, stepped together by central differences."""

import math

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from .contact.assemble import Contact
from .contact.bonded import Bonded
from .contact.depth import check_start, too_deep
from .contact.laws import COMPLIANCE
from .contact.mirrors import Mirrors
from .contact.near import near_nodes
from .contact.network import num_active_pairs
from .contact.springs import list_edge_springs, list_springs
from .contact.walls import Walls
from .errors import SolverError, UnstableError
from .fidelity import LoadWatch
from .integrators.explicit import central_difference
from .kernels.energy import kinetic_energy
from .kernels.motion import accelerate_and_half_kick, half_kick_and_drift, predict
from .kernels.rigid import clear
from .mass_scaling import FALLEN, MassScaling
from .rigid import RigidGrains, check_rigid
from .solid import Solid
from .state import initial_state
from .time_step import HighestFrequency

#: Names of the terms of the energy balance, in the order of history.csv.
ENERGIES = ("kinetic", "elastic", "plastic", "friction", "contact", "damping", "work", "residual")

#: How much faster than so far grains may move before the time step is evaluated early.
FASTER = 1.25
#: The tets are looked at again when the bound of single ones falls by this, or after so many
#: evaluations: their frequency changes with their shapes alone.
WORSE, RARELY = 0.97, 10


class Simulation:
    """A set of grains between walls, on all ranks of ``mesh.comm``. Collective.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        materials: A material for each grain of this rank.
        walls: List of :class:`~mufe_fenicsx.contact.walls.Wall`.
        friction: Coefficient of friction between grains.
        friction_kinetic: Coefficient while a contact slips; ``friction`` if None.
        compliance: Constant c of the contact layer.
        points: Where contact acts, one of contact.points.KINDS.
        law: Normal law of contact, one of contact.laws.law_names().
        element: One of solid.ELEMENTS: "averaged", "p1" or "composite".
        damping: Force -damping m v on every node [1/s].
        assembled: Time step from the assembled system (True) or from single elements.
        time_step_factor: Time step over the limit of stability.
        refresh: Steps between two evaluations of that limit.
        velocity: Initial velocities [m/s], shape (num_nodes, 3); rest if None.
        mass_factor: Nodal masses times this, shape (num_nodes,), where only slow loading is
            of interest; 1 if None. Not seen by the time step of single elements.
        self_contact: Concave grains meet themselves too: nodes with facets.
        mass_scaling: Settings of mass added for a longer step (scene.MassScaling), or None.
    """

    static = False  #: whether increments leave inertia out; steps in time do not

    def __init__(
        self,
        mesh,
        materials,
        walls=(),
        *,
        friction=0.0,
        friction_kinetic=None,
        compliance=COMPLIANCE,
        points="facets",
        law="matched",
        element="averaged",
        damping=0.0,
        assembled=True,
        time_step_factor=0.9,
        refresh=150,
        velocity=None,
        mass_factor=None,
        self_contact=False,
        mass_scaling=None,
    ):
        self.mesh, self.comm = mesh, mesh.comm
        self.damping, self.assembled = float(damping), assembled
        self.time_step_factor, self.refresh = time_step_factor, refresh
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
        )
        self.bonded = Bonded(
            self.comm, self.walls, self.contact.own.nodes, self.walls.bonded, mesh.x
        )
        self.mirrors = Mirrors(
            self.comm, self.walls, mesh.x, self.bonded.nodes, self.rigid.nodes,
            self.contact.kinematic,
        )  # fmt: skip
        check_rigid(
            self.comm, self.rigid, self.bonded.nodes, self.contact.kinematic, self.assembled
        )
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
        rows, turned = self.rigid.free_masses(self.solid.mass), self.rigid.turned_rows()
        self._highest, self._highest_of_springs, self._highest_of_tets = (
            HighestFrequency(
                self.comm, *rows, self.rigid.constrained(add, self.state), turned=turned
            )
            for add in (self._add_stiffness, self._add_springs, self._add_tets)
        )
        self._rate_of_tets, self._tets_at, self._element_step_then = math.nan, 0, math.nan
        self._contact_step = self.rigid.contact_step(self.contact.points)
        self._margin = 0.0
        self._clock_at_refresh, self._refreshed_at = 0.0, 0
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

    def step(self, everywhere=True):
        """Advance by one stable time step. Collective.

        Args:
            everywhere: Bring all nodes of rigid grains up to date, by :meth:`complete`. Without,
                a step costs less and leaves the state of those that contact does not read
                as it was, and all their velocities.
        """
        if self._watch.num_waiting:
            self._release_loaded()
        # Early where contacts may close that the last evaluation did not count.
        moved = self.contact.clock - self._clock_at_refresh > self._margin
        waited = self.state.num_steps - self._refreshed_at
        if moved or waited >= self.refresh:
            self.check()
            self.update_time_step(early=2 * waited < self.refresh)
        central_difference(self.state, self.dt, self._drift, self._forces, self._kick)
        if everywhere:
            self.complete()

    def complete(self):
        """Positions and velocities of all nodes of rigid grains, after steps without. Local."""
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
        s = self.state
        half_kick_and_drift(s.x, s.u, s.v, s.a, self.mesh.x, self.rigid.runs, dt, self.damping)
        self.rigid.drift(s.x, s.u, dt, self.damping)

    def _forces(self, dt):
        s = self.state
        wall_move = max(self.walls.move(dt), self.rigid.moved)
        self.walls.add_work()
        self.bonded.move(s.x, s.u, s.v, self.mesh.x, dt)
        positions = s.x
        if not self.contact.kinematic:
            self.contact.begin(positions, wall_move)
        if self.contact.moving is None:
            self._f[:] = 0.0
        else:
            clear(self._f, self.rigid.runs, self.rigid.followed.nodes)
        bad = self.solid.add_internal_forces(self._f, s, dt)
        if bad >= 0:
            self._inverted = bad
        if self.contact.kinematic:
            positions = self._predicted
            predict(positions, s.x, s.v, self._f, self._inertia, dt)
            self.contact.begin(positions, wall_move)
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
            self.walls.adjust(self.wall_forces())

    def _kick(self, dt):
        s = self.state
        self.damped += accelerate_and_half_kick(
            s.a, s.v, self._f, self.solid.mass, self.rigid.runs, dt, self.damping
        )
        self.damped += self.rigid.kick(dt, self.damping)
        self.bonded.give_velocity(s.v)

    def take_over(self):
        """Go on from a state that another integrator left. Collective."""
        s = self.state
        s.a[:] = self._f / self.solid.mass[:, None]
        s.dt, self.dt = 0.0, math.nan
        self._clock_at_refresh = self.contact.clock
        self.update_time_step()

    def check(self, diverged=False):
        """Stop where an element fails or a value is not finite. Collective.

        Raises:
            UnstableError: An element turned inside out or collapsed, or the motion is not
                finite; on all ranks.
            SolverError: An element left its table of yield stresses, or a grain is too deep in
                another one; on all ranks.
        """
        finite = math.isfinite(self._kinetic()) and not diverged
        failure = None
        if finite or self._inverted >= 0:
            failure = self.solid.failure(self.state, self._inverted)
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

    # --- time step ------------------------------------------------------------------------

    def _add_stiffness(self, y, q):
        self._add_tets(y, q)
        self._add_springs(y, q)

    def _add_tets(self, y, q):
        self.solid.add_stiffness(y, q, self.state.x)

    def _add_springs(self, y, q):
        if not self.contact.kinematic:
            self._springs.add(y, q)

    def update_time_step(self, early=False):
        """Set ``dt`` from the limit of stability at the present state. Collective.

        An ``early`` call, soon after the last one for contacts that may close, only shortens it.
        """
        s = self.state
        self.complete()
        # What does not deform has a limit by contact alone, and is never faster than one.
        own = min(self.solid.element_time_step(s.x), self._contact_step)
        self.dt_element = self.comm.allreduce(own, op=MPI.MIN)
        # Pairs that can close before the next evaluation count as closed.
        moved = self.contact.clock - self._clock_at_refresh
        moved *= self.refresh / max(s.num_steps - self._refreshed_at, 1)
        self._clock_at_refresh, self._refreshed_at = self.contact.clock, s.num_steps
        # The first step is counted too, by its speed: an assembled step is up to 3 times longer.
        speed = np.sqrt(max((s.v**2).sum(axis=1).max(), (self.walls.velocity**2).sum()))
        ahead = 6.0 * self.dt_element * self.comm.allreduce(float(speed), op=MPI.MAX)
        moved = min(FASTER * moved, self.contact.skin)
        self._margin = max(moved, ahead, 1e-3 * self.contact.edge)
        if self.scaling is not None and not self.scaling.reached:
            # What is within an edge now, the walls above all, is held some time.
            self._scale_masses(max(self._margin, self.contact.edge))
        limit = self._present_limit()
        if self.scaling is not None and not early and limit < FALLEN * self.scaling.reached:
            if self._add_mass():
                limit = self._present_limit()
            self.scaling.reached = limit
        elif self.scaling is not None and not self.scaling.reached:
            self.scaling.reached = limit
        dt = _rounded_down(self.time_step_factor * limit)
        # A change costs accuracy of the energies: small ones are not worth it.
        if not 0.99 * self.dt <= dt <= (math.inf if early else 1.05 * self.dt):
            self.dt = dt
            self.contact.set_time_step(dt)

    def _present_limit(self):
        """Limit of stability [s] at the present state. Collective."""
        return self._limit(self._highest, self._highest_of_springs, self._tets)

    def _limit(self, highest, highest_of_springs, rate_of_tets):
        """Limit of stability [s] by the highest frequencies of all, springs, tets. Collective."""
        self._springs = list_springs(self.contact, self._margin)
        # A node that meets a spring of rate w at speed v leaves it one step later at up to
        # |1 - (w dt)^2| v: contacts that open and close need (w dt)^2 <= 2 of the springs alone.
        springs = 0.0 if self.contact.kinematic else highest_of_springs()
        limit = self.comm.allreduce(self._contact_step, op=MPI.MIN)
        if springs > 0.0:
            limit = min(limit, math.sqrt(2.0) / springs)
        if not self.assembled:
            stiffest = self.comm.allreduce(self._stiffest_contact(), op=MPI.MAX)
            return min(limit, 2.0 / math.sqrt((2.0 / self.dt_element) ** 2 + 2.0 * stiffest))
        # The squares of springs and tets add up at most (Weyl). Where contacts that open and close
        # ask for a step well within that bound, the costly products with both are not needed.
        if springs > 0.0:
            proven = 2.0 / math.hypot(springs, rate_of_tets())
            if 0.5 * (1.0 + self.time_step_factor) * limit <= proven:
                return limit
        rate = highest()
        return min(limit, 2.0 / rate) if rate > 0.0 else limit

    def _tets(self):
        """Highest frequency of the tetrahedra [rad/s], from not long ago. Collective."""
        waited = self.state.num_steps - self._tets_at
        worse = not self.dt_element >= WORSE * self._element_step_then
        if worse or waited >= RARELY * self.refresh:
            self._rate_of_tets = self._highest_of_tets()
            self._tets_at, self._element_step_then = self.state.num_steps, self.dt_element
        return self._rate_of_tets

    def _add_mass(self):
        """Adjust the added mass to the present geometry; whether there is more. Collective."""
        before = self._kinetic()
        changed = self._scale_masses(self._margin)
        self.damped += before - self._kinetic()
        return changed

    def _scale_masses(self, margin):
        """Masses for elements and contacts nearer than ``margin`` [m]; whether there is more."""
        bounds = list_springs(self.contact, margin).bounds()
        springs = self.contact.own.nodes, bounds
        changed = self.scaling.adjust(self.state.x, springs)
        self.take_masses()
        return changed

    def take_masses(self):
        """Follow a change of the nodal masses; velocities and forces stay. Local."""
        s, mass = self.state, self.solid.mass
        self._free_mass = self.bonded.free_mass(mass)
        s.a[:] = self._f / mass[:, None]
        for highest in (self._highest, self._highest_of_springs, self._highest_of_tets):
            highest.set_mass(mass)
        self._element_step_then = math.inf  # their highest frequency is to be found again

    def stable_step_within(self, margin):
        """Limit of stability [s] if all pairs within ``margin`` [m] were closed. Collective."""
        before, self._margin = self._margin, margin
        adds = self._add_stiffness, self._add_springs, self._add_tets
        rows = self.rigid.free_masses(self.solid.mass)
        turned = self.rigid.turned_rows()
        limit = self._limit(
            *(
                HighestFrequency(
                    self.comm, *rows, self.rigid.constrained(add, self.state), turned=turned
                )
                for add in adds
            )
        )
        self._margin = before
        return limit

    def stable_step_of_tets(self):
        """Limit of stability [s] of the tetrahedra without contact; inf for rigid grains."""
        rate = HighestFrequency(self.comm, self.solid.mass, self.mesh.x, self._add_tets)()
        return 2.0 / rate if rate > 0.0 else math.inf

    def limits_with_and_without_added_mass(self):
        """Stable steps of the present state [s], each estimated from scratch. Collective."""
        adds = self._add_stiffness, self._add_springs, self._add_tets
        masses = self.solid.mass, self.scaling.first_mass
        return [
            self._limit(*(HighestFrequency(self.comm, m, self.mesh.x, add) for add in adds))
            for m in masses
        ]

    def _stiffest_contact(self):
        """Largest sum over mass of a node's contact springs [1/s²], all closed. Collective.

        A spring between two nodes adds at most twice its stiffness over the mass
        (Gershgorin); a surface node carries its own spring and those of the facets.
        """
        c = self.contact
        if c.kinematic:
            return 0.0
        mass = self.solid.mass[c.own.nodes]
        spring = c.points.to_nodes((c.points.area / c.layer)[:, None], mass.size)[:, 0]
        return float(
            ((2.0 * spring + list_edge_springs(c, self._margin).bounds()) / mass).max(initial=0.0)
        )

    # --- numbers --------------------------------------------------------------------------

    def wall_forces(self):
        """Normal forces of the grains on the walls [N], compression positive. Collective."""
        normal = -np.einsum("ij,ij->i", self.walls.force, self.walls.normal)
        return self.comm.allreduce(normal) if self.comm.size > 1 else normal

    def _kinetic(self):
        s = self.state
        deformable = kinetic_energy(s.v, s.a, s.dt, self._free_mass, self.rigid.runs)
        return deformable + self.rigid.kinetic_energy(s.dt)

    def energies(self):
        """Terms of the energy balance [J], a dict with the keys of ``ENERGIES``. Collective."""
        contact, num_contacts = self.contact.energy()
        local = np.array(
            [
                self._kinetic(),
                self.solid.elastic_energy(self.state).sum(),
                self.state.plastic_work.sum(),
                self.contact.dissipated,
                contact,
                self.damped,
                self.walls.work,
                num_contacts,
            ]
        )
        total = self.comm.allreduce(local)
        self.num_contacts = int(total[7])
        energies = dict(zip(ENERGIES, total[:7], strict=False))
        energies["residual"] = self.initial_kinetic + total[6] - total[:6].sum()
        return energies

    def num_active_grains(self):
        """Grains with at least one closed contact. Collective."""
        active = np.zeros(self.mesh.labels.size, dtype=bool)
        p, w, points = self.contact.pairs, self.walls.pairs, self.contact.points
        active[points.grain_of_point[p.node[p.closed]]] = True
        active[p.grain[p.closed]] = True
        active[points.grain_of_point[w.node[w.closed]]] = True
        active[self.contact.edges.closed_grains()] = True
        self.comm.Allreduce(MPI.IN_PLACE, active, op=MPI.LOR)
        return int(active.sum())

    def mean_active_contacts(self):
        """Mean number of neighbours that press on a grain, walls left out. Collective."""
        return 2.0 * num_active_pairs(self.contact) / self.mesh.labels.size


def _rounded_down(value):
    """The value to 20 binary digits: the order in which ranks add up does not change it."""
    mantissa, exponent = math.frexp(value)
    return math.ldexp(math.floor(mantissa * 2**20), exponent - 20)
