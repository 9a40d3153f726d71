"""What a test will cost on this machine: a second of its own steps, and what follows from them.

    wall = set-up + steps of loading · t + rows and states

A step is measured, and costs as many tetrahedra as it has, and ``PAIR_COSTS`` for each pair in
contact. How many pairs come into contact and how much contact shortens the stable time step
follows from what is near each other at the start. The seating before is not counted: how long it
takes is not known.
"""

import math
import time
from dataclasses import dataclass
from statistics import quantiles

import numpy as np
from mpi4py import MPI

from ..contact.separation import separate
from ..loading.oedometer import smooth_step
from ..loading.quasi_static import AIM
from ..loading.stage_end import SETTLED
from ..machine.memory import peak_memory
from ..run.from_scene import (
    load_mesh,
    make_membrane,
    make_simulation,
    sleeve_of,
)
from ..run.preparation import Prepared
from ..run.rebalance import PAIR_COSTS
from ..run.scene_tools import check_sizes, make_tools
from .contacts import closing_points
from .course import course_of, wave_speed
from .errors import flows

#: Pairs nearer than this part of an edge count as closed for the stable step under load. With the
#: mass that is added for them, steps of sand of 63 to 612 grains are 1.07 to 1.10 of the actual
#: ones (docs/record/2026-11-choices.md). Later new contacts shorten the step: to 0.79 of that at a
#: strain of 0.05 and to 0.78 at 0.1 in two others.
LOADED, LATE, SHORTER = 0.3, 0.03, 0.78
#: Tetrahedra that flow cost 1.14 times as much as elastic ones (`mufe bench box`), and 1.13 in a
#: test of 228 grains between its start and a strain of 0.01; they take two thirds of a step.
#: Searches, which are longer than a block of steps, 3 % more.
FLOWS, SEARCHES = 1.09, 1.03
#: Part of the points that geometry closes (`contacts`) which are in contact in the mean while
#: loading: 0.3 to 0.8 in three tests of sand.
CLOSED = 0.5
#: Part of the height that the platen travels at most in that second.
FURTHEST = 0.02
#: Memory of a tetrahedron with its share of nodes, contact and output [bytes]; what a run holds
#: beyond what its first steps do.
TET_MEMORY, MORE_MEMORY = 860.0, 1.02
#: Bytes of a stored state for each node, tetrahedron and grain; of the mesh; of a checkpoint
#: over a state; of a row of the history.
STATE_BYTES, MESH_BYTES, CHECKPOINT, ROW_BYTES = (96, 72, 2000), (24, 45), 1.5, 550
#: What files are written at [bytes/s], and each state and checkpoint takes besides [s].
WRITING, STATE_S = 2e8, 0.03
#: Steps of one measurement.
BLOCK = 20


@dataclass(frozen=True)
class Benchmark:
    """A second of a scene's own steps."""

    num_ranks: int
    num_grains: int
    num_cells: int
    num_nodes: int
    height: float  #: of the sample [m]
    setup_s: float
    step_s: float  #: time of a step, its share of estimates of the stable step included [s]
    due: tuple  #: pairs of grains, and with walls, in contact meanwhile
    closing: tuple  #: points of both that geometry closes at half of the strain
    row_s: float  #: of a row of the history [s]
    loaded_step: float  #: stable step with all pairs closed that are near, with its factor [s]
    tets_step: float  #: that of the tetrahedra alone [s]
    memory: float  #: of all ranks so far [bytes]
    of_sleeve: int = 0  #: tetrahedra of a membrane, beside those of the grains


@dataclass(frozen=True)
class Cost:
    """What a test is predicted to take after its seating, if it has one."""

    num_ranks: int
    num_cells: int
    num_steps: int
    time_step: float  #: under load [s]
    wall_s: float
    setup_s: float
    memory_bytes: float  #: of all ranks
    disk_bytes: float
    limit: str  #: what limits the time step: "contact" or "elements"
    seats: bool = False  #: whether a seating comes before, which is not counted


def benchmark(scene, grains_folder, comm, seconds=1.0, clock=time.perf_counter):
    """Set a scene up and step for about ``seconds``. Collective.

    Args:
        scene: :class:`~mufe_fenicsx.scene.Scene`.
        grains_folder: Folder that `mufe mesh` wrote.
        comm: MPI communicator.
        seconds: Of stepping.
        clock: What times are taken with; ``time.process_time`` where other work shares the
            processors.

    Returns:
        :class:`Benchmark`, the same on all ranks.
    """
    start = clock()
    s, bounds = _set_up(scene, grains_folder, comm)
    mesh, container = s.mesh, scene.container.kind
    setup = comm.allreduce(clock() - start, op=MPI.MAX)
    course, height = course_of(scene), bounds.height
    closing = closing_points(s, bounds, 0.5 * course.strain)  # before the platen moves
    top = [wall.name for wall in s.walls.walls].index(container.walls[container.top])
    if course.presses:
        s.walls.velocity[top, 2] = -course.seating_speed
    blocks = []
    while sum(blocks) < seconds or len(blocks) < 4:
        comm.Barrier()
        begin = clock()
        # A fast machine would crush the sample in that time.
        if bounds.high[2] - s.walls.point[top, 2] > FURTHEST * height:
            s.walls.velocity[top, 2] = 0.0
        for _ in range(BLOCK):
            s.step(everywhere=False)
        blocks.append(comm.allreduce(clock() - begin, op=MPI.MAX))
    estimate = _timed(comm, s.update_time_step, clock)
    row = _timed(comm, s.energies, clock)
    factor = s.time_step_factor
    due, memory = tuple(comm.allreduce(_due(s))), float(peak_memory(comm))
    dt, of_tets = s.dt, factor * s.stable.of_tets()
    margin = LOADED * s.contact.edge
    if s.scaling is not None:  # a test adds mass where contacts close that shorten its step
        s.limit.scale_masses(margin)
    loaded = factor * s.limit.within(margin, s.dt_element)
    return Benchmark(
        num_ranks=comm.size,
        num_grains=mesh.num_sample_grains,
        num_cells=comm.allreduce(mesh.num_sample_cells),
        num_nodes=comm.allreduce(mesh.num_nodes),
        height=height,
        setup_s=setup,
        # Other programs make blocks longer only.
        step_s=quantiles(blocks[1:], n=4, method="inclusive")[0] / BLOCK
        + estimate / s.limit.schedule.steps,
        due=due,
        closing=tuple(closing),
        row_s=row,
        loaded_step=min(loaded, dt),
        tets_step=of_tets,
        memory=memory,
        of_sleeve=comm.allreduce(mesh.num_shown_cells - mesh.num_sample_cells),
    )


def _set_up(scene, grains_folder, comm):
    """The simulation of a scene with its tools and its membrane, and its bounds. Collective."""
    tools, sample = make_tools(comm, scene), scene.sample
    mesh = load_mesh(comm, grains_folder, tools=tools, around=sleeve_of(scene))
    check_sizes(mesh, tools)
    if sample.separation:
        separate(mesh, sample.max_shift, sample.close_gaps, sample.close_gaps_over_h)
    prepared = Prepared.of(scene, mesh, tools)
    simulation = make_simulation(scene, prepared)
    make_membrane(scene, simulation, prepared.bounds)
    return simulation, prepared.bounds


def _timed(comm, function, clock):
    """Least time of three calls [s]: the first one may have to fetch compiled code. Collective."""
    times = []
    for _ in range(3):
        comm.Barrier()
        begin = clock()
        function()
        times.append(comm.allreduce(clock() - begin, op=MPI.MAX))
    return min(times)


def _due(simulation):
    """Closed pairs of grains and with walls, shape (2,). Local."""
    contact = simulation.contact
    return np.array([pairs.closed.sum() for pairs in (contact.pairs, contact.walls.pairs)])


def predict(scene, measured, finer=1.0, shorter=1.0):
    """:class:`Cost` of a scene from a measured second of it.

    Args:
        scene: :class:`~mufe_fenicsx.scene.Scene`.
        measured: :class:`Benchmark` of it.
        finer: Tetrahedra over those of the grains that were measured; those of a membrane stay.
        shorter: Length of edges over theirs: time steps go with it.
    """
    course, out, b = course_of(scene), scene.output, measured
    loaded, late = shorter * b.loaded_step, max(0.0, 1 - LATE / course.strain)
    steps = loading_time(scene, b.height) / loaded * (1 - late + late / SHORTER)
    # Of the work of a step, a membrane's tetrahedra count as those of grains.
    before = b.num_cells + b.of_sleeve
    num_cells = finer * b.num_cells + b.of_sleeve
    finer = num_cells / before
    num_nodes, step_s = finer * b.num_nodes, finer * b.step_s
    state = STATE_BYTES[0] * num_nodes + STATE_BYTES[1] * num_cells + STATE_BYTES[2] * b.num_grains
    closed = CLOSED * float(PAIR_COSTS @ b.closing)
    unit = SEARCHES * step_s / (before + float(PAIR_COSTS @ b.due))
    slower = FLOWS if flows(scene.material) else 1.0
    stepping = steps * unit * (slower * before + closed)
    checkpoints = 1 + (stepping / out.checkpoint if out.checkpoint else 0)
    written = state * (out.fields + CHECKPOINT * checkpoints)
    output = (
        out.history * finer * b.row_s + written / WRITING + STATE_S * (out.fields + checkpoints)
    )
    setup = finer * b.setup_s
    memory = MORE_MEMORY * b.memory + TET_MEMORY * (num_cells - before)
    return Cost(
        num_ranks=b.num_ranks,
        num_cells=round(num_cells),
        num_steps=round(steps),
        time_step=loaded,
        wall_s=setup + stepping + output,
        setup_s=setup,
        memory_bytes=memory,
        disk_bytes=(
            state * (out.fields + 2 * CHECKPOINT)
            + MESH_BYTES[0] * num_nodes + MESH_BYTES[1] * num_cells + out.history * ROW_BYTES
        ),
        limit="contact" if b.loaded_step < 0.9 * b.tets_step else "elements",
        seats=course.presses and (
            scene.oedometer is not None or any(stage.zero for stage in scene.stages)
        ),
    )  # fmt: skip


def loading_time(scene, height):
    """Time of loading [s], after the sample is seated.

    The platen of an oedometer gets smoothly from the speed of the seating to its own, over the
    ramp; after a seating at rest in the time in which its speed goes over that. In a test by stages
    each stage begins at rest; towards a strain its speed falls with the root of what is left, over
    the ramp, which takes twice as long; and each waits for its stresses, and its hold.

    Args:
        scene: :class:`~mufe_fenicsx.scene.Scene`.
        height: Of the sample, H [m].
    """
    o, course = scene.oedometer, course_of(scene)
    at_rest = o is not None and o.seating_at_rest
    if scene.quasi_static is not None and o is not None:
        begin = scene.quasi_static.slowest if at_rest else o.seating_speed
        return _adapted_time(scene, height, 0.0, o.strain, begin)
    if at_rest:
        return height / o.speed * (o.strain + 0.5 * o.ramp)
    if o is not None:
        parts = (np.arange(200) + 0.5) / 200
        slowness = [1 / (o.seating_speed + (o.speed - o.seating_speed) * smooth_step(s))
                    for s in parts]  # fmt: skip
        return height * (o.ramp * float(np.mean(slowness)) + (o.strain - o.ramp) / o.speed)
    found, wait = 0.0, course.presses * SETTLED * height / wave_speed(scene)
    for part in course.parts:
        led = scene.quasi_static is not None and math.isfinite(part.level)
        if part.way > 0.0 and led and part.stated is None:
            begin = max(part.level - part.way, 0.0)
            found += _adapted_time(scene, height, begin, begin + part.way, course.speed)
        elif part.way > 0.0:
            ramps = (1.5 if part.slows else 0.5) * course.ramp
            speed = part.stated or course.speed
            if part.rate is not None:
                speed = min(speed, part.rate * height)
            found += (part.way + ramps) * height / speed
        found += part.waits + wait
    return found


def _adapted_time(scene, height, begin, end, speed):
    """Time from one strain to another [s] at a speed that adapts ([quasi_static]).

    It follows kinetic over internal energy of a linear sample, k = (v/(c ε))²/3, c
    the speed of waves through it, at its target and within its limits (speed_control). It begins
    with ``speed``, and changes by no more than v in the time T = H/c of a wave, nor by
    more than makes half of the force difference that is allowed:
    d H ε/T².
    """
    wanted, c = scene.quasi_static, wave_speed(scene)
    step = height / c / 50  # of time
    k, d = min(wanted.kinetic, wanted.unbalanced / 1.5), wanted.unbalanced
    strain, steps, v = begin, 0, speed
    while strain < end:
        loaded = max(strain, wanted.loaded)
        aim = min(max(AIM * loaded * c * math.sqrt(3 * k), wanted.slowest), wanted.fastest)
        most = step * min(v * c, d * loaded * c**2) / height
        v += min(max(aim - v, -most), most)
        strain += v * step / height
        steps += 1
    return steps * step
