"""When the limit of explicit time steps is found again."""

import pytest

from mufe_fenicsx.refresh import FASTER, LONGEST_WAIT, SLACK, Refresh

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
    refresh = Refresh(STEPS)
    assert [evaluate(refresh, 1.0, FREE) for _ in range(4)] == [1, 2, 4, LONGEST_WAIT]
    # What is allowed for is the motion until then.
    assert refresh.margin == pytest.approx(FASTER * 1e-3 * LONGEST_WAIT * STEPS)
    assert not refresh.due(refresh.at + LONGEST_WAIT * STEPS - 1)
    # Contact limits it, which is seen at the end of the wait; the next one is not longer.
    assert evaluate(refresh, 0.995, HELD) == LONGEST_WAIT
    assert evaluate(refresh, 0.995, HELD) == 1


def test_a_long_wait_that_makes_the_step_shorter_is_given_up():
    refresh = Refresh(STEPS)
    for _ in range(4):
        evaluate(refresh, 1.0, FREE)
    assert evaluate(refresh, 0.9, FREE) == 1
    assert refresh.margin == pytest.approx(FASTER * 1e-3 * STEPS)
    assert evaluate(refresh, 0.9, FREE) == 1  # the limit fell last time


def test_no_evaluation_waits_longer_after_an_early_one():
    refresh = Refresh(STEPS)
    for _ in range(4):
        evaluate(refresh, 1.0, FREE)
    assert evaluate(refresh, 1.0, FREE, early=True, steps=7) == 1
    # As fast as in those few steps.
    assert refresh.margin == pytest.approx(FASTER * 1e-3 * STEPS)
