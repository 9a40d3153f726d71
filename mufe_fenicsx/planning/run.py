"""A plan made on all ranks, followed by a run, and what came of its predictions."""

import gc
import time
from bisect import bisect_left

from ..analysis.evidence import read_points
from ..errors import InputError
from ..machine.ranks import on_first_rank
from .choice import follow, plan_scene
from .cost import benchmark, predict
from .present import present_state
from .sample import read_sample
from .text import brief, duration, percent

#: Errors among which the least is looked for that a time buys; costs fall from one to the next.
ACCURACIES = tuple(0.01 * 1.1**k for k in range(42))


def make_plan(
    scene, grains, comm, accuracy=None, keep_mesh=False, measure=True, clock=time.perf_counter
):
    """The plan of a scene and its cost here. Collective.

    Args:
        scene: :class:`~mufe_fenicsx.scene.Scene`.
        grains: Folder that `mufe mesh` wrote.
        comm: MPI communicator.
        accuracy: Wanted; None: the scene's.
        keep_mesh: The grains have to do as they are.
        measure: Measure this machine; without, the cost is None.
        clock: As of :func:`~.cost.benchmark`.

    Returns:
        :class:`~.choice.Plan` and :class:`~.cost.Cost`, the same on all ranks.

    Raises:
        InputError: No plan meets the accuracy; on all ranks.
    """

    def plan():
        sample = read_sample(grains)
        return plan_scene(scene, sample, accuracy, keep_mesh=keep_mesh), sample

    made, sample = comm.bcast(on_first_rank(comm, plan))
    if not measure:
        return made, None
    planned = follow(scene, made)
    measured = benchmark(planned, grains, comm, clock=clock)
    gc.collect()  # what was measured refers to itself
    return made, predict(planned, measured, made.tets / sample.tets, made.size / sample.size)


def plan_within(scene, grains, comm, seconds, clock=time.perf_counter):
    """The plan of the least error whose loading ends within a time here, and its cost. Collective.

    Args:
        scene, grains, comm, clock: As of :func:`make_plan`; steps are measured with the
            settings of the plan of the largest error, added mass among them.
        seconds: Of the run without its seating [s].

    Raises:
        InputError: No plan does; the message says what the cheapest takes. On all ranks.
    """
    coarsest, _ = make_plan(scene, grains, comm, ACCURACIES[-1], measure=False)
    measured = benchmark(follow(scene, coarsest), grains, comm, clock=clock)
    gc.collect()  # what was measured refers to itself

    def plan():
        sample, points = read_sample(grains), read_points()

        def planned(accuracy):
            made = plan_scene(scene, sample, accuracy, points)
            finer, shorter = made.tets / sample.tets, made.size / sample.size
            return made, predict(follow(scene, made), measured, finer, shorter)

        def fits(accuracy):
            try:
                return planned(accuracy)[1].wall_s <= seconds
            except InputError:  # out of reach
                return False

        first = bisect_left(ACCURACIES[:-1], True, key=fits)
        made, cost = planned(ACCURACIES[first])
        if cost.wall_s > seconds:
            raise InputError(
                f"cost = {duration(seconds)}, expected at least {duration(cost.wall_s)} beside the "
                f"seating, for an error of {percent(made.error)}: more ranks, or fewer grains, "
                "take less"
            )
        return made, cost

    return comm.bcast(on_first_rank(comm, plan))


def present(scene, grains, comm, measure=True, clock=time.perf_counter):
    """What error a scene has as it stands, and its cost here. Collective.

    Args:
        scene, grains, comm, measure, clock: As of :func:`make_plan`.

    Returns:
        :class:`~.present.Present` and :class:`~.cost.Cost`, the same on all ranks.

    Raises:
        InputError: The grains cannot be read, or nothing is known of the scene's element,
            integrator or law of contact; on all ranks.
    """
    found = comm.bcast(on_first_rank(comm, lambda: present_state(scene, read_sample(grains))))
    if not measure:
        return found, None
    return found, predict(scene, benchmark(scene, grains, comm, clock=clock))


def planned_scene(scene, grains, comm, measure=True, clock=time.perf_counter):
    """The scene that a run follows, and what is kept of its plan. Collective.

    Returns:
        The scene as planned, and a function of the summary of the finished run that gives
        {"plan": …} with a line of predicted and actual cost.
    """
    made, cost = make_plan(scene, grains, comm, keep_mesh=True, measure=measure, clock=clock)
    return follow(scene, made), lambda summary: brief(made, cost, summary)
