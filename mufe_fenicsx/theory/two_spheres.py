"""Two elastic spheres pressed on each other, each whole: Hertz's contact of finite bodies.

Each sphere carries the same pressure at its opposite pole, as between two smooth rigid planes,
or is cut at its equator and rests there on a smooth plane: by symmetry the same. Its surface
responds as in :mod:`.finite_sphere`; where the spheres touch

    Σ u_z + δ = Σ Rᵢ (1 - cos θᵢ)

in linear elasticity, for the positions on the unstrained surface. What remains outside is
large strain and the difference of radial displacements of unlike spheres, both of order a/R
in the strain, not in the force's leading order.
"""

import numpy as np

from .finite_sphere import axial_response, contact_places


def compression(a, spheres, num_terms=3, resolution=80.0):
    """Approach, force and central pressure where the contact has the radius ``a``.

    Args:
        a: Radius of the contact [m].
        spheres: Tuples (radius [m], E [Pa], ν) of elastic spheres; what is not named is a
            rigid plane.
        num_terms: Terms (1 - ρ²/a²)^(k+½) of the pressure.
        resolution: Highest order of the series of the sphere of radius R, times a/R.

    Returns:
        delta: Approach of the equators [m].
        force: [N].
        p0: Pressure at the centre [Pa].
    """
    at = a * contact_places(num_terms)
    sag, uz = np.zeros(at.size), np.zeros((at.size, num_terms))
    for radius, E, nu in spheres:
        response, force = axial_response(a / radius, nu, num_terms, resolution)
        uz += response * radius * (1 + nu) / E  # 2G = E/(1 + ν)
        sag += radius * (1 - np.sqrt(1 - (at / radius) ** 2))
        total = force * radius**2
    # Columns of like size: the pressure in units of E*.
    unit = 1 / sum((1 - nu**2) / E for _, E, nu in spheres)
    matrix = np.column_stack([unit * uz / a, np.ones(at.size)])
    *factors, delta = np.linalg.lstsq(matrix, sag / a, rcond=None)[0]
    factors = unit * np.array(factors)
    return float(delta * a), float(factors @ total), float(factors.sum())
