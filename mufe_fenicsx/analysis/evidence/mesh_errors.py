"""How far off a contact is on a mesh of so many elements per contact radius, by stored points."""

import itertools
import math
from statistics import mean

from . import read_points, usable

#: Parameters of a point that changes nothing but its mesh.
DEFAULTS = {
    "element": "averaged", "law": "matched", "fidelity": "j2", "time_step": "assembled",
    "added_mass": "0", "loading": "1", "time_step_factor": "0.9", "integrator": "explicit",
}  # fmt: skip


def between(pairs, x):
    """Value at x on straight lines of logarithms; below the first pair that of the first."""
    if x <= pairs[0][0]:
        return pairs[0][1]
    for (a, u), (b, v) in itertools.pairwise(pairs):
        if x <= b:
            return u * (v / u) ** (math.log(x / a) / math.log(b / a))
    return pairs[-1][1]


def falling(pairs):
    """(size, error) pairs from coarse to fine, each error at least that of all finer ones."""
    worst, found = 0.0, []
    for n, e in sorted(pairs, reverse=True):
        worst = max(worst, e)
        found.append((n, worst))
    return tuple(reversed(found))


def order_of(pairs):
    """Order of the two finest, no less than 1, no more than 2, that of surfaces and of elements.

    Args:
        pairs: (size, error), errors falling.
    """
    if len(pairs) < 2 or not pairs[-1][1] > 0:
        return 1.0
    (coarse, more), (fine, less) = pairs[-2:]
    return min(max(math.log(more / less) / math.log(fine / coarse), 1.0), 2.0)


def error_at(pairs, n, order=1.0):
    """Error at n elements per contact radius; inf where that is coarser than any known.

    Beyond the finest it falls with that order of the size of elements.

    Args:
        pairs: (elements per contact radius, error), errors falling.
        n: Elements per contact radius.
        order: 1 or above.
    """
    (coarse, _), (fine, least) = pairs[0], pairs[-1]
    if n < coarse * (1 - 1e-9):
        return math.inf
    return least * (fine / n) ** order if n >= fine else between(pairs, n)


def mesh_errors(case, points=None):
    """(elements per contact radius, error) of a case with all defaults, errors falling.

    Args:
        case: "hertz" of elastic balls, "plastic-sphere" of a ball that flows.
        points: Those of a table; None: the stored one.
    """
    points = read_points() if points is None else points
    return falling((size(p), p.error) for p in select(usable(points, case), element="averaged"))


def known_samples(points=None, element="averaged", fidelity="j2"):
    """(edges per diameter of grains, error of the stress) of grains of known shape, falling.

    Means over several samples; () where the table has none.

    Args:
        points: Those of a table; None: the stored one.
        element: Of the mesh.
        fidelity: "j2" of grains that yield, or "elastic".
    """
    known = usable(read_points() if points is None else points, "sample")
    own = select(known, fidelity=fidelity, element=element)
    sizes = sorted({size(p) for p in own})
    return falling((n, mean(p.error for p in own if size(p) == n)) for n in sizes)


def select(points, **wanted):
    """Points that differ from ``DEFAULTS`` in the mesh and in what is wanted alone."""
    wanted = DEFAULTS | wanted
    return [p for p in points
            if all(p.parameters.get(k, DEFAULTS[k]) == v for k, v in wanted.items())]  # fmt: skip


def size(point):
    """Its parameter of the mesh."""
    own = point.parameters
    names = "elements_per_radius", "element_size", "elements_per_diameter"
    return float(next((own[name] for name in names if name in own), "nan"))
