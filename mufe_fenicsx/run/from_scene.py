"""From a scene file and grains on disk to the simulation of a test."""

from copy import copy
from dataclasses import fields, replace

import numpy as np
from mpi4py import MPI

from ..bulk.cracks.cracks import Cracks
from ..contact.separation import separate
from ..contact.settings import ContactSettings
from ..contact.walls import Wall
from ..container import SIDE, Bounds
from ..errors import InputError, raise_together
from ..explicit.simulation import Simulation
from ..geometry.bodies.sleeve import sleeve_around
from ..geometry.grains import load_grains, read_grain_table
from ..loading.measures import MembraneMeasures
from ..loading.membrane import Membrane
from ..loading.oedometer import OedometerLoading
from ..loading.stages import StagedLoading
from ..machine.ranks import on_first_rank
from ..mesh import create_grain_mesh, partition_grains
from .seating import hold_of

#: Part of the radius by which grains may reach through a cylinder that the scene states.
OUTSIDE = 1e-6


def load_mesh(comm, grains_folder, rank_of_grain=None, tools=(), around=None):
    """Read each rank's own grains and make the distributed mesh. Collective.

    Args:
        comm: MPI communicator.
        grains_folder: Folder that `mufe mesh` wrote.
        rank_of_grain: Ranks of the grains, of the sleeve and of the tools; None: evenly by their
            cells, and the sleeve on the last one.
        tools: All :class:`~mufe_fenicsx.bulk.tools.Tool`, further bodies of the mesh.
        around: ``around(comm, points, cut)`` makes a sleeve around this rank's nodes ``points`` and
            those of others, which a cylinder ``cut``, or None: a body, the same on all ranks;
            collective. None: there is no sleeve.

    Raises:
        InputError: The folder cannot be used, or there are more ranks than grains.
    """
    # The checksum first: HDF5 may hang on a file that is damaged.
    found = on_first_rank(comm, lambda: read_grain_table(grains_folder))
    labels, num_cells, _, centroids = comm.bcast(found)
    num_grains = labels.size
    if comm.size > labels.size:
        raise InputError(
            f"number of ranks = {comm.size}, expected at most the number of grains, {labels.size}"
        )
    of_tools = [tool.points.mean(axis=0) for tool in tools]
    if rank_of_grain is None:
        work = np.append(num_cells, np.ones(len(tools)))  # tools cost next to nothing
        rank_of_grain = partition_grains(work, np.vstack([centroids, *of_tools]), comm.size)
        if around is not None:
            rank_of_grain = np.insert(rank_of_grain, num_grains, comm.size - 1)
    rank_of_grain = np.asarray(rank_of_grain, dtype=np.int32)
    own = np.flatnonzero(rank_of_grain == comm.rank)
    mine, others = own[own < num_grains], own[own >= num_grains]
    grains = _together(comm, lambda: load_grains(grains_folder, mine, compare=False))
    cell_grain = np.repeat(mine, np.diff(grains.cell_offset))
    points, cells = grains.points, grains.cells
    sleeves = () if around is None else (SIDE,)
    bodies = [around(comm, points, grains.cylinder) for _ in sleeves]
    bodies += [(tool.points, tool.cells) for tool in tools]
    for number in others:
        body = bodies[number - num_grains]
        cells = np.vstack([cells, body[1] + len(points)])
        points = np.vstack([points, body[0]])
        cell_grain = np.append(cell_grain, np.full(len(body[1]), number))
    labels = np.append(labels, labels.max() + 1 + np.arange(len(bodies)))
    names = [tool.name for tool in tools]
    mesh = create_grain_mesh(comm, points, cells, cell_grain, labels, rank_of_grain, sleeves, names)
    return replace(mesh, cylinder=grains.cylinder)


def _together(comm, read):
    """What each rank reads; an error of one is raised by all. Collective."""
    found, message = None, None
    try:
        found = read()
    except (InputError, OSError) as error:
        message = str(error)
    raise_together(comm, message)
    return found


def separate_surfaces(mesh, sample):
    """Move overlapping surfaces apart where the scene wants that; what was moved, or None."""
    if not sample.separation:
        return None
    return separate(mesh, sample.max_shift, sample.close_gaps, sample.close_gaps_over_h)


def sleeve_of(scene):
    """What makes the sleeve of a scene for :func:`load_mesh`; None without a membrane.

    It stands between the platens. Its facets keep off the grains by the gap.
    """
    if scene.membrane is None:
        return None

    def around(comm, points, cut):
        low, high = _extent(comm, points)
        settings = scene.membrane
        centre, radius = _cylinder(scene, comm, points, cut)
        if settings.thickness > 0.5 * radius:
            raise InputError(
                f"membrane.thickness = {settings.thickness:.3g} m, expected at most half of the "
                f"sample's radius, {0.5 * radius:.3g} m"
            )
        found, cells = sleeve_around(
            radius + settings.room, settings.thickness, high[2] - low[2], settings.edge(radius),
            settings.layers,
        )  # fmt: skip
        return found + np.append(centre, low[2]), cells

    return around


def make_membrane(scene, simulation, bounds):
    """The :class:`Membrane` of a scene, and what it measures; None without one. Collective."""
    settings = scene.membrane
    if settings is None:
        return None
    label = simulation.mesh.labels_of_sleeves[0]
    membrane = Membrane(simulation, label, damping=settings.rate(bounds.radius))
    return MembraneMeasures(membrane, settings.E * settings.thickness, settings.correction)


def make_walls(scene, bounds, sleeves=()):
    """The walls of a scene, list of :class:`~mufe_fenicsx.contact.walls.Wall`.

    Args:
        scene: :class:`~mufe_fenicsx.scene.Scene`.
        bounds: :class:`~mufe_fenicsx.container.Bounds` that they stand at.
        sleeves: Labels of sleeves: they take the place of the side, and platens glue their ends.
    """
    container, walls = scene.container.kind, []
    areas = container.areas_of_walls(container.lengths_within(bounds))
    for surface, area in zip(container.surfaces(bounds), areas, strict=True):
        if sleeves and surface.name == SIDE:
            continue
        settings = scene.walls[surface.name]
        moves = {"velocity": settings.velocity * surface.normal}
        if surface.radius:
            rate = -float(np.sign(surface.radius)) * settings.velocity
            moves = {"radius": surface.radius, "growth_rate": rate}
        walls.append(
            Wall(
                name=surface.name,
                point=surface.point,
                normal=surface.normal,
                friction=settings.friction,
                friction_kinetic=settings.friction_kinetic,
                target=None if settings.stress is None else settings.stress * area,
                speed=settings.speed or 0.0,
                mirror=bool(settings.mirror),
                bonded=tuple(sleeves) or False,
                **moves,
            )
        )
    return walls


def find_bounds(scene, mesh):
    """Where the walls of a scene stand: around all grains and tools, or where it says. Collective.

    A cylinder that the scene does not place is the one that has cut the grains, if one has. Their
    faces lie on it exactly, which no search for the smallest circle finds.

    Raises:
        InputError: Grains are outside of the cylinder that the scene states, or in its hole.
    """
    low, high = _extent(mesh.comm, mesh.x)
    centre, radius, inner = 0.5 * (low + high)[:2], 0.0, 0.0
    if scene.container.shape != "box":
        of_grains = mesh.x[mesh.sample_nodes]  # tools pass through its side
        centre, radius = _cylinder(scene, mesh.comm, of_grains, mesh.cylinder)
    if scene.container.shape == "hollow cylinder":
        inner = _inner_radius(mesh, centre, scene.container.inner_radius)
    return Bounds(low, high, centre, radius, inner)


def _inner_radius(mesh, centre, given):
    """Radius of the hole [m]: the given one, or that of the node next to the axis. Collective."""
    of_grains = mesh.x[mesh.sample_nodes, :2]
    nearest = float(np.linalg.norm(of_grains - centre, axis=1).min(initial=np.inf))
    nearest = mesh.comm.allreduce(nearest, op=MPI.MIN)
    radius = nearest if given is None else given
    if not 0.0 < radius <= nearest * (1.0 + OUTSIDE):
        raise InputError(
            f"container.inner_radius = {radius:.9g}, expected more than 0 and at most "
            f"{nearest:.9g}: that of the innermost node of the grains about "
            f"{centre[0]:.6g}, {centre[1]:.6g}"
        )
    return radius


def _extent(comm, points):
    """Corners of the box around the points of all ranks [m], two of shape (3,). Collective."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    comm.Allreduce(points.min(axis=0, initial=np.inf), low, op=MPI.MIN)
    comm.Allreduce(points.max(axis=0, initial=-np.inf), high, op=MPI.MAX)
    return low, high


def _cylinder(scene, comm, points, cut):
    """Centre across z, shape (2,), and radius of a scene's cylinder around points [m]. Collective.

    Args:
        scene: :class:`~mufe_fenicsx.scene.Scene`.
        comm: MPI communicator.
        points: Nodes of this rank's grains [m], shape (num_nodes, 3).
        cut: The cylinder that cut them, x, y and radius [m]; None: there was none.

    Raises:
        InputError: Points are outside of the cylinder that the scene states.
    """
    stated = scene.container
    places = np.concatenate(comm.allgather(_hull(points[:, :2])))
    given = stated.centre
    if given is not None:
        centre = np.array(given)
    elif cut is not None:
        centre = np.array(cut[:2])
    else:
        centre = _middle_of_smallest_circle(places)
    needed = float(np.linalg.norm(places - centre, axis=1).max())
    radius = needed if stated.radius is None else stated.radius
    if cut is not None and given is None and stated.radius is None:
        radius = max(radius, float(cut[2]))
    if needed > radius * (1.0 + OUTSIDE):
        raise InputError(
            f"container.radius = {radius:.9g}, expected at least {needed:.9g}: that of the "
            f"outermost node of the grains about {centre[0]:.6g}, {centre[1]:.6g}"
        )
    return centre, radius


def _hull(places):
    """Corners of the convex hull of points in a plane, shape (num_corners, 2)."""
    if not len(places):
        return places
    from scipy.spatial import ConvexHull

    return places[ConvexHull(places).vertices]


def _middle_of_smallest_circle(places):
    """Of those around points of a plane, (num, 2): the middle m of the least r² ≥ |x - m|²."""
    from scipy.optimize import minimize  # of no other test

    middle, size = places.mean(axis=0), np.ptp(places, axis=0).max()
    x = (places - middle) / size

    def room(unknown):  # of each point: r² - |x - m|²
        return unknown[2] - ((x - unknown[:2]) ** 2).sum(axis=1)

    start = np.array([0.0, 0.0, (x**2).sum(axis=1).max()])
    found = minimize(
        lambda unknown: unknown[2], start, method="SLSQP", tol=1e-12,
        constraints={"type": "ineq", "fun": room},
    )  # fmt: skip
    return middle + size * found.x[:2]


def make_simulation(scene, prepared, shorter=1.0):
    """The :class:`Simulation` of a scene at its start. Collective.

    Args:
        scene: :class:`~mufe_fenicsx.scene.Scene`.
        prepared: :class:`~.preparation.Prepared`.
        shorter: The scene's time step times this.
    """
    solver, mesh = scene.solver, prepared.mesh
    contact = {key.name: getattr(scene.contact, key.name) for key in fields(ContactSettings)}
    contact["friction"] = scene.friction_of(mesh.labels[: mesh.first_tool], len(mesh.sleeves))
    make = Simulation
    more = {
        "assembled": solver.time_step == "assembled",
        "time_step_factor": solver.time_step_factor * shorter,
        "mass_scaling": scene.mass_scaling,
        "hold_step": scene.fracture is not None,
    }
    if solver.integrator != "explicit":
        # A tenth of a second that others need not wait.
        from ..implicit.simulation import ImplicitSimulation

        make, more = ImplicitSimulation, _increments(scene, prepared.bounds.height, shorter)
    simulation = make(
        mesh,
        materials_of(scene, mesh),
        [copy(wall) for wall in prepared.walls],  # whose targets may change
        **more,
        **contact,
        element=solver.element,
        damping=solver.damping,
        gravity=scene.gravity,
        tools=prepared.tools,
    )
    if scene.fracture is not None:
        simulation.add_term(Cracks(simulation.specimen, scene.fracture))
    return simulation


def make_loading(scene, simulation, area, measures=None):
    """What moves the walls of a simulation, at its start. Collective.

    Args:
        scene, simulation: The scene, and what was made of it.
        area: Of the sample across the axis [m²].
        measures: Of what surrounds the sample, of loading.measures; None: of its walls.
    """
    oedometer = scene.oedometer
    if oedometer is None:
        return StagedLoading(simulation, scene.loading, scene.stages, scene.quasi_static, measures)
    return OedometerLoading(
        simulation,
        oedometer.strain,
        oedometer.speed,
        oedometer.ramp,
        oedometer.seating_stress * area,
        oedometer.seating_speed,
        scene.quasi_static,
        hold_of(simulation, oedometer),
    )


def materials_of(scene, mesh):
    """Material of each grain of this rank, and of a sleeve, but of no tool. Local.

    Raises:
        InputError: A group of the scene names a grain that the sample has not.
    """
    sample = mesh.labels[: mesh.num_sample_grains]
    found = scene.materials_of(mesh.labels[mesh.grains[mesh.is_of_sample]], sample)
    if mesh.sleeves:
        num = np.count_nonzero(~mesh.is_tool & ~mesh.is_of_sample)
        found += [scene.membrane.material] * int(num)
    return found


def _increments(scene, height, shorter):
    """Options of an :class:`ImplicitSimulation`, strains turned into times."""
    settings, dynamic = scene.implicit, scene.solver.integrator == "implicit"
    second = shorter * height / scene.oedometer.speed  # for a strain of one
    smallest, largest = settings.smallest, settings.largest
    return {
        "first_step": settings.step * second,
        "smallest_step": None if smallest is None else smallest * second,
        "largest_step": None if largest is None else largest * second,
        "spectral_radius": settings.spectral_radius if dynamic else None,
        "stabilisation": settings.stabilisation,
        "tolerance": settings.tolerance,
        "max_iterations": settings.max_iterations,
        "linear_solver": settings.linear_solver,
        "petsc": settings.petsc_options(),
    }
