"""Kick and drift of a step, and how far nodes move in it."""

import numpy as np

from ..kernels.bulk.energy import kinetic_energy
from ..kernels.bulk.kick_drift import KickAndDrift
from ..kernels.bulk.motion import accelerate_and_half_kick, half_kick_and_drift
from ..state import Stateful


class Motion(Stateful):
    """Motion of all nodes of this rank, those of rigid grains with these. Local.

    The second half of a kick may wait for the next step, whose first half then goes with it: nodes
    are read and written once. Until :meth:`finish_kick` their velocities are those of the middle of
    the step, and accelerations as they were. Glued nodes go where their wall goes: the kick passes
    them by, and how far they move is known once walls have moved.

    Args:
        specimen: :class:`~mufe_fenicsx.specimen.Specimen`.
    """

    STATE = {"common": ("field", "damping"), "largest": ("fastest",), "sum": ("powers",)}

    def __init__(self, specimen):
        self._specimen = specimen
        self.may_wait = False  #: whether the second half of this step's kick is to wait
        self._kick_waits = False
        self._kick_and_drift = KickAndDrift()
        self.damping = 0.0  #: that of the last step [1/s]
        self.largest = 0.0  #: largest motion of a node or a wall in this step [m]
        self.fastest = 0.0  #: speed of a wall or of a tool that is led, so far [m/s]
        #: Of the damping of deformable grains and of rigid ones at the end of the last step [W].
        self.powers = np.zeros(2)
        self._moved = 0.0  # how far a deformable node moved in this step [m]
        # Of each grain, beside a field that fits all velocities; those of rigid ones stay unknown.
        self._moves = np.full(specimen.mesh.num_grains, np.inf)
        self.set_field(np.zeros((4, 3)))

    def set_field(self, field):
        """Measure the motion of grains beside another velocity field, as in kernels.bulk.motion."""
        self.field = field
        self._slope = float(np.linalg.norm(field[1:]))

    def load_state_dict(self, kept):
        """Become what :meth:`state_dict` told."""
        super().load_state_dict(kept)
        self.set_field(self.field)

    def beside_field(self, dt):
        """Motion of the grains in a step of ``dt`` [s], as Contact.begin_step wants it."""
        return self._moves, self.field, self._slope, dt

    def drift(self, dt):
        """Half a kick, and the motion over a step ``dt`` [s]."""
        sp, s = self._specimen, self._specimen.state
        damping = self.damping
        x0, runs = sp.mesh.x, sp.rigid.lists.runs
        if self._kick_waits:
            self._kick_waits = False
            damped, self._moved = self._kick_and_drift(
                s.x, s.u, s.v, sp.f, sp.solid.mass, x0, runs, s.dt, dt, damping, self.field,
                self._moves,
            )  # fmt: skip
            damped -= sp.bonded.damped(sp.solid.mass, s.dt, damping)
            self._book(0, damped, s.dt)
        else:
            self._moved = half_kick_and_drift(
                s.x, s.u, s.v, s.a, sp.f, x0, runs, dt, damping, self.field, self._moves
            )
        self.fastest = max(self.fastest, sp.lead_tools(dt))
        sp.rigid.drift(s.x, s.u, dt, damping)
        if sp.tools.any:
            sp.tools.add_work(dt)

    def move_walls(self, dt):
        """Walls go on by ``dt`` [s]."""
        sp = self._specimen
        moved = sp.move_walls(dt)
        self.fastest = max(self.fastest, moved / dt)
        glued = sp.bonded.largest_motion(
            self._moves, sp.state.x, sp.mesh.grain_of_node, self.field, dt
        )
        self.largest = max(moved, glued, sp.rigid.moved, self._moved)

    def kick(self, dt):
        """Half a kick at the end of the step."""
        self._kick_waits = True
        self._book(1, self._specimen.rigid.kick(dt, self.damping), dt)
        if self.may_wait:
            self._specimen.bonded.give_velocity(self._specimen.state.v)
        else:
            self.finish_kick()

    def finish_kick(self):
        """Velocities and accelerations of the deformable grains at the end of the step."""
        if not self._kick_waits:
            return
        self._kick_waits = False
        sp, s = self._specimen, self._specimen.state
        sp.bonded.take_velocity(s.v)
        damped = accelerate_and_half_kick(
            s.a, s.v, sp.f, sp.solid.mass, sp.rigid.lists.runs, s.dt, self.damping
        )
        self._book(0, damped, s.dt)
        sp.bonded.give_velocity(s.v)

    def _book(self, which, damped, dt):
        """Work of the damping in a step, a trapezium; ``damped`` has the power of its end alone."""
        before, self.powers[which] = self.powers[which], damped / dt
        self._specimen.damped += 0.5 * (dt * before + damped)

    def complete(self):
        """Bring all nodes up to date, after steps that did not."""
        self.finish_kick()
        sp, s = self._specimen, self._specimen.state
        if sp.rigid.num_grains:
            sp.rigid.complete(s.x, s.u, s.v)

    def kinetic_energy(self):
        """Kinetic energy of this rank's grains [J]."""
        self.finish_kick()
        return sum(self._kinetic_energies(self._specimen.state.dt, self.damping))

    def _kinetic_energies(self, dt, damping):
        """That of deformable grains and of rigid ones."""
        sp, s = self._specimen, self._specimen.state
        runs = sp.rigid.lists.runs
        deformable = kinetic_energy(s.v, s.a, dt, damping, sp.free_mass, runs)
        return deformable, sp.rigid.kinetic_energy(dt, damping)

    def begin_steps(self, dt, damping):
        """Go on by steps of another length [s] or damping [1/s].

        Returns:
            Growth of the kinetic energy by this alone, as that of central differences has both in
            it [J]. The first step begins with it from rest under a force.
        """
        before = self.kinetic_energy()
        self._specimen.state.dt, self.damping = dt, damping
        self.powers[:] = 2.0 * damping * np.array(self._kinetic_energies(0.0, 0.0))
        return self.kinetic_energy() - before
