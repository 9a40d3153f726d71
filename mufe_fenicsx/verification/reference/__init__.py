"""Converged axisymmetric balls under a plane, stored as a table because they take minutes.

``axisymmetric.csv`` was made by ``demos/axisymmetric_reference.py`` of commit 0daf308, with a
solver of its own: displacements of second order with a pressure of first order (Taylor & Hood),
curved edges, Newton's method, the same law of the material on paper. Its first line says how. A
row is a ball at an approach: lengths over its radius R, forces over E R², stresses over E.
Columns ``check_…`` are the same on a mesh twice as coarse with half as many steps, nan between
those: they tell how far a row is converged.
"""

import csv
import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator

from ...errors import InputError

TABLE = Path(__file__).with_name("axisymmetric.csv")
#: Of each row: approach; force; radius of the contact's edge, and of the half-ellipsoid of
#: pressure with the same second moment; pressure in the middle; largest plastic strain; largest
#: von Mises stress on the axis and its depth over the radius of moment (elastic balls).
COLUMNS = (
    *("delta", "force", "radius", "moment_radius", "p0", "plastic_strain"),
    *("mises", "mises_depth"),
)
#: Those that are there from the coarser mesh as well.
CHECKED = ("force", "radius", "moment_radius", "p0")


@dataclass(frozen=True)
class Course:
    """One ball over the approach."""

    name: str
    values: dict  #: of arrays by column, shape (num_rows,)
    checks: dict  #: the same of ``CHECKED`` on the coarser mesh

    def __getitem__(self, column):
        return self.values[column]

    def covers(self, delta):
        """Whether the table reaches over all of these approaches over R."""
        known = self["delta"]
        return bool(known[0] <= np.min(delta) and np.max(delta) <= known[-1])

    def at(self, delta, column="force"):
        """A column at approaches over R, by monotone cubics in logarithms.

        Raises:
            InputError: An approach that the table does not cover.
        """
        known, wanted = self["delta"], np.asarray(delta, dtype=float)
        if not self.covers(wanted):
            raise InputError(
                f"approach over radius = {wanted.min():g} to {wanted.max():g}, expected "
                f"{known[0]:g} to {known[-1]:g} for {self.name}"
            )
        cubic = PchipInterpolator(np.log(known), np.log(self[column]))
        return np.exp(cubic(np.log(wanted)))

    def mean(self, delta):
        """Mean force over E R² and mean pressure over E at approaches over R.

        The pressure is on the disc on which an even one has the same second moment: of a
        half-ellipsoid with the radius a that is 2a²/5, of a disc half of its square.
        """
        force, area = self.at(delta), 0.8 * math.pi * self.at(delta, "moment_radius") ** 2
        return float(force.mean()), float(force.sum() / area.sum())

    def edge_over_disc(self, delta):
        """Radius of the contact's edge over that of this disc, mean over approaches over R."""
        disc = math.sqrt(0.8) * self.at(delta, "moment_radius")
        return float((self.at(delta, "radius") / disc).mean())

    def mean_pressure(self):
        """Force over the area within the edge, over E."""
        return self["force"] / (math.pi * self["radius"] ** 2)

    def change(self, column):
        """Relative change of a column from the coarser mesh, where that has a row."""
        change = np.abs(self.checks[column] / self[column] - 1)
        return change[~np.isnan(change)]


def elastic_name(a_over_R, nu, finite):
    """Of a ball at the approach where the contact of linear elasticity has that radius."""
    return f"elastic {'finite' if finite else 'linear'} nu={nu:g} a/R={a_over_R:g}"


def perfect_name(ratio, nu):
    """Of a perfectly plastic ball, E/Y = ``ratio``."""
    return f"perfect nu={nu:g} E/Y={ratio:g}"


def paper_name(Y):
    """Of the ball of figure 8 of Nadimi & Fonseca (2018) with yield at ``Y`` [Pa]."""
    return f"paper Y={Y / 1e6:g}MPa"


def steel_name(depth):
    """Of the steel of Jackson and Green, pressed to ``depth`` times the approach of onset."""
    return f"steel {depth:g}"


@lru_cache(maxsize=4)
def load(path=TABLE):
    """The table: a dict of :class:`Course` by name."""
    with open(path, encoding="utf-8", newline="") as file:
        file.readline()
        rows = list(csv.DictReader(file))
    courses = {}
    for name in dict.fromkeys(row["case"] for row in rows):
        own = [row for row in rows if row["case"] == name]

        def array(key, own=own):
            return np.array([float(row[key]) for row in own])

        courses[name] = Course(
            name,
            {key: array(key) for key in COLUMNS},
            {key: array(f"check_{key}") for key in CHECKED},
        )
    return courses


def large_strain(a_over_R, nu):
    """An elastic ball's force over that of linear elasticity, at the same approach.

    Args:
        a_over_R: 0.005, 0.04 or 0.16, radius of the contact by linear elasticity.
        nu: 0.15 or 0.3.
    """
    table = load()
    finite, linear = (table[elastic_name(a_over_R, nu, kind)] for kind in (True, False))
    return float(finite["force"][0] / linear["force"][0])
