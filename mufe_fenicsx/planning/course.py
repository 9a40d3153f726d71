"""How far, how high and how long a test loads its sample, as far as that is known beforehand.

Of a test by stages strains that stresses make, and stresses that strains make, follow from a linear
sample of the stiffness M = ρ c² along each axis, c the speed of `wave_speed` and ρ the density of
its rock times ``SOLID``, or is stated. Sides that keep the volume go the other way as z, those
that keep p or a ratio of stresses have the stress that this asks for.

Inertia adds the stress ρ c v at the speed v. At a strain ε it is the part v/(c ε) of that which the
strain has made. At a stress it is the larger the stiffer the sample is: there c is that of
elastic balls in contact, the stiffest that grains are. All parts are judged at their ends.
"""

import math
from dataclasses import dataclass

import numpy as np

from ..loading.measured_paths import measured_paths, read_motions
from .errors import COORDINATION, PACKING, SOLID, flows

#: Values of `until` that are stresses, beside those named so.
STRESSES = "deviator", "q", "pore_pressure"
#: Shear strain over angle of platens that turn, R/H: a guess, sizes are not known here.
ARM = 0.5
#: Inner over outer diameter of a hollow cylinder, likewise.
HOLE = 0.6


@dataclass(frozen=True)
class Part:
    """A stage of loading after the sample is seated.

    Where a stage unloads, its ``level`` is that of its beginning; inf where nothing is loaded.
    """

    name: str
    way: float  #: largest change of strain along an axis
    level: float  #: strain at which inertia is the same part of the stress as at its end
    stated: float | None  #: speed that the stage states itself [m/s]
    waits: float  #: time that does not depend on the speed of the test [s]
    slows: bool  #: whether it comes to rest at a strain
    rate: float | None = None  #: of shear strain that the stage states itself [1/s]


@dataclass(frozen=True)
class Course:
    """The test of a scene as a plan needs it."""

    key: str  #: of the speed of loading in the scene: "table.key"
    speed: float  #: that speed [m/s]
    ramp: float  #: strain over which it is reached
    strain: float  #: largest strain
    seating_stress: float  #: [Pa]
    seating_speed: float  #: [m/s]
    parts: tuple  #: of :class:`Part`
    presses: bool = True  #: whether walls load the sample; without, tools do, or nothing

    @property
    def level(self):
        """Least load at the end of a part, as a strain: inertia is the most of it there."""
        return min(part.level for part in self.parts)

    def too_fast(self, wave, time):
        """The first part whose stated speed leaves less time than that, or None.

        Args:
            wave: Speed of waves [m/s].
            time: Of loading over that of a wave.
        """
        return next((p for p in self.parts if p.stated and p.level * wave < p.stated * time), None)


def wave_speed(scene):
    """Speed of waves through the loaded sample [m/s].

    That of the sample's stiffness, where the scene states it. Else a guess: where contacts do not
    flow that of balls in contact under the largest stress that stages ask for, where they ask for
    one; of others a part of that of their rock.
    """
    stress = _largest_stress(scene.stages)
    if scene.modulus is not None or (stress > 0.0 and not flows(scene.material, stress)):
        return speed_under(scene, stress)
    return PACKING * scene.material.wave_speed


def speed_under(scene, stress):
    """Speed of waves at a stress [m/s]: of the stated stiffness, else of elastic balls."""
    if scene.modulus is not None:
        return math.sqrt(scene.modulus / (SOLID * scene.material.rho))
    return elastic_wave_speed(scene.material, stress)


def _largest_stress(stages):
    """The largest stress that stages ask for, at their ends or on the way [Pa]; 0: none."""
    found = [0.0]
    for stage in stages:
        found += [axis.stress for axis in stage.axes.values()]
        found += [stage.p, *(stage.stresses or ())]
        given = {} if stage.until is None else stage.until.given
        found += [value for name, value in given.items() if "stress" in name or name in STRESSES]
    return max(abs(value) for value in found if value is not None)


def elastic_wave_speed(material, stress):
    """Speed of waves through a random packing of elastic balls under a mean stress [m/s].

        K = (1/6) (3 (1 - φ)² n² p Ec²/π²)^(1/3),  G = 3/5 K (5 + r)/(2 + r),  r = ν/(1 - ν),

    balls so rough that they do not slip, n contacts each, 1 - φ = ``SOLID``, Ec = E/(1 - ν²).

    Args:
        material: Of the balls.
        stress: p [Pa].

    Source: K. Walton, Journal of the Mechanics and Physics of Solids 35, 1987, 213-226.
    """
    square = (SOLID * COORDINATION * material.contact_modulus / math.pi) ** 2
    K = (3.0 * square * stress) ** (1 / 3) / 6.0
    r = material.nu / (1.0 - material.nu)
    G = 0.6 * K * (5.0 + r) / (2.0 + r)
    return math.sqrt((K + 4.0 / 3.0 * G) / (SOLID * material.rho))


def course_of(scene):
    """The :class:`Course` of a scene."""
    o, loading = scene.oedometer, scene.loading
    if o is not None:
        part = Part("loading", o.strain, o.strain, None, 0.0, False)
        return Course("oedometer.speed", o.speed, o.ramp, o.strain, o.seating_stress,
                      o.seating_speed, (part,))  # fmt: skip
    modulus = SOLID * scene.material.rho * wave_speed(scene) ** 2
    zeros = [number for number, stage in enumerate(scene.stages) if stage.zero]
    seated = max(zeros, default=-1)
    motions = read_motions(scene.stages, scene.container.kind)
    container, parts, furthest = scene.container.kind, [], 0.0
    stress, strain, shear = *np.zeros((2, len(container.axes))), 0.0
    seating_stress, seating_speed = 0.0, _speed(scene.stages[0]) or loading.speed
    for number, stage in enumerate(scene.stages):
        paths = _paths(motions.get(number), container)
        new_stress, new_strain = _after(stage, paths, container, stress, strain, modulus)
        sheared, rate = _shear_after(stage, shear)
        way = max(float(np.abs(new_strain - strain).max()), abs(sheared - shear))
        way = max([way, *(path.way for path in paths.values())])
        # Where it unloads, inertia counts over the load that it begins with.
        largest = max(float(stress.max()), float(new_stress.max()))
        stress, strain, shear = new_stress, new_strain, sheared
        if number <= seated:
            seating_stress, seating_speed = float(stress.max()), _speed(stage) or loading.speed
            strain = 0.0 * strain if number == seated else strain
            continue
        until = None if stage.until is None else stage.until.time
        level = largest / modulus
        if largest > 0.0 and _is_led_by_stress(stage):
            density, wave = SOLID * scene.material.rho, wave_speed(scene)
            level = largest / (density * wave * speed_under(scene, largest))
        furthest = max(furthest, float(np.abs(strain).max()))
        slows = bool(paths) or any(axis.strain is not None for axis in stage.axes.values())
        slows |= any(move.leads for move in stage.along.values())
        moves = way > 0.0
        loads = moves and level > 0.0
        parts.append(
            Part(stage.name, way, level if loads else math.inf, _speed(stage) if moves else None,
                 stage.hold + (until or 0.0) * (not moves), slows, rate)
        )  # fmt: skip
    loaded = [part for part in parts if part.way > 0.0]
    if not loaded and seated < 0 and scene.tools:
        return Course("loading.speed", loading.speed, loading.ramp, 1e-6, 0.0, loading.speed,
                      tuple(parts), presses=False)  # fmt: skip
    if not loaded:  # seating is all that there is
        level = max(seating_stress / modulus, 1e-6)
        parts = [Part(scene.stages[-1].name, level, level, None, 0.0, False)]
        furthest = level
    presses = any(math.isfinite(part.level) for part in parts)
    return Course("loading.speed", loading.speed, loading.ramp, furthest or 1e-6, seating_stress,
                  seating_speed, tuple(parts), presses)  # fmt: skip


def _paths(motion, container):
    """Shortenings of axes of length 1 that follow a file, by the numbers of the axes."""
    ones = [1.0] * len(container.axes)
    return measured_paths(motion, container, ones, ones)


def _is_led_by_stress(stage):
    """Whether a stage ends at a stress."""
    values = {} if stage.until is None else stage.until.given
    by_stress = any("stress" in name or name in STRESSES for name in values)
    by_stress |= stage.stresses is not None
    return by_stress or any(axis.stress is not None for axis in stage.axes.values())


def _speed(stage):
    """The slowest speed that a stage states for what it moves [m/s]; None: it states none."""
    stated = [abs(axis.speed) for axis in stage.axes.values() if axis.speed]
    return min(stated, default=None)


def _shear_after(stage, shear):
    """Shear strain after a stage, and the rate that the stage states [1/s], None where it does not.

    Where `until` names nothing of it, it goes on at its rate for the time there, or not known.
    """
    for key, move in stage.along.items():
        per_angle = 1.0 if key == "shear" else ARM
        rate = None if move.rate is None else abs(move.rate) * per_angle
        given = {} if stage.until is None else stage.until.given
        ends = [] if move.target is None else [move.target * per_angle]
        ends += [given[name] for name in ("gamma_xz", "gamma_tz") if name in given]
        ends += [given["twist"] * per_angle] if "twist" in given else []
        ends += [shear + move.rate * per_angle * given["time"]] if _runs(move, given) else []
        return min(ends, key=lambda end: abs(end - shear), default=shear), rate
    return shear, None


def _runs(move, given):
    """Whether a move goes at a rate for a time."""
    return move.target is None and "time" in given


def _volumetric(container, strain):
    """Sum of the strains along three directions; the hole of a hollow cylinder is ``HOLE``."""
    lengths = np.array([1.0, HOLE, 1.0]) if container.across else None
    return float(container.three_strains(strain, lengths).sum())


def _after(stage, paths, container, stress, strain, modulus):
    """Stresses [Pa] and strains along the axes of a container after a stage, from those before."""
    change, sides = 0.0 * strain, np.sign(container.shortening)
    led = [a for a, name in enumerate(container.axes) if a in paths or name in stage.axes]
    for a in led:
        axis = stage.axes.get(container.axes[a])
        if a in paths:
            change[a] = 1.0 - paths[a].length(1.0)
        elif axis.stress is not None:
            change[a] = sides[a] * (axis.stress - stress[a]) / modulus
        else:
            ways = [] if axis.strain is None else [axis.strain - strain[a]]
            ways += _ways_until(stage, container, a, stress, strain, modulus)
            change[a] = min(ways, key=abs, default=0.0)
    others = [a for a in range(len(change)) if a not in led]
    if stage.undrained:
        three = container.three
        following = sum(a in others for a in three)
        change[others] = -sum(change[a] for a in three if a in led) / following
    elif stage.stresses is not None or stage.p is not None or stage.eta is not None:
        wanted = _wanted(stage, stress + modulus * change)
        for a in others:
            change[a] = (wanted[a] - stress[a]) / modulus
    return np.maximum(stress + modulus * sides * change, 0.0), strain + change


def _wanted(stage, stress):
    """Stresses that p, q and eta ask for [Pa], of those where z has gone so far already."""
    vertical = stress[-1]
    if stage.stresses is not None:
        side, vertical = stage.stresses
    elif stage.eta is not None:
        side = vertical * (3.0 - stage.eta) / (3.0 + 2.0 * stage.eta)
    else:
        side = 0.5 * (3.0 * stage.p - vertical)
    return np.append(np.full(len(stress) - 1, side), vertical)


def _ways_until(stage, container, a, stress, strain, modulus):
    """Changes of strain along an axis at which values of `until` are passed, other axes held.

    Those of an undrained stage go the other way as this one: q grows by half as much again, and
    the pore pressure by half as much, as its stress.
    """
    name, given = container.axes[a], {} if stage.until is None else stage.until.given
    others = float(np.delete(stress, a).mean())
    q, more = stress[a] - others, 1.5 if stage.undrained else 1.0
    ends = {
        f"stress_{name}": lambda value: value,
        "deviator": lambda value: stress[a] + (value - q) / more,
        "q": lambda value: stress[a] + (value - q) / more,
        "mean_stress": lambda value: 3.0 * value - 2.0 * others,
        "pore_pressure": lambda value: stress[a] + 2.0 * value,
    }
    side = math.copysign(modulus, container.shortening[a])
    ways = [(end(given[key]) - stress[a]) / side for key, end in ends.items() if key in given]
    if f"strain_{name}" in given:
        ways.append(given[f"strain_{name}"] - strain[a])
    if "strain_volume" in given:
        ways.append(given["strain_volume"] - _volumetric(container, strain))
    return ways
