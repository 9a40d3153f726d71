"""Figure 8 of the paper: a ball is stiffer against a platen the higher its yield stress."""

import math
from typing import Literal

import numpy as np

from ..materials.j2 import J2
from .case import case, compare
from .plastic_ball import RADIUS, press_ball
from .reference import load, paper_name

E, NU, RHO = 100e9, 0.15, 2650.0
YIELD = (40e6, 30e6, 20e6, 10e6)
#: The paper's hardening: by this much [Pa] until this plastic strain, then none.
HARDENING, UNTIL = 100e6, 0.05
#: Parts of the way at which forces are compared: before, the contact has few elements.
PARTS = np.linspace(0.4, 1.0, 7)
#: Tolerance of the axisymmetric reference at one element per contact radius, falling as 1/n. Forces
#: are above it, the more the smaller the contact and the lower the yield: by 0.1 to 0.23 /n.
REFERENCE = 0.25
#: Points of facets that flow has flattened keep their curvature: they stand off this part of h²/R.
OFF = 1 / 24


@case("paper-sphere", num_bodies=1)
def paper_sphere(
    comm,
    elements_per_radius=5.0,
    refinement=1.5,
    approach=0.004,
    num_yields=4,
    periods=40.0,
    integrator: Literal["explicit", "static"] = "explicit",
    increments=80,
):
    """A ball of the paper's material with yield 10, 20, 30, 40 MPa: force rises with yield.

    Source of the set-up: S. Nadimi, J. Fonseca, Geotechnique 68, 2018, 290-302, figure 8: E = 100
    GPa, ν = 0.15, hardening by 100 MPa until a plastic strain of 0.05. Forces are compared with
    those of a finer mesh and of the axisymmetric reference.

    Args:
        comm: MPI communicator.
        elements_per_radius: Contact radius over the length of edges there, at the end.
        refinement: Of the second mesh.
        approach: Of plane and base at the end over the radius of the ball.
        num_yields: How many of the four, from the highest.
        periods: Duration, as of :func:`~.plastic_ball.press_ball`.
        integrator: Time steps, or static increments.
        increments: How many of these; radial return is of the first order in them.
    """
    options = {"increments": increments if integrator == "static" else None}
    results, simulations, before = {}, [], None
    meshes = (elements_per_radius, elements_per_radius * refinement)
    for Y in YIELD[:num_yields]:
        courses = [force_curve(comm, Y, n, approach, periods, **options) for n in meshes]
        simulations += [course.simulation for course in courses]
        coarse, fine = (forces(course, n) for course, n in zip(courses, meshes, strict=True))
        name = f"yield {Y / 1e6:g} MPa: "
        # The target of the method: all along the curve.
        worst = np.argmax(np.abs(coarse / fine - 1))
        results[name + f"force at {PARTS[worst]:.1f} of the approach, the worst [N]"] = compare(
            coarse[worst], fine[worst], 0.03
        )
        converged = reference_forces(courses[0], elements_per_radius, Y)
        if converged is not None:
            worst = np.argmax(np.abs(coarse / converged - 1))
            # The force of a contact that flows is in proportion to the approach.
            off = OFF * contact_edge(approach, elements_per_radius) ** 2 / RADIUS
            tolerance = REFERENCE / elements_per_radius + off / (PARTS[worst] * approach * RADIUS)
            results[
                name + f"force at {PARTS[worst]:.1f} of the approach, axisymmetric, the worst [N]"
            ] = compare(coarse[worst], converged[worst], tolerance)
        if before is not None:
            # No tolerance: an order.
            above = max(0.0, float((1 - before / coarse).max()))
            results[name + "force above that of the next higher yield"] = compare(above, 0, 0, 1.0)
        # As of the case plastic-sphere.
        kinetic = max(course.kinetic for course in courses)
        results[name + "kinetic energy over work"] = compare(kinetic, 0.0, 2e-3, 1.0)
        before = coarse
    return results, simulations


def force_curve(comm, Y, elements_per_radius, approach, periods=40.0, **options):
    """Press a ball that yields first at Y [Pa] by ``approach`` radii. Collective, one rank.

    Returns:
        :class:`~.plastic_ball.Course`.
    """
    material = J2(E, NU, RHO, ((0.0, Y), (UNTIL, Y + HARDENING)))
    n = elements_per_radius
    way = approach * RADIUS * (1 + 0.5 / n) ** 2
    a = n * contact_edge(approach, n)
    return press_ball(comm, material, way, a, n, periods=periods, **options)


def contact_edge(approach, elements_per_radius):
    """Length of edges in the contact [m]: its radius at the end over ``elements_per_radius``."""
    # Between the elastic radius √(Rδ) and that without hardening, 1.5 times as large: measured.
    return RADIUS * math.sqrt(2.0 * approach) / elements_per_radius


def forces(course, elements_per_radius):
    """Forces [N] at ``PARTS`` of the way: means over growths of the contact by an element."""
    windows = _windows(course, elements_per_radius)
    return np.array([np.interp(w, course.approach, course.force).mean() for w in windows])


def reference_forces(course, elements_per_radius, Y):
    """The same of the axisymmetric reference, None where it does not reach."""
    stored, windows = load()[paper_name(Y)], _windows(course, elements_per_radius)
    if not stored.covers(np.ravel(windows) / RADIUS):
        return None
    return np.array([stored.mean(w / RADIUS)[0] for w in windows]) * E * RADIUS**2


def _windows(course, n):
    way = course.approach[-1] / (1 + 0.5 / n) ** 2
    return [course.window(n * math.sqrt(part), part * way) for part in PARTS]
