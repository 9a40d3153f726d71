"""Closed forms of cohesive cracks."""

import math

import numpy as np


def linear_softening(opening, strength, energy):
    """Traction of a facet that opens without a turn [Pa], effective like its opening [m].

        T = σ (1 - δ/δc),  δc = 2 G/σ

    Source: G. T. Camacho, M. Ortiz, Int. J. Solids Struct. 33, 1996, 2899-2938, section 4.
    """
    return strength * np.maximum(1.0 - np.asarray(opening) * strength / (2.0 * energy), 0.0)


def fragment_size_grady(rho, rate, energy):
    """Size of fragments [m] of a ring that expands at a rate of strain [1/s].

        s = (24 G/(ρ ε'²))^(1/3)

    from the kinetic energy of the parts that becomes fracture energy.

    Source: D. E. Grady, J. Appl. Phys. 53, 1982, 322-325.
    """
    return (24.0 * energy / (rho * rate**2)) ** (1.0 / 3.0)


def fragment_size_zhou(E, rho, rate, energy, strength):
    """The same of simulations with cohesive points along a bar [m].

        s/s₀ = 4.5/(1 + 0.77 x^(1/4) + 5.4 x^(3/4)),  x = ε'/ε'₀,
        s₀ = E G/σ²,  ε'₀ = c σ³/(E² G)

    Source: F. Zhou, J.-F. Molinari, K. T. Ramesh, Appl. Phys. Lett. 88, 2006, 261918.
    """
    wave = math.sqrt(E / rho)
    x = rate * E**2 * energy / (wave * strength**3)
    return E * energy / strength**2 * 4.5 / (1.0 + 0.77 * x**0.25 + 5.4 * x**0.75)


def tension_on_plane(angle, shear_ratio):
    """Tension over σ at which a plane opens whose normal is turned by an angle from it [-].

        1/(cos α √(cos²α + sin²α/β²))

    Source: the effective traction of G. T. Camacho, M. Ortiz, as above.
    """
    cos, sin = math.cos(angle), math.sin(angle)
    return 1.0 / (cos * math.hypot(cos, sin / shear_ratio))


def compression_on_plane(angle, shear_ratio, friction):
    """The same of a compression: β/(sin α cos α - μ cos²α), inf where friction holds the plane.

    Source: C. A. Coulomb's law with cohesion βσ.
    """
    drives = math.sin(angle) * math.cos(angle) - friction * math.cos(angle) ** 2
    return shear_ratio / drives if drives > 0.0 else math.inf


def compressive_strength(shear_ratio, friction):
    """Compression over σ at which the weakest of all planes slips: 2β(√(1 + μ²) + μ).

    Source: Mohr and Coulomb; J. C. Jaeger, N. G. W. Cook, Fundamentals of Rock Mechanics, 1979,
    section 4.6.
    """
    return 2.0 * shear_ratio * (math.hypot(1.0, friction) + friction)
