"""Grains, contact and walls, stepped together by central differences."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import ArrayLike

from ..arguments import checked, finite_number
from ..bulk.release import LoadWatch
from ..contact.pairs.motion_bounds import linear_field
from ..contact.walls import Wall
from ..errors import InputError
from ..materials.elastic import IsotropicSolid
from ..mesh import GrainMesh
from ..solvers.central_difference import central_difference
from ..specimen import OfSpecimen, Specimen
from .contact_in_steps import ContactInSteps
from .growth import carry_over, grown_mesh, options_of
from .mass_scaling import MassScaling
from .motion import Motion
from .stable_step import StableStep
from .step_limit import StepLimit

#: Largest time step over the limit of stability: beyond, energy comes from nowhere.
LARGEST = 1.0
#: The limit is found early where single elements ask for this part of their step then.
SHORTER = 0.98


class Simulation(OfSpecimen):
    """A specimen in time steps. Collective.

    Args:
        mesh, materials, walls, options: As of :class:`~mufe_fenicsx.specimen.Specimen`.
        assembled: Time step from the assembled system (True) or from single elements.
        time_step_factor: Time step over the limit of stability.
        refresh: Steps between two evaluations of that limit, where none waits longer.
        mass_scaling: Settings of mass added for a longer step (scene.MassScaling), or None.
        hold_step: Whether that mass is left for what shortens the step later, as cracks do.

    Raises:
        InputError: Rigid grains, or forces with a stiffness of their own, and a step from single
            elements; and as of the specimen.
    """

    STATE = {"common": ("dt", "dt_element")}

    static = False  #: whether increments leave inertia out; steps in time do not
    increments = False  #: whether a step is an increment that takes Newton's method

    @checked
    def __init__(
        self,
        mesh: GrainMesh,
        materials: Sequence[IsotropicSolid],
        walls: Sequence[Wall] = (),
        *,
        assembled: bool = True,
        time_step_factor: float = 0.9,
        refresh: int = 150,
        mass_scaling: Any = None,
        hold_step: bool = False,
        **options: Any,
    ):
        time_step_factor = finite_number("time_step_factor", time_step_factor, gt=0, le=LARGEST)
        finite_number("refresh", refresh, ge=1, unit="steps")
        scaling = None if mass_scaling is None else (mass_scaling, hold_step)
        self._made_of = materials, walls, assembled, time_step_factor, refresh, scaling
        self._make(mesh, options)
        specimen = self.specimen
        specimen.start()
        specimen.terms.insert(0, self.contact_term)
        s, soft = self.state, specimen.rigid.lists.soft
        s.a[soft] = (specimen.f / specimen.solid.mass[:, None])[soft]
        for constraint in specimen.constraints:
            constraint.complete(s)
        self.update_time_step()
        specimen.initial_kinetic = self.kinetic_energy()

    def _make(self, mesh, options, before=None):
        """Make all that stands on a mesh, before any force is known. Collective.

        ``before``: As of the specimen.
        """
        materials, walls, assembled, time_step_factor, refresh, scaling = self._made_of
        self._options = {name: value for name, value in options.items() if name != "velocity"}
        specimen = Specimen(mesh, materials, walls, before=before, **options)
        super().__init__(specimen)
        if specimen.any_rigid and not assembled:
            raise InputError('time step = by element, expected "assembled" for rigid grains')
        self.time_step_factor = time_step_factor
        self.watch = LoadWatch(specimen.rigid, specimen.solid)
        self.motion = Motion(specimen)
        self.scaling = None if scaling is None else MassScaling(specimen.solid, *scaling)
        self.stable = StableStep(specimen, assembled, time_step_factor)
        self.limit = StepLimit(specimen, self.motion, self.stable, refresh, self.scaling)
        self.dt = math.nan
        self.dt_element = math.nan
        self.contact_term = ContactInSteps(specimen, self.motion)

    @property
    def parts(self):
        """All that steps change, :class:`~mufe_fenicsx.state.Stateful` by name."""
        scaling = {} if self.scaling is None else {"scaling": self.scaling}
        return scaling | self.specimen.parts | {
            "simulation": self,
            "motion": self.motion,
            **self.limit.parts,
            "contact_term": self.contact_term,
        }  # fmt: skip

    def load_state_dict(self, kept):
        """Become what :meth:`state_dict` told; added mass is there already."""
        super().load_state_dict(kept)
        if self.scaling is not None:
            self.limit.restore_masses()

    # --- stepping -------------------------------------------------------------------------

    def step(self, everywhere: bool = True) -> None:
        """Advance by one stable time step. Collective.

        Args:
            everywhere: Bring all nodes up to date, by :meth:`complete`. Without, a step costs
                less, and leaves the state halfway.
        """
        if self.watch.num_waiting:
            self._release_loaded()
        for between in self.facets_to_open():
            self.grow(between)
        # Early where contacts may close that the last evaluation did not count.
        if self.limit.is_due():
            self.update_time_step(early=self.limit.is_early(), of_elements=self.check())
        elif self.limit.is_half_way():
            of_elements = self.check()
            if self.limit.of_elements(of_elements) < SHORTER * self.dt_element:
                self.update_time_step(of_elements=of_elements)
        if (self.dt, self.damping) != (self.state.dt, self.motion.damping):
            self.specimen.initial_kinetic += self.motion.begin_steps(self.dt, self.damping)
        central_difference(self.state, self.dt, self.motion.drift, self._forces, self.motion.kick)
        if self.walls.has_servo:
            self.walls.adjust(self.comm, self.dt)
        if everywhere:
            self.complete()

    def complete(self) -> None:
        """Bring a state that is halfway to the end of its step. Local."""
        self.motion.complete()

    def kinetic_energy(self):
        """Kinetic energy of this rank's grains [J], at the end of the step. Local."""
        return self.motion.kinetic_energy()

    def energy_of_touch(self):
        """Energy of all grains seen from the fastest wall or tool so far, M v²/2 [J]. Collective.

        When it meets them its blow leaves a part out of the balance: of a node of mass m on a
        contact of stiffness k up to k (v Δt)²/8, with √(k/m) Δt below √2 at most m v²/4.
        """
        fastest = self.comm.allreduce(self.motion.fastest, op=MPI.MAX)
        return 0.5 * self.mass_of_grains() * fastest**2

    def _forces(self, dt):
        try:
            self.specimen.add_forces(dt)
        except FloatingPointError:
            self.check(diverged=True)

    def _release_loaded(self):
        """Let grains deform that carry more than they may as rigid ones. Local.

        Contact, places and velocities stay as they are, and so does the time
        step: contact layer, lumped masses and limit are those of the deformable grain already.
        """
        specimen, lists, near = self.specimen, self.rigid.lists, self.rigid.followed
        which = self.watch.loaded(specimen.f)
        if not which.any():
            return
        s, before = self.state, self.kinetic_energy()
        s.a[lists.nodes[np.repeat(which, np.diff(lists.offset))]] = 0.0
        nodes = near.nodes[np.repeat(which, np.diff(near.offset))]  # others carry no force
        s.a[nodes] = specimen.f[nodes] / specimen.solid.mass[nodes, None]
        self.watch.release(which)
        specimen.initial_kinetic += self.kinetic_energy() - before
        self.contact.follow_all(s.x)

    def deform_all_but(self, still_rigid):
        """Let rigid grains deform but for ``still_rigid``, global indices. Local."""
        self.watch.release_all_but(still_rigid)

    def take_over(self):
        """Go on from a state that another integrator left. Collective."""
        s = self.state
        s.a[:] = self.specimen.f / self.solid.mass[:, None]
        s.dt, self.dt = 0.0, math.nan
        self.limit.schedule.bound = self.contact.motion.bound
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
        finite = math.isfinite(self.kinetic_energy()) and not diverged
        return self.specimen.check(finite)

    # --- growth ---------------------------------------------------------------------------

    def grow(self, between: ArrayLike) -> None:
        """Open facets between cells of grains that deform, between two steps. Collective.

        Where all cells around a node no longer hang together, it is doubled
        (:meth:`.GrainMesh.grow`). Parts of a node have its place and velocity, and the mass of the
        cells around each. What was there keeps forces, stress and contact; opened facets become
        surface, without contact so far. They meet other bodies, and what has come loose meets the
        rest of its grain. The faces of a crack that has not gone through do not meet.

        What averaged elements store changes, as the mean of the volumes around a node becomes one
        for each part. The account ``parting`` has it.

        ``mesh``, ``state`` and all other parts are new ones afterwards.

        Args:
            between: Pairs of rows of ``mesh.cells`` on the two sides of each facet, as of
                ``mesh.inner_facets()``, of this rank's grains, shape (n, 2). Where no node parts
                nothing changes yet.

        Raises:
            InputError: A pair is no two cells that share a facet; a grain is rigid; there is a
                membrane, or a force term that cannot follow; on all ranks. Nothing has changed.
        """
        self.complete()
        mesh = grown_mesh(self.specimen, between)
        if mesh is not self.mesh:
            grown = object.__new__(type(self))
            grown._made_of = self._made_of
            grown._make(mesh, options_of(self._options, mesh), self.specimen)
            carry_over(self, grown)
            vars(self).update(vars(grown))
            self.update_time_step()

    # --- time step ------------------------------------------------------------------------

    def update_time_step(self, early=False, of_elements=None):
        """Set ``dt`` from the limit of stability at the present state. Collective.

        An ``early`` call, soon after the last one for contacts that may close, only shortens it.
        ``of_elements`` is what :meth:`check` found at this state, None where it was not called.
        """
        self.complete()
        self.motion.set_field(linear_field(self.comm, self.state.x, self.state.v))
        self.dt_element = self.limit.of_elements(of_elements)
        limit = self.limit.find(self.dt_element, early)
        dt = _rounded_down(self.time_step_factor * limit)
        # A change costs accuracy of the energies: small ones are not worth it.
        if not 0.99 * self.dt <= dt <= (math.inf if early else 1.05 * self.dt):
            self.dt = dt
            self.contact.set_time_step(dt)


def _rounded_down(value):
    """The value to 10 binary digits: the order in which ranks add up seldom changes it.

    Each iteration for the highest frequency begins from the vector of the last one: where balls
    are alike, frequencies are too, and rounding grows to 1e-5 of the limit in ten of them.
    """
    mantissa, exponent = math.frexp(value)
    return math.ldexp(math.floor(mantissa * 2**10), exponent - 10)
