"""The cheapest choice for a case of charts that keeps an accuracy elsewhere too.

Errors and costs of a choice of element, law, time step, mass and loading are known on some
meshes. Between two of them costs are taken to lie on straight lines of logarithms, and errors on
e ~ hᵖ from the coarser one, p that of the two, but at most the order of linear elements: where
errors fall faster, that of the finer mesh is small by chance. Nothing is taken beyond the finest.
"""

import itertools
import math

from ..errors import InputError
from ..evidence import DONE, SUFFIX, Point, command_of, read_elsewhere, read_points, usable
from .errors import between, checked_accuracy

#: Error of a measured point over what it may be at another Poisson's ratio, size of contact or
#: speed, for points that nobody has computed there, as are all between two meshes.
MARGIN = 0.75
#: The same where somebody has, at two or three sets of parameters: of 29 plans that were followed
#: at others one came to 1.06 times the largest of those, and missed what was wanted.
RESERVE = 0.94
#: Power of the length of edges that errors of forces fall with at most: that of the energy of
#: linear elements (T. J. R. Hughes, The Finite Element Method, 1987, section 4.1).
ORDER = 2.0
#: Parameters that set the mesh, and the power of them that grows as it becomes finer.
MESHES = {"elements_per_radius": 1, "element_size": -1}


def expected_error(point, elsewhere):
    """What the error of a point may be at parameters other than its own.

    Args:
        point: :class:`~mufe_fenicsx.evidence.Point`.
        elsewhere: {command: largest error elsewhere} of those that were computed there.
    """
    return _largest(point, elsewhere) / (RESERVE if point.command in elsewhere else 1.0)


def _largest(point, elsewhere):
    """The largest error that was computed; where that is the table's alone, with its margin."""
    largest = elsewhere.get(point.command)
    return point.error / MARGIN if largest is None else max(point.error, largest)


def plan_case(case, accuracy, points=None, elsewhere=None):
    """The cheapest choice for a case of charts that keeps an accuracy elsewhere too.

    Args:
        case: Name of a case of which the table has points.
        accuracy: Wanted error.
        points: Of the table; None: the stored one.
        elsewhere: {command: largest error at other parameters}; None: those that are stored.

    Returns:
        :class:`~mufe_fenicsx.evidence.Point`, a measured one or one between two of them, whose
        status says between which.

    Raises:
        InputError: The table has none; the message says how near the nearest is.
    """
    accuracy = checked_accuracy(accuracy)
    own = usable(read_points() if points is None else points, case)
    if not own:
        raise InputError(f"case {case}, expected one of which the table of points has some")
    elsewhere = read_elsewhere() if elsewhere is None else elsewhere
    good = [p for p in own if expected_error(p, elsewhere) <= accuracy]
    if not good:
        best = min(own, key=lambda p: expected_error(p, elsewhere))
        least = expected_error(best, elsewhere)
        raise InputError(
            f"accuracy = {accuracy:g}, expected at least {least:.2g}: the nearest that was "
            f"measured of {case}{SUFFIX} is `{best.command}` in {best.seconds:.3g} s"
        )
    for line in lines(own):
        good += _on_line(line, accuracy, elsewhere)
    return min(good, key=lambda p: (p.seconds, p.error))


def lines(points):
    """Points that differ in their mesh alone, of one case: lists of them, from coarse to fine."""
    found = {}
    for point in points:
        rest = frozenset((k, v) for k, v in point.parameters.items() if k not in MESHES)
        found.setdefault(rest, {})[point.command] = point
    return [sorted(line.values(), key=fineness) for line in found.values()]


def fineness(point):
    """A number that grows as 1/h, of the parameter of a point that sets its mesh."""
    name = next(name for name in MESHES if name in point.parameters)
    return float(point.parameters[name]) ** MESHES[name]


def _on_line(line, accuracy, elsewhere):
    """The point between two of a line whose error, with a margin, is the accuracy: a list or [].

    Errors of all finer meshes have to be within the accuracy: one that is small by chance, where
    the error changes its sign, is no end of a line.
    """
    worst = list(itertools.accumulate((_largest(p, elsewhere) for p in line[::-1]), max))
    for (coarse, fine), off in zip(itertools.pairwise(line), worst[-2::-1], strict=True):
        most = _largest(coarse, elsewhere)
        if not off <= accuracy < most:
            continue
        whole = fineness(fine) / fineness(coarse)
        part = (most / (MARGIN * accuracy)) ** (1 / _power(most, off, whole))
        return [_between(coarse, fine, part)] if part < whole else []
    return []


def _power(error, least, finer):
    """Power of 1/h that an error falls with to another one on a mesh so much finer."""
    return min(math.log(error / least) / math.log(finer), ORDER)


def _between(coarse, fine, finer):
    """The point on a mesh so much finer than that of the first of two on a line."""
    name = next(name for name in MESHES if name in coarse.parameters)
    value = (fineness(coarse) * finer) ** MESHES[name]
    # To three digits, on the side of the finer one.
    unit = 10.0 ** (math.floor(math.log10(value)) - 2)
    value = float(f"{(math.ceil if MESHES[name] > 0 else math.floor)(value / unit) * unit:.3g}")
    finer = value ** MESHES[name] / fineness(coarse)
    whole = fineness(fine) / fineness(coarse)

    def cost(key):
        return between([(1.0, getattr(coarse, key)), (whole, getattr(fine, key))], finer)

    sizes = " and ".join(p.parameters[name] for p in (coarse, fine))
    return Point(
        case=coarse.case,
        series=coarse.series,
        error=coarse.error * finer ** -_power(coarse.error, fine.error, whole),
        seconds=cost("seconds"),
        element_steps=cost("element_steps"),
        num_cells=round(cost("num_cells")),
        num_steps=round(cost("num_steps")),
        status=f"not measured, between {name} = {sizes}",
        command=command_of(coarse.case, {**coarse.parameters, name: value}),
    )


def measured(point):
    """Whether a point of a plan was computed."""
    return point.status == DONE
