"""The present stage of a test: what it began with, how far it has come."""

import math
from dataclasses import dataclass, field

from ..state import Stateful
from .waiting import Waiting

#: Ways of every stage: s, that of lengths, and of time where it waits.
NUM_WAYS = 3


@dataclass
class PresentStage(Stateful):
    """What a stage began with, and how far it has come; the same on all ranks."""

    STATE = {
        "common": (
            "begun", "length0", "places0", "stress0", "held", "ways", "values0", "s", "settled",
            "hold_from", "brake_from", "led_until",
        )
    }  # fmt: skip

    stage: object  #: :class:`~mufe_fenicsx.scene.stages.Stage`
    shearing: object  #: what shears the sample, :class:`~.shearing.Unsheared`
    begun: float = 0.0  #: time of its start [s]
    length0: list | tuple = ()  #: distances of opposite walls then [m]
    places0: list | tuple = ()  #: how far in planes stood then [m]
    stress0: list | tuple = ()  #: stress of each axis then [Pa]
    held: list | tuple = ()  #: stress that each axis held then [Pa], or None
    values0: dict = field(default_factory=dict)  #: what `until` can name, at its start
    s: float = 0.0  #: how far along the line to its stresses and strains, from 0 to 1
    settled: float | None = None  #: time since when all is within its tolerance [s]
    hold_from: float | None = None  #: time at which `hold` began [s]
    brake_from: float | None = None  #: time at which a value of `until` was passed [s]
    led_until: float | None = None  #: time at which walls had reached what they go to [s]
    waiting: Waiting = field(default_factory=Waiting)  #: begins anew where a run goes on
    tasks: tuple = ()  #: what each axis does, :class:`~.tasks.Task`
    parts: tuple = ()  #: how far each value of `until` has come; 1 where it is passed

    def __post_init__(self):
        #: Those by which rows fall due, each of which only grows.
        self.ways = [0.0] * (NUM_WAYS + len(self.given))

    @property
    def given(self):
        """The values of `until`, by name."""
        until = self.stage.until
        return {} if until is None else until.given

    @property
    def all_tasks(self):
        """Tasks of the axes, and what shears the sample."""
        return (*self.tasks, self.shearing)

    @property
    def goes(self):
        """Whether anything goes along the line of the stage."""
        return any(task.goes for task in self.all_tasks)

    @property
    def ends(self):
        """Whether it ends when something is reached."""
        return any(task.ends for task in self.all_tasks)

    @property
    def ends_itself(self):
        """Whether it ends when all is there: nothing else, as a value of `until`, ends it."""
        return self.ends or self.stage.until is None

    @property
    def has_no_end(self):
        """Whether something goes at a speed, and nothing says for how long."""
        at_speed = any(task.at_speed for task in self.all_tasks)
        return at_speed and self.stage.until is None and not self.ends

    @property
    def has_servo(self):
        """Whether walls follow a stress."""
        return any(task.servo for task in self.tasks)

    @property
    def is_led(self):
        """Whether walls are on the way to what the stage is to reach, or go at a speed."""
        return (self.s < 1.0 and self.goes) or any(task.driven for task in self.all_tasks)

    def targets(self, means):
        """Stress that each axis is to carry [Pa], at mean ones of the axes; None where free."""
        return [task.target(self.s, means) for task in self.tasks]

    def held_stresses(self, means):
        """(axis, stress [Pa]) of what servos hold, at mean stresses of the axes."""
        held = [task for task in self.tasks if task.servo and not task.goes]
        targets = ((task.axis, task.target(self.s, means)) for task in held)
        return [(axis, target) for axis, target in targets if target]

    def take_parts(self, values):
        """Know how far each value of `until` has come.

        Args:
            values: All that `until` can name, now.
        """
        before = self.values0
        ways = {name: value - before[name] for name, value in self.given.items()}
        self.parts = [(values[n] - before[n]) / way if way else 1.0 for n, way in ways.items()]

    def come(self, shares, t, least):
        """Add to the ways what has been done since, each of which only grows.

        Args:
            shares: Changes of the lengths that nothing states, over the largest allowed.
            t: Time [s].
            least: In which rows are as near as before it waits [s].
        """
        led = self.hold_from if "time" in self.given else self.led_until
        until = t if led is None else led
        # Rows are as near at first as before it waits, and as many each time that it has waited
        # e times as long: few grains may rattle for long.
        whole = max(until - self.begun, self.stage.hold, least)
        waited = math.log1p((t - until) / whole) if whole > 0.0 else 0.0
        now = [self.s, max(shares, default=0.0), waited, *self.parts]
        self.ways = [float(max(a, b)) for a, b in zip(self.ways, now, strict=True)]

    def is_over(self, t):
        """Whether it is over at the time ``t`` [s]."""
        return self.hold_from is not None and t - self.hold_from >= self.stage.hold

    def progress(self, t):
        """How far it has come, from 0 to 1, less than 1: it is not over."""
        leading = [self.s] if self.ends else []
        led = min(max(max([*leading, *self.parts], default=0.0), 0.0), 1.0)
        # Where it waits it stays just below what a row or a state is due at.
        done, hold = led * (1.0 - 1e-9), self.stage.hold
        if hold > 0.0:
            held = 0.0 if self.hold_from is None else (t - self.hold_from) / hold
            done = 0.5 * (done if self.hold_from is None else 1.0) + 0.5 * min(held, 1.0)
        return min(done, 1.0 - 1e-9)
