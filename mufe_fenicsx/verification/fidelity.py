"""One packing compressed with grains of each fidelity, side by side."""

import time
from dataclasses import dataclass

import numpy as np

from ..contact.separation import separate
from ..contact.walls import Wall
from ..errors import InputError
from ..explicit.simulation import Simulation
from ..geometry.bodies.shapes import sphere
from ..loading.oedometer import LOADING, OedometerLoading
from ..materials.auto import Auto
from ..materials.elastic import Elastic
from ..materials.rigid import Rigid
from ..materials.sand import SAND
from ..run.from_bodies import axis_planes, build
from .case import case, compare

ROCK = {"E": SAND.E, "nu": SAND.nu, "rho": SAND.rho}
#: Materials by fidelity: that of the paper, and the same with less of its behaviour.
FIDELITIES = {
    "rigid": Rigid(**ROCK),
    "elastic": Elastic(**ROCK),
    "auto": Auto(**ROCK, yield_stress=SAND.yield_stress),
    "j2": SAND,
}


@dataclass(frozen=True)
class Course:
    """One oedometer test; arrays of shape (num_records,)."""

    strain: np.ndarray  #: since the end of the seating [-]
    stress: np.ndarray  #: mean of top and bottom [Pa]
    contacts: np.ndarray  #: mean number of active neighbours of a grain
    deforming: np.ndarray  #: grains that are not rigid
    seconds: float  #: wall time of all steps
    element_steps: float  #: elements that deform times steps, summed
    residual: float  #: of the energy balance over the work
    processor_s: float  #: time of the processor for all steps
    simulation: Simulation


def compress(
    comm,
    bodies,
    material,
    strain,
    speed,
    friction=0.23,
    records=60,
    seating=2e6,
    close_gaps=0.0,
    **options,
):
    """Compress ``bodies`` of one material in an oedometer. Collective.

    Args:
        comm: MPI communicator of at most as many ranks as bodies.
        bodies: List of (points [m], cells).
        material: Of all of them.
        strain: Largest vertical strain.
        speed: Of the top platen [m/s].
        friction: Between grains; walls are smooth.
        records: Number of records.
        seating: Mean stress at which the strain begins to count [Pa].
        close_gaps: Between neighbours that are closed first, over the element size.
        options: Of :class:`~mufe_fenicsx.explicit.simulation.Simulation`.
    """
    mesh = build(comm, bodies, FIDELITIES["elastic"], np.zeros(3), np.zeros(3), axes="").mesh
    separate(mesh, 0.3, 0.0, close_gaps)
    low = np.min(comm.allgather(mesh.x.min(axis=0)), axis=0)
    high = np.max(comm.allgather(mesh.x.max(axis=0)), axis=0)
    walls = [Wall(name, *plane) for name, plane in axis_planes(low, high).items()]
    s = Simulation(mesh, [material] * mesh.num_grains, walls, friction=friction, **options)
    area = (high - low)[0] * (high - low)[1]
    loading = OedometerLoading(s, strain, speed, 0.1 * strain, seating * area, speed)
    rows, due, work, begin = [], 0.0, 0.0, time.perf_counter()
    began = time.process_time()
    cells = np.diff(mesh.cell_offset)
    last = 0
    while True:
        if loading.finished or (loading.stage == LOADING and loading.progress >= due):
            work += float(cells[s.solid.grains].sum()) * (s.state.num_steps - last)
            last = s.state.num_steps
            s.energies()
            forces = s.wall_forces()
            rows.append(
                (
                    loading.strain,
                    0.5 * (forces[4] + forces[5]) / area,
                    s.mean_active_contacts(),
                    comm.allreduce(s.solid.grains.size),
                )
            )
            due += strain / records
        if loading.finished:
            break
        loading.before_step()
        s.step()
    s.check()
    seconds, processor_s = time.perf_counter() - begin, time.process_time() - began
    e = s.energies()
    return Course(
        *np.array(rows).T, seconds, comm.allreduce(work), abs(e["residual"]) / e["work"],
        processor_s, s,
    )  # fmt: skip


def lattice(counts, element_size, radius=1e-3):
    """Balls in a cubic lattice, and loose ones of half their size in the voids between.

    Args:
        counts: Balls along x, y, z.
        element_size: Edge of the elements over the radius.
        radius: Of the large balls [m].

    Returns:
        List of (points [m], cells).
    """
    points, cells = sphere(radius, element_size * radius)
    small, small_cells = sphere(0.5 * radius, 0.5 * element_size * radius)
    places, voids = (
        2.0 * radius * np.stack(np.meshgrid(*map(np.arange, n), indexing="ij"), -1).reshape(-1, 3)
        for n in (counts, [c - 1 for c in counts])
    )
    return [(points + p, cells) for p in places] + [
        (small + p + radius, small_cells) for p in voids
    ]


@case("fidelity", num_bodies=8)
def fidelity(comm, columns=2, layers=3, strain=0.008, element_size=0.4, speed=1.0):
    """A lattice of balls with loose ones between: `auto` answers as all-J2 does.

    Where grains rearrange, two runs of the same model part by several per cent for a change
    in rounding. A lattice does not until it buckles, at a
    strain of 0.01, so it shows what the rigid beginning of `auto` changes. The loose balls
    never deform. Wall times are reported as a ratio without a limit.

    Args:
        comm: MPI communicator.
        columns, layers: Balls along x and y, and along z.
        strain: Largest vertical strain.
        element_size: Edge of the elements over the radius.
        speed: Of the top platen [m/s].
    """
    bodies = lattice((columns, columns, layers), element_size)
    if len(bodies) < comm.size:
        raise InputError(
            f"number of grains = {len(bodies)}, expected at least one a rank, {comm.size}"
        )
    auto, full = (
        compress(comm, bodies, FIDELITIES[name], strain, speed, close_gaps=0.0)
        for name in ("auto", "j2")
    )
    stress = np.interp(full.strain, auto.strain, auto.stress)
    large = columns**2 * layers
    results = {
        # What is asked for: a fiftieth of the range of the curve.
        "stress of auto against j2, largest difference over the largest": compare(
            np.abs(stress - full.stress).max() / full.stress.max(), 0.0, 0.02, scale=1.0
        ),
        "grains that deform in the end": compare(auto.deforming[-1], large, 0.0),
        "energy residual over work, auto": compare(auto.residual, 0.0, 0.01, scale=1.0),
        "energy residual over work, j2": compare(full.residual, 0.0, 0.01, scale=1.0),
        "element-steps of auto over j2": compare(
            auto.element_steps / full.element_steps, 0.0, np.inf, scale=1.0
        ),
        "wall time of auto over j2": compare(auto.seconds / full.seconds, 0.0, np.inf, scale=1.0),
    }
    return results, [auto.simulation, full.simulation]
