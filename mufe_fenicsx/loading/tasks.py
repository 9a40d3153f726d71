"""What the walls across one axis do in a stage of a test, each kind a small class.

    Rest        they stand still
    Carry       a servo takes them to a stress and keeps it
    Travel      they go along a curve of lengths
    Drive       their length changes at a speed
    KeepVolume  they keep the volume of the sample, whatever the other axes do

How far a stage has come along its line is s, from 0 to 1. What a wall is to carry at s is

    σ*(s) = first + s way,

its two numbers constant for a stress that is stated, and functions of the vertical stress that the
platens measure for a mean stress p or a ratio σside/σz that is kept.
"""

import math
from dataclasses import dataclass

import numpy as np

#: Walls that hold a stress may move so many times faster than `loading.speed`.
HOLDING = 4.0
#: Part of the way along the line while a wall that is to carry a stress has not met the sample.
UNMET = 0.2
#: Part of a length to which it is reached.
EXACT = 1e-9


@dataclass(frozen=True)
class WallsNow:
    """What the walls are like before a step."""

    lengths: np.ndarray  #: along the axes [m], shape (num_axes,)
    axis_stress: np.ndarray  #: mean of the walls of each axis [Pa], shape (num_axes,)
    stress: np.ndarray  #: of each wall as its servo takes it (Gauges.led) [Pa], (num_walls,)
    stiffness: np.ndarray  #: of the contacts on each wall [N/m], shape (num_walls,)
    gain: np.ndarray  #: of their servos [m/(s Pa)], shape (num_walls,)
    moved: np.ndarray  #: how far planes have come in since the stage began [m], (num_walls,)
    dt: float  #: of the coming step [s]


@dataclass(frozen=True)
class Pace:
    """How fast lengths change in the coming step."""

    speed: float  #: `loading.speed` [m/s]
    fastest: float  #: the speed of the test: that, or a larger one that keeps it quasi-static [m/s]
    factor: float  #: part of its speed that a length has, by ramps and the quasi-static control
    ramp: float  #: strain over which speeds fall before a length is reached
    leading: bool  #: whether the stage still goes on to what it is to reach


# --- stresses to carry --------------------------------------------------------------------


@dataclass(frozen=True)
class Straight:
    """From one stress to another."""

    first: float  #: [Pa]
    last: float  #: [Pa]

    def line(self, stress):
        """Stress at s = 0 and how much more it is at s = 1 [Pa], at stresses along the axes."""
        return self.first, self.last - self.first


@dataclass(frozen=True)
class MeanStress:
    """Of a side, so that the mean stress goes straight from p0 to p1: σ = (3 p - σz)/2.

    Sides that differ at the start become equal along the line.
    """

    first: float  #: p0 [Pa]
    last: float  #: p1 [Pa]
    apart: float  #: stress of the side less the mean of both, at the start [Pa]

    def line(self, stress):
        """As :meth:`Straight.line`."""
        first = 0.5 * (3.0 * self.first - stress[-1]) + self.apart
        return first, 1.5 * (self.last - self.first) - self.apart


@dataclass(frozen=True)
class Ratio:
    """Of a side, so that σside/σz goes straight from one value to another."""

    first: float
    last: float

    def line(self, stress):
        """As :meth:`Straight.line`."""
        return self.first * stress[-1], (self.last - self.first) * stress[-1]


# --- lengths to go along ------------------------------------------------------------------


@dataclass(frozen=True)
class StraightLengths:
    """From one length to another."""

    first: float  #: [m]
    last: float  #: [m]

    @property
    def way(self):
        """Largest change of the length over that of s [m]."""
        return abs(self.last - self.first)

    def length(self, s):
        """Length at s [m]."""
        return self.first + s * (self.last - self.first)

    def places(self, s):
        """How far each wall has come in at s [m]; None: all alike."""
        return None


# --- tasks --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Task:
    """What all kinds have in common; alone it is that of walls at rest."""

    axis: int
    walls: tuple  #: numbers of those that move
    #: Speed of each of them over that of the length, which it shortens; below 0 where a wall that
    #: comes towards the sample makes the length longer.
    share: float
    across: tuple  #: numbers of all walls across the axis

    goes = False  #: whether it goes along the line of the stage
    ends = False  #: whether the stage ends when that is done
    servo = False  #: whether walls follow a stress
    free = False  #: whether nothing says what the length is to be
    at_speed = False  #: whether it has a speed all stage long
    driven = False  #: whether that is not zero
    keeps_volume = False  #: whether it goes with the other axes

    @property
    def leads(self):
        """Whether the stage states where it goes."""
        return self.ends or self.at_speed

    def target(self, s, stress):
        """Stress to carry at s [Pa], by those along the axes; None where that is free."""
        return None

    def furthest(self, s, now, pace):
        """How far along the line its walls can go in the coming step."""
        return 1.0

    def is_there(self, means, axis_means, lengths, tolerance):
        """Whether its walls have what they are to reach or to hold.

        Args:
            means: Stress of each wall as its servo takes it, mean over the time of a wave [Pa].
            axis_means: The same of the axes [Pa].
            lengths: Along the axes [m].
            tolerance: Of a stress, over that stress.
        """
        return True

    def speeds(self, s, now, pace, closing=None):
        """Speeds of its walls towards the sample in the coming step [m/s]: one, or one each.

        Args:
            s: How far along the line it goes.
            now: :class:`WallsNow`.
            pace: :class:`Pace`.
            closing: Speeds at which the other axes shorten [m/s], (num_axes,), for what goes with
                them.
        """
        return 0.0


class Rest(Task):
    """Its walls stand still."""


@dataclass(frozen=True)
class Carry(Task):
    """A servo takes its walls along a line of stresses."""

    law: Straight | MeanStress | Ratio
    speed: float = 0.0  #: of the length on the way there, at most [m/s]
    goes: bool = False
    ends: bool = False

    servo = free = True

    def target(self, s, stress):
        """As :meth:`Task.target`."""
        first, way = self.law.line(stress)
        return first + s * way

    def furthest(self, s, now, pace):
        """As far as its walls need no more than their speed."""
        if not self.goes:
            return 1.0
        first, way = self.law.line(now.axis_stress)
        most, found = self.speed * pace.factor * abs(self.share), 1.0
        for w in self.walls:
            if not now.stiffness[w] > 0.0:
                # Those that have met the sample press a little, and stay.
                found = min(found, UNMET)
            elif way != 0.0:
                come = (now.stress[w] - first) * math.copysign(1.0, way)
                found = min(found, (come + most / now.gain[w]) / abs(way))
        return found

    def is_there(self, means, axis_means, lengths, tolerance):
        """Whether each wall across the axis is within the tolerance of the last stress."""
        target = self.target(1.0, axis_means)
        off = max(abs(means[wall] - target) for wall in self.across)
        return bool(off <= tolerance * target)

    def speeds(self, s, now, pace, closing=None):
        """Those of the servo; walls that have not met the sample come on to it."""
        most, free, share = HOLDING * pace.fastest, pace.speed, abs(self.share)
        first, way = self.law.line(now.axis_stress)
        if self.ends and pace.leading:
            free = self.speed * pace.factor
            if s < 1.0 and way != 0.0:
                most = free
        target = first + s * way
        found = []
        for w in self.walls:
            if now.stiffness[w] > 0.0:
                v = now.gain[w] * (target - now.stress[w])
                found.append(min(max(v, -most * share), most * share))
            else:  # on towards the sample, which it meets with no more than it shall carry
                found.append(min(share * free, now.gain[w] * max(first, first + way)))
        return found


@dataclass(frozen=True)
class Travel(Task):
    """Its walls go along a curve of lengths."""

    path: object  #: such as :class:`StraightLengths`
    first: float  #: length at the start [m]
    speed: float  #: of the length, at most [m/s]

    goes = leads = True

    @property
    def ends(self):
        """Whether there is a way to go: what is there already ends nothing that others do."""
        return self.path.way > EXACT * self.first

    def furthest(self, s, now, pace):
        """As far as the speed lets it, which falls with the root of what is left at the end."""
        way = self.path.way
        if not way > 0.0:
            return 1.0
        most = self.speed * pace.factor
        left = (1.0 - s) * way / (pace.ramp * self.first) if pace.ramp > 0.0 else 1.0
        return s + most * math.sqrt(min(left, 1.0)) * now.dt / way

    def is_there(self, means, axis_means, lengths, tolerance):
        """Whether the last length is reached."""
        length = lengths[self.axis]
        return bool(abs(length - self.path.length(1.0)) <= EXACT * length)

    def speeds(self, s, now, pace, closing=None):
        """To the length at the end of the step, or each wall to its place.

        A step that turned out shorter than foreseen is made up for at the speed that it may have.
        """
        if not pace.leading:
            return 0.0
        places = self.path.places(s)
        if places is not None:
            v = (places - now.moved[list(self.walls)]) / now.dt
            return np.clip(v, -self.speed, self.speed)
        v = (now.lengths[self.axis] - self.path.length(s)) / now.dt
        return self.share * min(max(v, -self.speed), self.speed)


@dataclass(frozen=True)
class Drive(Task):
    """Its length changes at a speed until the stage ends."""

    speed: float  #: at which the length shortens [m/s]

    free = at_speed = True

    @property
    def driven(self):
        """Whether its speed is not zero."""
        return bool(self.speed)

    def speeds(self, s, now, pace, closing=None):
        """Its speed, but for the ramps."""
        return self.share * self.speed * pace.factor if pace.leading else 0.0


@dataclass(frozen=True)
class KeepVolume(Task):
    """Its walls go with the others so that the volume stays what it was.

    The volume is proportional to the product of lengths along three directions. Those that
    follow change alike,

        L_a = L_a0 (Π L_l0/L_l)^(1/n),

    the product over the directions that are led, n those that follow.
    """

    first: tuple  #: lengths along the axes at the start [m]
    led: tuple  #: axes of the directions that are led
    num: int  #: of directions that follow

    keeps_volume = True

    def speeds(self, s, now, pace, closing=None):
        """To the length that keeps the volume at the end of the step."""
        if not pace.leading:
            return 0.0
        shrunk = 1.0
        for a in self.led:
            shrunk *= self.first[a] / (now.lengths[a] - closing[a] * now.dt)
        wanted = self.first[self.axis] * shrunk ** (1.0 / self.num)
        return self.share * (now.lengths[self.axis] - wanted) / now.dt
