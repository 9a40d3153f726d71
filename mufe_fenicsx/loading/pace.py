"""How fast the walls of a test by stages move: ramps, and the speed that keeps it quasi-static.

Speeds rise over the strain ``ramp`` as a smooth step of time, and fall so where a value of
``until`` was passed: at once they would send a wave through the sample that unloads it.
"""

from .oedometer import smooth_step
from .quasi_static import QuasiStaticSpeed
from .tasks import Pace


class Paces:
    """The pace of each step. Collective where the speed adapts.

    Args:
        simulation: :class:`~.Simulation` with the walls of a container.
        container: Its :class:`~mufe_fenicsx.container.Container`.
        settings: :class:`~mufe_fenicsx.scene.stages.Loading`.
        quasi_static: Settings of a speed that adapts (scene.QuasiStatic), or None.
    """

    def __init__(self, simulation, container, settings, quasi_static):
        self.simulation, self.container, self.settings = simulation, container, settings
        self.control = None
        if quasi_static is not None:
            platens = container.top, container.bottom
            self.control = QuasiStaticSpeed(simulation, quasi_static, *platens)

    def state_dict(self):
        """What a test that goes on has to know, by part: of the speed that adapts, if it does."""
        return {} if self.control is None else {"control": self.control.state_dict()}

    def load_state_dict(self, kept, tasks):
        """Go on from what :meth:`state_dict` gave in a stage with these tasks."""
        if self.control is not None:
            self.control.load_state_dict(kept["control"])
            self.lead(tasks)

    def begin(self, tasks, loaded, held):
        """A stage begins; ``loaded``: the sample is seated; ``held``: speed that servos follow."""
        if self._is_controlled(loaded):
            slowest = self.control.settings.slowest
            self.control.begin(min(self.settings.speed, max(held, slowest)))
            self.control.acceleration = 0.0
            self.lead(tasks)

    def lead(self, tasks):
        """The control looks at the walls of the leading axis."""
        if self.control is not None:
            walls = self.container.walls_of_axis[leading_axis(tasks)]
            self.control.platens = walls[-1], walls[0]

    def ramp_time(self, now):
        """In which walls get from rest to their speed, and back, in a stage [s]."""
        shortest = self.container.shortest(now.length0)
        return self.settings.ramp * shortest / self.settings.speed

    def pace(self, now, tasks, strains, loaded, shearing):
        """:class:`~.tasks.Pace` of the coming step.

        Args:
            now: :class:`~.present_stage.PresentStage`.
            tasks: Of its axes.
            strains: Along the axes, shape (num_axes,).
            loaded: Whether the sample is seated.
            shearing: :class:`~.shearing.Unsheared`, what shears it.
        """
        settings, leading = self.settings, now.hold_from is None
        factor = 0.0
        if leading:
            factor = self._ramps(now) * self._control_factor(now, tasks, strains, loaded, shearing)
        controlled = self.control.speed if self._is_controlled(loaded) else 0.0
        fastest = max(settings.speed, controlled)
        return Pace(settings.speed, fastest, factor, settings.ramp, leading)

    def _ramps(self, now):
        """Part of the speed that the ramps, at the start of a stage and at its end, let through."""
        time = self.ramp_time(now)
        # The middle of the coming step: the first one moves.
        t = self.simulation.state.t + 0.5 * self.simulation.dt
        if time == 0.0:
            return 1.0
        brake = 0.0 if now.brake_from is None else smooth_step((t - now.brake_from) / time)
        return smooth_step((t - now.begun) / time) * (1.0 - brake)

    def _is_controlled(self, loaded):
        """Whether the speed adapts: not while the sample is seated, where walls travel freely."""
        return self.control is not None and loaded

    def _control_factor(self, now, tasks, strains, loaded, shearing):
        """Speed that keeps the test quasi-static over the one that is stated."""
        if not self._is_controlled(loaded):
            return 1.0
        if now.s == 1.0 and not any(each.at_speed for each in (*tasks, shearing)):
            return self.control.speed / self.settings.speed
        strain = abs(float(strains[leading_axis(tasks)]))
        return self.control(max(strain, shearing.way)) / self.settings.speed


def leading_axis(tasks):
    """The axis that leads a stage: the last one that goes somewhere, or the vertical one."""
    leads = [a for a, task in enumerate(tasks) if task.leads]
    return leads[-1] if leads else len(tasks) - 1
