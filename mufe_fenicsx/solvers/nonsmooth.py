"""Equilibria on a jump of the forces.

Forces of contact jump where a point leaves a facet over a sharp edge: it is held on one side, and
not on the other. Where either side pushes it to the other one, forces vanish nowhere, and
time steps go to and fro between both under forces that are a mean of both. That mean is the
equilibrium (A. F. Filippov, Differential Equations with Discontinuous Righthand Sides, 1988):

    0 = Σ λ_i r_i,  λ_i >= 0,  Σ λ_i = 1,

r_i the residuals on all sides that meet there. Steps to it are those of bundle methods (C.
Lemaréchal, in: Nonsmooth Optimization, 1978, 79-102): of all mixes the one that is least in the
metric of the inverse tangent leads down on all sides at once.
"""

import numpy as np
from petsc4py import PETSc
from scipy.optimize import nnls

#: Sides that are kept, besides the present one.
MOST = 8


class Sides:
    """Other sides of jumps beside an iterate, which go along with it. Collective.

    Args:
        residual: ``residual(x)`` gives r at a vector, a vector that the next call overwrites.
    """

    def __init__(self, residual):
        self._residual = residual
        self._offsets, self._residuals = [], []

    def add(self, offset):
        """One more, at ``offset`` from the iterate; :meth:`follow` comes next."""
        self._offsets.append(offset)
        del self._offsets[:-MOST]

    def follow(self, x, reach):
        """Residuals beside ``x``, as far as they are no further from it than ``reach`` [m]."""
        largest = PETSc.NormType.NORM_INFINITY
        self._offsets = [offset for offset in self._offsets if offset.norm(largest) <= reach]
        self._residuals = [self._residual(x + offset).copy() for offset in self._offsets]
        found = [np.isfinite(r.norm()) for r in self._residuals]
        self._offsets = [one for one, there in zip(self._offsets, found, strict=True) if there]
        self._residuals = [one for one, there in zip(self._residuals, found, strict=True) if there]

    def keep(self, which):
        """Forget those that are not in the mask ``which``."""
        self._offsets = [one for one, kept in zip(self._offsets, which, strict=True) if kept]
        self._residuals = [one for one, kept in zip(self._residuals, which, strict=True) if kept]

    def residuals(self, f):
        """All of them, the one at the iterate, ``f``, first."""
        return [f, *self._residuals]

    def best(self, x, f):
        """Where the residual is the smallest."""
        best = int(np.argmin([r.norm() for r in self.residuals(f)]))
        return x + self._offsets[best - 1] if best else x


def least_mix(products):
    """Weights of the mix of least size.

    Args:
        products: Products of all vectors with each other, in any metric, shape (n, n).

    Returns:
        Weights >= 0 that add up to one, shape (n,).
    """
    n = len(products)
    if n == 1:
        return np.ones(1)
    values, vectors = np.linalg.eigh(0.5 * (products + products.T))
    factor = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    # A sum that is to be one as far as size lets it: weights are right but for a factor.
    size = np.sqrt(values[-1]) if values[-1] > 0.0 else 1.0
    weights, _ = nnls(np.vstack([factor, np.full(n, size)]), np.append(np.zeros(n), size))
    return weights / weights.sum()
