"""Balls of which the axisymmetric reference is made, and how: elastic and yielding ones."""

import math
from dataclasses import dataclass

import numpy as np

from ...materials.elastic import Elastic
from ...materials.j2 import J2
from ...theory import finite_sphere, plastic_contact
from ..paper_sphere import HARDENING, UNTIL, YIELD
from ..plastic_sphere import STEEL, STEEL_NU, STEEL_RHO, STEEL_YIELD
from ..reference import (
    CHECKED,
    COLUMNS,
    Course,
    elastic_name,
    paper_name,
    perfect_name,
    steel_name,
)
from . import measure as measure
from .solver import Ball

E, RHO = 100e9, 2650.0
#: Of elastic and of yielding balls: edges per contact radius at the end, how much shorter they are
#: on the surface, and steps of the approach; a check has half of edges and steps.
ELASTIC, PLASTIC = (60, 1, 4), (16, 4, 48)
#: Part of the radius at the end from which on the contact of a yielding ball has edges enough.
FROM = 0.3


@dataclass(frozen=True)
class Case:
    """A ball to be pressed."""

    name: str
    material: object
    contact_radius: float  #: about the largest over R
    approach: float  #: largest of plane and base over R
    base: str
    finite: bool = True

    @property
    def plastic(self):
        """Whether the ball yields."""
        return isinstance(self.material, J2)


def elastic(a_over_R, nu, finite=True):
    """At the approach at which the contact of linear elasticity has that radius."""
    delta = finite_sphere.compression(a_over_R, nu)[0]
    name = elastic_name(a_over_R, nu, finite)
    return Case(name, Elastic(E, nu, RHO), a_over_R, delta, "smooth", finite)


def perfect(ratio, nu):
    """Perfectly plastic, E/Y = ``ratio``: 100 or 1000."""
    approach, radius = {100: (0.025, 0.21), 1000: (0.0085, 0.147)}[ratio]
    material = J2(E, nu, RHO, ((0.0, E / ratio),))
    return Case(perfect_name(ratio, nu), material, radius, approach, "glued")


def steel(depth):
    """That of Jackson and Green in the case `plastic-sphere`, up to ``depth`` δc: 7 or 140."""
    material = J2(STEEL, STEEL_NU, STEEL_RHO, ((0.0, STEEL_YIELD),))
    factor = plastic_contact.fitted_onset_factor(STEEL_NU)
    delta = plastic_contact.onset(1.0, material.contact_modulus, STEEL_YIELD, factor)[0]
    radius = {7: 0.019, 140: 0.105}[depth]
    return Case(steel_name(depth), material, radius, depth * delta, "glued")


def paper(Y):
    """The ball of figure 8 of the paper, of the case `paper-sphere`."""
    material = J2(E, 0.15, RHO, ((0.0, Y), (UNTIL, Y + HARDENING)))
    return Case(paper_name(Y), material, 0.11, 0.0055, "glued")


def all_cases():
    """Every case that is stored."""
    cases = [
        elastic(a, nu, finite)
        for finite in (False, True)
        for nu in (0.15, 0.3)
        for a in (0.005, 0.04, 0.16)
    ]
    cases += [perfect(ratio, nu) for ratio in (100, 1000) for nu in (0.15, 0.3)]
    return [*cases, steel(7), steel(140), *(paper(Y) for Y in YIELD)]


def checked(case, fineness=1.0):
    """A :class:`~.reference.Course` with its check on a mesh twice as coarse. One rank.

    The check has half as many steps: nan where it has none.
    """
    fine, coarse = converged(case, fineness), converged(case, 0.5 * fineness)
    same = [np.abs(fine["delta"] / delta - 1).argmin() for delta in coarse["delta"]]
    checks = {key: np.full(fine["delta"].size, math.nan) for key in CHECKED}
    for key, values in checks.items():
        values[same] = coarse[key]
    return Course(case.name, fine, checks)


def converged(case, fineness=1.0):
    """:func:`press`, of balls that yield drawn on to steps of no length. One rank.

    The radial return to the end of a step has an error of first order, some percent of the force
    at 24 steps: twice the value of a step less that of steps twice as long leaves the second
    order.
    """
    many = press(case, fineness)
    if not case.plastic:
        return many
    few = press(case, fineness, 0.5)
    same = [np.abs(many["delta"] / delta - 1).argmin() for delta in few["delta"]]
    return {key: 2 * many[key][same] - few[key] for key in COLUMNS}


def press(case, fineness=1.0, steps=1.0):
    """Press a ball step by step. One rank.

    The contact grows by about the same at each step. Of an elastic ball only the last one
    is measured.

    Args:
        case: :class:`Case`.
        fineness: Of edges and steps, over those of ``ELASTIC`` or ``PLASTIC``.
        steps: Another factor of the number of steps.

    Returns:
        A dict of ``COLUMNS``, arrays of shape (num_measured,): lengths over R, forces over E R²,
        stresses over E; the largest von Mises stress on the axis and its depth over the radius
        of moment, nan for balls that yield.
    """
    elements, surface, count = PLASTIC if case.plastic else ELASTIC
    steps = max(round(count * fineness * steps), 1)
    ball = Ball(
        case.material, case.contact_radius, elements * fineness, surface, case.base, case.finite
    )
    rows = []
    for k in range(1, steps + 1):
        state = ball.press(case.approach * (k / steps) ** 2)
        if k < (FROM * steps if case.plastic else steps):
            continue
        radius = measure.radius_of_moment(state)
        mises = (math.nan, math.nan)
        if not case.plastic:
            mises = measure.largest_on_axis(state, radius)
        rows.append(
            (
                *(state.delta, state.force, measure.edge(state), radius),
                *(measure.centre_pressure(state, radius), state.strain.max(), *mises),
            )
        )
    return dict(zip(COLUMNS, np.array(rows).T, strict=True))
