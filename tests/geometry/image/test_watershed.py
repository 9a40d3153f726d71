"""The watershed does what ITK's filter does, and merges no grains across the void."""

from pathlib import Path

import numpy as np
import pytest
import scipy.ndimage

from mufe_fenicsx.geometry.image.watershed import watershed
from tests.geometry.itk_reference import CASES, FILE, height_of, itk_watershed

DATA = Path(__file__).resolve().parents[4] / "shared" / "data"


def adjusted_rand_index(a, b):
    """Agreement of two labellings of the same voxels on which pairs of voxels belong together.

    1: the same but for numbers; 0: as by chance.

    Source: L. Hubert, P. Arabie, J. Classification 2 (1985) 193-218, eq. (5).

    Args:
        a, b: Labels from 0, of equal shape; voxels that shall not count are left out.
    """

    def pairs(labels):
        n = np.unique(labels, return_counts=True)[1].astype(float)
        return (n * (n - 1) / 2).sum()

    both = pairs(a.ravel().astype(np.int64) * (int(b.max()) + 1) + b.ravel())
    of_a, of_b, of_all = pairs(a), pairs(b), a.size * (a.size - 1) / 2
    by_chance, most = of_a * of_b / of_all, (of_a + of_b) / 2
    return 1.0 if most == by_chance else float((both - by_chance) / (most - by_chance))


def agreement(solid, height, itk, threshold, level):
    """Adjusted Rand index in the solid: with the void as ground, as ITK sees it, and without."""
    everywhere, _ = watershed(height, np.ones_like(solid), threshold, level)
    inside, _ = watershed(height, solid, threshold, level)
    return adjusted_rand_index(everywhere[solid], itk[solid]), adjusted_rand_index(
        inside[solid], itk[solid]
    )


@pytest.mark.parametrize("number", range(3))
def test_basins_and_merges_are_those_of_itk(number):
    with np.load(FILE) as data:
        solid, itk = data["solid"], data["labels"][number].astype(np.int64)
    everywhere, inside = agreement(solid, height_of(solid), itk, *CASES[number])
    # Of equally low neighbours ITK may take another one at the edge of a plateau.
    assert everywhere > 0.99
    # ITK sees the void as one more basin, and joins small grains across it.
    assert inside > 0.98


@pytest.mark.slow
@pytest.mark.parametrize("name", ["snow", "carbonate sand"])
@pytest.mark.parametrize("smoothing", [0.0, 1.0])
def test_real_images_are_cut_as_by_itk(name, smoothing):
    pytest.importorskip("itk", reason="needs the package itk-segmentation")
    if not DATA.is_dir():
        pytest.skip(f"no {DATA}")
    if name == "snow":
        import tifffile

        grey = tifffile.imread(DATA / "snow_xct_grey_100.tif").astype(np.float32)
        solid = scipy.ndimage.gaussian_filter(grey, 1.0) > 23394  # Otsu
    else:
        with np.load(DATA / "carbonate_sand_300.npz") as data:
            solid = data["solid"][100:220, 100:220, 100:220] > 0
    distance = scipy.ndimage.distance_transform_edt(solid).astype(np.float32)
    height = -scipy.ndimage.gaussian_filter(distance, smoothing, mode="nearest") * solid
    for threshold, level in ((0.04, 0.2), (0.0, 0.0), (0.04, 0.05)):
        itk = itk_watershed(height, threshold, level)
        assert min(agreement(solid, height, itk, threshold, level)) > 0.98


def valleys(depths, sill=0.0):
    """Heights along x: valleys of these depths below sills that are all as high."""
    line = [sill]
    for depth in depths:
        line += [sill - depth / 2, sill - depth, sill - depth / 2, sill]
    return np.tile(np.array(line, dtype=np.float32), (2, 2, 1))


def test_valleys_merge_at_their_depth():
    height, ground = valleys([4, 1, 3]), np.ones((2, 2, 13), dtype=bool)
    assert watershed(height, ground, depth=0.9)[0].max() == 3
    assert watershed(height, ground, depth=1.0)[0].max() == 2
    assert watershed(height, ground, depth=3.0)[0].max() == 1
    # ITK looks at merges up to level × range = 3.2 deep, and makes those up to level × 3.
    labels, depth = watershed(height, ground, level=0.8)
    assert depth == pytest.approx(2.4) and labels.max() == 2
    # Lifting the lowest four tenths of the range makes no two valleys one.
    assert watershed(height, ground, threshold=0.4)[0].max() == 3
    ground[:, :, 6] = False
    labels, _ = watershed(height, ground, depth=9.0)
    assert labels.max() == 2 and (labels[:, :, 6] == 0).all()


def test_valleys_merge_by_a_part_of_their_depth():
    """Sills 2 below the top: valleys that dip by 1 and 3 are 3 and 5 deep."""
    height, ground = valleys([4, 1, 3], sill=-2.0), np.ones((2, 2, 13), dtype=bool)
    height[:, :, 0] = 0.0
    for relative, number in ((0.3, 3), (0.4, 2), (0.58, 2), (0.62, 1)):
        assert watershed(height, ground, depth=0.0, relative=relative)[0].max() == number


def test_small_regions_join_their_lowest_neighbour():
    height, ground = valleys([4, 4, 4, 4]), np.ones((2, 2, 17), dtype=bool)
    height[:, :, 8] = -1  # the lowest sill
    # The void takes most of the second valley.
    ground[:, :, 4:6] = ground[:, :, 10:12] = False
    labels, _ = watershed(height, ground, min_voxels=13)
    assert len(np.unique(labels[:, :, 6:10])) == 1
    assert labels.max() == 3
