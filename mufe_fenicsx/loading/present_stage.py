"""The present stage of a test: what it began with, how far it has come, stresses of its walls."""

import math
from dataclasses import dataclass, field

import numpy as np

from ..state import Stateful


@dataclass
class PresentStage(Stateful):
    """What a stage began with, and how far it has come; the same on all ranks."""

    STATE = {
        "common": (
            "begun", "length0", "stress0", "ways", "values0", "s", "settled", "hold_from",
            "brake_from", "led_until",
        )
    }  # fmt: skip

    begun: float  #: time of its start [s]
    length0: list  #: distances of opposite walls then [m]
    stress0: list  #: stress of each axis then [Pa]
    ways: list  #: those by which rows fall due, each of which only grows
    values0: dict = field(default_factory=dict)  #: what `until` can name, at its start
    s: float = 0.0  #: how far along the line to its stresses and strains, from 0 to 1
    settled: float | None = None  #: time since when all is within its tolerance [s]
    hold_from: float | None = None  #: time at which `hold` began [s]
    brake_from: float | None = None  #: time at which a value of `until` was passed [s]
    led_until: float | None = None  #: time at which walls had reached what they go to [s]


class WallMeans(Stateful):
    """Mean stress of each wall over the time that a wave travels.

    Args:
        stress: At the start, of six walls [Pa].
        at: Time of that [s].
    """

    STATE = {"common": ("stress", "at")}

    def __init__(self, stress, at):
        self.stress, self.at = stress, at

    def add(self, stress, t, travel_time):
        """Take the stresses at the time ``t`` [s] into the means. Twice gives the same as once."""
        elapsed, self.at = t - self.at, t
        if elapsed > 0.0:  # not twice in the same state
            weight = 1.0 - math.exp(-elapsed / travel_time) if travel_time > 0.0 else 1.0
            mean = np.asarray(self.stress)
            self.stress = (mean + weight * (stress - mean)).tolist()
