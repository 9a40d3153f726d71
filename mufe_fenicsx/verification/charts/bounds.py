"""Points of charts for what bounds a sample: a wall that is a cylinder, a tool, a membrane.

As those of :mod:`.points`. A ball pressed into a hollow cylinder, or by a ball that is a tool,
follows Hertz's law with the compliance of the whole ball added; a tube under pressure is compared
with axisymmetric elements.
"""

import math
import time
from typing import Literal

import numpy as np

from ...bulk.tools import Tool, ToolPath
from ...contact.walls import Wall
from ...geometry.bodies.half_ball import half_ball
from ...materials.elastic import Elastic
from ...run.from_bodies import build, drive
from ...theory import hertz
from ..case import by_name, case
from ..curved_walls import AXIS, UP, Hollow
from ..hertz_bodies import RADIUS, RHO, E, hertz_at, whole_contact
from ..membrane import BLOWN_UP, deflected
from ..plastic_ball import slope_of
from ..pressed import turn
from .answers import TimeStep, course_error, lines_of, options_of, work_of

Bulk = Literal["averaged", "p1"]
Integrator = Literal["explicit", "static"]
#: Radius of the cylinder over that of the ball, edges of the tool over those of the grain, height
#: of the tube over its inner radius.
WIDER, TOOL_SIZE, HEIGHT = 2.0, 0.5, 1.5
#: Duration over the period of the ball, static increments, records of a course in time steps.
PERIODS, INCREMENTS, RECORDS = 3.0, 10, 200


@case("cylinder-wall-point", num_bodies=1)
def cylinder_wall_point(
    comm,
    elements_per_radius=2.5,
    growth=0.3,
    element: Bulk = "averaged",
    integrator: Integrator = "explicit",
    time_step: TimeStep = "assembled",
    added_mass=0.0,
    a_over_R=0.02,
    nu=0.22,
    accuracy=0.05,
):
    """A rigid cylinder, twice as wide, pressed on an elastic ball inside: error of its force, cost.

    Args:
        comm: MPI communicator.
        elements_per_radius: Contact radius √(ab) at the end over the length of edges there.
        growth: Growth of the element size with the distance, for plastic_ball.slope_of.
        element, integrator, time_step: The choices.
        added_mass: Most mass that is added for a longer time step, over that of the body.
        a_over_R: Contact radius at the end over that of the ball.
        nu: Poisson's ratio.
        accuracy: Error that is wanted.
    """
    a, hollow = a_over_R * RADIUS, Hollow(AXIS, WIDER)
    unit = hertz.elliptic_contact(1.0, *hollow.curvatures(), hertz.effective_modulus((E, nu)))
    way, radius = a**2 / (unit[1] * unit[2]), WIDER * RADIUS
    ball, base = _ball(a, elements_per_radius, growth)
    wall = Wall("side", (RADIUS - radius) * UP, AXIS, radius=radius)
    # Nodes of a ball whose facets enclose its volume stand out of it.
    room = max(0.0, -float(wall.gap(ball[0]).min()))
    wall.point = wall.point + room * UP
    duration = _duration(nu)
    s = _build(comm, ball, nu, [base, wall], integrator, duration, element=element,
               **options_of("matched", time_step, added_mass))  # fmt: skip
    start = float(wall.point[2])
    rows, record = _recorder(s, duration, lambda: start - s.walls.point[1, 2],
                             lambda: s.walls.force[1, 2])  # fmt: skip
    began = time.process_time()
    drive(s, {"side": -(way + room) * UP}, duration, at_step=record)
    spent = time.process_time() - began
    return _answer(s, rows, room, unit[0], (a, nu), accuracy, spent, integrator)


@case("tool-point", num_bodies=1)
def tool_point(
    comm,
    elements_per_radius=2.5,
    growth=0.3,
    element: Bulk = "averaged",
    integrator: Integrator = "explicit",
    time_step: TimeStep = "assembled",
    added_mass=0.0,
    a_over_R=0.02,
    nu=0.22,
    accuracy=0.05,
):
    """A ball that is a tool pressed on an elastic one of the same size: error of the force, cost.

    Args:
        comm: MPI communicator.
        elements_per_radius: Contact radius at the end over the length of edges there.
        growth: Growth of the element size with the distance, for plastic_ball.slope_of.
        element, integrator, time_step: The choices.
        added_mass: Most mass that is added for a longer time step, over that of the body.
        a_over_R: Contact radius at the end over that of the balls.
        nu: Poisson's ratio.
        accuracy: Error that is wanted.
    """
    a = a_over_R * RADIUS
    way = 2 * a**2 / RADIUS
    ball, base = _ball(a, elements_per_radius, growth)
    size, slope = TOOL_SIZE * a / elements_per_radius, slope_of(growth, elements_per_radius)
    points, cells = half_ball(RADIUS, size, slope, -UP, a, 0.4 * RADIUS)
    # The pole of either stands out of its ball.
    points = points + (ball[0][:, 2].max() - points[:, 2].min()) * UP
    room = float(points[:, 2].max()) - 2 * RADIUS
    duration, part = _duration(nu), np.linspace(0.0, 1.0, 401)
    place = np.zeros((part.size, 6))
    place[:, 2] = -(way + room) * (part - np.sin(2 * math.pi * part) / (2 * math.pi))
    tool = Tool("ball", points, cells, path=ToolPath(duration * part, place))
    s = _build(comm, ball, nu, [base], integrator, duration, element=element, tools=[tool],
               **options_of("matched", time_step, added_mass))  # fmt: skip
    rows, record = _recorder(s, duration, lambda: -s.tools.places()[0, 2],
                             lambda: s.tools.forces()[0, 2])  # fmt: skip
    began = time.process_time()
    while s.state.t < (1 - 1e-9) * duration:
        s.step()
        record()
    spent = time.process_time() - began
    stiffness = float(hertz.hertz_force(1.0, 0.5 * RADIUS, hertz.effective_modulus((E, nu))))
    return _answer(s, rows, room, stiffness, (a, nu), accuracy, spent, integrator)


def _ball(a, elements_per_radius, growth):
    """Half a ball whose pole is up and no node is on the axis, and what its base is glued to."""
    h, slope = a / elements_per_radius, slope_of(growth, elements_per_radius)
    points, cells = half_ball(RADIUS, h, slope, UP, a, 0.4 * RADIUS)
    tilt = turn([0.37 * h / RADIUS, -0.21 * h / RADIUS, 0])
    return (points @ tilt.T, cells), Wall("base", np.zeros(3), tilt[:, 2], bonded=True)


def _frequency(nu):
    """Of a shear wave between pole and base [rad/s]."""
    return 0.5 * math.pi * math.sqrt(Elastic(E, nu, RHO).shear_modulus / RHO) / RADIUS


def _duration(nu):
    return PERIODS * 2 * math.pi / _frequency(nu)


def _build(comm, ball, nu, walls, integrator, duration, **options):
    """The ball, whose base is glued, in time steps or static increments."""
    if integrator == "static":
        options |= {"increment": duration / INCREMENTS, "linear_solver": "products"}
    return build(
        comm, [ball], Elastic(E, nu, RHO), np.zeros(3), np.zeros(3), "", walls=walls, friction=0.0,
        damping=0.3 * _frequency(nu), time_step_factor=0.8, **options,
    )  # fmt: skip


def _recorder(s, duration, way, force):
    """Rows (way [m], force [N]), and what adds one at even steps."""
    rows, every = [], max(int(duration / s.dt / RECORDS), 1)

    def record():
        if s.state.num_steps % every == 0:
            rows.append((way(), force()))

    return rows, record


def _answer(s, rows, room, stiffness, of_ball, accuracy, spent, integrator):
    """Of a contact with F = ``stiffness`` δ^(3/2) [N/m^(3/2)] on a half-space."""
    way, force = np.array(rows).T
    approach = way - room
    error = course_error(approach, force, force_on_ball(approach, stiffness, *of_ball))
    return lines_of(error, accuracy, spent, work_of(s, integrator)), [s]


def force_on_ball(approach, stiffness, a, nu):
    """Force [N] on a ball at approaches [m] of its middle: the contact and the ball in series.

        δ = (F/k)^(2/3) + C F

    Far from it a contact of any shape is its force, so that C is that of a ball on a plane.

    Args:
        approach: Of the ball's middle [m].
        stiffness: k, F over δ^(3/2) on a half-space [N/m^(3/2)].
        a: Contact radius on a plane for which C is taken [m].
        nu: Poisson's ratio.
    """
    whole = whole_contact("sphere-plane", a, nu)
    alone = (whole.force / hertz_at("sphere-plane", 1.0, nu).force) ** (2 / 3)
    compliance = (whole.delta - alone) / whole.force
    delta = np.linspace(0.0, 1.2 * float(np.max(approach)), 2001)
    force = stiffness * delta**1.5
    return np.interp(approach, delta + compliance * force, force)


@case("membrane-point", num_bodies=1)
def membrane_point(
    comm,
    ends_over_t=0.5,
    h_over_t=2.0,
    layers=2,
    element: Bulk = "averaged",
    time_step: TimeStep = "assembled",
    added_mass=0.0,
    t_over_R=0.1,
    accuracy=0.05,
):
    """A rubber tube between two platens that is blown up: error of its shape, and cost.

    Largest difference of radii from axisymmetric elements, over the largest deflection.

    Args:
        comm: MPI communicator.
        ends_over_t: Length of edges along at the platens over the thickness.
        h_over_t: Length of the others.
        layers: Elements through the wall.
        element, time_step: The choices.
        added_mass: Most mass that is added for a longer time step, over that of the tube.
        t_over_R: Thickness over inner radius.
        accuracy: Error that is wanted.
    """
    s, found, reference, spent = deflected(
        comm, -BLOWN_UP * t_over_R, h_over_t, layers, t_over_R, HEIGHT, ends_over_t,
        element=element,
        **options_of("matched", time_step, added_mass),
    )  # fmt: skip
    error = float(np.abs(found - reference).max() / np.abs(reference).max())
    return lines_of(error, accuracy, spent, work_of(s)), [s]


BOUNDS = by_name(cylinder_wall_point, tool_point, membrane_point)
