"""The cheapest choice for a case of charts that keeps an accuracy elsewhere too.

Errors and costs of a choice of element, law, time step, mass and loading are known on some
meshes. Between two of them costs are taken to lie on straight lines of logarithms, and errors on
e ~ hᵖ from the coarser one, p that of the two, but at most the order of linear elements: where
errors fall faster, that of the finer mesh is small by chance. Nothing is taken beyond the finest.

A choice has to keep the accuracy at all values that its error was computed for, of the speed and
the like; where those of a scene are stated, at these, on a straight line between their neighbours.
"""

import itertools
import math
from dataclasses import replace

import numpy as np

from ..analysis.evidence import DONE, SUFFIX, Point, command_of, read_elsewhere, read_points, usable
from ..errors import InputError
from .errors import between, checked_accuracy

#: Error of a measured point over what it may be at another Poisson's ratio, size of contact or
#: speed, for points that nobody has computed there, as are all between two meshes.
MARGIN = 0.75
#: The same where somebody has, at two or three sets of parameters: of 29 plans that were followed
#: at others one came to 1.06 times the largest of those, and missed what was wanted.
RESERVE = 0.94
#: The same between two values of a parameter: nine of ten errors in the stored table are at most
#: 1.19 times the line between their neighbours, which are twice as far away as a plan's.
BETWEEN = 0.84
#: Power of the length of edges that errors of forces fall with at most: that of the energy of
#: linear elements (T. J. R. Hughes, The Finite Element Method, 1987, section 4.1).
ORDER = 2.0
#: Parameters that are names: errors at two of them say nothing of what is between.
NAMES = {"sample"}
#: Parameters that set the mesh, and the power of them that grows as it becomes finer.
MESHES = {"elements_per_radius": 1, "element_size": -1, "ends_over_t": -1}


def expected_error(point, elsewhere, stated=None):
    """What the error of a point may be at parameters other than its own.

    Args:
        point: :class:`~mufe_fenicsx.analysis.evidence.Point`.
        elsewhere: Errors of those that were computed there, as of `evidence.read_elsewhere`.
        stated: {parameter: value} of the case where these are known; others may be anything.
    """
    known = elsewhere.get(point.command)
    if known is None:
        return point.error / MARGIN
    stated = stated or {}
    errors = (_along(values, stated.get(name)) / _reserve(values, stated.get(name))
              for name, values in known.items())  # fmt: skip
    return max(errors, default=point.error / RESERVE)


def settled(points, elsewhere):
    """Errors elsewhere, those of a mesh no smaller than those of finer ones of its line.

    An error that grows again on a finer mesh was small by chance, as by a change of its sign.

    Args:
        points: Of one case.
        elsewhere: As of `evidence.read_elsewhere`.
    """
    found = {}
    for line in lines(points):
        finer = {}
        for point in line[::-1]:
            own = elsewhere.get(point.command, {})
            for name, values in own.items():
                for value, error in values.items():
                    finer[name, value] = max(error, finer.get((name, value), 0.0))
            if own:
                found[point.command] = {
                    name: {value: finer[name, value] for value in values}
                    for name, values in own.items()
                }
    return found


def _largest(point, elsewhere, stated):
    """The largest error that was computed; where that is the table's alone, with its margin."""
    known = elsewhere.get(point.command)
    if known is None:
        return point.error / MARGIN
    errors = (_along(values, stated.get(name)) for name, values in known.items())
    return max(errors, default=point.error)


def _reserve(values, wanted):
    """What :func:`_along` is divided by: more between two values than at one of them."""
    inside = wanted is not None and min(values) < wanted < max(values)
    return BETWEEN if inside and wanted not in values else RESERVE


def _along(values, wanted):
    """The error at a value of a parameter, on the straight line between its neighbours.

    The largest of all where none is wanted, or one outside of what was computed.
    """
    value = sorted(values)
    if wanted is None or not value[0] <= wanted <= value[-1]:
        return max(values.values())
    return float(np.interp(wanted, value, [values[v] for v in value]))


def _checked(stated, case, own, elsewhere):
    """The stated parameters, numbers.

    Raises:
        InputError: One of them is none that errors of the case are known along, or no number.
    """
    names = {name for point in own for name in elsewhere.get(point.command, ())}
    for name, value in stated.items():
        if name not in names:
            known = " or ".join(sorted(names)) or "none"
            raise InputError(f"parameter {name} of a plan for {case}, expected {known}")
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(f"{name} = {value}, expected a number")
    return {name: float(value) for name, value in stated.items()}


def plan_case(case, accuracy, points=None, elsewhere=None, stated=None):
    """The cheapest choice for a case of charts that keeps an accuracy elsewhere too.

    Args:
        case: Name of a case of which the table has points.
        accuracy: Wanted error.
        points: Of the table; None: the stored one.
        elsewhere: Errors at other parameters, as of `evidence.read_elsewhere`; None: those that
            are stored.
        stated: {parameter: value} of the case that the choice is for; what is not stated may be
            anything that errors were computed for.

    Returns:
        :class:`~.Point`, a measured one or one between two of them, whose
        status says between which; its command has what is stated.

    Raises:
        InputError: The table has none; the message says how near the nearest is. Or nothing is
            known along a stated parameter.
    """
    accuracy = checked_accuracy(accuracy)
    own = usable(read_points() if points is None else points, case)
    if not own:
        raise InputError(f"case {case}, expected one of which the table of points has some")
    elsewhere = read_elsewhere() if elsewhere is None else elsewhere
    # Lines that nobody computed elsewhere are those that do not reach the front.
    own = [p for p in own if p.command in elsewhere] or own
    stated = _checked(stated or {}, case, own, elsewhere)
    elsewhere, there = settled(own, elsewhere), stated
    stated = {name: value for name, value in stated.items() if name not in NAMES}
    good = [p for p in own if expected_error(p, elsewhere, stated) <= accuracy]
    if not good:
        best = min(own, key=lambda p: expected_error(p, elsewhere, stated))
        least = expected_error(best, elsewhere, stated)
        raise InputError(
            f"accuracy = {accuracy:g}, expected at least {least:.2g}: the nearest that was "
            f"measured of {case}{SUFFIX} is `{best.command}` in {best.seconds:.3g} s"
        )
    for line in lines(own):
        good += _on_line(line, accuracy, lambda p: _largest(p, elsewhere, stated))
    best = min(good, key=lambda p: (p.seconds, p.error))
    return _there(best, there, _largest(best, elsewhere, stated))


def _there(point, stated, error):
    """A point of a plan at stated parameters, where its error is another one."""
    if not stated:
        return point
    command = command_of(point.case, point.parameters | stated)
    if point.status != DONE:
        return replace(point, command=command)
    shown = ", ".join(f"{name} = {value:g}" for name, value in stated.items())
    return replace(point, command=command, error=error, status=f"not measured at {shown}")


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


def _on_line(line, accuracy, largest):
    """The point between two of a line whose error, with a margin, is the accuracy: a list or [].

    Errors of all finer meshes have to be within the accuracy: one that is small by chance, where
    the error changes its sign, is no end of a line.
    """
    worst = list(itertools.accumulate((largest(p) for p in line[::-1]), max))
    for (coarse, fine), off in zip(itertools.pairwise(line), worst[-2::-1], strict=True):
        most = largest(coarse)
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
