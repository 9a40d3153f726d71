"""What is computed: grains, contact, walls, masses and energies, and all forces as a list of terms.

Nothing here knows how the specimen moves: :mod:`.explicit` steps it in time, :mod:`.implicit` looks
for its equilibria.
"""

from dataclasses import fields

import numpy as np

from .bulk.added_term import name_failure, try_term
from .bulk.rigid import RigidGrains, check_rigid
from .bulk.solid import Solid
from .bulk.tools import Tools, tool_solids
from .contact.contact import Contact
from .contact.glued import Glued
from .contact.mirrors import Mirrors
from .contact.results.network import num_active_grains, num_active_pairs
from .contact.results.patches import find_patches
from .contact.settings import ContactGrains, ContactSettings
from .contact.start.overlap import check_start, too_deep
from .contact.walls import Walls
from .errors import (
    InputError,
    SolverError,
    UnstableError,
    finite_array,
    nearest_name,
    raise_together,
    shown,
)
from .loading.gravity import Gravity
from .materials.elastic import IsotropicSolid
from .state import ForceTerm, Stateful, initial_state


class Specimen(Stateful):
    """A set of grains between walls, on all ranks of ``mesh.comm``. Collective.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        materials: A material for each grain of this rank, tools left out.
        walls: List of :class:`~mufe_fenicsx.contact.walls.Wall`.
        element: One of solid.ELEMENTS: "averaged" or "p1".
        velocity: Initial velocities [m/s], shape (num_nodes, 3); rest if None.
        mass_factor: Nodal masses times this, shape (num_nodes,), where only slow loading is
            of interest; 1 if None. Not seen by the time step of single elements.
        gravity: Acceleration [m/s²], shape (3,); none if None.
        damping: Force -damping m v on every node [1/s]; time steps are at most one over it, and
            static increments have none.
        tools: All :class:`~mufe_fenicsx.bulk.tools.Tool`, in the order of those of the mesh.
        before: The specimen of the mesh that this one has grown from, with the same options: what
            is as it was is taken from there, and contact has no pairs yet. None: of the start.
        contact: Fields of :class:`~mufe_fenicsx.contact.settings.ContactSettings`, ``friction``
            among them.

    Attributes:
        state: :class:`~mufe_fenicsx.state.State`.
        f: Sum of all forces on the nodes [N], shape (num_nodes, 3).
        terms: All forces, :class:`~mufe_fenicsx.state.ForceTerm`, in the order in which they act.
            What moves the specimen puts that of contact first.
        constraints: Of the terms the last ones, :class:`~mufe_fenicsx.state.Constraint`.
        free_mass: Nodal masses [kg] without those of glued nodes, shape (num_nodes,).
        tools: :class:`~mufe_fenicsx.bulk.tools.Tools`.
    """

    STATE = {
        "nodes": ("f",),
        "sum": ("initial_kinetic", "first_energies", "damped", "parted"),
    }
    SHARED = ("f",)

    def __init__(
        self,
        mesh,
        materials,
        walls=(),
        *,
        element="averaged",
        velocity=None,
        mass_factor=None,
        gravity=None,
        damping=0.0,
        tools=(),
        before=None,
        **contact,
    ):
        self.mesh, self.comm = mesh, mesh.comm
        raise_together(self.comm, _what_is_wrong(mesh, materials, velocity, mass_factor))
        materials = [*materials, *tool_solids(self.comm, mesh, tools, materials)]
        self.solid = solid = Solid(mesh, materials, element, before and before.solid)
        weighed = solid.mass.copy()
        self.rigid = RigidGrains(mesh, materials, solid.mass, mass_factor)
        if mass_factor is not None:
            solid.mass *= mass_factor
        self.walls = walls = Walls(walls)
        self.f = np.zeros((mesh.num_nodes, 3))
        self.state = initial_state(mesh.x, mesh.num_cells, before and before.state)
        settings = _settings_of_contact(contact).with_tools(mesh.first_tool, tools)
        grains = ContactGrains(
            solid.contact_modulus, solid.tangential_ratio, solid.mass,
            self.rigid.layers(materials), solid.edge_compliance,
            tuple(material.yield_table() for material in materials), self.state.plastic_strain,
        )  # fmt: skip
        self.contact = Contact(mesh, mesh.x, walls, grains, settings, before and before.contact)
        kinematic = self.contact.layers.kinematic
        self.glued = Glued(mesh, self.walls, self.contact.own.nodes)
        self.mirrors = Mirrors(
            self.comm, self.walls, mesh.x, self.glued.nodes, self.rigid.lists.nodes, kinematic
        )
        check_rigid(self.comm, self.rigid, self.glued.nodes, kinematic, mass_factor)
        self.tools = Tools(mesh, tools, self.rigid)
        constraints = self.glued, self.mirrors, self.rigid, self.tools
        self.constraints = [term for term in constraints if term.any]
        self.terms = [solid, *self.constraints]
        self.free_mass = self.glued.free_mass(solid.mass)
        self._begin_motion(velocity)
        self.damping = _not_negative("damping", damping)
        #: At the start on this rank, and its growth where its definition changed since [J].
        self.initial_kinetic = 0.0
        #: Energy that damping, stabilisation and changes of added mass took on this rank [J].
        self.damped = 0.0
        #: Energy that went where nodes parted on this rank, below zero where it came [J].
        self.parted = 0.0
        self.first_energies = np.empty(0)  #: of the added terms, on this rank [J]
        if gravity is not None:
            weight = self.glued.free_mass(weighed)
            weight[self.tools.borne_nodes()] = 0.0
            self.add_term(Gravity(mesh, weight, gravity, self.rigid))
        if self.any_rigid:
            rigid, s = self.rigid, self.state
            self.contact.before_search = lambda: rigid.place_all(s.x, s.u)

    def _begin_motion(self, velocity):
        """Initial velocities, and those that are told. Local."""
        if velocity is not None:
            self.state.v[:] = velocity
            self.rigid.set_velocity(self.state.v)
            self.mirrors.project(self.state.v)
            self.state.v[self.glued.nodes] = 0.0
        for constraint in self.constraints:
            constraint.lead(0.0, 0.0)

    def add_term(self, term):
        """Let a force of one's own act, before constraints take what they hold. Collective.

        Args:
            term: :class:`~mufe_fenicsx.state.ForceTerm` with a name that no other term has.

        Raises:
            InputError: It is none, its name is missing or taken, it is made for the nodes of
                another mesh, it knows nothing of the rigid grains that there are, or it fails.
        """
        names = [other.name for other in self.terms if other.name]
        if not isinstance(term, ForceTerm):
            raise InputError(f"force term = {shown(term)}, expected a state.ForceTerm")
        if self.any_rigid and type(term).act_on_rigid is ForceTerm.act_on_rigid:
            raise InputError(
                f"force term {term.name} has no act_on_rigid, expected one where grains are rigid: "
                "their nodes follow them, and forces on these are lost"
            )
        if not term.name:
            raise InputError(f"force term {type(term).__name__} has no name, expected one")
        if term.name in names:
            raise InputError(
                f'name of a force term = "{term.name}", expected one that is not there: '
                f"{', '.join(names) or 'none is'}"
            )
        if term.mesh is not None and term.mesh is not self.mesh:
            raise InputError(
                f"force term {term.name} is made for another mesh, of {term.mesh.num_nodes} nodes, "
                f"expected that of the simulation, of {self.mesh.num_nodes}"
            )
        message = None
        try:
            added, energy = try_term(term, self.state)
        except InputError as error:
            message = str(error)
        raise_together(self.comm, message)
        self.insert_term(term)
        self.f += added
        self.f[self.glued.nodes] = 0.0
        self.mirrors.project(self.f)
        self.first_energies = np.append(self.first_energies, energy)

    def insert_term(self, term):
        """Put a term after those of users before it, without any look at it. Local."""
        self.terms.insert(self.terms.index(self.solid) + 1 + len(self.added_terms), term)
        if term.constraint is not None:
            self.terms.append(term.constraint)
            self.constraints.append(term.constraint)

    @property
    def any_rigid(self):
        """Whether any rank has rigid grains or tools at the start."""
        return self.rigid.any

    @property
    def parts(self):
        """All that changes, :class:`~mufe_fenicsx.state.Stateful` by name, but pairs of contact."""
        return {
            "specimen": self,
            "state": self.state,
            "solid": self.solid,
            "rigid": self.rigid,
            "bonded": self.glued,
            "walls": self.walls,
            "curved_walls": self.walls.curved,
            "near_walls": self.walls.near,
            "tools": self.tools,
            **self.contact.parts,
            **{f"term_{term.name}": term for term in self.added_terms},
        }

    @property
    def added_terms(self):
        """Forces beside those of bulk, contact and constraints."""
        return [term for term in self.terms if term.name]

    @property
    def energy_columns(self):
        """Keys of :meth:`energies` by added terms."""
        pairs = zip(self.added_terms, self.first_energies, strict=True)
        whole = [f"energy_{term.name}" for term, first in pairs if not np.isnan(first)]
        return [*whole, *self._parts_of_energies()]

    def _parts_of_energies(self):
        """Shares of the energies of added terms on this rank [J], by name. Local."""
        return {
            f"{term.name}_{name}": value
            for term in self.added_terms
            for name, value in self.ask(term, "parts_of_energy", self.state).items()
        }

    @property
    def opening_terms(self):
        """Added terms that have facets open between cells."""
        return [term for term in self.terms if term.opens]

    def start(self):
        """Forces of the initial state; overlaps there are accepted. Collective."""
        s, contact = self.state, self.contact
        contact.begin_step(s.x)
        self.f[:] = 0.0
        # Of the terms, all but that of contact, which what moves the specimen brings.
        self._each_term("begin_forces", self.f, s, 0.0)
        contact.add_forces(self.f, s.x, accept=True)
        check_start(self.mesh, contact)
        self._end_forces(0.0)

    def add_forces(self, dt):
        """All forces at the present positions, added to ``f``. Collective.

        Args:
            dt: Length of the step that led there [s].
        """
        self._each_term("begin_forces", self.f, self.state, dt)
        self._end_forces(dt)

    def _end_forces(self, dt):
        self._each_term("add_forces", self.f, self.state, dt)
        if self.any_rigid:
            self._each_term("act_on_rigid", self.rigid, self.state)

    def _each_term(self, method, *arguments):
        term = None
        try:
            for term in self.terms:
                getattr(term, method)(*arguments)
        except Exception as error:
            if term in self.added_terms:
                name_failure(term, self.comm, error)
            raise

    def ask(self, term, method, *arguments):
        """What a method of an added term gives; named where it fails. As collective as that."""
        try:
            return getattr(term, method)(*arguments)
        except Exception as error:
            name_failure(term, self.comm, error)
            raise

    def take_masses(self):
        """Follow a change of the nodal masses. Local."""
        self.free_mass = self.glued.free_mass(self.solid.mass)
        for constraint in self.constraints:
            constraint.take_masses(self.solid.mass)

    def speed_bound(self):
        """No node of this rank and no wall moves faster than this [m/s]. Local."""
        v = self.state.v
        return float(np.sqrt(max(np.einsum("ni,ni->n", v, v).max(), self.walls.speed_square())))

    def check(self, finite):
        """Stop where an element fails or a value is not finite. Collective.

        Args:
            finite: Whether the motion of this rank is.

        Returns:
            Proven bound of the stable time step from single elements of this rank [s].

        Raises:
            UnstableError: An element turned inside out or collapsed, or the motion is not
                finite; on all ranks.
            SolverError: An element left its table of yield stresses, or a grain is too deep in
                another one; on all ranks.
        """
        failure, solid = None, self.solid
        worst = solid.worst_element(self.state.x)
        if finite or solid.inverted >= 0:
            failure = solid.failure(self.state, worst, solid.inverted)
        found = self.comm.allgather((failure, finite))
        failures = [failure for failure, _ in found if failure]
        if failures:
            message, unstable = failures[0]
            raise (UnstableError if unstable else SolverError)(message)
        if not all(ok for _, ok in found):
            terms = "".join(f", or look at the force term {t.name}" for t in self.added_terms)
            raise UnstableError(
                f"the motion is no longer finite at step {self.state.num_steps}: reduce "
                f"solver.time_step_factor or oedometer.speed{terms}"
            )
        deep = too_deep(self.mesh, self.contact)
        if deep is not None:
            raise SolverError(deep)
        return worst[0]

    # --- numbers --------------------------------------------------------------------------

    def wall_forces(self):
        """Normal forces of the grains on the walls [N], compression positive. Collective."""
        normal = self.walls.normal_forces()
        return self.comm.allreduce(normal) if self.comm.size > 1 else normal

    def unbalanced_force(self):
        """Sum of all forces on the sample from outside [N], shape (3,). Collective.

        Walls, with friction and glue, tools and added terms; a sample in equilibrium has none.
        """
        total = -self.walls.force.sum(axis=0) - self.tools.reaction[:, :3].sum(axis=0)
        if self.added_terms:
            f, rigid = np.zeros_like(self.state.x), self.rigid
            kept = rigid.force.copy(), rigid.torque.copy()
            rigid.force[:] = 0.0
            for term in self.added_terms:
                term.add_forces(f, self.state, 0.0)
                term.act_on_rigid(rigid, self.state)
            total += f.sum(axis=0) + rigid.force.sum(axis=0)  # tools have no mass
            rigid.force[:], rigid.torque[:] = kept
        return self.comm.allreduce(total)

    def work(self):
        """Work of walls and tools on this rank's grains so far [J]. Local."""
        return float(self.walls.work + self.tools.work)

    def energies(self, kinetic):
        """Terms of the energy balance [J], and the number of closed contacts. Collective.

        Args:
            kinetic: Kinetic energy of this rank's grains [J].

        Returns:
            dict with kinetic, elastic, plastic, friction, switching, contact, damping and parting;
            ``energy_NAME`` of each added term that has an energy, since the start; ``work`` of the
            walls; ``residual``, what none explains; and ``plastic_dents``, a part of plastic.
        """
        contact, num_contacts = self.contact.energy()
        dents = self.contact.dissipation.dents.work.sum()
        local = {
            "kinetic": kinetic,
            "elastic": self.solid.elastic_energy(self.state).sum(),
            "plastic": self.state.plastic_work.sum() + dents,
            "friction": self.contact.dissipation.total,
            "switching": self.contact.dissipation.switched,
            "contact": contact,
            "damping": self.damped,
            "parting": self.parted,
        }
        for term, first in zip(self.added_terms, self.first_energies, strict=True):
            if not np.isnan(first):
                local[f"energy_{term.name}"] = self.ask(term, "energy", self.state) - first
        local["work"] = self.work()
        parts = self._parts_of_energies()
        local_sums = [*parts.values(), *local.values(), self.initial_kinetic, dents, num_contacts]
        *values, initial, dents, number = self.comm.allreduce(np.array(local_sums))
        parts, values = dict(zip(parts, values, strict=False)), values[len(parts) :]
        work = values[-1]
        total = dict(zip(local, values, strict=True))
        total["residual"] = initial + work - np.sum(values[:-1])
        total["plastic_dents"] = dents
        return total | parts, int(number)

    def num_active_grains(self):
        """Grains with at least one closed contact, sleeves and tools left out. Collective."""
        return num_active_grains(self.contact, self.mesh.num_sample_grains)

    def mean_active_contacts(self):
        """Mean number of neighbours that press on a grain, of grains alone. Collective."""
        num_grains = self.mesh.num_sample_grains
        return 2.0 * num_active_pairs(self.contact, num_grains) / num_grains

    def contact_patches(self):
        """Patches of contact now. Collective: one gather.

        Returns:
            :class:`~mufe_fenicsx.contact.results.patches.Patches` on rank 0, None on the others.
        """
        return find_patches(self.contact, self.mesh, self.state.x)


def _what_is_wrong(mesh, materials, velocity, mass_factor):
    """Message about what this rank was given for its nodes and grains, None if it can be used."""
    for material in materials:
        if not isinstance(material, IsotropicSolid):
            return (
                f"material = {shown(material)}, expected one such as Elastic(E=70e9, nu=0.2, "
                "rho=2500)"
            )
    num = mesh.num_grains - int(mesh.is_tool.sum())
    if len(materials) != num:
        return f"materials = {len(materials)}, expected one for each of {num} grains"
    of_nodes = ("velocity", velocity, (3,)), ("mass_factor", mass_factor, ())
    try:
        for name, value, shape in of_nodes:
            if value is not None:
                finite_array(name, value, (mesh.num_nodes, *shape))
    except InputError as error:
        return str(error)
    return None


def _not_negative(name, value):
    number = float(finite_array(name, value, ()))
    if number < 0.0:
        raise InputError(f"{name} = {shown(value)}, expected 0 or more")
    return number


def _settings_of_contact(options):
    """Settings of contact from what is left of the options of a simulation."""
    known = [field.name for field in fields(ContactSettings)]
    for name in options:
        if name not in known:
            raise InputError(
                f"option of a simulation = {shown(name)}, expected {nearest_name(name, known)}"
            )
    return ContactSettings(**options)


class OfSpecimen(Stateful):
    """What simulations show of the specimen that they move.

    Attributes:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        comm: MPI communicator.
        state: :class:`~mufe_fenicsx.state.State`.
        solid: :class:`~mufe_fenicsx.bulk.solid.Solid`.
        rigid: :class:`~mufe_fenicsx.bulk.rigid.RigidGrains`.
        walls: :class:`~mufe_fenicsx.contact.walls.Walls`.
        tools: :class:`~mufe_fenicsx.bulk.tools.Tools`.
        contact: :class:`~mufe_fenicsx.contact.contact.Contact`.
    """

    def __init__(self, specimen):
        self.specimen = specimen
        self.mesh, self.comm = specimen.mesh, specimen.comm
        self.state, self.solid, self.rigid = specimen.state, specimen.solid, specimen.rigid
        self.walls, self.tools = specimen.walls, specimen.tools
        self.contact = specimen.contact
        self.num_contacts = 0  #: closed ones when the energies were asked for last

    @property
    def u(self):
        """Displacement as a function of DOLFINx [m], made anew. Collective after a growth."""
        return self.mesh.function(self.state.u)

    @property
    def v(self):
        """Velocity as a function of DOLFINx [m/s], as :attr:`u`."""
        return self.mesh.function(self.state.v)

    @property
    def force(self):
        """Sum of the forces on the nodes as a function of DOLFINx [N], as :attr:`u`."""
        return self.mesh.function(self.specimen.f)

    def grow(self, between):
        """Open facets between cells, as :meth:`.explicit.simulation.Simulation.grow`. Collective.

        Raises:
            InputError: These are increments.
        """
        raise InputError("growth of the mesh in increments, expected steps in time")

    def facets_to_open(self):
        """Pairs of cells for :meth:`grow`, of each force term that opens some now. Collective."""
        for term in self.specimen.opening_terms:
            between = term.facets_to_open(self.state)
            if between is not None:
                yield between

    @property
    def initial_kinetic(self):
        """Kinetic energy at the start [J]. Collective."""
        return self.comm.allreduce(self.specimen.initial_kinetic)

    def add_term(self, term):
        """Let a force of one's own act from now on, as :meth:`Specimen.add_term`. Collective."""
        self.specimen.add_term(term)
        self.update_time_step()

    def update_time_step(self):
        """Follow a change of stiffness. Collective."""
        raise NotImplementedError

    @property
    def damping(self):
        """Force -damping m v on every node [1/s]; may be changed between two steps."""
        return self.specimen.damping

    @damping.setter
    def damping(self, value):
        self.specimen.damping = _not_negative("damping", value)

    @property
    def damped(self):
        """Energy taken by damping on this rank [J]."""
        return self.specimen.damped

    def kinetic_energy(self):
        """Kinetic energy of this rank's grains [J]. Local."""
        raise NotImplementedError

    def energies(self):
        """Terms of the energy balance [J], as of :meth:`Specimen.energies`. Collective."""
        found, self.num_contacts = self.specimen.energies(self.kinetic_energy())
        return found

    def mass_of_grains(self):
        """Mass of all grains [kg], sleeves and tools left out. Collective."""
        return self.comm.allreduce(float(self.solid.mass[self.mesh.sample_nodes].sum()))

    def wall_forces(self):
        """Normal forces of the grains on the walls [N], compression positive. Collective."""
        return self.specimen.wall_forces()

    def unbalanced_force(self):
        """Sum of all forces on the sample from outside [N], shape (3,). Collective."""
        return self.specimen.unbalanced_force()

    def num_active_grains(self):
        """Grains with at least one closed contact. Collective."""
        return self.specimen.num_active_grains()

    def mean_active_contacts(self):
        """Mean number of neighbours that press on a grain, walls left out. Collective."""
        return self.specimen.mean_active_contacts()

    def contact_patches(self):
        """Patches of contact now, on rank 0. Collective."""
        return self.specimen.contact_patches()
