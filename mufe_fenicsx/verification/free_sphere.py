"""A free elastic ball that vibrates in its lowest modes."""

import math
from typing import Literal

import numpy as np

from ..bulk.solid import ELEMENTS
from ..geometry.bodies.shapes import sphere
from ..materials.elastic import Elastic
from ..run.from_bodies import build
from ..theory.sphere_modes import displacement, modes, torsional_frequency, twist
from .case import case, compare

E, RHO, RADIUS = 100e9, 2650.0, 1e-3
#: How long the ball is watched, in periods of the mode.
PERIODS = 3.0


@case("free-sphere", num_bodies=1)
def free_sphere(comm, elements_per_radius=8.0, nu=0.15, element: Literal[*ELEMENTS] = "averaged"):
    """A free ball in its modes 0T2, 0S2 and 0S0: frequencies of Lamb 1882.

    It starts with the velocities of a mode, small; the frequency is that of the
    projection of its velocities on that mode, which filters out what the mesh makes of the others.

    Args:
        comm: MPI communicator.
        elements_per_radius: Radius over the length of edges.
        nu: Poisson's ratio; the tolerances hold up to 0.15. The error of 0S0 grows with it, by
            half at 0.3 and to 1.8 times at 0.4.
        element: One of solid.ELEMENTS.
    """
    material = Elastic(E, nu, RHO)
    points, cells = sphere(RADIUS, RADIUS / elements_per_radius)
    # The mesh's volume is smaller than the ball's: its own radius sets its frequencies.
    corners = points[cells]
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])).sum() / 6
    radius = (0.75 * volume / math.pi) ** (1 / 3)
    spheroidal = {n: min((m for m in modes(nu) if m.order == n), key=lambda m: m.frequency)
                  for n in (2, 0)}  # fmt: skip
    wave = math.sqrt(material.shear_modulus / RHO) / radius
    shapes = {
        "0T2": (torsional_frequency(2), twist),
        "0S2": (spheroidal[2].frequency, lambda x: displacement(spheroidal[2], nu, x)),
        "0S0": (spheroidal[0].frequency, lambda x: displacement(spheroidal[0], nu, x)),
    }
    results, simulations = {}, []
    for name, (frequency, shape) in shapes.items():
        omega = frequency * wave

        def start(x, _grain, shape=shape, omega=omega):
            return 1e-6 * radius * omega * shape((x + 1e-9 * radius) / radius)

        s = build(
            comm, [(points, cells)], material, (0, 0, 0), (0, 0, 0), axes="", velocity=start,
            element=element,
        )  # fmt: skip
        phi = s.solid.mass[:, None] * s.state.v
        course = []
        while s.state.t * omega < 2 * math.pi * (PERIODS + 0.3):
            s.step()
            # Velocities belong to the middle of the step.
            course.append((s.state.t - 0.5 * s.dt, comm.allreduce(float(np.vdot(phi, s.state.v)))))
        t, q = np.array(course).T
        # Zeros of the cosine; the velocity is known half a step back.
        k = np.flatnonzero(q[:-1] * q[1:] < 0)
        zeros = t[k] - q[k] * (t[k + 1] - t[k]) / (q[k + 1] - q[k])
        computed = math.pi * (zeros.size - 1) / (zeros[-1] - zeros[0]) / wave
        # The target at 8 elements a radius; the error is of second order.
        tolerance = 0.01 * max(8.0 / elements_per_radius, 1.0) ** 2
        results[f"{name}: frequency over c_s/R"] = compare(computed, frequency, tolerance)
        energies = s.energies()
        results[f"{name}: energy over its start"] = compare(
            -energies["residual"] / s.initial_kinetic, 0.0, 1e-4, scale=1.0
        )
        simulations.append(s)
    return results, simulations
