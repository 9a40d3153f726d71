"""From a few bodies to a simulation, and how to load it without shaking it."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import ArrayLike

from ..arguments import body_of, checked, finite_number
from ..bulk.tools import Tool
from ..contact.walls import Wall
from ..errors import (
    InputError,
    finite_array,
    nearest_name,
    raise_together,
    shortened,
    shown,
)
from ..explicit.simulation import Simulation
from ..implicit.simulation import ImplicitSimulation
from ..materials.elastic import IsotropicSolid
from ..mesh import GrainMesh, create_grain_mesh, partition_grains

#: Options that increments have no use for.
OF_STEPS = ("assembled", "time_step_factor", "refresh", "mass_scaling", "hold_step")
#: Steps that a computer takes in a life.
MOST_STEPS = 1e9
#: Nodes [m], shape (num_nodes, 3), and tetrahedra, shape (num_cells, 4).
Body = tuple[np.ndarray, np.ndarray]


@checked
def build(
    comm: MPI.Intracomm,
    bodies: list[Body],
    material: IsotropicSolid | list[IsotropicSolid],
    low: ArrayLike,
    high: ArrayLike,
    axes: str = "xyz",
    wall_friction: dict[str, float] | None = None,
    velocity: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None,
    walls: Sequence[Wall] = (),
    increment: float | None = None,
    **options: Any,
) -> Simulation | ImplicitSimulation:
    """Bodies between smooth planes. Collective.

    Args:
        comm: Communicator with at most as many ranks as bodies.
        bodies: List of (points [m], cells), the same on all ranks; labels are 1, 2, …
        material: Material of all of them, or a list with that of each.
        low, high: Where the walls stand [m], shape (3,).
        axes: Which pairs of walls there are.
        wall_friction: Coefficient by the name of a wall, 0 where absent.
        velocity: ``velocity(x, grain)`` at the start [m/s], for arrays of nodes.
        walls: Further :class:`~mufe_fenicsx.contact.walls.Wall`, in any position.
        increment: Length of implicit increments [s]; None for time steps.
        options: Of :class:`~.Simulation`; ``sleeves`` are names of the last bodies, which are no
            grains.

    Raises:
        InputError: A name of a wall, letter of ``axes``, shape or option that is not known; a
            value that is not finite.
    """
    bodies = _checked(bodies)
    for what, cls, given in (("wall", Wall, walls), ("tool", Tool, options.get("tools", ()))):
        if not isinstance(given, list | tuple):
            raise InputError(f"{what}s = {shown(given)}, expected a list")
        for one in given:
            if not isinstance(one, cls):
                raise InputError(f"{what} = {shown(one)}, expected a {cls.__name__}")
    friction, planes = wall_friction or {}, axis_planes(low, high, axes)
    for name in friction:
        if name not in planes:
            raise InputError(
                f"wall of wall_friction = {shown(name)}, expected {nearest_name(name, planes)}"
            )
    walls = [
        Wall(name, point, normal, friction=friction.get(name, 0.0))
        for name, (point, normal) in planes.items()
    ] + list(walls)
    tools, sleeves = options.get("tools", ()), options.pop("sleeves", ())
    if (
        not isinstance(sleeves, list | tuple)
        or len(sleeves) > len(bodies)
        or not all(isinstance(name, str) for name in sleeves)
    ):
        raise InputError(f"sleeves = {shown(sleeves)}, expected names of the last bodies")
    mesh = distribute(comm, bodies, tools, sleeves)
    if velocity is not None:
        options["velocity"] = _velocities(velocity, mesh)
    materials = material if isinstance(material, list) else [material] * len(bodies)
    if len(materials) != len(bodies):
        raise InputError(f"materials = {len(materials)}, expected one, or one of each body")
    own = [materials[g] for g in mesh.grains[~mesh.is_tool]]
    return simulate(mesh, own, walls, increment, **options)


def distribute(
    comm: MPI.Intracomm,
    bodies: list[Body],
    tools: Sequence[Tool] = (),
    sleeves: Sequence[str] = (),
) -> GrainMesh:
    """Mesh of a few bodies, each on one rank. Collective.

    Args:
        comm: Communicator with at most as many ranks as bodies.
        bodies: List of (points [m], cells), the same on all ranks; labels are 1, 2, …
        tools: Further bodies, with the next labels.
        sleeves: Names of the last of ``bodies``, which are no grains but around them.
    """
    bodies = [*bodies, *((tool.points, tool.cells) for tool in tools)]
    # Tools cost next to nothing.
    first_tool = len(bodies) - len(tools)
    weights = [len(cells) for _, cells in bodies]
    work = [*weights[:first_tool], *(1 for _ in tools)]
    centroids = [points.mean(axis=0) for points, _ in bodies]
    rank_of_grain = partition_grains(work, centroids, comm.size)
    mine = np.flatnonzero(rank_of_grain == comm.rank)
    offset = np.cumsum([0] + [len(bodies[g][0]) for g in mine])
    return create_grain_mesh(
        comm,
        np.concatenate([bodies[g][0] for g in mine]),
        np.concatenate([bodies[g][1] + offset[k] for k, g in enumerate(mine)]),
        np.repeat(mine, [weights[g] for g in mine]),
        np.arange(1, len(bodies) + 1),
        rank_of_grain,
        sleeves,
        [tool.name for tool in tools],
    )


def simulate(
    mesh: GrainMesh,
    materials: Sequence[IsotropicSolid],
    walls: Sequence[Wall],
    increment: float | None = None,
    **options: Any,
) -> Simulation | ImplicitSimulation:
    """Time steps, or increments of the length ``increment`` [s]. Collective.

    Options are those of :class:`~.Simulation`, and of increments those of
    :class:`~.ImplicitSimulation`: static ones without ``spectral_radius``. Increments leave
    options of time steps alone.
    """
    if increment is None:
        return Simulation(mesh, materials, walls, **options)
    options = {name: value for name, value in options.items() if name not in OF_STEPS}
    options = {"first_step": increment, "largest_step": increment} | options
    return ImplicitSimulation(mesh, materials, walls, **options)


@checked
def drive(
    simulation: Simulation | ImplicitSimulation,
    moves: Mapping[str, ArrayLike],
    duration: float,
    at_step: Callable[[], object] | None = None,
    turns: Mapping[str, np.ndarray] | None = None,
) -> None:
    """Move and turn walls smoothly, with speed (1 - cos 2πt/T)/T times the whole. Collective.

    Args:
        simulation: The simulation.
        moves: Displacements [m] by the name of the wall, shape (3,) each.
        duration: T [s].
        at_step: Called after each step, without arguments.
        turns: Rotation vectors about their points [rad] by the name of the wall, shape (3,).
    """
    walls, duration = simulation.walls, finite_number("duration", duration, gt=0, unit="s")
    finite_number("steps of a drive", duration / simulation.dt, le=MOST_STEPS)
    start, end = simulation.state.t, simulation.state.t + duration
    target = _of_walls(walls, "move", moves)
    target = {i: (move, walls.point[i] + move) for i, move in target.items()}
    turns = _of_walls(walls, "turn", turns or {})
    turned = 0.0  # part of the turns
    while (t := simulation.state.t) < end:
        # The mean over the coming step: few increments go as far as many.
        dt = simulation.dt
        ends = [min((at - start) / duration, 1.0) for at in (t, t + dt)]
        before, after = (s - math.sin(2 * math.pi * s) / (2 * math.pi) for s in ends)
        rate = (after - before) / dt
        for i, (move, _) in target.items():
            walls.velocity[i] = move * rate
        for i, turn in turns.items():
            walls.angular_velocity[i] = turn * rate
        simulation.step()
        turned += rate * simulation.state.dt
        if at_step:
            at_step()
    # The sum over steps is the integral but for a remainder far below one step's way.
    for i, (_, place) in target.items():
        walls.velocity[i] = (place - walls.point[i]) / simulation.dt
    for i, turn in turns.items():
        walls.angular_velocity[i] = turn * (1 - turned) / simulation.dt
    simulation.step()
    if at_step:
        at_step()
    for i in target:
        walls.velocity[i] = 0.0
    for i in turns:
        walls.angular_velocity[i] = 0.0


def _of_walls(walls, what, given):
    """Number of a wall -> vector, from the vectors by name."""
    return {
        walls.number_of(name): finite_array(f"{what} of wall {name}", vector, (3,))
        for name, vector in given.items()
    }


def _velocities(velocity, mesh):
    """What a user's own function gives for the nodes of this rank. Collective."""
    found, message = None, None
    try:
        found = velocity(mesh.x, mesh.grains[mesh.grain_of_node])
    except Exception as error:  # whatever it raises, perhaps for nodes of one rank alone
        said = shortened(f"{type(error).__name__}: {error}")
        message = f"velocity(x, grain) fails: {said}, expected speeds of x"
    raise_together(mesh.comm, message)
    return found


def _checked(bodies):
    """The bodies, each a pair of arrays."""
    if not len(bodies):
        raise InputError(
            f"bodies = {shown(bodies)}, expected a list of pairs of nodes and tetrahedra"
        )
    return [body_of(f"body {k}", body) for k, body in enumerate(bodies, start=1)]


@checked
def settle(
    simulation: Simulation | ImplicitSimulation,
    ratio: float,
    max_steps: int = 20000,
    every: int = 50,
) -> float:
    """Step until kinetic energy is below ``ratio`` times the stored one. Collective.

    Returns:
        The ratio reached.
    """
    finite_number("max_steps", max_steps, ge=1, le=MOST_STEPS)
    finite_number("every", every, ge=1)
    reached = math.inf
    for k in range(max_steps):
        simulation.step()
        if k % every == every - 1:
            e = simulation.energies()
            reached = abs(e["kinetic"]) / (e["elastic"] + e["contact"])
            if reached <= ratio:
                break
    return reached


def sum_over_nodes(simulation: Simulation, values: ArrayLike) -> np.ndarray:
    """Sum of nodal values, shape (num_nodes, k), over all ranks. Collective."""
    return simulation.comm.allreduce(np.asarray(values).sum(axis=0))


def axis_planes(
    low: ArrayLike, high: ArrayLike, axes: str = "xyz"
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Point and inward normal of planes around a box: a dict by name, from x_min to z_max.

    Points are the lowest corner, and from there along one edge.

    Args:
        low, high: Corners of the box [m], shape (3,).
        axes: Which pairs of planes.
    """
    low, high = finite_array("low", low, (3,)), finite_array("high", high, (3,))
    if not set(axes) <= set("xyz"):
        raise InputError(f"axes = {shown(axes)}, expected letters of xyz")
    planes = {}
    for axis in axes:
        normal = np.eye(3)["xyz".index(axis)]
        opposite = np.where(normal > 0.0, high, low)
        planes[f"{axis}_min"], planes[f"{axis}_max"] = (low.copy(), normal), (opposite, -normal)
    return planes
