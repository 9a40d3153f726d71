"""What a ball that yields bears between two rigid planes, from a table.

By dimensions the force on half of a ball hangs on four numbers: the approach of plane and centre
over the radius, yield stress and slope of hardening over the modulus, and Poisson's ratio. They
are taken as

    F = 4/3 E* √(R δ³) φ(δ/R, Y/E*, H/Y, ν),  E* = E/(1 - ν²),

where φ, the force over that of Hertz, is smooth. ``ball.csv`` has φ and the largest plastic strain.
It was made by ``python -m mufe_fenicsx.verification.axisymmetric.response``, with axisymmetric
elements of second order. Between its points φ is a cubic spline in logarithms, over ν a line.

Contacts that are smaller than those of the table are alike: all lengths of the contact shrink with
√(δ/R), and so do strains. Then φ(δ, Y, H) = φ(δ₀, Y √(δ₀/δ), H).
"""

import csv
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

TABLE = Path(__file__).with_name("ball.csv")
#: Of H/Y the table's coordinate is log(1 + H/Y/KNEE).
KNEE = 10.0
#: Smallest approach over R that curves begin with, and points a decade.
SMALLEST, DENSITY = 1e-8, 12


@dataclass(frozen=True)
class BallTable:
    """Response of balls at points of a grid."""

    nu: np.ndarray  #: Poisson's ratios, shape (num_nu,)
    delta: np.ndarray  #: approaches over R, shape (num_delta,)
    yields: np.ndarray  #: Y/E*, shape (num_yields,)
    hardening: np.ndarray  #: H/Y, shape (num_hardening,)
    log_ratio: np.ndarray  #: log φ, shape (num_nu, num_delta, num_yields, num_hardening)
    log_strain: np.ndarray  #: log of the largest plastic strain and 1e-6, the same shape

    def course(self, nu, Y, k):
        """φ and the largest plastic strain over approaches from tiny ones to the largest.

        Args:
            nu: Poisson's ratio.
            Y: Yield stress over E*; above the largest of the table the ball is elastic.
            k: Slope of hardening over the yield stress.

        Returns:
            Approaches over R, φ and strains, each of shape (num_points,).
        """
        small, known, delta = self._approaches
        scale = np.sqrt(self.delta[0] / small)
        ratio = np.concatenate([
            self._at(self.log_ratio[:, :1], nu, Y * scale, k / scale)[0],
            self._at(self.log_ratio, nu, np.array([Y]), np.array([k]))[:, 0],
        ])  # fmt: skip
        strain = np.concatenate([
            np.full(small.size, np.log(1e-6)),
            self._at(self.log_strain, nu, np.array([Y]), np.array([k]))[:, 0],
        ])  # fmt: skip
        log = np.log(delta)
        phi = np.exp(CubicSpline(known, ratio)(log))
        return delta, phi, np.maximum(np.exp(np.interp(log, known, strain)) - 1e-6, 0.0)

    @cached_property
    def _approaches(self):
        """Those below the table, logarithms of these and the table's, and those of a course."""
        first, last = self.delta[[0, -1]]
        small = np.geomspace(SMALLEST, first, int(DENSITY * np.log10(first / SMALLEST)))[:-1]
        delta = np.geomspace(SMALLEST, last, 4 * DENSITY * int(np.log10(last / SMALLEST)))
        return small, np.log(np.concatenate([small, self.delta])), delta

    def _at(self, values, nu, Y, k):
        """Values of shape (num_nu, n, …) at ν and at points (Y, k), shape (n, num_points)."""
        part = np.clip((nu - self.nu[0]) / (self.nu[-1] - self.nu[0]), -0.75, 1.75)
        plane = (1 - part) * values[0] + part * values[-1]
        y = np.log(np.clip(Y, *self.yields[[0, -1]]))
        t = np.log1p(np.clip(k, *self.hardening[[0, -1]]) / KNEE)
        across_Y, across_k = self._bases
        return np.einsum("dyk,py,pk->dp", plane, across_Y(y), across_k(t))

    @cached_property
    def _bases(self):
        """Splines that are 1 at one point of the grid each and 0 at the others."""
        grid = np.log(self.yields), np.log1p(self.hardening / KNEE)
        return tuple(CubicSpline(x, np.eye(x.size)) for x in grid)


@cache
def load():
    """The table that the package has, a :class:`BallTable`."""
    with open(TABLE, encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    names = ("nu", "approach", "yield", "hardening")
    at = [np.array([float(row[name]) for row in rows]) for name in names]
    grid = [np.unique(values) for values in at]
    place = tuple(np.searchsorted(g, values) for g, values in zip(grid, at, strict=True))
    shape = tuple(g.size for g in grid)
    ratio, strain = np.full(shape, np.nan), np.full(shape, np.nan)
    ratio[place] = np.log([float(row["ratio"]) for row in rows])
    strain[place] = np.log([float(row["strain"]) + 1e-6 for row in rows])
    return BallTable(*grid, ratio, strain)
