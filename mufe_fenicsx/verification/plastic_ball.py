"""A half ball on a bonded base into which a rigid plane is pressed, and what is measured."""

import math
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from ..contact.walls import Wall
from ..geometry.half_ball import half_ball
from ..simulation import Simulation
from .build import distribute, drive
from .half_balls import slow_mass_factor
from .pressed import FRAME, turn

#: Towards the pole; nothing is aligned with the axes of space.
AXIS = FRAME[:, 2]
RADIUS = 1e-3


@dataclass(frozen=True)
class Course:
    """What was recorded as the plane came in; arrays of shape (num_records,)."""

    approach: np.ndarray  #: of the plane and the base, from first touch [m]
    force: np.ndarray  #: on the plane [N]
    base_force: np.ndarray  #: on the base [N]
    radius: np.ndarray  #: of the contact [m]
    strain: np.ndarray  #: largest plastic strain
    radius_at_yield: float  #: radius of the contact by Hertz's law when the first element yields
    force_at_yield: float  #: force then [N]; nan if none yields
    kinetic: float  #: largest kinetic energy over the work done, in the second half of the way
    residual: float  #: of the energy balance over the work, at the end
    simulation: Simulation

    @property
    def pressure(self):
        """Mean pressure over the contact [Pa]."""
        return self.force / (math.pi * self.radius**2)

    def force_at(self, approach):
        """Force [N] by interpolation."""
        return np.interp(approach, self.approach, self.force)

    def window(self, elements, h):
        """Records while the radius grows through its last ``elements`` element sizes ``h``."""
        return self.radius > self.radius[-1] - elements * h


def press_ball(
    comm,
    material,
    approach,
    contact_radius,
    elements_per_radius,
    growth=0.3,
    element="averaged",
    periods=6.0,
    records=200,
    watch_yield=False,
    **options,
):
    """Press a plane into the pole of a half ball by ``approach`` and record. Collective, one rank.

    The base is glued to a plane at rest, at the centre of the ball. The ball hardly moves,
    so that damping it costs no force. All sizes of the mesh shrink alike with
    ``elements_per_radius``.

    Args:
        comm: MPI communicator of one rank.
        material: Of the ball.
        approach: Way of the plane from the first touch [m].
        contact_radius: For which the mesh is made [m].
        elements_per_radius: That radius over the length of edges there.
        growth: Growth of the element size with the distance, times elements_per_radius / 2.5.
        element: "averaged" or "plain".
        periods: Duration over the period of a shear wave between pole and base.
        records: Number of records.
        watch_yield: Look for the first plastic strain at each step.
        options: Of :class:`~mufe_fenicsx.simulation.Simulation`.

    Returns:
        :class:`Course`.
    """
    h = contact_radius / elements_per_radius
    slope = growth * 2.5 / elements_per_radius
    points, cells = half_ball(RADIUS, h, slope, (0.0, 0.0, 1.0), contact_radius, 0.4 * RADIUS)
    # The pole is a node: it is moved off the axis by a part of an element.
    tilt = turn([0.37 * h / RADIUS, -0.21 * h / RADIUS, 0])
    turned = points @ (FRAME @ tilt).T
    top = float((turned @ AXIS).max())
    base = FRAME @ tilt[:, 2]
    mesh = distribute(comm, [(turned, cells)])
    walls = [Wall("base", np.zeros(3), base, bonded=True), Wall("plane", top * AXIS, -AXIS)]
    omega = 0.5 * math.pi * math.sqrt(material.shear_modulus / material.rho) / RADIUS
    options = {"damping": 0.3 * omega, "time_step_factor": 0.8} | options
    s = Simulation(
        mesh,
        [material],
        walls,
        element="p1" if element == "plain" else element,
        mass_factor=slow_mass_factor(mesh),
        **options,
    )
    duration = periods * 2 * math.pi / omega
    plane = s.walls.names.index("plane")
    every = max(int(duration / s.dt / records), 1)
    rows, first = [], [math.nan, math.nan]
    kinetic = 0.0

    def record():
        nonlocal kinetic
        strain = s.state.plastic_strain
        force = -float(s.walls.force[plane] @ s.walls.normal[plane])
        if watch_yield and math.isnan(first[0]) and strain.max() > 0:
            first[:] = force, _way(s, plane, top)
        if s.state.num_steps % every:
            return
        base_force = -float(s.walls.force[1 - plane] @ s.walls.normal[1 - plane])
        way = _way(s, plane, top)
        rows.append((way, force, base_force, contact_radius_of(s, plane), float(strain.max())))
        if way > 0.5 * approach:
            e = s.energies()
            kinetic = max(kinetic, e["kinetic"] / e["work"])

    drive(s, {"plane": -approach * AXIS}, duration, at_step=record)
    e = s.energies()
    columns = np.array(rows).T
    return Course(
        *columns,
        radius_at_yield=first[1],
        force_at_yield=first[0],
        kinetic=kinetic,
        residual=abs(e["residual"] / e["work"]),
        simulation=s,
    )


def _way(s, plane, top):
    """Of the plane since the start [m]."""
    return RADIUS - float(s.walls.point[plane] @ AXIS)


def contact_radius_of(s, wall):
    """Radius [m] of the circle whose area is that of the closed facets, as they now lie.

    A facet that the edge of the contact crosses counts whole or not at all, by its centroid.
    """
    pairs, points, own = s.walls.pairs, s.contact.points, s.contact.own
    on = np.flatnonzero(pairs.closed & (pairs.wall == wall))
    on = on if points.corner is None else on[points.recess[pairs.node[on]] == 0.0]
    if points.corner is None:
        return math.sqrt(points.area[pairs.node[on]].sum() / math.pi)
    x = s.state.x[own.nodes[points.corner[pairs.node[on]]]]
    double = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]) @ s.walls.normal[wall]
    area = s.comm.allreduce(float(0.5 * np.abs(double).sum()), op=MPI.SUM)
    return math.sqrt(area / math.pi)
