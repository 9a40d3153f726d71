"""Faces between grains: their area, which are contacts, and which cuts are doubtful."""

import numpy as np
import pytest
from scipy.special import erf, erfinv

from mufe_fenicsx.geometry.image.contact_faces import contact_table, open_gaps
from mufe_fenicsx.geometry.image.label_files import grain_table
from mufe_fenicsx.geometry.image.quality_flags import mark_doubts, solidity
from tests.geometry.scenes import ball, positions, two_balls


@pytest.mark.parametrize("normal", [(1, 0, 0), (1, 1, 0), (2, 3, 6)])
def test_halves_of_a_ball_have_its_section_between_them(normal):
    """And so a neck ratio of (1/2)^(-2/3): the smaller grain is half of the ball."""
    shape, radius = (32, 32, 32), 13.3
    side = (positions(shape) - 16.1) @ np.array(normal) > 0
    labels = np.where(ball(shape, (16, 16, 16), radius), 1 + side, 0)
    (row,) = contact_table(labels, 2.0)
    # On oblique planes half of the faces in a rim of half a voxel lack their neighbour.
    rim = 0.5 * 2 * np.pi * radius * 0.5
    assert row["area_m2"] == pytest.approx(4 * np.pi * radius**2, abs=4 * 1.2 * rim)
    assert row["neck_ratio"] == pytest.approx(2 ** (2 / 3), rel=0.05)
    rows = grain_table(labels, 2.0)
    assert mark_doubts(rows, [row], labels)["wide_necks"] == 1 and row["doubt"] == "wide neck"


def test_a_ball_fills_its_hull_and_two_that_touch_do_not():
    one = ball((30, 30, 30), (15, 15, 15), 11).astype(np.int32)
    # The hull is that of middles, wider by half a voxel: 3 · 0.25 / 11 either way.
    assert solidity(one)[1] == pytest.approx(1, abs=0.07)
    both = (two_balls() > 0).astype(np.int32)
    # Two balls of radius r, centres 1.7 r apart: 0.94 of two volumes in a hull of 1.27 + 1 of one.
    assert solidity(both)[1] < 0.85
    rows = grain_table(both, 1.0)
    assert mark_doubts(rows, [], both)["concave_grains"] == 1 and rows[0]["doubt"] == "concave"


def test_a_grain_of_odd_size_is_an_outlier():
    labels = np.zeros((12, 12, 200), dtype=np.int32)
    for k, size in enumerate([4, 5] * 6 + [9, 2]):
        labels[1 : 1 + size, 1 : 1 + size, 2 + 13 * k : 2 + 13 * k + size] = k + 1
    rows = grain_table(labels, 1.0)
    counts = mark_doubts(rows, [], labels)
    assert (counts["small_grains"], counts["large_grains"]) == (1, 1)
    assert [row["doubt"] for row in rows[-2:]] == ["large", "small"]


@pytest.mark.parametrize("part", [0.85, 1.15])
def test_a_gap_is_open_where_the_blurred_level_says_so(part):
    """Two half-spaces a gap g apart, blurred by s, have a level of 1 - erf(g/2√2 s) between."""
    s, level = 1.3, 0.7
    gap = part * 2 * np.sqrt(2) * s * erfinv(1 - level)
    z = np.arange(-10, 11.0)
    grey = 1 - 0.5 * (erf((z + gap / 2) / np.sqrt(2) / s) - erf((z - gap / 2) / np.sqrt(2) / s))
    image = 100 + 50 * np.tile(grey[:, None, None], (1, 4, 4))
    # The threshold closes the gap; labels meet at its middle.
    labels = np.where(np.arange(21) <= 10, 1, 2)[:, None, None] * np.ones((1, 4, 4), dtype=int)
    number, opened = open_gaps(labels, image, 100, 150, level)
    assert (number, len(opened)) == ((1, 16) if part > 1 else (0, 0))
    assert (labels == 0).sum() == len(opened) and (labels[10] == 0).all() == (part > 1)
