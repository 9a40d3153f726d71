"""How long steps may be until that is looked at again, and mass added for longer ones."""

import numpy as np
from mpi4py import MPI

from ..contact.stiffness.springs import all_springs
from .mass_scaling import FALLEN
from .step_schedule import StepSchedule

#: Largest damping times step. At 2 a step would leave no velocity to damp.
MOST_DAMPED = 1.0


class StepLimit:
    """The limit of the coming steps. Collective, as its methods.

    Args:
        specimen: :class:`~mufe_fenicsx.specimen.Specimen`.
        motion: :class:`~.motion.Motion` of its nodes.
        stable: :class:`~.stable_step.StableStep`.
        steps: Steps between two evaluations, where none waits longer.
        scaling: :class:`~.mass_scaling.MassScaling`, or None.

    Attributes:
        schedule: :class:`~.step_schedule.StepSchedule`.
    """

    def __init__(self, specimen, motion, stable, steps, scaling):
        self._specimen, self._motion, self._moved = specimen, motion, specimen.contact.motion
        self.stable, self.scaling = stable, scaling
        self.schedule = StepSchedule(steps)

    @property
    def parts(self):
        """All that steps change, :class:`~mufe_fenicsx.state.Stateful` by name, but added mass."""
        return {"schedule": self.schedule, "stable": self.stable, "shared": self.stable.shared}

    def is_due(self):
        """Whether it is to be found anew, by schedule or by what moved. Local."""
        now = self._specimen.state.num_steps
        return self.schedule.is_passed(self._moved) or self.schedule.due(now)

    def is_early(self):
        """Whether the last evaluation was not long ago. Local."""
        return 2 * self.schedule.waited(self._specimen.state.num_steps) < self.schedule.steps

    def is_half_way(self):
        """Whether elements are to be looked at while it waits longer. Local."""
        waited = self.schedule.waited(self._specimen.state.num_steps)
        return bool(waited) and not waited % self.schedule.steps

    def of_elements(self, own=None):
        """Bound from single elements, as of :meth:`.StableStep.of_elements` [s]."""
        return self.stable.of_elements(own)

    def find(self, element_step, early):
        """The limit from the present state on [s].

        Args:
            element_step: Present value of :meth:`of_elements` [s].
            early: Whether this is soon after the last evaluation, for contacts that may close.
        """
        sp, schedule, scaling = self._specimen, self.schedule, self.scaling
        # The first step is counted too, by its speed: an assembled step is up to 3 times longer.
        ahead = 6.0 * element_step * sp.comm.allreduce(sp.speed_bound(), op=MPI.MAX)
        least = max(ahead, 1e-3 * sp.contact.edge)
        schedule.begin(self._moved.bound, sp.state.num_steps, early)
        limit = self._ahead(least, element_step)
        if schedule.too_far(limit):
            limit = self._ahead(least, element_step)
        schedule.end(limit, self.stable.slack)
        self._moved.mark()
        if scaling is not None and not early and limit < FALLEN * scaling.reached:
            if self.add_mass():
                limit = self.stable(schedule.margin, element_step)
            scaling.reached = limit
        elif scaling is not None and not scaling.reached:
            scaling.reached = limit
        return min(limit, MOST_DAMPED / sp.damping) if sp.damping > 0.0 else limit

    def _ahead(self, least, element_step):
        """Limit until the next evaluation [s], in which grains move by ``least`` [m] at least."""
        # Pairs that can close before the next evaluation count as closed.
        margin, factor = self.schedule.look_ahead(least, self._moved.known_ahead)
        self._moved.expect(margin, least, factor)
        if self.scaling is not None and not self.scaling.reached:
            # What is within an edge now, the walls above all, is held some time.
            self.scale_masses(max(margin, self._specimen.contact.edge))
        return self.stable(margin, element_step)

    def within(self, margin, element_step):
        """Limit [s] if all pairs within ``margin`` [m] were closed."""
        return self.stable.afresh(margin, element_step)

    def with_and_without_added_mass(self, element_step):
        """Limits of the present state [s], each estimated from scratch."""
        masses = self._specimen.solid.mass, self.scaling.first_mass
        margin = self.schedule.margin
        return [self.stable.afresh(margin, element_step, mass) for mass in masses]

    # --- masses ---------------------------------------------------------------------------

    def add_mass(self):
        """Adjust the added mass to the present geometry; whether there is more."""
        before = self._motion.kinetic_energy()
        changed = self.scale_masses(self.schedule.margin)
        self._specimen.damped += before - self._motion.kinetic_energy()
        return changed

    def scale_masses(self, margin):
        """Add mass for elements and contacts nearer than ``margin`` [m]; whether any was added.

        Of a simulation with mass scaling.
        """
        sp = self._specimen
        listed = all_springs(sp, margin)
        bounds = listed.bounds(sp.mesh.num_nodes)
        listed.destroy()
        changed = self.scaling.adjust(sp.state.x, (np.arange(bounds.size), bounds))
        self.take_masses()
        return changed

    def take_masses(self):
        """Follow a change of the nodal masses; velocities and forces stay. Local."""
        sp = self._specimen
        self.restore_masses()
        sp.state.a[:] = sp.f / sp.solid.mass[:, None]

    def restore_masses(self):
        """Follow the nodal masses of a state that is read; accelerations are those of it. Local."""
        self._specimen.take_masses()
        self.stable.set_mass(self._specimen.solid.mass)
