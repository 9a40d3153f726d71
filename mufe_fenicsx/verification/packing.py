"""A packing of angular grains in an oedometer, watched by an independent check for intrusion."""

import numpy as np
from mpi4py import MPI

from ..contact.separation import separate
from ..contact.walls import Wall
from ..errors import InputError
from ..explicit.simulation import Simulation
from ..geometry.bodies.shapes import sphere
from ..loading.oedometer import OedometerLoading
from ..materials.sand import SAND
from ..run.from_bodies import axis_planes, build
from .case import case, compare
from .intrusion import find_intrusion

RADIUS = 1e-3


@case("packing", num_bodies=8)
def packing(
    comm, columns=5, layers=4, strain=0.15, element_size=0.45, speed=20.0, friction=0.23, states=10
):
    """Angular grains compressed to a strain of 0.15: none is deeper than 0.1 h in another.

    The grains are cells between jittered centres, with flat faces, edges and corners that meet
    in all ways, and the elasto-plastic material of the paper. At each stored state the library
    ipctk (in the extra ``test``) finds the deepest point of a surface inside another grain.

    Args:
        comm: MPI communicator.
        columns, layers: Grains along x and y, and along z.
        strain: Vertical strain after seating.
        element_size: Edge of the elements over half of the distance of centres.
        speed: Of the top platen [m/s].
        friction: Coefficient of friction between grains.
        states: States to look at, evenly over the strain, beside the start.
    """
    bodies = angular_grains((columns, columns, layers), element_size)
    if len(bodies) < comm.size:
        raise InputError(
            f"number of grains = {len(bodies)}, expected at least one a rank, {comm.size}"
        )
    mesh = build(comm, bodies, SAND, np.zeros(3), np.zeros(3), axes="").mesh
    separate(mesh, 0.3)
    low = np.min(comm.allgather(mesh.x.min(axis=0)), axis=0)
    high = np.max(comm.allgather(mesh.x.max(axis=0)), axis=0)
    walls = [Wall(name, *plane) for name, plane in axis_planes(low, high).items()]
    s = Simulation(mesh, [SAND] * mesh.num_grains, walls, friction=friction)
    area = (high - low)[0] * (high - low)[1]
    loading = OedometerLoading(s, strain, speed, 0.01, 1e5 * area, speed)
    deepest = deepest_vertex = due = 0.0
    while True:
        if loading.progress >= due:
            due += strain / states
            found = intrusion_of(s)
            deepest = max(deepest, found.depth)
            deepest_vertex = max(deepest_vertex, found.vertex_depth)
        if loading.finished:
            break
        loading.before_step()
        s.step()
    s.check()
    bottom, top = s.wall_forces()[4:]
    e = s.energies()
    # Of contact half of the largest depth, and dents.
    limit = 0.1 + comm.allreduce(s.contact.pairs.dent.max(initial=0.0), op=MPI.MAX) / s.contact.edge
    results = {
        "deepest vertex inside another grain over h": compare(
            deepest_vertex / s.contact.edge, 0.0, limit, scale=1.0
        ),
        "deepest point inside another grain over h": compare(
            deepest / s.contact.edge, 0.0, limit, scale=1.0
        ),
        "strain": compare(loading.strain, strain, 1e-3),
        # Grains under no load cannot intrude; at this speed platens agree but roughly.
        "bottom against top force": compare(bottom, top, 0.25),
        # The budget of a run, 1 %.
        "energy residual over work": compare(e["residual"] / e["work"], 0.0, 0.01, scale=1.0),
    }
    return results, [s]


def intrusion_of(simulation):
    """:func:`find_intrusion` of all grains of a simulation now. Collective."""
    own, comm = simulation.contact.own, simulation.comm
    parts = comm.gather((simulation.state.x[own.nodes], own.facets, own.grain_of_node))
    found = error = None
    if comm.rank == 0:
        first = np.cumsum([0] + [len(x) for x, *_ in parts])
        try:
            found = find_intrusion(
                np.concatenate([x for x, *_ in parts]),
                np.concatenate([f + k for (_, f, _), k in zip(parts, first, strict=False)]),
                np.concatenate([grain for *_, grain in parts]),
                0.25 * simulation.contact.edge,
            )
        except InputError as raised:
            error = raised
    found, error = comm.bcast((found, error))
    if error is not None:
        raise error
    return found


def angular_grains(counts, element_size, gap=0.02, jitter=0.15, roundness=0.08, seed=7):
    """Grains with flat faces and rounded edges that nearly fill space, as in crushed rock.

    A ball's mesh is drawn out along its rays to the faces half-way to the neighbours (a
    power mean of all faces rounds the edges), but no further than 1.2 times the mean.

    Args:
        counts: Grains along x, y, z.
        element_size: Edge of the elements over half of the distance of centres.
        gap: Between faces, over half of the distance of centres.
        jitter: Largest shift of a centre along each axis, over the distance of centres.
        roundness: The higher the rounder, between 0 and 1.
        seed: Of the shifts.

    Returns:
        List of (points [m], cells).
    """
    rng = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1).reshape(-1, 3)
    centres = 2.0 * grid + 2.0 * jitter * rng.uniform(-1, 1, grid.shape)
    points, cells = sphere(1.0, element_size)
    length = np.linalg.norm(points, axis=1)
    ray = points / np.maximum(length, 1e-12)[:, None]
    power = 1.0 / roundness
    bodies = []
    for k, centre in enumerate(centres):
        to = np.delete(centres, k, axis=0) - centre
        far = np.linalg.norm(to, axis=1)
        near = far < 4.5
        reached = ray @ (to[near] / far[near, None]).T / (0.5 * far[near] - 0.5 * gap)
        inverse = (np.maximum(reached, 0.0) ** power).sum(axis=1) + (1 / 1.2) ** power
        radius = inverse ** (-1 / power)
        bodies.append((RADIUS * (centre + points * radius[:, None]), cells))
    return bodies
