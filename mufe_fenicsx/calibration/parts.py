"""Whether the lower parts of curves tell the same as the whole.

The yield stress of the model grows linearly with plastic strain. Other laws may fit as well as it
does, with another modulus: no residual tells, but the fit to a part of the curves gives another
value. Each is compared with those of smaller parts (J. A. Hausman, Econometrica 46, 1978,
1251-1271).
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t as student

from .data import LEAST
from .fit import FLOOR, WIDE, fit_curves

#: Of the largest force of each curve.
PARTS = (0.5, 0.25, 0.125)
#: That values are found to differ where they do not.
CHANCE = 0.05
#: Rows of a part over its unknowns.
SPARE = 3


@dataclass(frozen=True)
class Agreement:
    """What parts of curves tell of one value."""

    name: str  #: "E" or "yield"
    parts: list  #: of the largest forces, the whole first
    values: list  #: [Pa]
    intervals: list  #: of 95 % [Pa]; (0, inf) where there is none
    until: int | None  #: the first part that all smaller ones confirm; None: none
    begins: float  #: least part of its largest force at which a curve begins; 0 where E is given

    @property
    def agrees(self):
        """Whether all parts confirm the whole, and some curve begins at touch."""
        return self.until == 0 and not self.begins_late

    @property
    def begins_late(self):
        """Whether no curve tells of the first touch: a grain that flows there seems soft."""
        return self.begins > FLOOR

    @property
    def ends(self):
        """Of all intervals [Pa]."""
        low, high = zip(*self.intervals, strict=True)
        return min(low), max(high)


def agreement(fit, curves, setup, given):
    """Fits to parts of curves against that to the whole. Local.

    Args:
        fit: :class:`~.fit.Fit` of the whole.
        curves: List of :class:`~.data.Curve`.
        setup: :class:`~.model.Setup`.
        given: :class:`~.fit.Given`.

    Returns:
        :class:`Agreement`, or None where grains do not yield.
    """
    if given.elastic:
        return None
    name, fits, parts = fit.names[0], [fit], [1.0]
    for part in PARTS:
        lower = [_below(curve, part) for curve in curves]
        lower = [curve for curve in lower if curve.force.size >= LEAST]
        unknowns = len(fit.names) - len(curves) + len(lower)
        if sum(c.force.size for c in lower) < SPARE * unknowns:
            break
        found = fit_curves(lower, setup, given)
        if name not in found.held and found.half_width(name) < WIDE:
            fits.append(found)
            parts.append(part)
    chance = CHANCE / max(len(fits) - 1, 1)
    until = next((i for i, each in enumerate(fits) if name not in each.held
                  and (i < len(fits) - 1 or i == 0)
                  and all(_alike(each, other, name, chance) for other in fits[i + 1 :])),
                 None)  # fmt: skip
    intervals = [(0.0, math.inf) if name in each.held else each.interval(name) for each in fits]
    begins = min(float(c.force.min() / c.force.max()) for c in curves) if name == "E" else 0.0
    return Agreement(name, parts, [each.value(name) for each in fits], intervals, until, begins)


def _below(curve, part):
    keep = curve.force <= part * curve.force.max()
    return replace(curve, displacement=curve.displacement[keep], force=curve.force[keep])


def _alike(one, other, name, chance):
    """Whether two values differ by no more than they scatter."""
    i, j = one.names.index(name), other.names.index(name)
    scatter = np.sqrt(one.covariance[i, i] + other.covariance[j, j])
    most = student.ppf(1 - chance / 2, min(one.freedom, other.freedom)) * scatter
    return abs(one.values[i] - other.values[j]) <= most
