"""One ball crushed between two platens, far beyond what a grain stands."""

import re

import numpy as np

from ..errors import SolverError
from ..geometry.bodies.shapes import sphere
from ..materials.sand import SAND
from ..run.energy_guard import EnergyGuard
from ..run.from_bodies import build, drive
from ..theory.plastic_contact import forged_disc
from ..theory.stability import shared_volume
from .case import case, compare

E, RADIUS = 100e9, 1e-3
#: Friction of the rough platens.
ROUGH = 0.5


@case("crush", num_bodies=1)
def crush(comm, strain=0.5, far=0.95, rough_far=0.8, element_size=0.3, speed=5.0):
    """A yielding ball between two platens, to half of its height and on to where its mesh ends.

    To ``strain`` the answer is right: energy balance, volume, forces and, between smooth
    platens, the mean stress, which has no lateral part (virial theorem), so that F H / V, with H
    between the points that touch, is at most the mean of the flow stress, and near it once the
    ball is a disc. On the way to ``far`` either that goes on, between rough platens to the stress
    of a forged disc, or the run stops and names the grain, the element and a cure.

    Args:
        comm: MPI communicator.
        strain: Way of the platen over the diameter.
        far, rough_far: The same, of the second part: of smooth platens, and of rough ones, which
            leave an element across the disc.
        element_size: Length of edges over the radius.
        speed: Mean speed of the platen [m/s].
    """
    results, simulations = {}, []
    for name, friction, end in (("smooth", 0.0, far), ("rough", ROUGH, rough_far)):
        s = _ball(comm, element_size, friction)
        _squeeze(s, strain, speed)
        rest = max(speed / 5.0, 1.0)
        checks = _checks(s, friction, rest, strain, element_size)
        results |= {f"{name}: {key}": line for key, line in checks.items()}
        simulations.append(s)
        message = _squeeze_on(s, strain, end, speed)
        lines = _end(s, friction, message, rest)
        results |= {f"{name}, further: {key}": line for key, line in lines.items()}
    return results, simulations


def _ball(comm, element_size, friction):
    return build(
        comm, [sphere(RADIUS, element_size * RADIUS)], SAND, (-RADIUS,) * 3,
        (RADIUS,) * 3, axes="z", wall_friction={"z_min": friction, "z_max": friction},
    )  # fmt: skip


def _squeeze(s, strain, speed):
    way = 2 * RADIUS * strain
    drive(s, {"z_max": (0, 0, -way)}, way / speed)
    s.check()


def _squeeze_on(s, strain, far, speed):
    """What stopped it on the way, or None."""
    guard, way = EnergyGuard(s, 0.1), 2 * RADIUS * (far - strain)

    def watch():
        if s.state.num_steps % 100 == 0:
            guard.check(s.energies(), "on the way")

    try:
        drive(s, {"z_max": (0, 0, -way)}, way / speed, at_step=watch)
        s.check()
    except SolverError as error:
        return str(error)
    return None


def _checks(s, friction, rest, strain, element_size):
    """A ball that was squeezed and now rests, but for waves of ``rest`` times the usual size."""
    energies, force = s.energies(), s.wall_forces()
    volumes = _volumes(s)
    K = s.solid.bulk[0]
    shared = np.average(s.solid.shared_mean_stress(), weights=volumes)
    mean = np.average(s.solid.mean_stress(s.state), weights=volumes)
    lines = {
        # The target of the energy balance.
        "energy residual over the work": compare(
            energies["residual"] / energies["work"], 0.0, 1e-3, scale=1.0
        ),
        # Flow keeps volume: it changes by the mean stress alone, p = K ln J of the nodes.
        # ln J against J - 1: J differs from 1 by up to some 1/100 between nodes.
        "change of volume over that of the mean stress": compare(
            (volumes.sum() / s.solid.volume0.sum() - 1) / (shared / K), 1.0, 0.05
        ),
        # Neighbours share their volumes so far as flow drives them to, by the flow stress; at the
        # rims of rough platens by several times that.
        "volume of single elements, |1 - 1/J| over (Y/G)^(1/3)": compare(
            np.abs(1 - s.solid.volume0 / volumes).max() / _shared_volume(), 1.0, 1.0
        ),
        # At rest but for waves that plastic flow has damped.
        "force on top over that below": compare(force[1], force[0], 1e-3 * rest),
    }
    if not friction:
        axial, flow = _axial_stress(s), _flow_stress(s)
        # As above.
        lines["mean stress over F H/3V"] = compare(-3 * mean / axial, 1.0, 2e-3 * rest)
        # Flattened facets keep the curvature that they had, their points stand off by h²/24R; dents
        # are at most h²/4R deep.
        lines["points off the platens over H"] = compare(
            _off_platens(s).sum() / (2 * RADIUS * (1 - strain)), 0.0,
            element_size**2 / (4 * (1 - strain)), scale=1.0,
        )  # fmt: skip
        # 1 at most; what it lacks is how uneven the stress still is.
        lines["mean axial stress F H/V over the mean flow stress"] = compare(
            axial / flow, 0.9, 0.1, scale=1.0
        )
    return lines


def _shared_volume():
    return shared_volume(SAND.yield_stress[-1][1], SAND.shear_modulus)


def _axial_stress(s):
    """Its mean, compression positive [Pa]."""
    return s.wall_forces()[1] * _height(s) / _volumes(s).sum()


def _height(s):
    """Distance of the points that touch the platens [m]."""
    return (s.walls.point[1] - s.walls.point[0])[2] - _off_platens(s).sum()


def _off_platens(s):
    """How far points are off each platen, a mean by their forces [m], shape (2,)."""
    p = s.walls.pairs
    distance = np.bincount(p.wall, p.normal_force * np.where(p.closed, p.gap - p.recess, 0.0), 2)
    return distance / np.bincount(p.wall, p.normal_force, 2)


def _flow_stress(s):
    """Mean yield stress [Pa]."""
    flow = np.interp(s.state.plastic_strain, *np.array(SAND.yield_stress).T)
    return np.average(flow, weights=_volumes(s))


def _end(s, friction, message, rest):
    """A ball that was crushed, or a run that stopped."""
    energies = s.energies()
    named = message and re.search(r"grain 1 .*\(element \d+ .*\).*: .*(mesh|load)", message)
    lines = {}
    if message is None:
        # A thin disc, uneven at its rim only; what still flows outward unloads it by its inertia,
        # as the square of the speed. Between rough platens one element is left across it.
        disc = forged_disc(_volumes(s).sum() / _height(s) ** 3, friction)
        lines["mean axial stress F H/V over the mean flow stress"] = compare(
            _axial_stress(s) / _flow_stress(s), disc, 0.15 if friction else 0.05 * rest**2
        )
    return lines | {
        "right, or a stop that names grain, element and cure": compare(
            1.0 if message is None or named else 0.0, 1.0, 0.0
        ),
        # The target, also where it stops.
        "energy residual over the work": compare(
            energies["residual"] / energies["work"], 0.0, 1e-3, scale=1.0
        ),
        "state is finite at the end": compare(
            float(np.isfinite(s.state.x).all() and np.isfinite(s.solid.stress(s.state)).all()), 1, 0
        ),
    }


def _volumes(s):
    corners = s.state.x[s.mesh.cells]
    return np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
