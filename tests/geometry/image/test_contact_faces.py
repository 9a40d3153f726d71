"""Faces between grains: their area, which are contacts, and which cuts are doubtful."""

import numpy as np
import pytest
import scipy.ndimage
from scipy.special import erf, erfinv

from mufe_fenicsx.geometry.image.contact_faces import contact_table, open_gaps
from mufe_fenicsx.geometry.image.label_files import grain_table
from mufe_fenicsx.geometry.image.labels import largest_piece
from mufe_fenicsx.geometry.image.quality_flags import mark_doubts, solidity
from tests.geometry.scenes import ball, positions


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


def turned(size, seed):
    """Positions about a place within the middle voxel of an image, along turned axes."""
    rng = np.random.default_rng(seed)
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return (positions((2 * size + 8,) * 3) - size - 4 + rng.random(3)) @ axes


@pytest.mark.parametrize("size", [10, 15])
@pytest.mark.parametrize("seed", range(4))
def test_convex_bodies_fill_their_hulls_and_two_balls_do_not(size, seed):
    """However they lie in the grid. Two balls of radius r, 1.95 r apart, share 0.0009 of one.

    They fill (2 - 0.0009) 4/3 / (4/3 + 1.95) = 0.812 of their hull; voxels between the middles of
    those at the surface, about r² in number, and a filter of a voxel make that more.
    """
    x, r = turned(size, seed), size / 2
    balls = np.linalg.norm(x[..., None, :] - [[0.975 * r, 0, 0], [-0.975 * r, 0, 0]], axis=-1)
    bodies = {
        "ball": np.linalg.norm(x, axis=-1) < r,
        "cube": abs(x).max(axis=-1) < r,
        "ellipsoid": np.linalg.norm(x / [r, 1.3 * r, 1.8 * r], axis=-1) < 1,
        "plate": (abs(x) < [0.4 * r, r, r]).all(axis=-1),
        "two balls": balls.min(axis=-1) < r,
    }
    for name, body in bodies.items():
        labels = body.astype(np.int32)
        rows = grain_table(labels, 1.0)
        doubted = mark_doubts(rows, [], labels)["concave_grains"]
        assert doubted == (name == "two balls"), (name, rows[0]["solidity"])
        assert doubted or rows[0]["solidity"] == pytest.approx(1, abs=0.01)
        assert not doubted or rows[0]["solidity"] == pytest.approx(
            0.812 + 0.5 / size, abs=0.3 / size
        )


def test_a_rough_surface_is_not_concave():
    """Noise of 1/4 of the contrast on a blurred ball leaves voxels on and pits in its surface."""
    level = scipy.ndimage.gaussian_filter(ball((30,) * 3, (15,) * 3, 9).astype(float), 1.0)
    level += np.random.default_rng(1).normal(0, 0.25, level.shape)
    rough = largest_piece(level > 0.5).astype(np.int32)
    assert 0.9 < solidity(rough)[1]


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
