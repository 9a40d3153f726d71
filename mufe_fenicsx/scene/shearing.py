"""`shear` and `turn` of a stage: walls that move along themselves."""

import math
from dataclasses import dataclass

from ..errors import InputError
from ..units import check_keys, require, setting

#: Platens that may turn.
TURNING = ("top", "bottom")


class Along:
    """What both have in common."""

    rate: float | None

    @property
    def target(self) -> float | None:
        """What is to be reached; None where it goes on at a rate."""
        raise NotImplementedError

    @property
    def leads(self) -> bool:
        """Whether there is something to reach."""
        return self.target is not None


@dataclass(frozen=True)
class Shear(Along):
    """Simple shear of a box: its top moves along x, the walls across x tilt along with it.

    γ is the way of the top along x over the height, the tangent of the tilt.
    """

    xz: float | None = setting(None, "-", "γ to reach; then the top rests", gt=-10, lt=10)
    rate: float | None = setting(None, "s^-1", "of γ: alone, all stage long; else at most")

    def __post_init__(self):
        check_keys(self)
        _check_rate(self, "xz")

    @property
    def target(self) -> float | None:
        """γ to reach."""
        return self.xz


@dataclass(frozen=True)
class Turn(Along):
    """Torsion of a cylinder or a hollow one: a platen turns about the axis.

    The angle is that of the top against the bottom, right-handed about z, whichever of both turns.
    """

    angle: float | None = setting(
        None,
        "rad",
        "to reach, since the start of the test; then the platen rests",
        gt=-1e4,
        lt=1e4,
        usual=(0.0, 2.0 * math.pi),
    )
    rate: float | None = setting(None, "rad/s", "alone, all stage long; else at most")
    wall: str = setting("top", "", 'platen that turns: "top" or "bottom"', allowed=TURNING)

    def __post_init__(self):
        check_keys(self)
        _check_rate(self, "angle")

    @property
    def target(self) -> float | None:
        """Angle to reach [rad]."""
        return self.angle


def _check_rate(given, name):
    """Raise InputError unless there is a target, with a rate above zero, or a rate alone."""
    if given.target is None:
        if given.rate is None:
            raise InputError(f"{name} is missing, expected it or a rate")
    elif given.rate is not None:
        require(given.rate > 0.0, "rate", given.rate, f"> 0 beside {name}")
