"""Elastic moduli of a laterally confined column."""


def oedometric_modulus(E, nu):
    """Stiffness without lateral strain [Pa].

        M = E (1 - ν) / ((1 + ν) (1 - 2ν))

    Args:
        E: Young's modulus [Pa].
        nu: Poisson's ratio [-].

    Source: S. P. Timoshenko, J. N. Goodier, Theory of Elasticity, 3rd ed. 1970, section 6
    (Hooke's law with two strains zero).
    """
    return E * (1 - nu) / ((1 + nu) * (1 - 2 * nu))


def lateral_stress_ratio(nu):
    """Lateral over axial stress without lateral strain, ν / (1 - ν) [-].

    Source: as :func:`oedometric_modulus`.
    """
    return nu / (1 - nu)
