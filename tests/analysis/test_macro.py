"""Stress of a sample from its contacts and its walls, and curves of made-up tests."""

import numpy as np
import pytest

from mufe_fenicsx.analysis import macro
from mufe_fenicsx.container import BOX

ROUND_OFF = 1e-12


def lattice(n, D, F):
    """Forces and branch vectors of balls of diameter D in a cubic lattice between walls.

    F are the forces of its contacts along x, y and z; in a shear-free lattice the same ones act
    from wall to wall. Grain a is the upper one of a pair, as is the one that a wall carries.
    """
    force, branch = [], []
    for axis in range(3):
        e = np.eye(3)[axis]
        inner = n[axis] - 1
        lines = np.prod(n) // n[axis]
        for length, number in ((D, inner), (D / 2, 1)):
            force += [F[axis] * e] * (number * lines)
            branch += [length * e] * (number * lines)
        force += [-F[axis] * e] * lines  # the wall at the far end pushes back
        branch += [-D / 2 * e] * lines
    return np.array(force), np.array(branch)


def test_stress_of_contacts_is_that_of_the_walls():
    n, D, F = (3, 4, 5), 2e-3, np.array([1.0, 2.0, 6.0])
    force, branch = lattice(n, D, F)
    lengths = D * np.array(n)
    stress = macro.contact_stress(force, branch, lengths.prod())
    assert stress == pytest.approx(np.diag(F / D**2), rel=ROUND_OFF)
    # On each wall as many forces as lines of balls end there.
    lines = np.array([np.prod(n) // k for k in n])
    on_walls = np.repeat(F * lines, 2)
    assert BOX.stresses(on_walls, lengths) == pytest.approx(F / D**2, rel=ROUND_OFF)
    both = BOX.stresses(np.tile(on_walls, (4, 1)), np.tile(lengths, (4, 1)))
    assert both.shape == (4, 3) and both[2] == pytest.approx(F / D**2, rel=ROUND_OFF)


def test_inertia_closes_the_balance_of_a_column_that_accelerates():
    """Three balls, forces 2, 3, 5, 9 from the bottom wall up: each is accelerated downward."""
    D, up = 0.1, np.array([0.0, 0.0, 1.0])
    at = np.array([2.0, 3.0, 5.0, 9.0])
    force = [at[0] * up, at[1] * up, at[2] * up, -at[3] * up]  # wall on 1, 1 on 2, 2 on 3, top on 3
    branch = [D / 2 * up, D * up, D * up, -D / 2 * up]
    volume = D * D * 3 * D
    stress = macro.contact_stress(np.array(force), np.array(branch), volume)
    centre = np.array([[0, 0, 0.5 * D], [0, 0, 1.5 * D], [0, 0, 2.5 * D]])
    acceleration = np.outer(at[:3] - at[1:], up)
    inertia = macro.inertial_stress(acceleration, centre, np.array([0, 0, 1.5 * D]), volume)
    walls = BOX.stresses([0, 0, 0, 0, at[0], at[3]], [D, D, 3 * D])
    assert walls[2] == pytest.approx(5.5 / D**2, rel=ROUND_OFF)
    assert (stress + inertia)[2, 2] == pytest.approx(walls[2], rel=ROUND_OFF)
    assert abs(stress[2, 2] / walls[2] - 1) > 0.1  # which it is not without


def test_wall_friction():
    """Two grains on a floor, one dragged along x at half the push, one at rest."""
    force = np.array([[-1.0, 0.0, 2.0], [0.0, 0.0, 3.0]])
    found = macro.wall_friction(force, np.tile([0, 0, 1.0], (2, 1)))
    assert found.normal == 5.0 and found.mobilised == pytest.approx(0.2)
    assert found.shear.tolist() == [1.0, 0.0, 0.0]
    assert np.isnan(macro.wall_friction(np.empty((0, 3)), np.empty((0, 3))).mobilised)


def confined_history(M, K0, area, height, num_rows=51):
    """An elastic layer, pressed by 2 % after a seating stage."""
    strain = np.concatenate([np.zeros(5), np.linspace(0, 0.02, num_rows)])
    stress = np.concatenate([np.linspace(0, 0.9, 5) * 1e5, 1e5 + M * strain[5:]])
    now = height * (1 - strain)
    side = np.sqrt(area)
    h = {"strain": strain, "height": now}
    h["stage"] = np.where(np.arange(strain.size) < 5, "seating", "loading")
    for name in ("z_min", "z_max"):
        h[f"force_{name}"] = stress * area
    for name in ("x_min", "x_max", "y_min", "y_max"):
        h[f"force_{name}"] = K0 * stress * side * now
    return h, stress


def test_curves_of_an_elastic_layer():
    M, K0, area, height, solid = 200e6, 0.35, 4e-6, 2e-3, 5e-9
    h, stress = confined_history(M, K0, area, height)
    lengths = np.column_stack([*np.full((2, h["strain"].size), np.sqrt(area)), h["height"]])
    found = macro.oedometer_curves(h, lengths, solid)
    assert found["stress"] == pytest.approx(stress, rel=ROUND_OFF)
    assert found["K0"][1:] == pytest.approx(K0, rel=ROUND_OFF)
    # A line fitted to a line, over tens of rows.
    assert found["modulus"][5:] == pytest.approx(M, rel=1e-9)
    assert np.isnan(found["modulus"][:5]).all()
    e = area * h["height"] / solid - 1
    assert found["void_ratio"] == pytest.approx(e, rel=ROUND_OFF)
    assert np.isnan(found["K0"][0]) and np.isnan(found["log10_stress"][0])
    assert found["log10_stress"][1:] == pytest.approx(np.log10(stress[1:]), rel=ROUND_OFF)
    # Side walls that go apart: stress over the area that there is now.
    wider = macro.oedometer_curves(h, [1.1, 1.1, 1.0] * lengths, solid)
    assert wider["stress"] == pytest.approx(stress / 1.21, rel=ROUND_OFF)
    assert wider["stress_x"] == pytest.approx(K0 * stress / 1.1, rel=ROUND_OFF)


def test_strength_and_dilatancy_at_the_peak():
    """q/p = 6 sin φ/(3 - sin φ) of φ = 40°; the volume grows by half of the shortening there."""
    phi, top, num = np.radians(40), 0.1, 201
    peak = 6 * np.sin(phi) / (3 - np.sin(phi))
    axial = np.linspace(0, 0.2, num)  # logarithmic
    ratio = peak * np.where(axial <= top, np.sin(axial / top * np.pi / 2), 1.25 - 2.5 * axial)
    lost = -0.5 * (axial - top) + 2.0 * (axial - top) ** 2
    lost -= lost[0]
    h = {"stage": np.full(num, "shear"), "strain": -np.expm1(-axial), "height": np.exp(-axial)}
    h["strain_z"] = h["strain"]
    p = np.full(num, 1e5)
    curves = {"p": p, "q": ratio * p, "strain_volume": -np.expm1(-lost)}
    found = macro.triaxial_strength(h, curves)
    assert found.row == num // 2 and found.friction_angle == pytest.approx(40, rel=1e-12)
    assert found.volume_slope == pytest.approx(-0.5, abs=1e-12)  # the window lies even about it
    assert found.dilatancy_angle == pytest.approx(np.degrees(np.arcsin(0.2)), rel=1e-9)
    assert found.is_passed and found.last_ratio == pytest.approx(0.75 * peak)
    half = {name: values[: num // 2 + 1] for name, values in (h | curves).items()}
    assert not macro.triaxial_strength(half, half).is_passed
    assert macro.triaxial_strength(h, curves | {"q": -p}) is None


def test_stresses_of_a_tilted_box():
    """The same pressure all around: forces on tilted walls are larger by their areas."""
    lengths, tilt = np.array([[3.0, 2.0, 1.0]]), 0.75  # cos θ = 0.8
    forces = dict(zip(BOX.walls, [2 / 0.8, 2 / 0.8, 3, 3, 6, 6], strict=True))
    history = {f"force_{name}": np.array([value]) for name, value in forces.items()}
    found = macro.wall_stresses(history | {"gamma_xz": np.array([tilt])}, lengths)
    assert found == pytest.approx(np.ones((1, 3)))
