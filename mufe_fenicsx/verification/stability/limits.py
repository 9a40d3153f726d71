"""What the subjects of the stability map share: small bodies, noise, growth and bisection."""

import math

import numpy as np

from ...contact.mark import ContactMark
from ...contact.stiffness.springs import list_springs
from ...errors import InputError, SolverError
from ...geometry.bodies.shapes import box
from ...materials.elastic import Elastic
from ...run.energy_guard import EnergyGuard
from ...run.from_bodies import build, drive, settle
from ...state import copied

SIZE = 1e-3  #: edge of the blocks [m]
E, NU, RHO = 100e9, 0.15, 2650.0
#: Steps after which the limit is evaluated anew, where a step shall stay as it was set.
NEVER = 10**9
#: Speed of the noise [m/s]: strains of 1e-12, so that bodies stay linear while it grows.
NOISE = 1e-8


def bisect(fails, low, high, num=14):
    """Where ``fails(value)`` turns from False to True, the mean of the last interval's ends.

    Intervals are halved in the logarithm. inf if it does not fail at ``high``, 0 if it does at
    ``low``.
    """
    if not fails(high):
        return math.inf
    if fails(low):
        return 0.0
    for _ in range(num):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if fails(middle) else (middle, high)
    return math.sqrt(low * high)


class Snapshot:
    """A state to start from again and again, with its contacts."""

    def __init__(self, simulation):
        self.simulation = simulation
        self._contact = ContactMark(simulation.contact)
        self._previous = simulation.contact.ghosts.positions.own.copy()
        kept = simulation.state.state_dict()
        self._kept = copied({place: kept[place] for place in ("nodes", "cells")})

    def restore(self):
        """Make the state what it was."""
        self.simulation.state.load_state_dict(self._kept)
        contact = self.simulation.contact
        if contact.num_searches == self._contact.num_searches:
            self._contact.restore()
        else:  # a body that touches nothing went far enough: it has no contacts to restore
            self._contact = ContactMark(contact)
        contact.motion.measure_from(self._previous)


def kinetic(s):
    """Kinetic energy of the nodes [J], of one rank."""
    return 0.5 * float(s.solid.mass @ (s.state.v**2).sum(axis=1))


def set_step(s, dt):
    """Steps of length ``dt`` [s] from now on, whatever the limit."""
    s.dt, s.limit.schedule.margin = dt, math.inf  # no motion asks for another one
    s.contact.set_time_step(dt)


def shake(s, speed=NOISE, seed=1):
    """Add random velocities of up to ``speed`` [m/s]."""
    s.state.v += speed * np.random.default_rng(seed).uniform(-1, 1, s.state.v.shape)


def growth(s, start, dt, num_steps=600, largest=1e14, mode=None):
    """Factor of the amplitude of noise in a step of ``dt`` [s], and whether it grows for good.

    Args:
        s: Simulation on one rank.
        start: Its :class:`Snapshot`.
        dt: Time step [s].
        num_steps: Steps at most.
        largest: Kinetic energy over that of the noise at which to stop.
        mode: Shape of the motion instead of noise, largest entry 1, shape (num_nodes, 3): far
            beyond the limit noise has some steps only, in which other modes grow nearly as fast.
    """
    start.restore()
    if mode is None:
        shake(s)
    else:
        s.state.v += NOISE * mode
    set_step(s, dt)
    first, course = kinetic(s), []
    for _ in range(num_steps):
        s.step()
        course.append(kinetic(s) / first)
        if not course[-1] < largest:
            break
    start.restore()
    course = np.log(np.array(course))
    grown = not course[-1] < math.log(largest)
    # The last third: by then the fastest mode is alone, unless little grows.
    last = course[-max(3, len(course) // 3) :]
    rate = np.polyfit(np.arange(last.size), last, 1)[0] if last.size > 2 else course[-1]
    return float(np.exp(0.5 * rate)), grown


def dense_stiffness(s, bulk=True, springs=True):
    """Stiffness of bulk and closed springs [N/m], shape (3 num_nodes, 3 num_nodes). One rank."""
    n = s.state.x.size
    K, q = np.empty((n, n)), np.zeros_like(s.state.x)
    closed = list_springs(s.contact, 0.0)
    for i in range(n):
        q.flat[i] = 1.0
        y = np.zeros_like(q)
        if bulk:
            s.solid.add_stiffness(y, q, s.state.x)
        if springs:
            closed.add(y, q)
        K[:, i] = y.ravel()
        q.flat[i] = 0.0
    return K


def tangent_stiffness(s, part=1e-7):
    """Derivative of the internal forces, stresses included [N/m], by differences. One rank.

    What :func:`dense_stiffness` has of the bulk is that of a body without stresses.

    Args:
        s: Simulation; its state and stresses stay.
        part: Of each move over ``SIZE``: strains far below those of yield, far above rounding.
    """
    state, n = s.state, s.state.x.size
    names = ("x", "v", "deviator", "plastic_strain", "plastic_work")
    kept = {name: getattr(state, name).copy() for name in names}
    K, move = np.empty((n, n)), part * SIZE

    def forces(i, way):
        for name, values in kept.items():
            getattr(state, name)[:] = values
        state.x.flat[i] += way
        state.v[:] = 0.0
        state.v.flat[i] = way  # for a second: increments of strain follow from velocities
        f = np.zeros_like(state.x)
        s.solid.add_internal_forces(f, state, 1.0)
        return f.ravel()

    for i in range(n):
        K[:, i] = (forces(i, -move) - forces(i, move)) / (2 * move)
    forces(0, 0.0)  # the pressures are those of this state again
    for name, values in kept.items():
        getattr(state, name)[:] = values
    return K


def fastest_mode(s, K):
    """ω_max of M⁻¹K [rad/s], and its mode, largest entry 1, shape (num_nodes, 3). One rank."""
    root = np.repeat(1 / np.sqrt(s.solid.mass), 3)
    values, vectors = np.linalg.eigh(root[:, None] * (0.5 * (K + K.T)) * root)
    mode = root * vectors[:, -1]
    return math.sqrt(max(values[-1], 0.0)), (mode / np.abs(mode).max()).reshape(-1, 3)


def highest_frequency(s, bulk=True, springs=True):
    """ω_max of M⁻¹K by a dense eigenvalue problem [rad/s]. One rank."""
    return fastest_mode(s, dense_stiffness(s, bulk, springs))[0]


def free_block(comm, element="p1", divisions=2, **options):
    """An elastic cube that touches nothing."""
    bodies = [box((SIZE,) * 3, (divisions,) * 3)]
    options = {"refresh": NEVER} | options
    return build(
        comm, bodies, Elastic(E, NU, RHO), np.zeros(3), np.zeros(3), axes="", element=element,
        **options,
    )  # fmt: skip


def pressed_block(comm, element="p1", divisions=2, strain=1e-3, friction=1.0, **options):
    """A cube at rest between two platens that it sticks to; ν = 0, so that nothing slips."""
    material = Elastic(E, 0.0, RHO)
    bodies = [box((SIZE,) * 3, (divisions,) * 3)]
    s = build(
        comm, bodies, material, np.zeros(3), np.full(3, SIZE), axes="z", element=element,
        wall_friction={"z_min": friction, "z_max": friction},
        damping=math.pi * material.wave_speed / SIZE, **options,
    )  # fmt: skip
    drive(s, {"z_max": (0, 0, -strain * SIZE)}, 4 * SIZE / material.wave_speed)
    settle(s, 1e-18)
    s.damping, s.limit.schedule.steps = 0.0, NEVER
    s.state.v[:] = 0.0
    return s


def message_of(function, *arguments, **options):
    """What the program says where it refuses or stops; "" where it does neither."""
    try:
        function(*arguments, **options)
    except (InputError, SolverError) as error:
        return str(error)
    return ""


def steps_to_notice(s, limit=0.1, max_steps=4000, every=20):
    """Steps until the program stops a run, looking at its energies every so often, and its words.

    Returns:
        Steps (inf if it does not), message.
    """
    guard = EnergyGuard(s, limit)
    first = s.state.num_steps
    try:
        while s.state.num_steps - first < max_steps:
            s.step()
            if s.state.num_steps % every == 0:
                guard.check(s.energies(), f"at step {s.state.num_steps}")
    except SolverError as error:
        return s.state.num_steps - first, str(error)
    return math.inf, ""
