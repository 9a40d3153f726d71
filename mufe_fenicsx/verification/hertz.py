"""Elastic bodies pressed on each other or on a plane: Hertz's contact, and how errors shrink."""

from typing import Literal

import numpy as np

from ..bulk.solid import ELEMENTS
from .case import case, compare, on_first_ranks
from .hertz_bodies import NAMES, RADIUS, hertz_at, make, whole_contact
from .pressed import Pressed, measure
from .reference import large_strain

#: Approaches over which a mean is taken.
INDENTATIONS = 5
#: Targets in force, radius and pressure at one element per contact radius, falling as 1/n:
#: 2, 4 and 5 % at 2.5 elements, 1, 2 and 2.5 % at 5.
FORCE, SIZE, PRESSURE = 0.05, 0.10, 0.125
#: Large strain, which Hertz leaves out: the change of the largest pressure over a/R, 0 to 0.6
#: by the mesh, 0.2 in the mean (between a/R = 0.005 and 0.02), less of the force.
LARGE_STRAIN = 0.15
#: Contact radii over R at which the finite size of a ball shows; the axisymmetric reference has
#: them for these Poisson's ratios.
FINITE = (0.16, 0.04)
REFERENCE_NU = (0.15, 0.3)


@case("hertz", num_bodies=2)
def hertz(
    comm,
    bodies: Literal["all", *NAMES] = "all",
    elements_per_radius=2.5,
    a_over_R=0.005,
    nu=0.15,
    growth=0.4,
    element: Literal[*ELEMENTS] = "averaged",
    integrator: Literal["static", "explicit"] = "static",
):
    """Elastic balls, cylinders and an ellipsoid in contact: force, size and pressure of Hertz.

    Means over indentations between which the edge of the contact passes over one element,
    and the worst of them. Spheres are compared with linear elasticity of the whole body
    (theory.two_spheres), so that mesh and contact law are left; a/R to 0 shows the effect of
    the finite size for itself, and the axisymmetric reference adds that of large strain.
    Cylinders cross at 60°: parallel ones would have to end, or lie between walls in plane
    strain, where the force hardly depends on the contact, and grains do not meet along lines.

    Args:
        comm: MPI communicator.
        bodies: Which of them, or all.
        elements_per_radius: Contact radius √(ab) over the length of edges there.
        a_over_R: That radius over the effective radius, by Hertz. Strains are of its order:
            at 0.02 they add 0.1 to 0.4 % to the largest pressure.
        nu: Poisson's ratio. The tolerances hold from 0.15 on: at 0 the largest pressure is 7.6 %
            too high and the worst force 2.2 %.
        growth: Growth of the element size with the distance, times elements_per_radius.
        element: One of solid.ELEMENTS.
        integrator: How the state at rest is found: by static increments, or by damped time steps.
    """
    n = elements_per_radius
    # Below 2.5 elements the errors of second order lead.
    coarse = max(2.5 / n, 1.0) / n
    results, simulations = {}, []

    def add(name, ratio, line):
        pressed, rows = errors_of(
            comm, name, n, ratio, nu, growth, element=element, integrator=integrator
        )
        simulations.extend([pressed.simulation] if pressed else [])
        results.update({f"{name}: {key}": value for key, value in line(rows).items()})

    def lines(rows):
        mean = {key: float(np.mean(values)) for key, values in rows.items()}
        worst = rows["force"][np.argmax(np.abs(rows["force"] - 1))]
        strain = LARGE_STRAIN * a_over_R
        return {
            "force": compare(mean["force"], 1.0, FORCE * coarse + strain),
            "force, worst": compare(worst, 1.0, FORCE * coarse + strain),
            "radius": compare(mean["size"], 1.0, SIZE * coarse),
            "largest pressure": compare(mean["p0"], 1.0, PRESSURE * coarse + strain),
            # Newton's method ends where 1e-6 is left of the internal forces; time steps where
            # exp(-2π) is left of what swings on a base.
            "reaction of the base": compare(
                mean["reaction"], 1.0, 5e-3 if integrator == "explicit" else 5e-4
            ),
        }

    def finite(rows, ratio):
        name = f"force over Hertz at a/R = {ratio:g}"
        force, series = np.mean(rows["force over Hertz"]), np.mean(rows["finite size"])
        tolerance = FORCE * coarse
        lines = {name: compare(force, series, tolerance + LARGE_STRAIN * ratio)}
        if nu in REFERENCE_NU:
            # The axisymmetric reference knows large strain: the mesh alone is left.
            converged = series * large_strain(ratio, nu)
            lines[f"{name}, large strain"] = compare(force, converged, tolerance)
        return lines

    names = NAMES if bodies == "all" else (bodies,)
    for name in names:
        add(name, a_over_R, lines)
    if names[0] == "sphere-plane":
        for ratio in FINITE:
            add(names[0], ratio, lambda rows, ratio=ratio: finite(rows, ratio))
    return results, simulations


def errors_of(
    comm, name, elements_per_radius, a_over_R=0.02, nu=0.15, growth=0.4,
    element="averaged", **options,
):  # fmt: skip
    """Press a pair of bodies and compare with theory. Collective.

    Args:
        comm: MPI communicator; ranks beyond the number of bodies only receive the answer.
        name: One of :data:`~.hertz_bodies.NAMES`.
        elements_per_radius, a_over_R, nu, growth: As of the case.
        element: As of the case.
        options: ``variant`` and ``coarser`` of :func:`~.hertz_bodies.make`; others are those
            of :class:`~.pressed.Pressed`.

    Returns:
        The :class:`~.pressed.Pressed` bodies at their last indentation, None on ranks without
        any, and a dict of arrays of shape (INDENTATIONS,), computed over theory: force, size
        √(ab), a, b, area radius, p0, force over Hertz, reaction over force; and those of
        theory, finite size, and of the pressure, spread (root mean square about the
        theory's shape).
    """
    mesh_options = {key: options.pop(key) for key in ("variant", "coarser") if key in options}
    bodies = make(name, elements_per_radius, a_over_R, nu, growth, **mesh_options)
    pressed = []

    def press(part):
        pressed.append(Pressed(part, bodies, element=element, **options))
        return _rows(pressed[0], name, elements_per_radius, a_over_R, nu)

    rows = on_first_ranks(comm, len(bodies), press)
    return (pressed[0] if pressed else None), rows


def _rows(pressed, name, elements_per_radius, a_over_R, nu):
    """The dict of :func:`errors_of`."""
    rows = []
    for place in np.linspace(-0.5, 0.5, 2 * INDENTATIONS + 1)[1::2]:
        radius = a_over_R * RADIUS * (1 + place / elements_per_radius)
        theory = whole_contact(name, radius, nu)
        limit = hertz_at(name, theory.delta, nu)
        pressed.press(theory.delta)
        found = measure(*pressed.contact(), np.array([theory.a, theory.b]))
        rows.append(
            {
                "force": found["force"] / theory.force,
                "size": np.sqrt(found["a"] * found["b"]) / theory.radius,
                "a": found["a"] / theory.a,
                "b": found["b"] / theory.b,
                "area radius": found["area_radius"] / theory.radius,
                "p0": found["p0"] / theory.p0,
                "spread": found["spread"],
                "force over Hertz": found["force"] / limit.force,
                "finite size": theory.force / limit.force,
                "reaction": pressed.reaction() / found["force"],
            }
        )
    return {key: np.array([row[key] for row in rows]) for key in rows[0]}
