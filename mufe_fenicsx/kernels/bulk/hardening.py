"""Plastic flow of von Mises with isotropic hardening from a table.

Parameters of a material are one row of numbers: the least yield stress [Pa], the number n of
points of the table, their n plastic strains, increasing from 0, and their n yield stresses [Pa].
"""

import numba

# As of kernels.bulk.solid.
FAST = {"contract", "reassoc", "arcp", "nsz"}


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def plastic_increment(q, mean, alpha, dt, shear, parameters):
    """Plastic strain increment that returns a trial stress to the yield stress; 0 within it.

    Solves q - 3 G dp = Y(alpha + dp) exactly on a piecewise linear table; beyond
    its last point the yield stress stays constant.

    Args:
        q: Von Mises stress of the trial state, that of the Kirchhoff stress [Pa].
        mean: Mean stress [Pa], of which this law makes no use.
        alpha: Plastic strain so far [-].
        dt: Time step [s], of which this law makes no use.
        shear: Shear modulus G [Pa].
        parameters: As above.
    """
    last = int(parameters[1]) - 1
    strain, stress = 2, 3 + last
    k = 0
    while k < last and alpha >= parameters[strain + k + 1]:
        k += 1
    while k < last:
        Y = parameters[stress + k]
        H = (parameters[stress + k + 1] - Y) / (parameters[strain + k + 1] - parameters[strain + k])
        Y += H * (alpha - parameters[strain + k])
        if q <= Y:  # in the first of these segments only
            return 0.0
        dp = (q - Y) / (3.0 * shear + H)
        if alpha + dp <= parameters[strain + k + 1]:
            return dp
        k += 1
    return max(q - parameters[stress + last], 0.0) / (3.0 * shear)


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def yield_stress_at(alpha, parameters):
    """Yield stress [Pa] at the plastic strain ``alpha``."""
    last = int(parameters[1]) - 1
    strain, stress = 2, 3 + last
    k = 0
    while k < last and alpha >= parameters[strain + k + 1]:
        k += 1
    if k == last:
        return parameters[stress + last]
    H = (parameters[stress + k + 1] - parameters[stress + k]) / (
        parameters[strain + k + 1] - parameters[strain + k]
    )
    return parameters[stress + k] + H * (alpha - parameters[strain + k])
