"""One computation of a chart as a case of `mufe verify`: all choices are its parameters.

The error is a mean over the course of a test, not that of its last state, where errors of
unlike sign would cancel at some mesh or other. Costs are times of one processor for the steps
alone: meshes are made once for many computations, and a machine that is shared makes only clocks
on the wall run longer.
"""

import math
from typing import Literal

import numpy as np

from ...analysis.evidence import JAMMED, REFERENCE, distance, read_curve
from ...bulk.solid import ELEMENTS
from ...errors import InputError
from ...materials.elastic import Elastic
from ...materials.rigid import Rigid
from ...theory import hertz
from ..case import by_name, case, compare
from ..fidelity import FIDELITIES, compress
from ..hertz_bodies import hertz_at, whole_contact
from ..impact import QUARTZ, impact_theory, normal_impact
from ..known_stress import sample_point
from ..mindlin import shear_balls
from ..packing import angular_grains
from ..plastic_ball import PHASES, RADIUS, press_ball, slope_of
from ..plastic_sphere import mean_pressure
from ..polyhedra import SAMPLE, polyhedral_grains
from ..reference import load, perfect_name
from .answers import LAWS, Law, TimeStep, course_error, lines_of, options_of, work_of
from .bounds import BOUNDS

E, RHO = 100e9, 2650.0
Element = Literal[*ELEMENTS]
#: Duration of loading = 1, over the period of the body; increments of a static or implicit test.
PERIODS = {"hertz": 3.0, "mindlin": 6.0, "plastic-sphere": 10.0}
INCREMENTS = {"hertz": 10, "plastic-sphere": 20}
#: The plastic ball's E/Y and contact radius over that of the ball.
RATIO, PLASTIC_RADIUS = 1000.0, 0.1
#: Of the oedometer: grains along x, y, z; final strain; speed of the platen [m/s] at loading = 1,
#: and that on polyhedra; parts of the strain at which stresses are compared.
COUNTS, STRAIN, SPEED, JAMMED_SPEED = (2, 2, 5), 0.02, 10.0, 2.5
#: Between grains of the oedometers (Nadimi & Fonseca 2018).
FRICTION = 0.23
PARTS = np.linspace(0.125, 1.0, 8)


def _increments(integrator, number, loading):
    """Options of :func:`press_ball` for static or implicit increments; none for time steps."""
    if integrator == "explicit":
        return {}
    more = {"spectral_radius": 0.8} if integrator == "implicit" else {}
    return {"increments": max(round(number * loading), 1), **more}


@case("hertz-point", num_bodies=1)
def hertz_point(
    comm,
    elements_per_radius=2.5,
    growth=0.3,
    element: Element = "averaged",
    law: Literal[*LAWS] = "matched",
    integrator: Literal["explicit", "implicit", "static"] = "explicit",
    time_step: TimeStep = "assembled",
    added_mass=0.0,
    loading=1.0,
    a_over_R=0.02,
    nu=0.15,
    num_phases=1,
    accuracy=0.05,
):
    """A plane pressed into an elastic ball: error of the force along its course, and cost.

    Args:
        comm: MPI communicator.
        elements_per_radius: Contact radius at the end over the length of edges there.
        growth: Growth of the element size with the distance, for plastic_ball.slope_of.
        element, law, integrator, time_step: The choices.
        added_mass: Most mass that is added for a longer time step, over that of the body.
        loading: Duration over three periods of the ball.
        a_over_R: Contact radius at the end over that of the ball.
        num_phases: Places where the axis meets the facets; the error is the largest of them.
        accuracy: Error that is wanted.
    """
    courses = [
        press_ball(
            comm, Elastic(E, nu, RHO), a_over_R**2 * RADIUS, a_over_R * RADIUS,
            elements_per_radius, growth, element=element, periods=PERIODS["hertz"] * loading,
            added_mass=0.0, phase=phase,
            **_increments(integrator, INCREMENTS["hertz"], loading),
            **options_of(law, time_step, added_mass),
        )
        for phase in PHASES[:num_phases]
    ]  # fmt: skip
    errors = []
    for course in courses:
        theory = hertz.hertz_force(course.approach, RADIUS, hertz.effective_modulus((E, nu)))
        theory *= finite_size(course.approach, nu)
        errors.append(course_error(course.approach, course.force, theory))
    work, seconds = work_of(courses[0].simulation, integrator), courses[0].processor_s
    return lines_of(max(errors), accuracy, seconds, work), [c.simulation for c in courses]


def finite_size(approach, nu):
    """Force of a whole ball over that of a half-space at approaches [m]; linear in a/R."""
    a = math.sqrt(approach[-1] * RADIUS)
    whole = whole_contact("sphere-plane", a, nu)
    beyond = whole.force / hertz_at("sphere-plane", whole.delta, nu).force - 1
    return 1 + beyond * np.sqrt(np.maximum(approach, 0.0) / whole.delta)


@case("mindlin-point", num_bodies=1)
def mindlin_point(
    comm,
    elements_per_radius=2.5,
    growth=0.3,
    element: Literal["averaged", "p1"] = "averaged",
    law: Literal["matched", "stiff", "nodes", "four"] = "matched",
    integrator: Literal["explicit", "static"] = "explicit",
    time_step: TimeStep = "assembled",
    added_mass=0.0,
    loading=1.0,
    a_over_R=0.015,
    nu=0.3,
    accuracy=0.05,
):
    """Two elastic balls sheared to and fro at constant approach: error of the force, and cost.

    Args:
        comm: MPI communicator.
        elements_per_radius: Contact radius over the length of edges there.
        growth: Growth of the element size with the distance, for plastic_ball.slope_of.
        element, law, integrator, time_step: The choices.
        added_mass: Most mass that is added for a longer time step, over that of the bodies.
        loading: Duration of half a cycle over six periods of a cap.
        a_over_R, nu: As of `mindlin`.
        accuracy: Error that is wanted, over the largest force.
    """
    friction, ratio = 0.3, 0.8
    s = shear_balls(
        comm, elements_per_radius, a_over_R, nu, friction, ratio,
        slope_of(growth, elements_per_radius), PERIODS["mindlin"] * loading, integrator,
        varying=(), added_mass=0.0, element=element, **options_of(law, time_step, added_mass),
    )  # fmt: skip
    away = np.abs(s.force - s.theory).mean()
    error = float(away / (ratio * friction * s.normal[s.turns[1]]))
    work = work_of(s.simulation, integrator)
    return lines_of(error, accuracy, s.processor_s, work), [s.simulation]


@case("impact-point", num_bodies=1)
def impact_point(
    comm,
    elements_per_radius=2.5,
    growth=0.3,
    element: Literal["averaged", "p1"] = "averaged",
    law: Law = "matched",
    fidelity: Literal["elastic", "rigid"] = "elastic",
    time_step: TimeStep = "assembled",
    added_mass=0.0,
    speed=10.0,
    accuracy=0.05,
):
    """A ball meets a plane and another ball: largest error of what theory gives, and cost.

    Of contact time, largest force, largest approach (of the whole ball) and restitution.

    Args:
        comm: MPI communicator.
        elements_per_radius: Contact radius over the length of edges there.
        growth: Growth of the element size with the distance, for plastic_ball.slope_of.
        element, law, fidelity, time_step: The choices.
        added_mass: Most mass that is added for a longer time step, over that of the balls.
        speed: Against the plane [m/s].
        accuracy: Error that is wanted.
    """
    material = QUARTZ if fidelity == "elastic" else Rigid(QUARTZ.E, QUARTZ.nu, QUARTZ.rho)
    found = normal_impact(
        comm, speed, elements_per_radius, slope_of(growth, elements_per_radius), material,
        element=element, **options_of(law, time_step, added_mass),
    )  # fmt: skip
    peaks = found.force.max(axis=0), found.approach.max(axis=0)
    error = impact_error(found.mass, speed, found.contact_time, *peaks, found.restitution)
    simulation = found.balls.simulation
    return lines_of(error, accuracy, found.processor_s, work_of(simulation)), [simulation]


def impact_error(mass, speed, contact_time, force, approach, restitution):
    """The largest error of impacts of balls of a mass [kg] at a speed [m/s].

    Args:
        mass, speed: As of `impact_theory`.
        contact_time: [s], shape (n,), as are all.
        force: Largest [N].
        approach: Largest, of a ball against the plane between [m].
        restitution: [-].
    """
    _, whole, loss = impact_theory(mass, speed)
    errors = [
        contact_time / whole.time - 1,
        force / whole.force - 1,
        approach / whole.approach - 1,
        restitution / math.sqrt(1 - loss) - 1,
    ]
    return float(np.abs(errors).max())


@case("plastic-sphere-point", num_bodies=1)
def plastic_sphere_point(
    comm,
    elements_per_radius=2.5,
    element: Element = "averaged",
    law: Literal["matched", "stiff", "nodes", "four"] = "matched",
    integrator: Literal["explicit", "static"] = "explicit",
    time_step: TimeStep = "assembled",
    added_mass=0.0,
    loading=1.0,
    a_over_R=PLASTIC_RADIUS,
    nu=0.15,
    accuracy=0.05,
):
    """A ball that flows (E/Y = 1000) under a plane: error of its force, and cost.

    The error is that of the force along the course, against the stored axisymmetric reference.
    That of the mean pressure at the end stands beside it: an element that locks makes the pressure
    too high and the contact too small. Of contacts with few points the pressure says nothing.

    Args:
        comm: MPI communicator.
        elements_per_radius: Contact radius at the end over the length of edges there.
        element, law, integrator, time_step: The choices.
        added_mass: Most mass that is added for a longer time step, over that of the body.
        loading: Duration over ten periods of the ball.
        a_over_R: Contact radius at the end over that of the ball.
        nu: Poisson's ratio, 0.15 or 0.3.
        accuracy: Error that is wanted.

    Raises:
        InputError: There is no reference with this ratio.
    """
    stored = flowing_ball(nu)
    _, course = mean_pressure(
        comm, nu, RATIO, elements_per_radius, a_over_R, element, added_mass=0.0,
        periods=PERIODS["plastic-sphere"] * loading,
        **_increments(integrator, INCREMENTS["plastic-sphere"], loading),
        **options_of(law, time_step, added_mass),
    )  # fmt: skip
    of_force = flowing_error(stored, course.approach, course.force)
    first, last = RADIUS * stored["delta"][[0, -1]]
    # Windows of the coarsest meshes reach beyond the table.
    window = course.window(elements_per_radius)
    window = window[(window >= first) & (window <= last)]
    force_there = np.interp(window, course.approach, course.force)
    pressure = force_there.sum() / np.interp(window, course.approach, course.area).sum()
    converged = stored.mean(window / RADIUS)[1] * E
    of_pressure = abs(float(pressure / converged) - 1)
    work = work_of(course.simulation, integrator)
    lines = lines_of(of_force, accuracy, course.processor_s, work)
    lines["error of the mean pressure"] = compare(of_pressure, 0.0, math.inf, scale=1.0)
    return lines, [course.simulation]


def flowing_ball(nu):
    """The stored axisymmetric reference of a ball that flows.

    Raises:
        InputError: There is none with this Poisson's ratio.
    """
    stored = load().get(perfect_name(RATIO, nu))
    if stored is None:
        raise InputError(f"nu = {nu:g}, expected 0.15 or 0.3: there is no reference of others")
    return stored


def flowing_error(stored, approach, force):
    """Error of the force [N] of a ball that flows along its approach [m]."""
    first, last = RADIUS * stored["delta"][[0, -1]]
    on = (approach >= first) & (approach <= last)
    theory = stored.at(approach[on] / RADIUS) * E * RADIUS**2
    return course_error(approach[on], force[on], theory)


@case("oedometer-point", num_bodies=1)
def oedometer_point(
    comm,
    element_size=0.5,
    element: Literal["averaged", "p1"] = "averaged",
    law: Law = "matched",
    fidelity: Literal[*FIDELITIES] = "j2",
    time_step: TimeStep = "assembled",
    added_mass=0.0,
    loading=1.0,
    time_step_factor=0.9,
    accuracy=0.05,
):
    """Twenty angular grains in an oedometer: error of the stress against a fine mesh, and cost.

    Mean over the strain, against the stored course of a fine mesh, pressed slowly.

    Args:
        comm: MPI communicator.
        element_size: Length of edges over half of the distance of grains.
        element, law, fidelity, time_step: The choices.
        added_mass: Most mass that is added for a longer time step, over that of all grains.
        loading: Duration over that at 10 m/s.
        time_step_factor: Time step over the limit of stability: another one is another
            rounding, and shows how far paths of the same model part.
        accuracy: Error that is wanted.
    """
    course = press_grains(
        comm, element_size, fidelity, loading, time_step_factor=time_step_factor, element=element,
        **options_of(law, time_step, added_mass),
    )  # fmt: skip
    return _against_curve(course, read_curve(REFERENCE), accuracy), [course.simulation]


def _against_curve(course, reference, accuracy):
    """Answer of an oedometer test: mean distance of its stress from a stored course."""
    strain, stress, _ = reference
    found = np.interp(PARTS * STRAIN, course.strain, course.stress)
    wanted = np.interp(PARTS * STRAIN, strain, stress)
    work = course.element_steps or math.nan
    results = lines_of(float(distance(found, wanted)), accuracy, course.processor_s, work)
    for part, one, other in zip(PARTS, found, wanted, strict=True):
        name = f"stress at {part:g} of the strain [Pa]"
        results[name] = compare(one, other, math.inf)
    return results


def press_grains(comm, element_size, fidelity="j2", loading=1.0, **options):
    """The oedometer test of the case, whose parameters these are. Collective, one rank.

    Returns:
        :class:`~mufe_fenicsx.verification.fidelity.Course`.
    """
    bodies = angular_grains(COUNTS, element_size, gap=0.0)
    return compress(comm, bodies, FIDELITIES[fidelity], STRAIN, SPEED / loading, **options)


@case("jammed-point", num_bodies=1)
def jammed_point(
    comm,
    element_size=0.5,
    element: Literal["averaged", "p1"] = "averaged",
    law: Law = "matched",
    fidelity: Literal[*FIDELITIES] = "j2",
    time_step: TimeStep = "assembled",
    added_mass=0.0,
    loading=1.0,
    time_step_factor=0.9,
    friction=FRICTION,
    sample=SAMPLE,
    accuracy=0.05,
):
    """Twenty polyhedra that fill an oedometer: error of the stress, converged, and cost.

    Mean over the strain, against the stored course of a fine mesh, pressed slowly. All meshes have
    the same shape and the same gaps, and there is little room for grains to rearrange.

    Args:
        comm: MPI communicator.
        element_size: Length of edges over half of the distance of grains.
        element, law, fidelity, time_step: The choices.
        added_mass: Most mass that is added for a longer time step, over that of all grains.
        loading: Duration over that at 2.5 m/s.
        time_step_factor: Time step over the limit of stability.
        friction: Between grains.
        sample: Seed of the random polyhedra.
        accuracy: Error that is wanted.

    Raises:
        InputError: There is no reference with this friction of this sample.
    """
    reference = read_curve(JAMMED, jammed_column(friction, sample))
    course = press_polyhedra(
        comm, element_size, fidelity, loading, friction, sample,
        time_step_factor=time_step_factor, element=element,
        **options_of(law, time_step, added_mass),
    )  # fmt: skip
    return _against_curve(course, reference, accuracy), [course.simulation]


def jammed_column(friction=FRICTION, sample=SAMPLE):
    """What the table of references calls a test of `jammed_point`."""
    return f"friction {friction:g} sample {sample:g}"


def press_polyhedra(
    comm, element_size, fidelity="j2", loading=1.0, friction=FRICTION, sample=SAMPLE, **options
):
    """The oedometer test of `jammed_point`, whose parameters these are. Collective, one rank.

    Returns:
        :class:`~mufe_fenicsx.verification.fidelity.Course`.
    """
    bodies, speed = polyhedral_grains(element_size, sample=int(sample)), JAMMED_SPEED / loading
    return compress(comm, bodies, FIDELITIES[fidelity], STRAIN, speed, friction=friction, **options)


POINTS = BOUNDS | by_name(
    hertz_point, mindlin_point, impact_point, plastic_sphere_point, oedometer_point, jammed_point,
    sample_point,
)  # fmt: skip
