"""[loading] and [[stage]] of a scene: tests by stages, led by stress, strain or speed."""

from collections.abc import Iterable
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path

from ..container import SHEARED
from ..errors import InputError
from ..units import REQUIRED, Key, check_keys, require, setting
from .shearing import Shear, Turn

#: Keys of a stage that say what the walls across one, two or three axes do.
AXIS_KEYS = ("x", "y", "z", "xy", "xz", "yz", "xyz", "r", "rz", "o", "i", "oi", "oiz")

#: Walls across an axis that may move.
MOVING = ("both", "min", "max")
#: Cycles of a test.
MOST_CYCLES = 10_000
#: Stages of a test, each cycle counted.
MOST_STAGES = 10_000


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
    q: float | None = setting(None, "Pa", "σz - (σx + σy)/2; below 0 in extension")
    pore_pressure: float | None = setting(
        None, "Pa", "of undrained stages: side stress at the start of the first, less that now"
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

    @cached_property
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
        """Velocity and rate of turning, (6,); None of what goes on."""
        return _six(self.velocity, self.angular_velocity)

    @property
    def loads(self):
        """Force and torque, (6,); None of what goes on."""
        return _six(self.force, self.torque)


def _six(*vectors):
    """Two vectors in a row, each of three times None where it is None."""
    return tuple(value for vector in vectors for value in vector or (None,) * 3)


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
    p: float | None = setting(None, "Pa", "mean stress to go to; two of p, q, eta, or p with z")
    q: float | None = setting(None, "Pa", "deviator σz - σside to go to; below 0: extension")
    eta: float | None = setting(None, "-", "stress ratio q/p to go to; alone with z", gt=-1.5, lt=3)
    undrained: bool = setting(
        False, "", "walls that the stage does not state keep the volume; needs a strain or a speed"
    )
    follow: Path | None = setting(
        None, "", "CSV file with measured strains, displacements or places of walls over time"
    )
    row: int | None = setting(
        None, "", "of that file to go to, from the row before; left out: all rows", ge=2
    )
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
    repeat: int | None = setting(
        None, "", "number of cycles, of the stages from repeat_from to this one",
        ge=1, le=MOST_CYCLES,
    )  # fmt: skip
    repeat_from: str | None = setting(
        None, "", "name of the first stage of a cycle; left out: this one"
    )

    def __post_init__(self):
        check_keys(self)
        seen = {}
        for key in AXIS_KEYS:
            for axis in key if getattr(self, key) is not None else "":
                if seen.setdefault(axis, key) != key:
                    raise InputError(f"{key} is given, expected {axis} once: {seen[axis]} has it")
        self._check_stresses()
        if self.row is not None and self.follow is None:
            raise InputError(f"row = {self.row}, expected follow = a file beside it")
        if self.undrained:
            self._check_undrained()
        moves = [*self.axes.values(), *self.along.values()]
        leads = self.follow is not None or self.stresses is not None
        leads = leads or any(move.leads for move in moves)
        if moves and self.until is None and not leads:
            raise InputError("until is missing, expected what ends a stage that has speeds alone")
        if not moves and not leads and self.until is None and self.hold == 0:
            raise InputError("hold = 0, expected a time > 0 s where no axis and no until is given")
        if self.repeat is None and self.repeat_from is not None:
            raise InputError(
                f'repeat_from = "{self.repeat_from}", expected repeat = number of cycles beside it'
            )

    def _check_stresses(self):
        """Raise InputError where p, q and eta do not say one path."""
        given = [name for name in ("p", "q", "eta") if getattr(self, name) is not None]
        if not given:
            return
        if len(given) == 3:
            raise InputError(f"eta = {self.eta}, expected none beside p and q: it is q/p")
        if self.undrained:
            raise InputError(f"{given[0]} is given, expected none beside undrained = true")
        if len(given) == 2:
            for key in AXIS_KEYS:
                if getattr(self, key) is not None:
                    raise InputError(f"{key} is given, expected none beside {' and '.join(given)}")
            if self.follow is not None:
                raise InputError(f"follow is given, expected none beside {' and '.join(given)}")
            if self.eta == 0.0 and self.p is None:
                raise InputError("eta = 0.0, expected another one beside q: p is q/eta")
            side, vertical = self.stresses
            if min(side, vertical) <= 0.0:
                raise InputError(
                    f"{given[1]} = {getattr(self, given[1])}, expected stresses > 0 Pa: side "
                    f"p - q/3 = {side:.4g} Pa, vertical p + 2q/3 = {vertical:.4g} Pa"
                )
            return
        (name,) = given
        z = self.axes.get("z")
        led = self.follow is not None and not self.axes
        led = led or (set(self.axes) == {"z"} and z is not None and z.stress is None)
        if name == "q" or not led:
            beside = " or ".join(other for other in ("p", "q", "eta") if other != name)
            more = "" if name == "q" else ", or z alone with a strain or a speed"
            raise InputError(f"{name} is given, expected {beside} beside it{more}")
        if name == "p" and self.p <= 0.0:
            raise InputError(f"p = {self.p}, expected > 0 Pa (compression)")
        if name == "eta" and self.eta < 0.0:
            raise InputError(
                f"eta = {self.eta}, expected >= 0 beside z: sides that press more than z feed "
                "themselves; lead it by p and eta"
            )

    def _check_undrained(self):
        """Raise InputError where walls cannot keep the volume."""
        for name, axis in self.axes.items():
            if axis.stress is not None:
                raise InputError(
                    f"{name}.stress = {axis.stress}, expected a strain or a speed with undrained "
                    "= true: end it by until"
                )
        if not self.axes and self.follow is None:
            raise InputError("undrained = true, expected a strain or a speed of one axis beside it")

    @property
    def stresses(self) -> tuple[float, float] | None:
        """Side and vertical stress that two of p, q and eta say [Pa]; None without.

        σz = p + 2q/3 and σside = p - q/3.
        """
        p, q, eta = self.p, self.q, self.eta
        if p is not None and q is not None and eta is None:
            mean, deviator = p, q
        elif p is not None and q is None and eta is not None:
            mean, deviator = p, eta * p
        elif p is None and q is not None and eta is not None:
            mean, deviator = q / eta, q
        else:
            return None
        return mean - deviator / 3.0, mean + 2.0 * deviator / 3.0

    @property
    def axes(self) -> dict[str, Axis]:
        """The axes that it states: "x", "y", "z", "r" -> :class:`Axis`."""
        return {a: getattr(self, key) for key in AXIS_KEYS if getattr(self, key) for a in key}

    @property
    def along(self) -> dict[str, Shear | Turn]:
        """What moves walls along themselves, by its key."""
        return {key: getattr(self, key) for key in SHEARED if getattr(self, key) is not None}


def named(stages: Iterable[Stage]) -> tuple[Stage, ...]:
    """The stages in their order, each with its name filled in and cycles written out.

    Raises:
        InputError: A name is there twice, or a cycle cannot be.
    """
    found = []
    for number, stage in enumerate(stages, start=1):
        name = stage.name or ("seating" if stage.zero else f"stage {number}")
        if not name.isprintable():
            raise InputError(f"stage[{number}].name = {name!r}, expected one line of text")
        found.append(replace(stage, name=name))
    _check_names([stage.name for stage in found])
    written = _in_cycles(found)
    _check_names([stage.name for stage in written])
    return written


def _check_names(names):
    seen = set()
    for number, name in enumerate(names, start=1):
        if name in seen:
            raise InputError(f'stage[{number}].name = "{name}", expected names that differ')
        seen.add(name)


def _in_cycles(stages):
    """Stages with each cycle written out: "load", "unload", "load 2", "unload 2" and so on."""
    found, after = [], 0  # the first stage that no cycle has yet
    names = [stage.name for stage in stages]
    for number, stage in enumerate(stages):
        if stage.repeat is None:
            continue
        where = f"stage[{number + 1}].repeat"
        begin = stage.name if stage.repeat_from is None else stage.repeat_from
        if begin not in names[: number + 1]:
            raise InputError(
                f'{where}_from = "{begin}", expected the name of this stage or of one before it'
            )
        first = names.index(begin)
        if first < after:
            raise InputError(
                f'{where}_from = "{begin}", expected a stage after those of the cycles before'
            )
        cycle = [replace(one, repeat=None, repeat_from=None) for one in stages[first : number + 1]]
        if any(one.zero for one in cycle):
            raise InputError(f"{where} = {stage.repeat}, expected no stage with zero = true in it")
        found += stages[after:first] + cycle
        num = len(found) + (stage.repeat - 1) * len(cycle)
        if num > MOST_STAGES:
            raise InputError(
                f"{where} = {stage.repeat} of {len(cycle)} stages, expected at most {MOST_STAGES} "
                "stages in all"
            )
        for k in range(2, stage.repeat + 1):
            found += [replace(one, name=f"{one.name} {k}") for one in cycle]
        after = number + 1
    return (*found, *stages[after:])
