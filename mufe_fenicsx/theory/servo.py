"""A wall that a servo presses on a sample: v = γ (F* - F)/(K Δt)."""


def absorbing_gain(modulus, density):
    """Speed of a wall over its lack of stress at which waves do not come back [m/(s Pa)].

        v = (σ* - σ)/(ρ c),  ρ c = √(ρ M)

    A dead load on a viscous boundary: a wave that meets the wall has σ = ρ c v itself.

    Args:
        modulus: Constrained modulus M of the sample [Pa].
        density: Its mass over its volume, voids included [kg/m³].

    Source: J. Lysmer & R. L. Kuhlemeyer, Finite dynamic model for infinite media,
    J. Engng Mech. Div. ASCE 95 (1969), 859-877.
    """
    return (modulus * density) ** -0.5


def stable_gain(omega_dt):
    """Largest stable γ of a servo that moves a wall by γ (F* - F)/K a step.

        γ < 2 - (ω Δt)²/2

    K is the stiffness between the wall and nodes of mass m, which central differences move
    with ω² = K/m. The lack of force e then obeys

        e'' - (2 - γ - Ω²) e' + (1 - γ) e = 0,  Ω = ω Δt,

    with e, e', e'' of three steps in a row; by Jury's test its roots are in the unit circle for
    0 < γ < 2 and 2 γ < 4 - Ω². Without inertia (ω = 0) it is γ < 2, Euler's method on a decay.

    Args:
        omega_dt: ω Δt, at most 2.
    """
    return 2 - 0.5 * omega_dt**2
