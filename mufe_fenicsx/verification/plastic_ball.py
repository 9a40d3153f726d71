"""A half ball on a bonded base into which a rigid plane is pressed, and what is measured."""

import math
import time
from dataclasses import dataclass

import numpy as np

from ..contact.walls import Wall
from ..explicit.simulation import Simulation
from ..geometry.bodies.half_ball import half_ball
from ..run.from_bodies import distribute, drive, simulate
from .half_balls import ADDED, slow_mass_factor
from .pressed import FRAME, turn

#: Towards the pole; nothing is aligned with the axes of space.
AXIS = FRAME[:, 2]
RADIUS = 1e-3
#: Where the axis meets the facets, in edges from a node; the first where one place is enough.
PHASES = ((0.37, -0.21), (-0.41, -0.26), (0.3, 0.08), (-0.41, -0.07), (-0.36, 0.23))


@dataclass(frozen=True)
class Course:
    """What was recorded as the plane came in; arrays of shape (num_records,)."""

    approach: np.ndarray  #: of the plane and the base, from first touch [m]
    force: np.ndarray  #: on the plane [N]
    area: np.ndarray  #: of the contact [m²]
    strain: np.ndarray  #: largest plastic strain
    force_at_yield: float  #: when the first element below the surface yields [N]; nan if none does
    kinetic: float  #: largest kinetic energy over the work done, in the second half of the way
    residual: float  #: of the energy balance over the work, at the end; nan without work
    seconds: float  #: wall time without making the mesh
    processor_s: float  #: the same in time of the processor
    simulation: Simulation

    def window(self, elements, approach=None):
        """Approaches [m] over which the contact grows by one element, shape (41,).

        It grows through a part 1/``elements`` of its radius, by which its edge passes all places
        within an element; approach goes with the radius squared.

        Args:
            elements: Elements per contact radius in the middle of that.
            approach: In its middle [m]; None: it ends with the last record.
        """
        part = 0.5 / elements
        if approach is None:
            approach = self.approach[-1] / (1 + part) ** 2
        return approach * np.linspace(1 - part, 1 + part, 41) ** 2

    def mean(self, elements, approach=None):
        """Approach [m], force [N] and mean pressure [Pa], means over :meth:`window`."""
        approach = self.window(elements, approach)
        force = np.interp(approach, self.approach, self.force)
        area = np.interp(approach, self.approach, self.area)
        return float(approach.mean()), float(force.mean()), float(force.sum() / area.sum())


def slope_of(growth, elements_per_radius):
    """Growth of the element size with the distance from a contact.

    ``growth`` at 2.5 elements per radius. Meshes with more are finer everywhere in proportion;
    those with fewer are nearly uniform, as those of whole samples, where contacts are so small.
    """
    return growth * min(2.5 / elements_per_radius, elements_per_radius / 2.5)


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
    increments=None,
    added_mass=ADDED,
    phase=PHASES[0],
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
        growth: Growth of the element size with the distance, for :func:`slope_of`.
        element: One of solid.ELEMENTS.
        periods: Duration over the period of a shear wave between pole and base.
        records: Number of records.
        watch_yield: Look for the first plastic strain at each step.
        increments: Number of static increments; None for time steps.
        added_mass: By which small elements are slowed down, over that of the body.
        phase: By how many edges the pole, a node, is off the axis, along both tangents.
        options: Of :class:`~mufe_fenicsx.explicit.simulation.Simulation`.

    Returns:
        :class:`Course`.
    """
    h = contact_radius / elements_per_radius
    slope = slope_of(growth, elements_per_radius)
    points, cells = half_ball(RADIUS, h, slope, (0.0, 0.0, 1.0), contact_radius, 0.4 * RADIUS)
    tilt = turn([phase[0] * h / RADIUS, phase[1] * h / RADIUS, 0])
    turned = points @ (FRAME @ tilt).T
    top = float((turned @ AXIS).max())
    base = FRAME @ tilt[:, 2]
    mesh = distribute(comm, [(turned, cells)])
    walls = [Wall("base", np.zeros(3), base, bonded=True), Wall("plane", top * AXIS, -AXIS)]
    started, began = time.perf_counter(), time.process_time()
    omega = 0.5 * math.pi * math.sqrt(material.shear_modulus / material.rho) / RADIUS
    options = {"damping": 0.3 * omega, "time_step_factor": 0.8} | options
    if increments:  # the base holds the ball
        options = {"linear_solver": "products"} | options
    duration = periods * 2 * math.pi / omega
    s = simulate(
        mesh,
        [material],
        walls,
        increment=duration / increments if increments else None,
        element=element,
        mass_factor=slow_mass_factor(mesh, added_mass) if added_mass else None,
        **options,
    )
    plane = s.walls.names.index("plane")
    every = max(int(duration / s.dt / records), 1)
    own = np.zeros(mesh.num_nodes, dtype=bool)
    own[s.contact.own.nodes] = True
    below = ~own[mesh.cells].any(axis=1)
    force_at_yield = math.nan
    rows = []
    kinetic = 0.0

    def record():
        nonlocal kinetic, force_at_yield
        strain = s.state.plastic_strain
        force = -float(s.walls.force[plane] @ s.walls.normal[plane])
        if watch_yield and math.isnan(force_at_yield) and strain[below].max() > 0:
            force_at_yield = force
        if s.state.num_steps % every:
            return
        way = _way(s, plane, top)
        rows.append((way, force, contact_area(s, plane), float(strain.max())))
        e = s.energies()
        if way > 0.5 * approach and e["work"] > 0:
            kinetic = max(kinetic, e["kinetic"] / e["work"])

    drive(s, {"plane": -approach * AXIS}, duration, at_step=record)
    e = s.energies()
    columns = np.array(rows).T
    return Course(
        *columns,
        force_at_yield=force_at_yield,
        kinetic=kinetic,
        residual=abs(e["residual"] / e["work"]) if e["work"] else math.nan,
        seconds=time.perf_counter() - started,
        processor_s=time.process_time() - began,
        simulation=s,
    )


def _way(s, plane, top):
    """Of the plane since the start [m]."""
    return RADIUS - float(s.walls.point[plane] @ AXIS)


def contact_area(s, wall):
    """Area [m²] of the disc on which an even pressure has the second moment of this one. Local.

    That is 2π times the mean square of the distance from the middle, weighted by force. Forces of
    points are brought to the nodes, which the body feels.
    """
    pairs, points, own = s.walls.pairs, s.contact.points, s.contact.own
    on = np.flatnonzero(pairs.wall == wall)
    normal_force = np.zeros((points.num_points, 1))
    normal_force[pairs.node[on], 0] = np.maximum(pairs.normal_force[on], 0.0)
    force = points.to_nodes(normal_force, own.nodes.size)[:, 0]
    total = force.sum()
    if total == 0.0:
        return 0.0
    x = s.state.x[own.nodes]
    away = x - force @ x / total
    away -= np.outer(away @ s.walls.normal[wall], s.walls.normal[wall])
    return float(2.0 * math.pi * (force @ np.einsum("ij,ij->i", away, away)) / total)
