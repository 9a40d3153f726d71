"""[loading] and [[stage]] of a scene: tests by stages, led by stress, strain or speed."""

from collections.abc import Iterable
from dataclasses import dataclass, field, fields, replace

from ..container import SHEARED
from ..errors import InputError
from ..units import REQUIRED, Key, check_keys, require, setting
from .shearing import Shear, Turn

#: Keys of a stage that say what the walls across one, two or three axes do.
AXIS_KEYS = ("x", "y", "z", "xy", "xz", "yz", "xyz", "r", "rz", "o", "i", "oi", "oiz")

#: Walls across an axis that may move.
MOVING = ("both", "min", "max")


@dataclass(frozen=True)
class Loading:
    """[loading]: what all stages of a test have in common."""

    speed: float = setting(
        REQUIRED, "m/s", "at which a length of the sample changes, at most", gt=0
    )
    ramp: float = setting(
        0.005, "-", "strain over which walls speed up, and slow down before a strain", ge=0, lt=1
    )
    tolerance: float = setting(0.01, "-", "of a stress that is held, over that stress", gt=0, lt=1)
    largest_strain: float = setting(
        0.25, "", "of an axis without a strain to reach in a stage; then it fails", gt=0, lt=1
    )

    def __post_init__(self):
        check_keys(self)


@dataclass(frozen=True)
class Axis:
    """What the walls across an axis do in a stage: one of stress and strain, or speed alone.

    Compression is positive. Strain is the shortening over the length at strain 0.
    """

    stress: float | None = setting(
        None, "Pa", "to reach, and to hold from then on", gt=0, expected="> 0 Pa (compression)"
    )
    strain: float | None = setting(None, "-", "to reach; then the walls rest", gt=-1, lt=1)
    speed: float | None = setting(None, "m/s", "of the length: alone, all stage long; else at most")
    walls: str = setting("both", "", 'walls that move: "both", "min" or "max"', allowed=MOVING)

    def __post_init__(self):
        check_keys(self)
        if self.stress is not None:
            require(self.strain is None, "strain", self.strain or 0.0, "none beside a stress")
        if self.speed is not None:
            if self.leads and self.speed <= 0:
                raise InputError(f"speed = {self.speed}, expected > 0 m/s beside what to reach")
            require(abs(self.speed) < 1e6, "speed", self.speed, "a speed of walls in m/s")
        if not self.leads and self.speed is None:
            raise InputError("stress is missing, expected a stress, a strain or a speed")

    @property
    def leads(self) -> bool:
        """Whether there is something to reach."""
        return self.stress is not None or self.strain is not None


@dataclass(frozen=True)
class Until:
    """What ends a stage: the first of these values that is passed, from either side.

    Stresses are those of the walls, the mean of both of an axis and over the time that a wave
    travels. Then the walls brake, over ``ramp``.
    """

    stress_x: float | None = setting(None, "Pa", "along x")
    stress_y: float | None = setting(None, "Pa", "along y")
    stress_z: float | None = setting(None, "Pa", "along z")
    stress_r: float | None = setting(
        None, "Pa", "of the side of a cylinder; of a hollow one the mean across it"
    )
    stress_o: float | None = setting(None, "Pa", "of the outer wall of a hollow cylinder")
    stress_i: float | None = setting(None, "Pa", "of its inner wall")
    stress_t: float | None = setting(None, "Pa", "mean around it, σθ")
    mean_stress: float | None = setting(
        None, "Pa", "p = (σx + σy + σz)/3; in a cylinder σx = σy = σr, in a hollow one σr and σθ"
    )
    deviator: float | None = setting(
        None, "Pa", "q = √(½((σx-σy)² + (σy-σz)² + (σz-σx)²) + 3τ²); τ that of the platens"
    )
    shear_xz: float | None = setting(None, "Pa", "τ of the platens of a box that is sheared")
    shear_tz: float | None = setting(None, "Pa", "τ of platens that turn")
    torque: float | None = setting(None, "N*m", "of platens that turn")
    gamma_xz: float | None = setting(None, "-", "γ of a box that is sheared")
    gamma_tz: float | None = setting(None, "-", "γ of platens that turn")
    twist: float | None = setting(None, "rad", "angle of platens that turn")
    strain_x: float | None = setting(None, "-", "along x")
    strain_y: float | None = setting(None, "-", "along y")
    strain_z: float | None = setting(None, "-", "along z")
    strain_r: float | None = setting(
        None, "-", "loss of diameter over the diameter; of a hollow cylinder of its thickness"
    )
    strain_o: float | None = setting(None, "-", "the same of its outer diameter")
    strain_i: float | None = setting(None, "-", "the same of its inner diameter")
    strain_t: float | None = setting(None, "-", "the same of the mean of both")
    strain_volume: float | None = setting(None, "-", "loss of volume over the volume at strain 0")
    time: float | None = setting(None, "s", "since the start of the stage", gt=0)

    def __post_init__(self):
        given = self.given
        if not given:
            raise InputError("stress_z is missing, expected at least one value that ends the stage")
        check_keys(self)
        for name, value in given.items():
            require(abs(value) < 1e30, name, value, "a finite number")

    @property
    def given(self) -> dict[str, float]:
        """The values that are stated, by name."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: value for name, value in values.items() if value is not None}


@dataclass(frozen=True)
class ToolMotion:
    """[stage.tools.NAME]: what a tool does from the start of a stage on; the rest goes on."""

    velocity: tuple[float, float, float] | None = setting(
        None, "m/s", "of its point, in later stages too", shape=(3,)
    )
    angular_velocity: tuple[float, float, float] | None = setting(
        None, "rad/s", "about its point", shape=(3,)
    )
    force: tuple[float, float, float] | None = setting(None, "N", "along what is free", shape=(3,))
    torque: tuple[float, float, float] | None = setting(
        None, "N*m", "about what is free to turn", shape=(3,)
    )
    ramp: float = setting(0.0, "s", "time in which it changes smoothly", ge=0)

    def __post_init__(self):
        check_keys(self)

    @property
    def rates(self):
        """Velocity and rate of turning, (6,); None where both go on."""
        return _six(self.velocity, self.angular_velocity)

    @property
    def loads(self):
        """Force and torque, (6,); None where both go on."""
        return _six(self.force, self.torque)


def _six(first, second):
    """Two vectors in a row, zero where one is None; None where both are."""
    none = (0.0, 0.0, 0.0)
    return None if first is None and second is None else (*(first or none), *(second or none))


@dataclass(frozen=True)
class Stage:
    """[[stage]]: one part of the test. Axes that it leaves out go on as they were.

    That is: held at the stress that they had reached, or at rest.
    """

    name: str = setting(
        "", "", 'in history.csv; left out: "seating" where zero = true, else "stage N"'
    )
    x: Axis | None = setting(None, "", "what the walls across x do")
    y: Axis | None = setting(None, "", "what the walls across y do")
    z: Axis | None = setting(None, "", "what the walls across z do")
    xy: Axis | None = setting(None, "", "the same for x and y")
    xz: Axis | None = setting(None, "", "the same for x and z")
    yz: Axis | None = setting(None, "", "the same for y and z")
    xyz: Axis | None = setting(None, "", "the same for all three")
    r: Axis | None = setting(None, "", "what the side of a cylinder does; lengths are diameters")
    rz: Axis | None = setting(None, "", "the same for r and z")
    o: Axis | None = setting(
        None, "", "what the outer wall of a hollow cylinder does; lengths are diameters"
    )
    i: Axis | None = setting(None, "", "what its inner wall does, likewise")
    oi: Axis | None = setting(None, "", "the same for o and i")
    oiz: Axis | None = setting(None, "", "the same for o, i and z")
    shear: Shear | None = setting(None, "", "way of the top of a box along x")
    turn: Turn | None = setting(None, "", "turn of a platen of a cylinder about its axis")
    until: Until | None = setting(
        None, "", "what ends the stage, if not what its axes are to reach"
    )
    hold: float = setting(
        0.0, "s", "time at its end in which stresses are held and all else rests", ge=0
    )
    zero: bool = setting(False, "", "strains are counted from the end of this stage")
    tools: dict[str, ToolMotion] = field(
        default_factory=dict, metadata={"key": Key({}, "", "what tools do from its start on")}
    )

    def __post_init__(self):
        check_keys(self)
        seen = {}
        for key in AXIS_KEYS:
            for axis in key if getattr(self, key) is not None else "":
                if seen.setdefault(axis, key) != key:
                    raise InputError(f"{key} is given, expected {axis} once: {seen[axis]} has it")
        moves = [*self.axes.values(), *self.along.values()]
        if moves and self.until is None and not any(move.leads for move in moves):
            raise InputError("until is missing, expected what ends a stage that has speeds alone")
        if not moves and self.until is None and self.hold == 0:
            raise InputError("hold = 0, expected a time > 0 s where no axis and no until is given")

    @property
    def axes(self) -> dict[str, Axis]:
        """The axes that it states: "x", "y", "z", "r" -> :class:`Axis`."""
        return {a: getattr(self, key) for key in AXIS_KEYS if getattr(self, key) for a in key}

    @property
    def along(self) -> dict[str, Shear | Turn]:
        """What moves walls along themselves, by its key."""
        return {key: getattr(self, key) for key in SHEARED if getattr(self, key) is not None}


def named(stages: Iterable[Stage]) -> tuple[Stage, ...]:
    """The stages, each with its name filled in. Raises InputError where a name is there twice."""
    found = []
    for number, stage in enumerate(stages, start=1):
        name = stage.name or ("seating" if stage.zero else f"stage {number}")
        if name in [other.name for other in found]:
            raise InputError(f'stage[{number}].name = "{name}", expected names that differ')
        if not name.isprintable():
            raise InputError(f"stage[{number}].name = {name!r}, expected one line of text")
        found.append(replace(stage, name=name))
    return tuple(found)
