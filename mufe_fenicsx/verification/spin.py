"""A free elastic body that turns many times."""

import math

import numpy as np

from ..geometry.shapes import sphere
from ..materials.elastic import Elastic
from ..solid import von_mises
from ..theory.rotation import mean_centrifugal_stress
from .build import build, sum_over_nodes
from .case import case, compare

RHO, NU, RADIUS = 2650.0, 0.15, 1e-3


@case("spin", num_bodies=1)
def spin(comm, turns=100.0, relative_stress=4e-7, element_size=1.0):
    """A free grain that turns: no stress but the centrifugal one, angular momentum and energy kept.

    Args:
        comm: MPI communicator.
        turns: Number of turns.
        relative_stress: ρ ω² R² / E, the size of the centrifugal stress; it sets the rate.
        element_size: Edge of the elements over the radius.
    """
    E = 100e9
    material = Elastic(E, NU, RHO)
    omega = math.sqrt(relative_stress * E / RHO) / RADIUS

    def rigid(x, _grain):
        return omega * np.column_stack([-x[:, 1], x[:, 0], np.zeros(len(x))])

    points, cells = sphere(RADIUS, element_size * RADIUS)
    points = points - _centre(points, cells)
    s = build(comm, [(points, cells)], material, (0, 0, 0), (0, 0, 0), axes="", velocity=rigid)
    mass = s.solid.mass[:, None]

    def angular_momentum():
        return sum_over_nodes(s, mass * np.cross(s.state.x, s.state.v))

    L0, energy0 = angular_momentum(), s.energies()["kinetic"]
    mean_square = sum_over_nodes(s, mass * s.mesh.x**2) / sum_over_nodes(s, mass)
    end = turns * 2 * math.pi / omega
    last_turn = end - min(turns, 1.0) * 2 * math.pi / omega

    largest, mean, samples = 0.0, np.zeros(3), 0
    every = 97  # no multiple of a period of the grain
    while s.state.t < end:
        for _ in range(every):
            s.step()
        largest = max(largest, von_mises(s.state.deviator).max())
        if s.state.t > last_turn:
            mean += np.average(s.solid.stress(s.state)[:, :3], axis=0, weights=s.solid.volume0)
            samples += 1
    mean /= samples
    energy = s.energies()
    theory = mean_centrifugal_stress(RHO, omega, 0.5 * (mean_square[0] + mean_square[1]))
    num_steps = s.state.num_steps
    # Rounding of each velocity update, as a random walk with a drift of up to 1/10 of eps.
    rounding = 1e-15 * math.sqrt(num_steps) + 0.1 * np.finfo(float).eps * num_steps
    results = {
        # The centrifugal stress starts suddenly, so it swings to about twice its mean, of
        # which relative_stress is the scale; a spurious stress would grow with the turns.
        "largest von Mises stress over E": compare(largest / E, 0.0, 1e-6, scale=1.0),
        # The stress swings about this mean; one turn holds hundreds of swings.
        "mean centrifugal stress over E": compare(0.5 * (mean[0] + mean[1]) / E, theory / E, 0.02),
        "angular momentum over its start": compare(
            np.linalg.norm(angular_momentum() - L0) / np.linalg.norm(L0), 0.0, rounding, scale=1.0
        ),
        # What the grain takes to swing is exchanged with the rotation: (centrifugal stress)²/E
        # over ρ v²/2, of the order of relative_stress; the scheme itself conserves to (ω_max Δt)²
        # of that part.
        "energy over its start": compare(
            1.0 - energy["residual"] / energy0, 1.0, relative_stress + rounding
        ),
    }
    return results, [s]


def _centre(points, cells):
    corners = points[cells]
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
    return np.average(corners.mean(axis=1), axis=0, weights=volume)
