"""The law of a contact: its normal spring, and Coulomb's static and kinetic friction.

Tangents call it; contact_law.h has it for pairs of points with facets and with walls, and of edges.
"""

import math

import numba

#: As in contact_law.h.
SOFTER = 1.69


@numba.njit(cache=True)
def share_of_stiffness(d, m):
    """Normal force over stiffness and depth; of friction's spring the same share is there."""
    return 1.0 - SOFTER * m * m * d / (m + 0.5 * d) ** 3 if m > 0.0 else 1.0


@numba.njit(cache=True)
def over_stiffness(d, m):
    """Normal force over stiffness at a depth [m]: less than it where a contact is small."""
    return d * share_of_stiffness(d, m)


@numba.njit(cache=True)
def slope_over_stiffness(d, m):
    """Derivative of :func:`over_stiffness` by the depth, 0.4 to 1.05."""
    if m <= 0.0:
        return 1.0
    return 1.0 - SOFTER * m * m * d * (2.0 * m - 0.5 * d) / (m + 0.5 * d) ** 4


@numba.njit(cache=True)
def slope_of_share(d, m):
    """Derivative of :func:`share_of_stiffness` by the depth [1/m]."""
    return SOFTER * m * m * (d - m) / (m + 0.5 * d) ** 4 if m > 0.0 else 0.0


@numba.njit(cache=True)
def limit_of_friction(mu, N, kt, slope):
    """Friction of a contact that slips [N]: μ times the normal force, which it lowers itself.

    The energy ½ kt u² of friction's spring, whose stiffness has the derivative ``slope`` by the
    depth, makes the normal force N + ½ slope u². Where kt is 0 there is no friction yet.
    """
    square = 1.0 - 2.0 * mu * mu * slope * N / (kt * kt) if kt > 0.0 else 1.0
    return 2.0 * mu * N / (1.0 + math.sqrt(max(square, 0.0)))


@numba.njit(cache=True)
def normal_force(stiffness, depth, largest_depth, m=0.0):
    """Force of a normal spring [N], which grows no more beyond the largest depth."""
    return stiffness * over_stiffness(min(depth, largest_depth), m)


@numba.njit(cache=True)
def stored_energy(stiffness, depth, largest_depth, m):
    """Energy of a normal spring whose force grows no more beyond the largest depth [J]."""
    d = min(depth, largest_depth)
    less = 0.0
    if m > 0.0:
        u = 1.0 + 0.5 * d / m
        less = m * m * (8.0 * math.log(u) + 16.0 / u - 4.0 / (u * u) - 12.0)
    energy = stiffness * (0.5 * d * d - SOFTER * less)
    return energy + stiffness * over_stiffness(d, m) * (depth - d)


@numba.njit(cache=True)
def left_by_slip(trial, limit):
    """Part of a spring that slip leaves: it carries the limit after a trial force."""
    return limit / trial if trial > 0.0 else 0.0


@numba.njit(cache=True)
def friction_of(friction, friction_row, p):
    """Static and kinetic coefficient of a pair, in its row or in the first of all."""
    return friction[friction_row[p] if friction_row.size else 0]


@numba.njit(cache=True)
def pressing_force(kn, kt, d, m, spring, mu):
    """Normal force at a depth [N], with what friction's spring of a given length adds to it.

    ``kt``: of the spring where the contact is flat; ``mu``: of a contact that slips, whose spring
    is as long as its friction makes it, negative for one that sticks.
    """
    N, slope = kn * over_stiffness(d, m), kt * slope_of_share(d, m)
    if mu >= 0.0:
        stiffness = kt * share_of_stiffness(d, m)
        spring = limit_of_friction(mu, N, stiffness, slope) / stiffness if stiffness > 0.0 else 0.0
    return N + 0.5 * slope * spring * spring


@numba.njit(cache=True)
def law_slope(K, n, e, kn, kt, mu, left, c):
    """Minus the derivative of a contact's force by the place of its point, in place.

    kn n nᵀ + μ kn e nᵀ + left kt (1 - n nᵀ - e eᵀ) - n cᵀ - c nᵀ with the direction e of friction;
    without slip μ and e are zero, and the part ``left`` of the spring is one. c is the spring times
    the derivative of its stiffness by the depth, zero with slip.
    """
    for i in range(3):
        for j in range(3):
            nn = n[i] * n[j]
            K[i, j] = kn * nn + kt * left * ((1.0 if i == j else 0.0) - nn - e[i] * e[j])
            K[i, j] += mu * kn * e[i] * n[j] - n[i] * c[j] - c[i] * n[j]
