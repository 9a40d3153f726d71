"""From where on a test is quasi-static, whether its contacts are resolved, and its cycles."""

import numpy as np
import pytest

from mufe_fenicsx.analysis import rows
from mufe_fenicsx.analysis.checks import check_trust
from mufe_fenicsx.analysis.contact_resolution import classes_of_contacts, contact_resolution
from mufe_fenicsx.analysis.cycles import find_cycles, turning_points
from mufe_fenicsx.analysis.quasi_static import KINETIC, trusted_from
from tests.made_up_run import fake_history, set_balance

ROUND_OFF = 1e-12


def set_kinetic(history, ratio):
    history["kinetic"] = ratio * (history["elastic"] + history["plastic"])


def test_a_test_that_is_quasi_static_from_the_start():
    history = fake_history()
    trust = trusted_from(history)
    assert history["strain"][trust.row] == 0.0 and trust.share == 0.0
    assert np.isnan(trust.kinetic) and trust.missed == 0.0  # there is nothing before


def test_one_late_slip_is_told_from_a_dynamic_test():
    """Nothing before it is trusted, but two rows are dynamic; one alone decides nothing."""
    history = fake_history()
    row, slip = np.arange(len(history["step"])), 3 * len(history["step"]) // 4
    set_kinetic(history, np.where(row == slip, 2 * KINETIC, 0.0))
    assert trusted_from(history).share == 0.0
    set_kinetic(history, np.where((row == slip) | (row == slip - 1), 2 * KINETIC, 0.0))
    trust = trusted_from(history)
    loaded = (history["stage"] != "seating") & (history["elastic"] + history["plastic"] > 0)
    before = np.count_nonzero(loaded[: slip + 1])
    assert trust.row == slip + 1 and trust.missed == pytest.approx(2 / before, rel=ROUND_OFF)


def test_a_dynamic_first_half_is_found():
    """The checks of the loaded half see nothing of it."""
    history = fake_history()
    early = history["strain"] < 0.05
    set_kinetic(history, np.where(early, 4 * KINETIC, 0.1 * KINETIC))
    trust = trusted_from(history)
    assert trust.row == np.argmin(early)
    assert trust.share == pytest.approx(history["strain"][trust.row] / 0.1, rel=ROUND_OFF)
    assert trust.kinetic == pytest.approx(4 * KINETIC, rel=ROUND_OFF)


@pytest.mark.parametrize("ramp", [True, False])
def test_a_start_from_rest_is_told_apart_from_one_that_strikes(ramp):
    """v = a t, ε = a t²/2H: k = 4/3 (T/t)² after a sample at rest; at a constant speed (T/t)²/3."""
    history = fake_history()
    loading = history["stage"] != "seating"
    time = history["time"] - history["time"][loading][0]
    T = 0.04 * time[-1]
    with np.errstate(divide="ignore"):
        k = np.where(loading, (4 if ramp else 1) / 3 * (T / time) ** 2, 0.0)
    set_kinetic(history, np.where(time == 0, 0.0 if ramp else 1.0, np.minimum(k, 1.0)))
    assert ("begins at rest" in check_trust(history).text) is ramp


def test_a_test_that_ends_dynamic_is_trusted_nowhere():
    history = fake_history()
    late = np.arange(len(history["step"])) >= len(history["step"]) - 2
    set_kinetic(history, np.where(late, 2 * KINETIC, 0.0))
    assert trusted_from(history).row is None
    nothing = fake_history()
    for name in ("elastic", "plastic", "force_z_min", "force_z_max"):
        nothing[name] = np.zeros(len(nothing["step"]))
    assert trusted_from(nothing).row is None


def test_where_strain_turns_back_time_tells_how_much_is_dynamic():
    """Strain 0 to 0.1 and back to 0.09, dynamic in the first quarter of the time."""
    history = fake_history()
    loading = history["stage"] != "seating"
    count = loading.sum()
    history["strain"][loading] = np.concatenate(
        [np.linspace(0, 0.1, count // 2), np.linspace(0.1, 0.09, count - count // 2)]
    )
    history["stage"] = history["stage"].astype("U9")
    history["stage"][-(count - count // 2) :] = "unloading"
    done = rows.course(history)
    assert done[loading][[0, -1]].tolist() == [0, 1] and np.isnan(done[~loading]).all()
    set_kinetic(history, np.where(done < 0.25, 1.0, 0.0))
    assert trusted_from(history).share == pytest.approx(0.25, abs=1.0 / count)


def test_forces_of_an_unloaded_sample_are_not_compared():
    """One platen lets go first as the load ends: a ratio of 2, of no load."""
    history = fake_history()
    history["force_z_max"][-2:], history["force_z_min"][-2:] = (
        0.0,
        0.05 * history["force_z_min"][-3],
    )
    set_balance(history)
    assert trusted_from(history).share == 0.0
    history["force_z_min"][-2:] *= 20
    set_balance(history)
    assert trusted_from(history).row is None


def test_contacts_count_by_their_force():
    """Forces 1, 5, 3, 1 of ten at n = 0.4, 0.5, 1.6, 3.2."""
    n, force = [3.2, 0.5, 0.4, 1.6], [1.0, 5.0, 1.0, 3.0]
    found = contact_resolution(n, force)
    assert (found.tenth, found.half, found.nine_tenths) == (0.4, 0.5, 1.6)
    assert found.coarse == pytest.approx(0.6, rel=ROUND_OFF) and found.num_patches == 4
    assert contact_resolution([3.0], [0.0]) is None and contact_resolution([], []) is None
    assert contact_resolution([2.0, 9.0], [1.0, -8.0]).half == 2.0  # what pulls carries nothing


def test_pressure_of_classes_is_force_over_area():
    """Mean pressure of all patches of a class, over 2.8 Y of those that can yield."""
    Y = 1e8
    classes = classes_of_contacts(
        [0.4, 0.6, 0.9, 5.0], [28.0, 30.0, 10.0, 4.0], [1e-7, 1e-7, 3e-7, 1e-7], [Y, Y, 2 * Y, 0.0]
    )
    assert [c.num_patches for c in classes] == [1, 2, 0, 1]
    assert [c.force_share for c in classes] == pytest.approx([28 / 72, 40 / 72, 0, 4 / 72])
    assert classes[0].pressure == pytest.approx(2.8e8, rel=ROUND_OFF)
    assert classes[0].flow == pytest.approx(1.0, rel=ROUND_OFF)
    assert classes[1].pressure == pytest.approx(40 / 4e-7, rel=ROUND_OFF)
    assert classes[1].flow == pytest.approx(40 / (2.8 * (1e-7 * Y + 3e-7 * 2 * Y)), rel=ROUND_OFF)
    assert np.isnan(classes[2].pressure) and np.isnan(classes[3].flow)


def test_cycles_of_a_linear_viscous_solid():
    """σ = E ε + 2DE A cos: an ellipse with secant stiffness E and damping ratio D."""
    E, D, A, count = 2e9, 0.1, 1e-3, 4000
    angle = 2 * np.pi * np.linspace(0, 3.25, count)
    strain, stress = A * np.sin(angle), E * A * (np.sin(angle) + 2 * D * np.cos(angle))
    cycles = find_cycles(strain, stress)
    assert len(cycles) == 3
    for cycle in cycles:  # to the square of a step of the angle, at the turning points to a step
        assert cycle.stiffness == pytest.approx(E, rel=D * 2 * np.pi * 3.25 / count)
        assert cycle.damping == pytest.approx(D, rel=2e-3)
    assert find_cycles(strain[: count // 5], stress[: count // 5]) == []


def test_a_loop_ends_where_strain_is_back():
    """Up to 2, down to 1, up to 4 along one line: no area, and the slope of the line."""
    strain = np.concatenate([np.linspace(0, 2, 9), np.linspace(2, 1, 9), np.linspace(1, 4, 13)])
    assert turning_points(strain) == [0, 9, 18, 30]
    (cycle,) = find_cycles(strain, 3.0 * strain)
    assert strain[cycle.end] == 2.0 and cycle.stiffness == pytest.approx(3.0, rel=ROUND_OFF)
    assert abs(cycle.work) < ROUND_OFF
