"""[[tool]] of a scene: rigid bodies whose motion is told, that hold a force, or are free."""

import math
from dataclasses import dataclass
from pathlib import Path

from ..container import WALLS
from ..errors import InputError
from ..materials.elastic import USUAL_RHO
from ..units import REQUIRED, check_keys, require, setting
from .tables import PLAUSIBLE_FRICTION

#: Degrees of freedom: along the axes, and turns about them.
FREEDOMS = ("x", "y", "z", "rx", "ry", "rz")


@dataclass(frozen=True)
class Tool:
    """[[tool]]: a rigid body from a file of its surface, beside the grains and the walls.

    It meets grains alone. Places and axes are those of the test, and the turn about a vector is
    right-handed, by its length.
    """

    name: str = setting(REQUIRED, "", "in history.csv: letters, digits and _")
    surface: Path = setting(REQUIRED, "", "file of its surface: STL, PLY, OBJ, OFF, VTK, MSH")
    unit: float = setting(1.0, "m", "length of one unit of that file", gt=0)
    thickness: float | None = setting(
        None, "m", "of the sheet behind an open surface; None: it is closed", gt=0
    )
    turned: tuple[float, float, float] = setting(
        (0.0, 0.0, 0.0),
        "rad",
        "turn of the surface about the origin of its file",
        shape=(3,),
        usual=(0.0, 2.0 * math.pi),
    )
    position: tuple[float, float, float] = setting(
        (0.0, 0.0, 0.0), "m", "where that origin is then", shape=(3,)
    )
    friction: float | None = setting(
        None, "-", "with grains; None: contact.wall_friction", ge=0, plausible=PLAUSIBLE_FRICTION
    )
    friction_kinetic: float | None = setting(
        None, "-", "while they slip; None: as contact, or friction", plausible=PLAUSIBLE_FRICTION
    )
    velocity: tuple[float, float, float] = setting(
        (0.0, 0.0, 0.0), "m/s", "of its point", shape=(3,)
    )
    angular_velocity: tuple[float, float, float] = setting(
        (0.0, 0.0, 0.0), "rad/s", "about its point", shape=(3,)
    )
    point: tuple[float, float, float] | None = setting(
        None, "m", "what it turns about, at the start; None: its centre of mass", shape=(3,)
    )
    path: Path | None = setting(
        None, "", "CSV file with columns time, x, y, z, rx, ry, rz; no velocities then"
    )
    free: str = setting("", "", 'what is not told: some of "x y z rx ry rz"; "": nothing')
    force: tuple[float, float, float] = setting(
        (0.0, 0.0, 0.0), "N", "along what is free", shape=(3,)
    )
    torque: tuple[float, float, float] = setting(
        (0.0, 0.0, 0.0), "N*m", "about what is free to turn", shape=(3,)
    )
    density: float = setting(
        7850.0, "kg/m^3", "of the body, where it is free", gt=0, usual=USUAL_RHO
    )

    def __post_init__(self):
        check_keys(self)
        plain = self.name.replace("_", "")
        if not (plain.isascii() and plain.isalnum()) or self.name in WALLS:
            raise InputError(
                f'name = "{self.name}", expected letters, digits and _, and no name of a wall'
            )
        for freedom in self.freedoms:
            require(freedom in FREEDOMS, "free", freedom, f"some of {' '.join(FREEDOMS)}")
        if self.friction_kinetic is not None:
            require(self.friction is not None, "friction_kinetic", self.friction_kinetic,
                    "a friction beside it")  # fmt: skip
            require(0 <= self.friction_kinetic <= self.friction, "friction_kinetic",
                    self.friction_kinetic, f"0 to friction = {self.friction}")  # fmt: skip

    @property
    def freedoms(self) -> tuple[str, ...]:
        """Degrees of freedom that are not told."""
        return tuple(self.free.replace(",", " ").split())
