"""Kick and drift of a step, and how far nodes and walls move in it."""

import numpy as np

from ..kernels.bulk.energy import kinetic_energy
from ..kernels.bulk.kick_drift import KickAndDrift
from ..kernels.bulk.motion import accelerate_and_half_kick, half_kick_and_drift
from ..state import Stateful


class Motion(Stateful):
    """Motion of all nodes of this rank. Local.

    The second half of a kick waits for the next step, whose first half then goes with it: nodes
    are read and written once. Until :meth:`complete` the state is halfway. Constraints move what
    is theirs: after all nodes in the drift, in the reverse order in the kick.

    Args:
        specimen: :class:`~mufe_fenicsx.specimen.Specimen`.
    """

    STATE = {"common": ("field", "damping"), "largest": ("fastest",), "sum": ("powers",)}

    def __init__(self, specimen):
        self._specimen = specimen
        self.constraints = specimen.constraints  #: which move what is theirs
        self._kick_and_drift = KickAndDrift()
        self.damping = 0.0  #: that of the last step [1/s]
        self.largest = 0.0  #: largest motion of a node or a wall in this step [m]
        self.fastest = 0.0  #: speed of a wall or of a tool that is led, so far [m/s]
        #: Of the damping of all nodes and of what constraints change at the last step's end [W].
        self.powers = np.zeros(2)
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
        """Half a kick, and the motion of walls and nodes over a step ``dt`` [s]."""
        sp, s, damping = self._specimen, self._specimen.state, self.damping
        of_walls = sp.walls.move(dt)
        sp.walls.add_work()
        x0, runs, moves, field = sp.mesh.x, sp.rigid.lists.runs, self._moves, self.field
        if s.halfway:
            s.halfway = False
            damped, moved = self._kick_and_drift(
                s.x, s.u, s.v, sp.f, sp.solid.mass, x0, runs, s.dt, dt, damping, field, moves
            )
            self._book(0, damped, s.dt)
        else:
            moved = half_kick_and_drift(
                s.x, s.u, s.v, s.a, sp.f, x0, runs, dt, damping, field, moves
            )
        self.fastest, self.largest = max(self.fastest, of_walls / dt), max(of_walls, moved)
        for constraint in self.constraints:
            self.fastest = max(self.fastest, constraint.lead(s.t, dt))
        for constraint in self.constraints:
            moved = constraint.drift(s, dt, damping, moves, field)
            self.largest = max(self.largest, moved)

    def kick(self, dt):
        """Half a kick of constraints at the end of the step; that of other nodes waits."""
        sp, damped = self._specimen, 0.0
        sp.walls.add_work()
        for constraint in reversed(self.constraints):
            damped += constraint.kick(sp.solid.mass, dt, self.damping)
        self._book(1, damped, dt)
        sp.state.halfway = True

    def complete(self):
        """Bring a state that is halfway to the end of its step: all nodes, and their velocities."""
        sp, s = self._specimen, self._specimen.state
        if not s.halfway:
            return
        s.halfway = False
        damped = accelerate_and_half_kick(
            s.a, s.v, sp.f, sp.solid.mass, sp.rigid.lists.runs, s.dt, self.damping
        )
        self._book(0, damped, s.dt)
        for constraint in self.constraints:
            constraint.complete(s)

    def _book(self, which, damped, dt):
        """Work of the damping in a step, a trapezium; ``damped`` has the power of its end alone."""
        before, self.powers[which] = self.powers[which], damped / dt
        self._specimen.damped += 0.5 * (dt * before + damped)

    def kinetic_energy(self):
        """Kinetic energy of this rank's grains [J], at the end of the step."""
        self.complete()
        return sum(self._kinetic_energies(self._specimen.state.dt, self.damping))

    def _kinetic_energies(self, dt, damping):
        """That of all nodes but those of constraints, and of these."""
        sp, s = self._specimen, self._specimen.state
        of_nodes = kinetic_energy(s.v, s.a, dt, damping, sp.free_mass, sp.rigid.lists.runs)
        return of_nodes, sum(one.kinetic_energy(dt, damping) for one in self.constraints)

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
