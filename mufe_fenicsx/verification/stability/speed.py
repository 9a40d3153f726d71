"""Speed of loading and added mass: kinetic energy against the error of the stress."""

import math
from types import SimpleNamespace

import numpy as np

from ...contact.walls import Wall
from ...geometry.bodies.shapes import box
from ...materials.elastic import Elastic
from ...run.from_bodies import build
from ..case import case, compare
from .limits import RHO, SIZE, E

#: Error of the stress that counts as the limit.
ERROR = 0.05


def column_error(comm, ratio, mass_factor=1.0, strain=1e-3, divisions=(1, 1, 48), scaling=None):
    """An elastic column under a platen that starts at full speed.

    Args:
        comm: MPI communicator of one rank.
        ratio: Speed over wave speed times strain.
        mass_factor: Masses times this.
        strain: Final strain.
        divisions: Bricks along the edges.
        scaling: Settings of mass scaling instead, or None.

    Returns:
        Error of the platen's stress in the last two passages of a wave over that at the end, √3
        of its root mean square, which is the height of the even saw that theory has; mean kinetic
        over elastic energy then; theory of both; the course; simulation.
    """
    material, up = Elastic(E, 0.0, RHO), np.eye(3)[2]
    height = SIZE * divisions[2] / divisions[0]
    body = box((SIZE, SIZE, height), divisions)
    c, slow = material.wave_speed, material.wave_speed / math.sqrt(mass_factor)
    factor = {} if mass_factor == 1.0 else {"mass_factor": np.full(len(body[0]), mass_factor)}
    walls = [
        Wall("base", np.zeros(3), up, bonded=True),
        Wall("platen", height * up, -up, bonded=True),
    ]
    s = build(
        comm, [body], material, np.zeros(3), np.zeros(3), axes="", walls=walls,
        mass_scaling=scaling, **factor,
    )  # fmt: skip
    speed = ratio * c * strain
    s.walls.velocity[1] = -speed * up
    end, times, stress, moving = strain * height / speed, [], [], []
    while s.state.t < end:
        s.step()
        times.append(s.state.t)
        stress.append(s.wall_forces()[1] / SIZE**2)
        moving.append(s.kinetic_energy())
    times, stress, moving = np.array(times), np.array(stress), np.array(moving)
    static = E * speed * times / height
    late = times > end - 2 * height / slow
    error = math.sqrt(3 * np.mean((stress - static)[late] ** 2))
    return SimpleNamespace(
        ratio=ratio, mass_factor=mass_factor, error=float(error / static[-1]),
        # Fronts are felt as jumps of 2 ρ c v about the line, and ρ c v/(E ε) = v/(c ε).
        theory=ratio * math.sqrt(mass_factor),
        kinetic=float(moving[late].mean() / s.energies()["elastic"]),
        # What is behind a front moves with v or rests: half of it in the mean.
        kinetic_theory=0.5 * ratio**2 * mass_factor,
        times=times, stress=stress, static=static, simulation=s,
    )  # fmt: skip


@case("stability-loading-speed", num_bodies=1)
def loading_speed(comm):
    """A column pressed suddenly: the stress is off by v/(c ε), as √(2 k) of the kinetic ratio k.

    Args:
        comm: MPI communicator.
    """
    found = [column_error(comm, ratio) for ratio in (0.02, 0.05, 0.1)]
    results = {}
    for one in found:
        name = f"v/(c ε) = {one.ratio:g}"
        # Fronts are some two elements of 48 wide, which takes 2/48 off the square.
        results[f"{name}: error of the stress over v/(c ε)"] = compare(
            one.error / one.ratio, one.theory / one.ratio, 0.05
        )
        # The same of the motion; and up to v/(c ε) of the energy comes and goes.
        results[f"{name}: mean kinetic over elastic energy"] = compare(
            one.kinetic, one.kinetic_theory, 0.05 + one.ratio
        )
    return results, [one.simulation for one in found]


@case("stability-mass", num_bodies=1)
def added_mass(comm):
    """Masses times F do what a speed times √F does, and no more.

    Args:
        comm: MPI communicator.
    """
    found = [column_error(comm, 0.1 / math.sqrt(factor), factor) for factor in (1.0, 16.0, 100.0)]
    results = {}
    results["F = 25 at v/(c ε) = 0.01: error of the stress over 5 %"] = compare(
        column_error(comm, 0.01, 25.0).error / ERROR, 1.0, 0.05
    )
    for one in found[1:]:
        name = f"F = {one.mass_factor:g}, speed over √F"
        # The equations are the same; what differs is rounding, and where steps fall.
        results[f"{name}: error of the stress"] = compare(one.error, found[0].error, 0.02)
        results[f"{name}: kinetic over elastic energy"] = compare(
            one.kinetic, found[0].kinetic, 0.05
        )
    return results, [one.simulation for one in found]
