"""Neo-Hookean grains: forces from their energy, closed forms of large stretch, small strain."""

import platform

import numpy as np
import pytest
from mpi4py import MPI
from scipy.optimize import brentq

from mufe_fenicsx.bulk.solid import ELEMENTS
from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.kernels.build import native
from mufe_fenicsx.kernels.bulk import solid as kernels
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.materials.neo_hookean import NeoHookean
from mufe_fenicsx.run.from_bodies import build
from tests.bodies import sphere

COMM = MPI.COMM_SELF
RUBBER = NeoHookean()
UP = np.array([0.0, 0.0, 1.0])


def block(material, element="averaged", divisions=(2, 2, 2), **options):
    body = box((1e-3, 1e-3, 1e-3), divisions)
    return build(COMM, [body], material, [0] * 3, [0] * 3, "", element=element, **options)


def deformed(s, F):
    """Forces and mean Cauchy stress of a body under an even deformation gradient."""
    s.state.x[:] = s.mesh.x @ np.asarray(F).T
    f = np.zeros_like(s.state.x)
    assert s.solid.add_internal_forces(f, s.state, 0.0) == -1
    return f, s.solid.stress(s.state)


@pytest.mark.parametrize("element", ELEMENTS)
@pytest.mark.parametrize("lanes", [4, None])
def test_forces_are_the_slope_of_the_energy(element, lanes, monkeypatch):
    """Also of elements beyond the series of J^(-2/3), and whose number is no multiple of lanes."""
    if lanes == 4 and platform.machine() != "x86_64":
        pytest.skip("four lanes are forced by its options")
    if lanes == 4:
        monkeypatch.setattr(kernels, "load", lambda name: native.load(name, "-mno-avx512f"))
    s = block(RUBBER, element, (3, 1, 1))
    assert s.mesh.num_cells % 8
    rng = np.random.default_rng(1)
    s.state.x[:] = 1.3 * s.mesh.x + 5e-5 * rng.standard_normal(s.mesh.x.shape)
    place, f = s.state.x.copy(), np.zeros_like(s.state.x)
    assert s.solid.add_internal_forces(f, s.state, 0.0) == -1
    for _ in range(5):
        d, values = rng.standard_normal(f.shape), []
        for sign in (1, -1):
            s.state.x[:] = place + sign * 1e-9 * d
            values.append(s.solid.elastic_energy(s.state).sum())
        # Central differences: rounding of the energy over the step, and its square.
        assert (values[0] - values[1]) / 2e-9 == pytest.approx(-np.vdot(f, d), rel=1e-6)


@pytest.mark.parametrize("element", ELEMENTS)
def test_even_deformation_has_the_stress_of_the_formula(element):
    """σ J = G J^(-2/3) dev F Fᵀ + J K ln J I, whatever the rotation in it."""
    F = np.array([[1.4, 0.5, 0.0], [-0.2, 0.9, 0.3], [0.1, 0.0, 0.8]])
    f, stress = deformed(block(RUBBER, element), F)
    J, b = np.linalg.det(F), F @ F.T
    deviator = b - np.trace(b) / 3 * np.eye(3)
    G, K = RUBBER.shear_modulus, RUBBER.bulk_modulus
    expected = G * J ** (-5 / 3) * deviator + K * np.log(J) * np.eye(3)
    np.testing.assert_allclose(
        stress - expected[[0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]], 0.0, atol=1e-9 * K
    )
    # No net force: of a few hundred terms rounding alone.
    assert np.abs(f.sum(axis=0)).max() < 1e-12 * np.abs(f).max()


def test_small_strain_is_linear_elasticity():
    strain = 1e-5 * np.array([[1.0, 0.3, 0.2], [0.3, -0.5, 0.1], [0.2, 0.1, 0.4]])
    f, _ = deformed(block(RUBBER), np.eye(3) + strain)
    s = block(Elastic(RUBBER.E, RUBBER.nu, RUBBER.rho))
    s.state.v[:] = s.mesh.x @ strain
    s.state.x[:] = s.mesh.x + s.state.v
    other = np.zeros_like(f)
    s.solid.add_internal_forces(other, s.state, 1.0)
    # Both are off by the square of the strain.
    np.testing.assert_allclose(f, other, atol=1e-4 * np.abs(other).max())


def test_a_rod_in_increments():
    """Uniaxial stress at λ = 1.5, and P = G (λ - 1/λ²) but for the volume that changes."""
    length = 1e-3
    walls = [Wall("xyz"[i], np.zeros(3), np.eye(3)[i], mirror=True) for i in range(3)]
    at_top = np.flatnonzero(np.isclose(block(RUBBER).mesh.x[:, 2], length))
    s = block(RUBBER, walls=walls, increment=0.1, held=[(at_top, UP)])
    for _ in range(10):
        s.prescribed[at_top, 2] = 0.05 * length
        s.step()
    stretch = s.state.x[at_top, 2].mean() / length
    assert stretch == pytest.approx(1.5)
    f = np.zeros_like(s.state.x)
    s.solid.add_internal_forces(f, s.state, s.dt)
    pulled = -f[at_top, 2].sum() / length**2
    assert pulled == pytest.approx(rod(stretch), rel=1e-6)
    # 1.1 %: the volume grows by a part of about P/3K, and the sides shrink less.
    assert pulled == pytest.approx(RUBBER.shear_modulus * (stretch - stretch**-2), rel=0.02)
    # With the consistent tangent of Newton's method the residual falls as its square.
    assert max(line[2] for line in s.report) <= 6


def rod(stretch):
    """Force over first area of a rod whose sides are free [Pa]."""
    G, K = RUBBER.shear_modulus, RUBBER.bulk_modulus

    def nominal(side):
        J = stretch * side**2
        third, shear = (stretch**2 + 2 * side**2) / 3, G * J ** (-2 / 3)
        along = shear * (stretch - third / stretch) + K * np.log(J) * side**2
        return along, shear * (side - third / side) + K * np.log(J) * stretch * side

    return nominal(brentq(lambda side: nominal(side)[1], 0.5, 1.0, xtol=1e-14))[0]


def test_a_body_that_turns_stays_without_stress():
    angle = 2.0
    R = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    s = build(COMM, [sphere(1e-3, 0.4e-3)], RUBBER, [0] * 3, [0] * 3, "")
    _, stress = deformed(s, R)
    assert np.abs(stress).max() < 1e-10 * RUBBER.bulk_modulus
