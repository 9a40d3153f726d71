"""Stress in a body that turns at a constant rate."""


def mean_centrifugal_stress(rho, omega, mean_square):
    """Mean of the stress σxx over a free body that turns about z [Pa], tension positive.

        <σxx> = ρ ω² <x²>

    Equilibrium div σ = -ρ ω² (x, y, 0), multiplied by x and integrated over the body
    without surface loads; exact whatever its shape and material.

    Args:
        rho: Density [kg/m³].
        omega: Rate of turning [rad/s].
        mean_square: Mean of x² over the body [m²], R²/5 for a sphere.

    Source: A. E. H. Love, A Treatise on the Mathematical Theory of Elasticity, 4th ed.
    1927, article 123 (mean values of the stress components).
    """
    return rho * omega**2 * mean_square
