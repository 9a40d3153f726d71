"""The present stage of a test: what it began with, how far it has come."""

from dataclasses import dataclass, field

from ..state import Stateful
from .waiting import Waiting


@dataclass
class PresentStage(Stateful):
    """What a stage began with, and how far it has come; the same on all ranks."""

    STATE = {
        "common": (
            "begun", "length0", "places0", "stress0", "held", "ways", "values0", "s", "settled",
            "hold_from", "brake_from", "led_until",
        )
    }  # fmt: skip

    begun: float  #: time of its start [s]
    length0: list  #: distances of opposite walls then [m]
    places0: list  #: how far in planes stood then [m]
    stress0: list  #: stress of each axis then [Pa]
    held: list  #: stress that each axis held then [Pa], or None
    ways: list  #: those by which rows fall due, each of which only grows
    values0: dict = field(default_factory=dict)  #: what `until` can name, at its start
    s: float = 0.0  #: how far along the line to its stresses and strains, from 0 to 1
    settled: float | None = None  #: time since when all is within its tolerance [s]
    hold_from: float | None = None  #: time at which `hold` began [s]
    brake_from: float | None = None  #: time at which a value of `until` was passed [s]
    led_until: float | None = None  #: time at which walls had reached what they go to [s]
    waiting: Waiting = field(default_factory=Waiting)  #: begins anew where a run goes on
