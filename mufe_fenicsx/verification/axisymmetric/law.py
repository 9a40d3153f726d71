"""The material of kernels.solid in UFL, in cylindrical coordinates without torsion.

One step from a known state to an unknown one, with the same equations: midpoint increment and
spin (Hughes & Winget 1980), deviator t of the Kirchhoff stress, radial return on a hardening
table, mean stress p = K ln J. Symmetric tensors are (rr, zz, hoop, rz).
"""

from itertools import pairwise

from ufl import (
    And,
    Identity,
    as_vector,
    conditional,
    det,
    exp,
    grad,
    inner,
    inv,
    le,
    lt,
    max_value,
    sqrt,
    tr,
)


class Motion:
    """From the first positions to the current ones.

    Args:
        r: First distance from the axis.
        u: Displacement (u_r, u_z).
    """

    def __init__(self, r, u):
        self.r = r
        self.F = Identity(2) + grad(u)
        self.hoop = 1 + u[0] / r
        self.J = det(self.F) * self.hoop


def deviator(now, before, state, shear, table):
    """Deviator and plastic strain at the end of a step.

    Args:
        now, before: :class:`Motion` at the end and at the start.
        state: At the start: deviator (rr, zz, hoop, rz) and plastic strain.
        shear: G.
        table: Points (plastic strain, yield stress), flat beyond the last.

    Returns:
        A vector as ``state``.
    """
    L = (now.F - before.F) * inv(0.5 * (now.F + before.F))
    hoop = 2 * (now.hoop - before.hoop) / (now.hoop + before.hoop)
    third = (tr(L) + hoop) / 3
    # Half of the increment turns along with the stress, and the other half not.
    half = [shear * x for x in (L[0, 0] - third, L[1, 1] - third, hoop - third)]
    half.append(0.5 * shear * (L[0, 1] + L[1, 0]))
    rr, zz, tt, rz = (state[i] + half[i] for i in range(4))
    q = 0.25 * (L[1, 0] - L[0, 1])  # tangent of half the angle
    c, s = (1 - q**2) / (1 + q**2), 2 * q / (1 + q**2)
    rr, zz, rz = (
        c**2 * rr - 2 * c * s * rz + s**2 * zz,
        s**2 * rr + 2 * c * s * rz + c**2 * zz,
        c * s * (rr - zz) + (c**2 - s**2) * rz,
    )
    trial = as_vector([rr, zz, tt, rz]) + as_vector(half)
    alpha = state[4]
    # No stress at all has no direction: far below any yield stress it does not matter.
    q = sqrt(max_value(von_mises2(trial), (1e-6 * table[0][1]) ** 2))
    dp = plastic_increment(q, alpha, shear, table)
    scale = 1 - 3 * shear * dp / q
    return as_vector([*(scale * trial[i] for i in range(4)), alpha + dp])


def von_mises2(t):
    """Squared von Mises stress of a deviator (rr, zz, hoop, rz)."""
    return 1.5 * (t[0] ** 2 + t[1] ** 2 + t[2] ** 2) + 3 * t[3] ** 2


def plastic_increment(q, alpha, shear, table):
    """As kernels.hardening.plastic_increment, for the points (plastic strain, yield stress)."""
    dp = max_value((q - table[-1][1]) / (3 * shear), 0)
    # From the last segment to the first: what is valid in an earlier one wins.
    for (strain, stress), (end, stress_at_end) in reversed(list(pairwise(table))):
        slope = (stress_at_end - stress) / (end - strain)
        here = (q - stress - slope * (alpha - strain)) / (3 * shear + slope)
        valid = And(lt(alpha, end), le(alpha + here, end))
        dp = conditional(valid, max_value(here, 0), dp)
    return dp


def virtual_work(now, t, p, v, q, bulk):
    """Internal virtual work over the first volume, and the weak form of p = K ln J.

    The pressure is a field of its own (P2 displacements, P1 pressure: Taylor & Hood), so that
    flow at constant volume does not lock. J = exp(p/K) is tested by it: then the tangent
    is symmetric where nothing flows.
    """
    r = now.r
    g, hoop = grad(v), v[0] / r
    cofactor = det(now.F) * inv(now.F).T
    volume = now.hoop * inner(cofactor, g) + det(now.F) * hoop
    g, hoop = g * inv(now.F), hoop / now.hoop
    constraint = now.J - exp(p / bulk)
    shape = t[0] * g[0, 0] + t[1] * g[1, 1] + t[2] * hoop + t[3] * (g[0, 1] + g[1, 0])
    return shape + p * volume + constraint * q
