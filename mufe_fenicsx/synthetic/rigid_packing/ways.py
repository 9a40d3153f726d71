"""Ways to a packing: compression to a pressure, to a void ratio, or settling under gravity."""

import copy
import math

import numpy as np

from ...errors import SolverError

#: Mean stress at which a packing by compression is done, over the modulus of contacts.
PRESSURE = 1e-4
#: Speed of grains that forget their lattice, and how far they go [mean diameters].
AGITATION, WANDER = 0.05, 3.0
#: Rates of the strain of each direction: while loose, then near the packing.
LOOSE_RATE, DENSE_RATE = 2e-3, 2e-4
#: Contacts over bodies at which the slower rate begins; 2 or more bear. With 1.5 inertia makes
#: rough grains denser; with fewer the way is longer, and some tens of equal spheres crystallise.
CROWDED = 1.0
#: Rate over the slower one, by the part of the pressure that lacks.
GAIN = 4.0
#: Drag of the motion relative to that of the container's strain.
DRAG = 0.003
#: A packing is at rest where forces balance to this part of those of contacts.
REST = 1e-3
#: Part of the pressure to which the servo holds each stress.
NEAR = 0.05
#: Steps in a row at rest that end a packing; between two looks at that.
CALM, LOOK = 200, 20
#: Rate at which the logarithm of friction falls on the way to a void ratio, and tries.
LOOSEN, TRIES = 1e-3, 8
#: Void ratio between two states on that way which are kept for further tries.
STRIDE = 0.01
#: Friction below this counts as none.
LEAST_FRICTION = 1e-3
#: Part of the pressure that grains have to bear in a container that is held.
STILL_BEARS = 0.1
#: Void ratios are reached to this.
TOLERANCE = 2e-3
#: Stress at the bottom of a heap over the modulus of contacts.
HEAP_STRESS = 5e-4
#: Drag in a heap over the root of gravity: grains fall no faster than from 12 diameters.
HEAP_DRAG = 0.2
#: Kinetic energy of a heap at rest over the weight of a grain times D.
STILL = 1e-5
#: After so many steps a packing has failed.
MAX_STEPS = 600_000


def compress(assembly, pressure=PRESSURE):
    """Compress grains of a gas until they bear a pressure at rest, in place.

    Args:
        assembly: :class:`~.assembly.Assembly`.
        pressure: [E], or one along each axis, shape (3,).

    Raises:
        SolverError: There was no rest.
    """
    stir(assembly)
    assembly.drag = DRAG
    crowded = 0
    while crowded < LOOK:  # in a row: a few grains that collide at the same time are no crowd
        assembly.step(np.full(3, LOOSE_RATE))
        crowd = assembly.contacts.num_closed >= CROWDED * assembly.bodies.num_bodies
        crowded = crowded + 1 if crowd else 0
        _check_steps(assembly, "while grains are apart")
    hold(assembly, pressure)


def stir(assembly):
    """Let grains fly and collide without loss until they have left their lattice, in place."""
    friction, assembly.friction, assembly.dashpots = assembly.friction, 0.0, False
    end = assembly.time + WANDER / AGITATION
    while assembly.time < end:
        assembly.step()
    assembly.friction, assembly.dashpots = friction, True


def hold(assembly, pressure):
    """Compress or expand until grains bear a pressure at rest, in place.

    Raises:
        SolverError: There was no rest.
    """
    calm = 0
    while calm < CALM:
        assembly.step(servo(assembly, pressure))
        calm = _calm(assembly, calm, pressure)
        part = assembly.pressure / np.mean(pressure)
        _check_steps(assembly, f"at the pressure {part:.3g} of the wanted")


def servo(assembly, pressure):
    """Rates of strain of the edges that bring their stresses nearer to the pressure, shape (3,).

    A cylinder stays one: its side follows the mean of both stresses across.
    """
    stress = assembly.axial_stresses
    return DENSE_RATE * np.clip(GAIN * (1 - stress / pressure), -1.0, 1.0)


def of_container(assembly):
    """Void ratio of the container, and the tolerance to which it is reached."""
    return assembly.void_ratio, TOLERANCE


def reach_void_ratio(assembly, void_ratio, pressure=PRESSURE, measure=of_container, held=False):
    """From a packing at rest to a void ratio by less and less friction.

    Under the pressure the packing gives way where friction falls. At the wanted void ratio grains
    are stopped, have their first friction again, and come to rest in the container as it is, or
    under the pressure where they would bear no tenth of it, or have to. A packing of few grains may
    fall together by more than the tolerance there; then it is tried anew, stopped so much earlier,
    or half way between the tries that came to rest on both sides.

    Args:
        assembly: :class:`~.assembly.Assembly`; it stays as it is.
        void_ratio: Wanted.
        pressure: As of :func:`compress`.
        measure: Gives the void ratio of an assembly that is meant, and its tolerance.
        held: The sample bears the pressure at its end.

    Returns:
        :class:`~.assembly.Assembly` at the void ratio.

    Raises:
        SolverError: The packing is denser from the start, or stays looser without friction; the
            message names the range.
    """
    first, tolerance = measure(assembly)
    fall, found = _Fall(assembly, pressure), [first]

    def refuse(densest):
        raise SolverError(
            f"void ratio {void_ratio:.4g} was not reached: grains bear from {densest:.4g} without "
            f"friction to {first:.4g} with friction {assembly.friction:g}, expected one of these"
            + ("" if assembly.friction >= 1 else ", or more friction")
        )

    apart = first - assembly.void_ratio
    if first < void_ratio - tolerance:
        told = apart, f", {first:.4g} is less than {void_ratio:.4g}: how dense can it get?"
        refuse(measure(fall.to(-math.inf, told))[0])
    # Steps see the void ratio of the container, which is another one beside walls.
    aim, low, high = void_ratio - apart, -math.inf, assembly.void_ratio
    for number in range(1, TRIES + 1):
        told = found[-1] - fall.stopped, f", wanted {void_ratio:.4g}, try {number} of {TRIES}"
        now = fall.to(aim, told)
        now.friction, now.wall_friction = assembly.friction, assembly.wall_friction
        now.still()  # what slides has speed, and would go on to a denser packing
        if held or not rest(now, STILL_BEARS * np.mean(pressure)):
            hold(now, pressure)
        value, tolerance = measure(now)
        found.append(value)
        if abs(value - void_ratio) <= tolerance:
            return now
        if fall.ended and value > void_ratio:
            refuse(value)
        low, high = (fall.stopped, high) if value < void_ratio else (low, fall.stopped)
        aim += void_ratio - value
        if not low < aim < high:
            aim = 0.5 * (low + high)
    nearest = min(found, key=lambda value: abs(value - void_ratio))
    raise SolverError(
        f"void ratio {void_ratio:.4g} was not reached in {TRIES} tries: grains came to rest at "
        f"{nearest:.4g} at the nearest, expected within {tolerance:.2g}; another --seed may do"
    )


class _Fall:
    """The way of a packing whose friction falls under a pressure; each part is gone once.

    Args:
        assembly: :class:`~.assembly.Assembly` at rest; it stays as it is.
        pressure: [E].
    """

    def __init__(self, assembly, pressure):
        self.pressure, self.states = pressure, [assembly]
        self.stopped = assembly.void_ratio  #: of the container, where the last way ended
        self.ended = False  #: whether it was at rest there without friction

    def to(self, aim, told):
        """A packing on the way where the container has the void ratio ``aim``, or none denser.

        Args:
            aim: Void ratio of the container.
            told: What assemblies tell of it: ``apart`` and ``doing``.
        """
        looser = [s for s in self.states if s.void_ratio > aim] or self.states[:1]
        now, calm = _copy(min(looser, key=lambda s: s.void_ratio)), 0
        now.apart, now.doing = told
        while now.void_ratio > aim and calm < CALM:
            now.step(servo(now, self.pressure))
            if now.friction <= LEAST_FRICTION:
                now.friction = now.wall_friction = 0.0
                calm = _calm(now, calm, self.pressure)
            elif abs(now.pressure / np.mean(self.pressure) - 1) < 0.2:
                part = math.exp(-LOOSEN * now.dt)
                now.friction *= part
                now.wall_friction *= part
            if now.void_ratio < self.states[-1].void_ratio - STRIDE:
                self.states.append(_copy(now))
            _check_steps(now, "while friction falls")
        self.stopped, self.ended = now.void_ratio, calm >= CALM
        return now


def _copy(assembly):
    shapes = assembly.bodies.shapes  # which do not change
    return copy.deepcopy(assembly, {id(shapes): shapes})


def rest(assembly, least=-math.inf):
    """Wait in the container as it is until forces balance, in place.

    Args:
        assembly: :class:`~.assembly.Assembly`.
        least: Pressure below which it is given up.

    Returns:
        Whether grains bear that pressure.

    Raises:
        SolverError: There was no rest.
    """
    calm = 0
    while calm < CALM:
        assembly.step()
        calm = _calm(assembly, calm)
        if assembly.pressure < least:
            return False
        _check_steps(assembly, "without rest")
    return True


def _calm(assembly, calm, pressure=None):
    """Number of steps in a row at rest, and at a pressure, looked at now and then."""
    if assembly.num_steps % LOOK:
        return calm
    near = pressure is None or np.abs(assembly.axial_stresses / pressure - 1).max() < NEAR
    return calm + LOOK if near and assembly.unbalanced < REST else 0


def settle(assembly):
    """Let grains fall and come to rest under gravity, in place.

    Raises:
        SolverError: There was no rest.
    """
    bodies = assembly.bodies
    container = assembly.container
    base = container.volume / (container.high[2] - container.low[2])
    assembly.gravity = HEAP_STRESS * base / bodies.solid
    assembly.drag = HEAP_DRAG * math.sqrt(assembly.gravity)
    rest(assembly)
    weight = assembly.gravity * bodies.mass.mean()
    while bodies.kinetic_energy > STILL * weight:  # of grains that roll freely
        assembly.step()
        _check_steps(assembly, "with grains that roll")
    top = bodies.centre[:, 2] + bodies.reach
    container.high[2] = min(float(top.max()), container.high[2])


def _check_steps(assembly, where):
    if assembly.num_steps >= MAX_STEPS:
        raise SolverError(
            f"packing: void ratio {assembly.void_ratio:.4g} {where} after {MAX_STEPS} steps, "
            "expected rest"
        )
    if not np.isfinite(assembly.dt):
        raise SolverError(f"packing: time step {assembly.dt} after {assembly.num_steps} steps")
