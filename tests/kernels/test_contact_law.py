"""The normal law of a contact smaller than an element, its energy, and what friction adds to it."""

import ctypes
import re
from pathlib import Path

import numpy as np
import pytest

from mufe_fenicsx.contact.surface import bulges
from mufe_fenicsx.kernels.build import native
from mufe_fenicsx.kernels.contact import tangents

HEADER = Path(tangents.__file__).with_name("contact_law.h")
#: Functions of kernels/contact/law.h and how many numbers they take.
LAW = {
    "over_stiffness": 2, "slope_over_stiffness": 2, "share_of_stiffness": 2, "slope_of_share": 2,
    "normal_force": 4, "stored_energy": 4, "limit_of_friction": 4,
    "energy": 3, "carried": 3,
}  # fmt: skip
#: Energy and normal force of a contact at a depth whose spring of friction is held at a length.
HELD = """
static spring_type held(double m) { return (spring_type){3.0, m, 2.0, 0.8}; }
static double energy(double depth, double m, double length) {
  return energy_of(held(m), depth,
                   (vec3){-length * tangential_stiffness(held(m), depth), 0.0, 0.0});
}
static double carried(double depth, double m, double length) {
  return carry((contact_type){held(m), depth, 1.0, {0.0, 0.0, 1.0}, {length, 0.0, 0.0},
                              {0.0, 0.0, 0.0}, 0, 1.0, 1.0}).N;
}
"""


@pytest.fixture(scope="module")
def law(tmp_path_factory):
    """These functions, compiled as they are in forces and tangents."""
    source, library = (tmp_path_factory.mktemp("law") / name for name in ("law.c", "law.so"))
    lines = ['#include "contact_law.h"', HELD]
    for name, number in LAW.items():
        taken = [f"x{i}" for i in range(number)]
        given = ", ".join(f"double {x}" for x in taken)
        lines.append(f"double of_{name}({given}) {{ return {name}({', '.join(taken)}); }}")
    source.write_text("\n".join(lines))
    library.write_bytes(native._compiled(source, native.OPTIONS))
    loaded = ctypes.CDLL(str(library))
    for name, number in LAW.items():
        function = loaded[f"of_{name}"]
        function.restype, function.argtypes = ctypes.c_double, [ctypes.c_double] * number
        setattr(loaded, name, function)
    return loaded


def force(d, m):
    """Over the stiffness: d - 1.69 d² m²/(m + d/2)³ (docs/method/contact.md)."""
    return d - 1.69 * d**2 * m**2 / (m + 0.5 * d) ** 3


@pytest.mark.parametrize("m", [0.3, 1.0, 20.0])
def test_the_force_is_that_of_the_formula_and_its_energy_the_integral(law, m):
    d = np.linspace(0.0, 2.0, 20001)
    found = np.array([law.over_stiffness(depth, m) for depth in d])
    np.testing.assert_allclose(found, force(d, m), rtol=1e-13, atol=1e-15)
    for depth, largest in ((1.3, 2.0), (2.0, 1.3)):  # beyond it the force grows no more
        on = d <= depth
        exact = 3.0 * np.trapezoid(force(np.minimum(d[on], largest), m), d[on])
        # Trapezoids of 1e-4, squared, and a kink.
        assert law.stored_energy(3.0, m, depth, largest) == pytest.approx(exact, rel=1e-7)
        end = law.normal_force(3.0, m, depth, largest)
        assert end == pytest.approx(3.0 * force(min(depth, largest), m), rel=1e-13)


@pytest.mark.parametrize("m", [0.3, 1.0, 20.0])
def test_slopes_are_the_derivatives(law, m):
    for d in (0.1, 0.7, 1.9):
        step = 1e-5
        for function, slope in (
            (law.over_stiffness, law.slope_over_stiffness),
            (law.share_of_stiffness, law.slope_of_share),
        ):
            difference = (function(d + step, m) - function(d - step, m)) / (2 * step)
            # The square of the step over lengths of 0.1, and rounding over the step.
            assert slope(d, m) == pytest.approx(difference, rel=1e-6, abs=1e-8)


@pytest.mark.parametrize("m", [0.0, 0.3, 1.0])
def test_the_normal_force_is_the_derivative_of_the_energy_of_both_springs(law, m):
    """Friction's spring has a part in it where its stiffness changes with the depth."""
    for d in (0.1, 0.7, 1.9, 2.5):
        step, length = 1e-5, 0.3 * d
        slope = (law.energy(d + step, m, length) - law.energy(d - step, m, length)) / (2 * step)
        assert law.carried(d, m, length) == pytest.approx(slope, rel=1e-7)


def test_a_flat_contact_is_a_linear_spring(law):
    assert law.over_stiffness(0.7, 0.0) == 0.7
    assert law.stored_energy(3.0, 0.0, 0.7, 1.0) == pytest.approx(1.5 * 0.7**2, rel=1e-14)


def test_slipping_friction_is_the_coefficient_times_a_normal_force_that_it_changes_itself(law):
    """T = μ (N + ½ kt' T²/kt²)."""
    mu, N, kt, slope = 0.6, 2.0, 5.0, 3.0
    T = law.limit_of_friction(mu, N, kt, slope)
    assert pytest.approx(mu * (N + 0.5 * slope * T**2 / kt**2), rel=1e-14) == T
    assert law.limit_of_friction(mu, N, kt, 0.0) == pytest.approx(mu * N, rel=1e-14)


def test_both_languages_have_the_same_factor():
    (written,) = re.findall(r"#define XI (\S+)", HEADER.read_text("utf-8"))
    assert float(written) == bulges.XI
