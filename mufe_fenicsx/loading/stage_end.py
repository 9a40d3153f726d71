"""When a stage of a test has got to what it is to reach, and what keeps it from that.

The rules stand in :mod:`.stages`.
"""

import numpy as np

from ..errors import SolverError
from .oedometer import hindrance

#: Times that a wave travels for which stresses have to stay within their tolerance.
SETTLED = 2.0


class StageEnd:
    """Looks for the end of the present stage. Collective; twice gives the same as once.

    Args:
        apparatus: :class:`~.apparatus.Apparatus`.
        settings: :class:`~mufe_fenicsx.scene.stages.Loading`.
    """

    def __init__(self, apparatus, settings):
        self.apparatus, self.settings = apparatus, settings
        self.gauges, self.servo = apparatus.gauges, apparatus.servo

    def look(self, now, t, loaded):
        """Take the present state into account, which the apparatus has sampled.

        Args:
            now: :class:`~.present_stage.PresentStage`.
            t: Time [s].
            loaded: Whether the sample is seated.

        Raises:
            SolverError: It cannot carry what it is to carry, or does not get there.
        """
        lengths, means = self.gauges.lengths, self.gauges.mean_stress()
        if now.given:
            now.take_parts(self.gauges.values(means, now.begun))
        self._check_lengths(now, lengths, means)
        most = self.settings.largest_strain
        shares = [
            abs(1.0 - lengths[a] / now.length0[a]) / most
            for a, task in enumerate(now.tasks)
            if task.free
        ]
        ramp = self.apparatus.paces.ramp_time(now)
        now.come(shares, t, max(SETTLED * self.servo.travel_time, ramp))
        near = now.s == 1.0 or not now.goes
        near &= now.shearing.is_there
        if not loaded and now.has_servo:
            waves = self.waves_waited(now, t)
            near &= now.waiting.rests(now.stage.name, self.servo.kinetic, waves)
        of_walls = self.gauges.led(np.asarray(self.gauges.means.stress))
        for task in now.tasks:
            near &= task.is_there(of_walls, means, lengths, self.settings.tolerance)
        now.settled = (t if now.settled is None else now.settled) if near else None
        if now.led_until is None and not now.is_led:
            now.led_until = t
        if now.hold_from is None:
            self._look_for_end(now, t, loaded, ramp)

    def waves_waited(self, now, t):
        """Times that a wave travels since walls had reached what they go to, at the time t [s]."""
        led, travel = now.led_until, self.servo.travel_time
        return 0.0 if led is None or not travel > 0.0 else (t - led) / travel

    def _look_for_end(self, now, t, loaded, ramp):
        """Let `hold` begin where the stage has reached what it is to reach, or `until`."""
        if now.ends_itself and now.settled is None:
            self._look_whether_it_waits(now, t, loaded)
        if now.ends_itself and now.settled is not None:
            wait = SETTLED * self.servo.travel_time if now.has_servo else 0.0
            if t - now.settled >= wait:
                now.hold_from = t
        if now.brake_from is None and any(part >= 1.0 for part in now.parts):
            now.brake_from = t
            if now.led_until is None:
                now.led_until = t
        if now.brake_from is not None and t - now.brake_from >= (ramp if now.is_led else 0.0):
            now.hold_from = t

    def _look_whether_it_waits(self, now, t, loaded):
        """Make a notice where the sample is at rest without the stresses that it is to reach.

        Raises:
            SolverError: A seating has not got there for long.
        """
        name, waiting = now.stage.name, now.waiting
        if not loaded:
            waiting.check(name, self.gauges.means.stress, self.waves_waited(now, t))
        if not waiting.is_due(t, self.servo.travel_time):
            return
        means, tolerance = self.gauges.mean_stress(), self.settings.tolerance
        targets = {task.axis: task.target(1.0, means) for task in now.tasks if task.servo}
        if not targets:
            return
        allowed = tolerance * min(targets.values())
        if not waiting.look(t, self.servo, self.gauges.lengths, allowed):
            return
        a = max(targets, key=lambda axis: abs(means[axis] - targets[axis]))
        waiting.notice = (
            f'stage "{name}" waits at rest: stress_{self.apparatus.container.axes[a]} = '
            f"{means[a] / 1e3:.5g} kPa, expected {targets[a] / 1e3:.5g} kPa for "
            f"{SETTLED:g} travel times of a wave within loading.tolerance = {tolerance:g}: stop, "
            "raise that, and --resume; where grains rattle raise solver.damping in a new run"
        )

    def _check_lengths(self, now, lengths, means):
        """Raise SolverError where the sample cannot carry what it is to carry."""
        limit, axes = self.settings.largest_strain, self.apparatus.container.axes
        for a, task in enumerate(now.tasks):
            change = 1.0 - lengths[a] / now.length0[a]
            if task.free and abs(change) > limit:
                stress = self.gauges.axis_stress(self.apparatus.forces)
                what = hindrance(self.apparatus.simulation) or (
                    "see that the sample fills its walls and can carry what is asked"
                )
                raise SolverError(
                    f'stage "{now.stage.name}": the length along {axes[a]} changed by {change:.1%} '
                    f"at a stress of {stress[a]:.3g} Pa there (loading.largest_strain = "
                    f"{limit:g}): {what}"
                )
            if task.servo and (target := task.target(now.s, means)) < 0.0:
                raise SolverError(
                    f'stage "{now.stage.name}": at stress_z = {means[-1]:.3g} Pa the mean stress '
                    f"asks for a stress of {target:.3g} Pa along {axes[a]}, expected q < 3 p"
                )
