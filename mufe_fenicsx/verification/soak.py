"""A million steps: what creeps in step by step would show here."""

import numpy as np

from ..contact.separation import separate
from ..contact.walls import Wall
from ..explicit.simulation import Simulation
from ..loading.oedometer import TOP, OedometerLoading
from ..machine.memory import memory_in_use
from ..materials.sand import SAND
from ..run.from_bodies import axis_planes, build
from .case import case, compare
from .packing import angular_grains

#: Parts of the steps after which the memory is compared with that at the end, and the forces.
WARM, HELD = 0.1, 0.5
#: Of the platen while it closes the gaps [m/s].
SEATING_SPEED = 0.5


def packing_to_hold(comm, strain, speed, element_size):
    """Twenty angular grains before they are compressed: simulation and loading. Collective."""
    bodies = angular_grains((2, 2, 5), element_size)
    mesh = build(comm, bodies, SAND, np.zeros(3), np.zeros(3), axes="").mesh
    separate(mesh, 0.3)
    low = np.min(comm.allgather(mesh.x.min(axis=0)), axis=0)
    high = np.max(comm.allgather(mesh.x.max(axis=0)), axis=0)
    walls = [Wall(name, *plane) for name, plane in axis_planes(low, high).items()]
    # Speeds halve within some 10 000 steps: little while it is loaded, all while it is held.
    s = Simulation(mesh, [SAND] * mesh.num_grains, walls, friction=0.3, damping=5e3)
    area = (high - low)[0] * (high - low)[1]
    loading = OedometerLoading(s, strain, speed, 0.1 * strain, 1e6 * area, SEATING_SPEED)
    return s, loading


def advance(s, loading):
    """One step of the test; once it is finished, with the platen at rest. Collective."""
    if not loading.finished:
        loading.before_step()
    else:
        s.walls.velocity[s.walls.names.index(TOP)] = 0.0
    s.step(everywhere=False)


@case("soak", num_bodies=4)
def soak(comm, steps=1_000_000, strain=0.1, speed=0.5, element_size=0.9):
    """Twenty yielding grains, compressed and then held, over a million steps.

    The energy balance has to close, no memory to be taken step by step, and the forces to stay
    where they are once the platen holds and the grains have come to rest by a light damping.

    Args:
        comm: MPI communicator.
        steps: Time steps, most of them after the platen has stopped.
        strain: Vertical strain at which it stops.
        speed: Of the platen [m/s].
        element_size: Edge of the elements over half of the distance of centres.
    """
    s, loading = packing_to_hold(comm, strain, speed, element_size)
    memory, early, late = None, [], []
    every = max(1, steps // 1000)
    while s.state.num_steps < steps:
        advance(s, loading)
        part = s.state.num_steps / steps
        if memory is None and part >= WARM:
            memory = memory_in_use(comm)
        if s.state.num_steps % every == 0 and part > HELD:
            (early if part < 0.5 * (1 + HELD) else late).append(s.wall_forces())
    s.check()
    energies, grown = s.energies(), memory_in_use(comm) - memory
    early, late = np.array(early), np.array(late)
    mean = late.mean(axis=0)
    vertical = mean[4:]
    results = {
        "strain at which the platen holds": compare(loading.strain, strain, 1e-3),
        "energy residual over work": compare(
            energies["residual"] / energies["work"], 0.0, 0.005, scale=1.0
        ),
        # What the libraries' allocators may take for good; 8 bytes a step would be twice that.
        "memory taken since a tenth of the steps [MB a rank]": compare(
            grown / comm.size / 1e6, 0.0, 4.0, scale=1.0
        ),
        "top against bottom force": compare(vertical[1], vertical[0], 1e-3),
        "drift of the forces from one quarter to the next": compare(
            np.abs(mean - early.mean(axis=0)).max() / vertical.mean(), 0.0, 1e-3, scale=1.0
        ),
        "scatter of the forces in the last quarter": compare(
            late.std(axis=0).max() / vertical.mean(), 0.0, 1e-3, scale=1.0
        ),
    }
    return results, [s]
