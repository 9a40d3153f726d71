"""What a closed cycle of strain leaves behind in a material whose law is a rate."""

import numpy as np


def residual_strain(strain):
    """Elastic strain left by Jaumann's rate after a closed path of logarithmic strain.

        e_res = -1/3 ∮ [e, [e, de]],   [A, B] = A B - B A,

    up to terms of fifth order in the strain. With F = R exp(e) the velocity gradient is, in the
    axes that turn with R, de + ½ [e, de] + ⅙ [e, [e, de]] + …: its skew part turns the stress
    2 G e (-½ of the integrand), the symmetric part adds ⅙. R has no influence. What is left
    stays as stress 2 G e_res and energy G e_res:e_res, and each further cycle adds as much
    strain.

    Args:
        strain: Deviators at points of the path, the last equal to the first, shape
            (num_points, ..., 3, 3); between them the path is taken straight, midpoint rule.

    Returns:
        Shape (..., 3, 3); zero where all strains have the same axes.

    Source: expansion of the derivative of the exponential map (W. Rossmann, Lie Groups, 2002,
    section 1.2) in the rate equation; compare M. Kojić, K.-J. Bathe, Computers &
    Structures 26, 1987, 175-179, for a cycle of large strain.
    """
    middle = 0.5 * (strain[1:] + strain[:-1])
    return -_commutator(middle, _commutator(middle, np.diff(strain, axis=0))).sum(axis=0) / 3


def residual_strain_bound(peak, length):
    """Bound of the norm of :func:`residual_strain`: ⅔ peak² length.

    By ‖[A, B]‖ ≤ √2 ‖A‖ ‖B‖ (A. Böttcher, D. Wenzel, Linear Algebra Appl. 403, 2005, 216-228).

    Args:
        peak: Largest norm of the strain on the path.
        length: Length of the path in the space of strains.
    """
    return 2 / 3 * peak**2 * length


def _commutator(A, B):
    return A @ B - B @ A
