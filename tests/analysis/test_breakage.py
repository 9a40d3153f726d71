"""Breakage numbers against sums by hand."""

import numpy as np
import pytest

from mufe_fenicsx.analysis.breakage import (
    SILT,
    breakage,
    einav,
    fragments_of,
    hardin,
    size_at,
)


def balls(*diameters):
    return np.pi / 6.0 * np.array(diameters) ** 3


def test_two_sizes_by_hand():
    """Of two grains of 1 mm one breaks into eight of half a millimetre."""
    first, now = balls(1e-3, 1e-3), balls(1e-3, *[0.5e-3] * 8)
    assert hardin(first, first) == einav(first, first) == 0.0
    assert hardin(first, now) == pytest.approx(0.5 * np.log(2.0) / np.log(1e-3 / SILT))
    assert einav(first, now) == pytest.approx(0.5 * np.log(2.0) * 0.4)
    assert (size_at(now, 0.1), size_at(now, 0.5)) == pytest.approx((0.5e-3, 0.5e-3))
    assert size_at(now, 0.51) == pytest.approx(1e-3)


def finer(volume, sizes):
    """Part of the volume in fragments no larger than each of some sizes."""
    own = np.sort(np.cbrt(6.0 / np.pi * volume))
    part = np.append(0.0, np.cumsum(np.sort(volume)) / volume.sum())
    return part[np.searchsorted(own, sizes, side="right")]


def test_areas_beside_the_curve_of_sizes():
    """Against the integrals of their definition, over steps of the logarithm."""
    random = np.random.default_rng(1)
    first, now = balls(*random.uniform(0.2e-3, 1e-3, 40)), balls(*random.uniform(2e-5, 7e-4, 300))
    size = np.exp(np.linspace(np.log(1e-5), np.log(1.01e-3), 200_001))
    step, before, after = np.log(size[1] / size[0]), finer(first, size), finer(now, size)
    total = (after - before).sum() * step
    ultimate = (np.minimum(size / np.cbrt(6 * first.max() / np.pi), 1.0) ** 0.4 - before).sum()
    tail = (1e-5 / np.cbrt(6 * first.max() / np.pi)) ** 0.4 / 0.4  # of smaller ones
    assert einav(first, now) == pytest.approx(total / (ultimate * step + tail), rel=1e-3)
    coarse = size >= SILT
    potential = (1.0 - before)[coarse].sum() * step
    assert hardin(first, now) == pytest.approx(
        (after - before)[coarse].sum() * step / potential, rel=1e-3
    )
    assert np.isnan(hardin(balls(1e-5), balls(1e-5)))


def test_grains_are_split_or_chipped():
    volume = [1.0, 0.6, 0.4, 0.95, 0.03, 0.02]  # whole, split, chipped
    found = breakage(np.array(volume) * 1e-9, [7, 3, 3, 9, 9, 9])
    assert (found.num_fragments, found.broken) == (5, pytest.approx(2 / 3))
    assert found.split == found.chipped == pytest.approx(1 / 3)
    whole = breakage([1e-9, 2e-9], [0, 1])
    assert (whole.num_fragments, whole.broken, whole.hardin, whole.einav) == (0, 0.0, 0.0, 0.0)


def test_fragments_of_cells():
    volume, grain = fragments_of([1.0, 2.0, 3.0, 4.0], [5, 5, 6, 5], [0, 1, 0, 1])
    assert volume.tolist() == [1.0, 6.0, 3.0] and grain.tolist() == [5, 5, 6]
