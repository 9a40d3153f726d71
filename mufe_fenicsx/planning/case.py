"""The cheapest measured point of a case of charts that keeps an accuracy elsewhere too."""

from ..errors import InputError
from ..evidence import SUFFIX, read_elsewhere, read_points, usable
from .errors import checked_accuracy

#: Error of a measured point over what it may be at another Poisson's ratio, size of contact or
#: speed, for points that nobody has computed there.
MARGIN = 0.75


def expected_error(point, elsewhere):
    """What the error of a point may be at parameters other than its own.

    Args:
        point: :class:`~mufe_fenicsx.evidence.Point`.
        elsewhere: {command: largest error elsewhere} of those that were computed there.
    """
    largest = elsewhere.get(point.command)
    return point.error / MARGIN if largest is None else max(point.error, largest)


def plan_case(case, accuracy, points=None):
    """The cheapest measured point of a case of charts that keeps an accuracy elsewhere too.

    Returns:
        :class:`~mufe_fenicsx.evidence.Point`.

    Raises:
        InputError: The table has none; the message says how near the nearest is.
    """
    accuracy = checked_accuracy(accuracy)
    own = usable(read_points() if points is None else points, case)
    if not own:
        raise InputError(f"case {case}, expected one of which the table of points has some")
    elsewhere = read_elsewhere()
    good = [p for p in own if expected_error(p, elsewhere) <= accuracy]
    if not good:
        best = min(own, key=lambda p: expected_error(p, elsewhere))
        least = expected_error(best, elsewhere)
        raise InputError(
            f"accuracy = {accuracy:g}, expected at least {least:.2g}: the nearest that was "
            f"measured of {case}{SUFFIX} is `{best.command}` in {best.seconds:.3g} s"
        )
    return min(good, key=lambda p: (p.seconds, p.error))
