"""How well least squares determine their unknowns.

Covariances follow from the residuals: by curves where there are enough, so that grains may differ
from each other, else by points, widened where neighbours in a curve stray together.

Sources: G. A. F. Seber, C. J. Wild, Nonlinear Regression, 1989, chapter 5; by curves: K.-Y. Liang,
S. L. Zeger, Biometrika 73, 1986, 13-22, with the jackknife of R. M. Bell, D. F. McCaffrey, Survey
Methodology 28, 2002, 169-181.
"""

import numpy as np

#: From so many curves on covariances are those of curves.
BY_CURVES = 8


def covariance_of(jacobian, residual, sizes, free):
    """Covariance of the unknowns, and degrees of freedom.

    Args:
        jacobian: Slopes of the residuals, shape (num_rows, num_unknowns).
        residual: Shape (num_rows,).
        sizes: Rows of each curve, one curve after the other.
        free: Which unknowns are sought and not held by a bound, shape (num_unknowns,).

    Returns:
        Covariance, 0 where not free, shape (num_unknowns, num_unknowns); degrees of freedom of
        intervals.
    """
    inverse = np.zeros((free.size, free.size))
    norm = np.linalg.norm(jacobian, axis=0)
    scale = np.maximum(norm, 1e-12 * norm.max())[free]
    A = jacobian[:, free] / scale
    inverse[np.ix_(free, free)] = np.linalg.pinv(A.T @ A, rcond=1e-14) / np.outer(scale, scale)
    rows = np.split(np.arange(residual.size), np.cumsum(sizes)[:-1])
    spare = residual.size - int(free.sum())
    if len(rows) >= BY_CURVES:
        # Each curve draws the fit to itself: its residuals are those of a fit without it.
        identity = np.eye(free.size)
        scores = []
        for own in rows:
            drawn = jacobian[own].T @ jacobian[own] @ inverse
            score = jacobian[own].T @ residual[own]
            scores.append(np.linalg.lstsq(identity - drawn, score, rcond=1e-8)[0])
        meat = np.transpose(scores) @ scores * (len(rows) - 1) / len(rows)
        return inverse @ meat @ inverse, len(rows) - 1
    # Neighbours that stray together are worth fewer points, as of an autoregression.
    alike = min(max(_straying(residual, rows), 0.0), 0.9)
    worth = (1 - alike) / (1 + alike)
    variance = float(residual @ residual) / spare
    return inverse * variance / worth, max(int(spare * worth), 1)


def shift_of(jacobian, error, free):
    """By how much unknowns move where the residuals have an error, shape (num_unknowns,).

    Args:
        jacobian, free: As of :func:`covariance_of`.
        error: Shape (num_rows,).
    """
    shift, norm = np.zeros(free.size), np.linalg.norm(jacobian, axis=0)
    scale = np.maximum(norm, 1e-12 * norm.max())[free]
    shift[free] = np.linalg.lstsq(jacobian[:, free] / scale, error, rcond=1e-7)[0] / scale
    return shift


def _straying(residual, rows):
    pairs = [(residual[own][:-1], residual[own][1:]) for own in rows]
    square = sum(float(a @ a + b @ b) for a, b in pairs)
    return 2 * sum(float(a @ b) for a, b in pairs) / square if square else 0.0
