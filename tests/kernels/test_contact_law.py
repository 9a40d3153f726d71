"""The normal law of a contact smaller than an element, its energy, and what friction adds to it."""

import re
from pathlib import Path

import numpy as np
import pytest

from mufe_fenicsx.contact.surface import bulges
from mufe_fenicsx.kernels import contact_law

HEADER = Path(contact_law.__file__).with_name("contact_law.h").read_text(encoding="utf-8")


def force(d, m):
    """Over the stiffness: d - 1.69 d² m²/(m + d/2)³ (docs/method/contact.md)."""
    return d - 1.69 * d**2 * m**2 / (m + 0.5 * d) ** 3


@pytest.mark.parametrize("m", [0.3, 1.0, 20.0])
def test_the_force_is_that_of_the_formula_and_its_energy_the_integral(m):
    d = np.linspace(0.0, 2.0, 20001)
    found = np.array([contact_law.over_stiffness(depth, m) for depth in d])
    np.testing.assert_allclose(found, force(d, m), rtol=1e-13, atol=1e-15)
    for depth, largest in ((1.3, 2.0), (2.0, 1.3)):  # beyond it the force grows no more
        on = d <= depth
        exact = 3.0 * np.trapezoid(force(np.minimum(d[on], largest), m), d[on])
        # Trapezoids of 1e-4, squared, and a kink.
        assert contact_law.stored_energy(3.0, depth, largest, m) == pytest.approx(exact, rel=1e-7)
        end = contact_law.normal_force(3.0, depth, largest, m)
        assert end == pytest.approx(3.0 * force(min(depth, largest), m), rel=1e-13)


@pytest.mark.parametrize("m", [0.3, 1.0, 20.0])
def test_slopes_are_the_derivatives(m):
    for d in (0.1, 0.7, 1.9):
        step = 1e-5
        for law, slope in (
            (contact_law.over_stiffness, contact_law.slope_over_stiffness),
            (contact_law.share_of_stiffness, contact_law.slope_of_share),
        ):
            difference = (law(d + step, m) - law(d - step, m)) / (2 * step)
            # The square of the step over lengths of 0.1, and rounding over the step.
            assert slope(d, m) == pytest.approx(difference, rel=1e-6, abs=1e-8)


def test_a_flat_contact_is_a_linear_spring():
    assert contact_law.over_stiffness(0.7, 0.0) == 0.7
    assert contact_law.stored_energy(3.0, 0.7, 1.0, 0.0) == pytest.approx(1.5 * 0.7**2, rel=1e-14)


def test_slipping_friction_is_the_coefficient_times_a_normal_force_that_it_changes_itself():
    """T = μ (N + ½ kt' T²/kt²)."""
    mu, N, kt, slope = 0.6, 2.0, 5.0, 3.0
    T = contact_law.limit_of_friction(mu, N, kt, slope)
    assert pytest.approx(mu * (N + 0.5 * slope * T**2 / kt**2), rel=1e-14) == T
    assert contact_law.limit_of_friction(mu, N, kt, 0.0) == pytest.approx(mu * N, rel=1e-14)


@pytest.mark.parametrize(("name", "value"), [("SOFTER", contact_law.SOFTER), ("XI", bulges.XI)])
def test_both_languages_have_the_same_factors(name, value):
    (written,) = re.findall(rf"#define {name} (\S+)", HEADER)
    assert float(written) == value
