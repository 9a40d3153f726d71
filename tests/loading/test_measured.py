"""Walls that move as a file says."""

import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.loading.measured import curve_through, read_measured, steepest
from mufe_fenicsx.scene.stages import Axis, Stage, Until
from tests.loading.staged import (
    MOTION,
    SIZE,
)
from tests.loading.test_paths import SPEED, block


def test_walls_follow_a_file(tmp_path):
    """Each row is met, at its part of the time, as fast as the fastest axis may; never beyond."""
    path = tmp_path / "motion.csv"
    path.write_text(MOTION)
    sim, loading = block(
        Stage("test", follow=path), Stage("rest", hold=1e-6, until=Until(time=1.0))
    )
    strains, z_min, ways, speeds = [], [], [], []
    while loading.index < 2:
        loading.before_step()
        sim.step()
        if loading.index == 1 and loading._now.hold_from is None:
            strains.append(loading.apparatus.gauges.strains.copy())
            z_min.append(sim.walls.point[4, 2])
            ways.append(loading._now.s)
            speeds.append(loading.speed_now)
    strains, ways, L = np.array(strains), np.array(ways), loading.apparatus.gauges.reference
    wanted = np.array([[0.001, 1e-6 / L[1], 0], [0.0005, 1.5e-6 / L[1], 2e-6 / L[2]],
                       [0.002, 1e-6 / L[1], 3e-6 / L[2]]])  # fmt: skip
    at = [np.argmin(np.abs(ways - part)) for part in (0.25, 0.75, 1.0)]
    step = SPEED * sim.dt / SIZE
    assert np.abs(strains[at] - wanted).max() < 1.5 * step
    assert strains[-1] == pytest.approx(wanted[-1], abs=1e-11)
    assert strains[:, 1].max() <= 1.5e-6 / L[1] + 1e-12 and np.ptp(z_min) < 1e-15
    assert 0.95 * SPEED < max(speeds) < 1.001 * SPEED


def test_curves_go_through_rows_without_overshoot():
    x, y = np.array([0.0, 0.2, 0.5, 1.0]), np.array([0.0, 1.0, 1.0, -2.0])
    curve = curve_through(x, y)
    fine = np.linspace(0, 1, 2001)
    assert curve(x) == pytest.approx(y, abs=1e-14) and curve(fine).max() <= 1.0 + 1e-14
    slopes = np.abs(np.diff(curve(fine)) / np.diff(fine))
    assert steepest(curve) == pytest.approx(slopes.max(), rel=1e-3)
    assert steepest(curve_through(np.array([0.0, 1.0]), np.array([0.0, 3.0]))) == pytest.approx(3.0)


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("strain_x", "strainx", 'line 2: "strainx" is not a known column, expected strain_x'),
        ("[um]", "[kPa]", 'line 2: displacement_y = "1 kPa", expected a length'),
        ("displacement_y [um]", "strain_x", "line 2: strain_x is there twice"),
        ("displacement_y [um]", "displacement_x", "has strain_x and displacement_x, expected one"),
        ("time [min]", "strain_y", "line 2: time is missing"),
        ("1, 0.2", "1, abc", 'line 4: strain_x = "abc", expected a finite number'),
        ("1, 0.2, 1, 5", "1, 0.2, 1", "line 4 has 3 values, expected 4"),
        ("3, 0.15", "1, 0.15", "line 6: time = 1, expected more than 1, that of the row before"),
        ("3, 0.15", "2e300, 0.15", 'line 6: time = "2e300", expected a finite number'),
        ("4, 0.3", "1e90, 0.3", "s and more, expected 1e-18 to 1e+10 s in all, in steps of"),
        ("1, 0.2", "1e-15, 0.2", "in steps of 6e-14 s and more, expected"),
    ],
)
def test_what_a_file_to_follow_must_not_be(tmp_path, old, new, words):
    path = tmp_path / "motion.csv"
    path.write_text(MOTION.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        block(Stage("test", follow=path))
    assert words in str(caught.value) and str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_must_not_lead_what_its_stage_leads(tmp_path):
    path = tmp_path / "motion.csv"
    path.write_text(MOTION)
    for given, words in (
        ({"z": Axis(strain=0.1)}, "z is given, expected none beside z_max"),
        ({"undrained": True}, "expected an axis that it leaves out"),
        ({"p": 1e6}, "expected z alone beside p or eta"),
    ):
        with pytest.raises(InputError, match=words):
            block(Stage("test", follow=path, **given))
    with pytest.raises(InputError, match=r"absent.csv cannot be read \(No such file"):
        block(Stage("test", follow=tmp_path / "absent.csv"))
    path.write_text("time, z_max\n0, 2e-3\n1, 0.9e-3")
    with pytest.raises(InputError, match=r"shortens z by 0\.0011 m, expected less than its length"):
        loading = block(Stage("test", follow=path))[1]
        loading._begin(np.zeros(6))
    assert read_measured(path, {"time": "s", "z_max": "m"}).columns["z_max"][1] == 0.9e-3


def test_a_stage_goes_from_one_row_to_the_next(tmp_path):
    """Stages of single rows end where the rows say, as the whole file does at its last one."""
    path = tmp_path / "motion.csv"
    path.write_text(MOTION)
    sim, loading = block(*(Stage(f"to {row}", follow=path, row=row) for row in (2, 3, 4)))
    ends = {}
    while not loading.finished:
        loading.before_step()
        sim.step()
        ends[loading.stage] = loading.apparatus.gauges.strains[0]
    strains = [ends[f"to {row}"] for row in (2, 3, 4)]
    # A stage reaches its last length to rounding.
    assert strains == pytest.approx([0.001, 0.0005, 0.002], abs=1e-11)
    for row in (1, 5):
        with pytest.raises(InputError, match=rf"row = {row}( of .*csv)?, expected (2 to 4|>= 2)"):
            block(Stage("test", follow=path, row=row))
    with pytest.raises(InputError, match="row = 2, expected follow = a file beside it"):
        Stage("test", row=2)
