"""When the limit of explicit time steps is found again."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.explicit.step_schedule import FASTER, LONGEST_WAIT, SLACK, StepSchedule
from mufe_fenicsx.materials.elastic import Elastic
from tests.bodies import packed_spheres, simulation_of

STEPS = 100
FREE, HELD = 1.5 * SLACK, 1.0  #: bound by contact over the limit


def evaluate(refresh, limit, slack, early=False, steps=None):
    """One evaluation where it is due, or after ``steps``; grains move 1 mm a step."""
    now = refresh.at + (refresh.wait * STEPS if steps is None else steps)
    assert refresh.due(now) or steps is not None
    refresh.begin(1e-3 * now, now, early)
    refresh.look_ahead(0.0, 1e3)
    if refresh.too_far(limit):
        refresh.look_ahead(0.0, 1e3)
    refresh.end(limit, slack)
    return refresh.wait


def test_evaluations_wait_longer_where_contact_does_not_limit_the_step():
    refresh = StepSchedule(STEPS)
    assert [evaluate(refresh, 1.0, FREE) for _ in range(4)] == [1, 2, 4, LONGEST_WAIT]
    # What is allowed for is the motion until then.
    assert refresh.margin == pytest.approx(FASTER * 1e-3 * LONGEST_WAIT * STEPS)
    assert not refresh.due(refresh.at + LONGEST_WAIT * STEPS - 1)
    # Contact limits it, which is seen at the end of the wait; the next one is not longer.
    assert evaluate(refresh, 0.995, HELD) == LONGEST_WAIT
    assert evaluate(refresh, 0.995, HELD) == 1


def test_a_long_wait_that_makes_the_step_shorter_is_given_up():
    refresh = StepSchedule(STEPS)
    for _ in range(4):
        evaluate(refresh, 1.0, FREE)
    assert evaluate(refresh, 0.9, FREE) == 1
    assert refresh.margin == pytest.approx(FASTER * 1e-3 * STEPS)
    assert evaluate(refresh, 0.9, FREE) == 1  # the limit fell last time


def test_no_evaluation_waits_longer_after_an_early_one():
    refresh = StepSchedule(STEPS)
    for _ in range(4):
        evaluate(refresh, 1.0, FREE)
    assert evaluate(refresh, 1.0, FREE, early=True, steps=7) == 1
    # As fast as in those few steps.
    assert refresh.margin == pytest.approx(FASTER * 1e-3 * STEPS)


@pytest.mark.mpi
@pytest.mark.parametrize(("strain", "found"), [(0.04, True), (0.01, False)])
def test_elements_that_shrink_ask_for_the_limit_in_a_long_wait(strain, found):
    """A ball that shrinks in one refresh by more than what `SHORTER` allows, or by less."""
    mesh = packed_spheres(MPI.COMM_WORLD, (3, 1, 1), gap=0.5)
    sim = simulation_of(mesh, Elastic(1e9, 0.15, 2650.0), refresh=2)
    schedule = sim.limit.schedule
    schedule.wait, schedule.margin = LONGEST_WAIT, np.inf  # no contact asks for it
    grain = mesh.grains[mesh.grain_of_node]
    if mesh.rank_of_grain[0] == mesh.comm.rank:
        rows = grain == 0
        centre = mesh.x[rows].mean(axis=0)
        sim.state.v[rows] = -strain / (2 * sim.dt) * (mesh.x[rows] - centre)
    for _ in range(3):  # before the rim swings back
        sim.step()
    assert sim.limit.schedule.at == (2 if found else 0)


def test_what_may_close_before_the_next_evaluation_is_known():
    """Balls that fly: no evaluation looks farther ahead than the last search for pairs did."""
    mesh = packed_spheres(MPI.COMM_WORLD, (3, 1, 1), gap=0.5)
    flight = np.zeros_like(mesh.x)
    flight[mesh.grain_of_node == 0, 0] = -20.0
    sim = simulation_of(mesh, Elastic(1e9, 0.15, 2650.0), velocity=flight, refresh=20)
    contact, looked, found = sim.contact, 0, sim.contact.num_searches
    for _ in range(300):
        known = contact.motion.searched_at + contact.motion.reach
        at, now = sim.limit.schedule.at, sim.state.num_steps
        sim.step()
        if sim.limit.schedule.at > at:
            assert sim.limit.schedule.at == now
            # But for what moves in the next two steps, which are at most three times as long as
            # those of single elements; waves in a ball add to its speed.
            ahead = max(known - sim.limit.schedule.bound, 6.0 * sim.dt_element * 1.2 * 20.0)
            assert sim.limit.schedule.margin <= ahead + 1e-9 * contact.edge
            looked += 1
    # Longer than a search lasts, or nothing was tested.
    assert looked > 5 and contact.num_searches > found + 2
