"""Dry friction."""


def friction_work(mu, normal_force, slip):
    """Work taken by friction at constant load, μ N s [J].

    Args:
        mu: Coefficient of friction [-].
        normal_force: N [N].
        slip: Distance slid s [m].

    Source: K. L. Johnson, Contact Mechanics, 1985, section 7.1 (Amontons' law of sliding).
    """
    return mu * normal_force * slip
