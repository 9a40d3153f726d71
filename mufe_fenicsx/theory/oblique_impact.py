"""Oblique impact of elastic spheres with friction: rebound of the contact point.

Hertz's impact gives the normal motion. Along the surface the contact is elastic too: parts
of it stick, parts slip by Coulomb's law at the local pressure. With the velocity v of
the contact point along the surface, the angles of incidence and rebound are

    ψ = κ v / (μ V),  κ = 2(1 - ν)/(2 - ν),

V the speed of approach of the centres. The rebound ψ₂ depends on ψ₁ and on

    χ = κ (1 + 1/K²)/2,  K² = I/(m R²),

alone: for the solid sphere χ = 7(1 - ν)/(2(2 - ν)). Limits:

    ψ₁ >= 4χ - 1 slips all the time: the impulse 2 μ m V takes 4χ from ψ₁, ψ₂ = ψ₁ - 4χ;
    ψ₁ <= 1 sticks at first: a contact that grows with v/V below μ/κ is all stuck.

Assumed: half-spaces of like elasticity, so that pressure moves nothing along the surface
(for unlike bodies Dundurs' β does); traction along one direction and
the displacement along it alone, averaged over the angle; no waves.

Source: N. Maw, J. R. Barber, J. N. Fawcett, The oblique impact of elastic spheres, Wear 38,
1976, 101-114.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .impact import loading


def tangential_ratio(nu):
    """κ = 2(1 - ν)/(2 - ν), tangential over normal stiffness of like bodies [-].

    Source: K. L. Johnson, Contact Mechanics, 1985, eq. (7.43).
    """
    return 2 * (1 - nu) / (2 - nu)


def inertia_parameter(nu, gyration=0.4):
    """χ = κ (1 + 1/K²)/2 [-].

    Args:
        nu: Poisson's ratio [-].
        gyration: K² = I/(m R²) [-], 2/5 for a solid sphere.
    """
    return 0.5 * tangential_ratio(nu) * (1 + 1 / gyration)


def spin_change(psi1, psi2, nu, gyration=0.4):
    """Change of R ω/(μ V) that goes with a change from ψ₁ to ψ₂ [-].

    The impulse P changes v by P/m (1 + 1/K²) and R ω by P/(m K²), so

        Δ(R ω)/(μ V) = (ψ₁ - ψ₂)/(κ (1 + K²)),

    5 where the solid sphere slips all the time.
    """
    return (psi1 - psi2) / (tangential_ratio(nu) * (1 + gyration))


@dataclass(frozen=True)
class ContactLaw:
    """How a contact differs from one of half-spaces; functions of r = a over its largest."""

    approach: Callable = np.ones_like  #: δ over a²/R
    force: Callable = np.ones_like  #: F over 4/3 E* a³/R
    along: Callable = np.ones_like  #: compliance along the surface over that of half-spaces


@dataclass(frozen=True)
class ObliqueImpact:
    """One impact; times from first touch over the time of contact, shape (2 num_rings + 1,)."""

    psi2: float  #: angle of rebound [-]
    dissipated: float  #: work of friction over m V² μ²/κ² / (1 + 1/K²), so (ψ₁² - ψ₂²)/2 [-]
    time: np.ndarray
    normal: np.ndarray  #: normal force over its largest value
    tangential: np.ndarray  #: friction over μ times the largest normal force
    psi: np.ndarray  #: velocity of the contact point, κ v/(μ V)


def oblique_impact(psi1, chi, num_rings=60, law=None):
    """Numerical solution for the contact divided into rings.

    Radii are in units of the largest contact radius a, lengths along the normal of a²/R, along
    the surface of μ a²/(R κ), pressure in its largest value, friction in μ times that. Then
    p = √(a² - r²), the approach is δ = a² and its speed follows from the energy; the traction
    is a sum of bᵢ √(aᵢ² - r²) within the outer radii aᵢ of the rings, its force Q = Σ bᵢ aᵢ³,
    and the displacement of the surface that of Hertz's pressure. With W = ∫ F dδ = 2/5 and
    the time in a²/(R V):

        dψ/dt = -χ Q/W.

    In the middle of each ring the surface either sticks, and moves as the body does, or slips
    forward or back at |q| = p. Rings end at the contact radii of the time steps of loading;
    unloading runs back through them.

    Args:
        psi1: Angle of incidence >= 0 [-].
        chi: Inertia parameter [-].
        num_rings: The error falls as its inverse: 0.003 in ψ₂ at 60.
        law: :class:`ContactLaw`; half-spaces if None. What adds to the compliance along the
            surface moves all of the contact alike.

    Returns:
        :class:`ObliqueImpact`.
    """
    law = ContactLaw() if law is None else law
    n, finer = num_rings, 100
    r, _, F, work, t = loading(
        lambda a: a**2 * law.approach(a), lambda a: a**3 * law.force(a), finer * n
    )
    work, F = work / F[-1], F / F[-1]
    r, F, t = r[::finer], F[::finer], t[::finer]
    outer = r[1:]
    middle = outer - 0.5 * np.diff(r)
    shape = np.sqrt(np.maximum(outer[None, :] ** 2 - middle[:, None] ** 2, 0.0))
    moved = _displacement(middle[:, None], outer[None, :])
    moved += 0.8 * outer**2 * (law.along(outer) - 1)  # 0.8 is the mean of the first over q

    time = np.concatenate([t, 2 * t[-1] - t[-2::-1]])
    normal = np.concatenate([F, F[-2::-1]])
    radius = np.concatenate([r, r[-2::-1]])
    psi, force = np.full(2 * n + 1, float(psi1)), np.zeros(2 * n + 1)
    rate = 0.5 * chi / work
    dissipated, b, slips = 0.0, np.zeros(n), np.zeros(n, dtype=int)  # 0 sticks, ±1 slips
    for k in range(1, 2 * n + 1):
        dt = time[k] - time[k - 1]
        shift = dt * (psi[k - 1] - rate * dt * force[k - 1])
        m = min(k, 2 * n - k)  # rings in contact
        before, b = b, np.zeros(n)
        if m:
            p = np.sqrt(radius[k] ** 2 - middle[:m] ** 2) * normal[k] / radius[k] ** 3
            stuck = moved[:m] @ before + shift
            b[:m] = _tractions(slips[:m], shape[:m, :m], moved[:m, :m], stuck, p)
        force[k] = b @ outer**3
        psi[k] = psi[k - 1] - rate * dt * (force[k - 1] + force[k])
        # ∫ q ds by the mean traction and the slip in the middle of each ring.
        slip = shift - moved @ (b - before)
        dissipated += 1.5 * (0.5 * (shape @ (b + before)) * slip * np.diff(r**2)).sum()
    return ObliqueImpact(
        psi2=float(psi[-1]),
        dissipated=float(2 * rate * dissipated),
        time=time / time[-1],
        normal=normal,
        tangential=force,
        psi=psi,
    )


def _tractions(slips, shape, moved, stuck, p):
    """Factors b of the tractions; ``slips`` of the rings is brought up to date, in place."""
    for _ in range(4 * p.size + 20):
        slipping = slips != 0
        matrix = np.where(slipping[:, None], shape, moved)
        b = np.linalg.solve(matrix, np.where(slipping, slips * p, stuck))
        q, slip = shape @ b, stuck - moved @ b
        too_much = ~slipping & (np.abs(q) > p * (1 + 1e-9))
        backwards = slipping & (slip * slips < -1e-9)
        if not (too_much.any() or backwards.any()):
            return b
        slips[too_much] = np.sign(q[too_much]).astype(int)
        slips[backwards] = 0
    raise ArithmeticError("stick and slip of the rings were not found")


def _displacement(r, a):
    """Displacement at r under the traction √(a² - r²) within a (Johnson 1985, eqs (3.41))."""
    ratio = np.minimum(a / r, 1.0)
    outside = (2 * a**2 - r**2) * np.arcsin(ratio) + a * r * np.sqrt(1 - ratio**2)
    return np.where(r < a, 0.5 * (2 * a**2 - r**2), outside / np.pi)
