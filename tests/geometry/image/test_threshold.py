"""Thresholds of histograms that are known."""

import numpy as np
import pytest
import scipy.ndimage
from scipy.optimize import minimize_scalar

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.image.threshold import (
    between_gaussians,
    doubt_about,
    find_threshold,
    otsu,
    two_gaussians,
)


def two_phases(s1, s2, weight=0.5, n=200_000):
    """Grey levels around 100 (weight) and 200, with standard deviations s1, s2."""
    rng = np.random.default_rng(1)
    first = int(weight * n)
    values = np.concatenate([rng.normal(100, s1, first), rng.normal(200, s2, n - first)])
    return rng.permutation(values).reshape(50, 40, 100)


def test_otsu_parts_equal_phases_half_way():
    # Between well-parted modes the criterion is flat: a bin is about 1 wide, the
    # empty range between 100 + 3 s and 200 - 3 s is not.
    assert otsu(two_phases(15, 15)) == pytest.approx(150, abs=2)


def test_minimum_between_gaussians():
    """With s1 = 12 and s2 = 24 the minimum of the sum lies nearer to the narrow mode."""
    image = two_phases(12, 24)
    lowest = minimize_scalar(
        lambda x: two_gaussians(x, 1 / 12, 100, 12, 1 / 24, 200, 24), bounds=(105, 195)
    ).x
    assert lowest < 145
    # The fit sees 200 000 voxels, so that mode and width are known to about 1 %.
    assert between_gaussians(image) == pytest.approx(lowest, abs=2)


def test_the_middle_lies_half_way_whatever_the_widths_and_shares_are():
    for image in (two_phases(12, 24), two_phases(15, 15, weight=0.8)):
        # As above: means to about 1 % of the deviations, and half a bin.
        assert find_threshold(image, "middle") == pytest.approx(150, abs=1)


def test_an_image_that_was_parted_before_keeps_its_phases():
    image = (np.random.default_rng(1).uniform(size=(20, 20, 20)) < 0.2) * np.uint8(190) + 10
    assert find_threshold(image, "middle") == 105
    assert doubt_about(image, 105)[0] is None


def test_a_threshold_far_from_otsus_is_reported():
    image = two_phases(12, 12)
    line, void, solid = doubt_about(image, 150.0)
    assert line is None and (void, solid) == pytest.approx((100, 200), abs=4)
    line, _, _ = doubt_about(image, 130.0)
    assert line.startswith("the threshold 130 lies") and "below Otsu's" in line


def one_phase():
    """Filtered noise: one mode, and twice its deviation would pass for a contrast."""
    noise = np.random.default_rng(2).normal(150, 60, (40, 40, 40))
    return scipy.ndimage.gaussian_filter(noise, 1.0)


@pytest.mark.parametrize("level", [otsu(one_phase()), 120.0, 151.0, 170.0])
def test_nothing_is_derived_from_a_level_that_parts_nothing(level):
    """Both "phases" of a single mode had been above the threshold, and contacts opened by them."""
    line, void, solid = doubt_about(one_phase(), level)
    assert (void, solid) == (None, None)
    assert "parts no two phases" in line and "contact_level is not used" in line


def test_a_level_beside_both_phases_is_reported():
    line, void, _ = doubt_about(two_phases(5, 5), 85.0)
    assert void is None and "parts no two phases" in line


def test_a_number_is_taken_as_it_is():
    assert find_threshold(two_phases(10, 10), 123.0) == 123.0


@pytest.mark.parametrize(
    ("image", "method", "message"),
    [
        (np.full((4, 4, 4), 17.0), "otsu", "image is constant, all voxels = 17"),
        (two_phases(10, 10), 5000.0, "threshold = 5000, expected between"),
        (two_phases(10, 10), "best", "threshold = 'best'"),
        (np.random.default_rng(0).uniform(0, 1, (60, 60, 60)), "gaussians", "no two modes"),
        (np.random.default_rng(0).normal(0, 1, (60, 60, 60)), "gaussians", "no two modes"),
    ],
)
def test_what_cannot_be_parted_is_refused(image, method, message):
    with pytest.raises(InputError, match=message):
        find_threshold(image, method)
