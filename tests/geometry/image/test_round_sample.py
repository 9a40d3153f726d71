"""A cylindrical sample: recognised as it is, its surroundings seen by nothing, its grains whole."""

import csv
import os
from pathlib import Path

import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.image.circles import field_circle, mould_circle
from mufe_fenicsx.geometry.image.cylinder import Cylinder
from mufe_fenicsx.geometry.image.label_files import read_labels, stated_cylinder
from mufe_fenicsx.geometry.segment import segment_image
from mufe_fenicsx.geometry.settings import SegmentSettings
from tests.geometry.round_scans import balls_in_cylinder, scan_of

SHAPE, X, Y, R = (24, 96, 100), 51.3, 46.6, 34.4
VOXEL = 1e-5
FIELD = Cylinder(50.0, 48.0, 47.2).inside(SHAPE)
#: A real scan, which is not ours to bring along: the folder that MUFE_TEST_DATA names has it.
SCAN = Path(os.environ.get("MUFE_TEST_DATA", "")) / "sand_xct_grey_cylinder_100x512x512.tif"


def made(mould=None, field=None, lean=(0.0, 0.0)):
    """True labels and a grey image of balls in a cylinder."""
    cylinder = Cylinder(X, Y, R, lean, SHAPE[0] / 2)
    labels = balls_in_cylinder(SHAPE, X, Y, R, sizes=(4.5, 6.5), lean=lean)
    return labels, scan_of(labels, cylinder.distance(SHAPE), R, mould=mould, field=field)


# Levels of a steel, a quartz, a plastic and an air-like mould; grains have 160, voids 80.
@pytest.mark.parametrize(("mould", "lean"), [
    pytest.param(250, 0.0, marks=pytest.mark.slow), (160, 0.12), (120, 0.0), (30, 0.0),
])  # fmt: skip
def test_the_wall_of_a_mould_is_found(mould, lean):
    _, grey = made(mould, FIELD, (lean, 0.0))
    found, line = mould_circle(grey, FIELD, "scan")
    # Middles are means over hundreds of edges. The blur of 1.3 voxels moves an edge of varying
    # contrast towards the side that it bends to, by σ²/2R = 0.02, and grains at it by more.
    assert [found.x, found.y] == pytest.approx([X, Y], abs=0.15)
    assert found.radius == pytest.approx(R, abs=0.4)
    assert found.lean == pytest.approx((lean, 0.0), abs=0.02)
    assert line.startswith("the wall is seen in")


def test_no_wall_is_found_where_none_is():
    _, grey = made(None, FIELD)
    with pytest.raises(InputError, match=r'cylinder = "mould": a wall is recognised in [01] of '):
        mould_circle(grey, FIELD, "scan")


def test_the_circle_of_the_field_of_view_is_found():
    found, _ = field_circle(FIELD, "scan")
    assert [found.x, found.y] == pytest.approx([50.0, 48.0], abs=0.05)
    # Half a voxel within the rim: all voxels inside were measured.
    assert found.radius == pytest.approx(47.2 - 0.5, abs=0.15)
    assert not (found.inside(SHAPE) & ~FIELD).any()
    with pytest.raises(InputError, match=r"the field of view of scan is not recognised"):
        field_circle(None, "scan")
    square = np.zeros(SHAPE, dtype=bool)
    square[:, 10:80, 10:80] = True
    with pytest.raises(InputError, match=r"is not round: its rim is \d"):
        field_circle(square, "scan")


@pytest.mark.parametrize("mould", [pytest.param(250, marks=pytest.mark.slow), 120])
def test_grains_in_a_mould_are_whole(tmp_path, mould):
    """They keep their volume, at the wall too, and the mould leaves no trace in the histogram."""
    labels, grey = made(mould, FIELD)
    np.save(tmp_path / "scan.npy", grey)
    settings = SegmentSettings(voxel_size=VOXEL, cylinder="mould")
    found = segment_image(tmp_path / "scan.npy", settings, tmp_path / "labels.tif")
    _, alone = made()
    np.save(tmp_path / "alone.npy", alone)
    place = {"cylinder_middle": (X * VOXEL, Y * VOXEL), "cylinder_radius": R * VOXEL}
    whole = SegmentSettings(voxel_size=VOXEL, cylinder="given", rim="whole", **place)
    same = segment_image(tmp_path / "alone.npy", whole, tmp_path / "alone.tif")
    # Histograms of the same voxels but those of a rim half a voxel wide; bins are a level wide.
    assert found["threshold"] == pytest.approx(same["threshold"], abs=2)
    assert found["num_grains"] == labels.max()
    assert found["cylinder_radius_m"] == pytest.approx(R * VOXEL, abs=0.4 * VOXEL)
    mine, _ = read_labels(tmp_path / "labels.tif")
    for number in range(1, labels.max() + 1):
        true = labels == number
        own = np.bincount(mine[true]).argmax()
        # Blur and filter, σ² = 0.8² + 0.7², take σ²/r from a ball's radius: 15 % of one of 4.7.
        # At the wall, where levels come from 1.5 voxels farther inside, they take less.
        volume = np.count_nonzero(mine == own) / np.count_nonzero(true)
        assert 0.82 < volume < 1.05
    assert (mine[~Cylinder(X, Y, R + 1).inside(SHAPE)] == 0).all()
    assert stated_cylinder(tmp_path / "labels.tif")["cut"] is False


def test_a_round_field_cuts_or_drops_the_grains_at_its_rim(tmp_path):
    labels = balls_in_cylinder(SHAPE, 50.0, 48.0, 60.0, sizes=(5.0, 7.0))
    grey = scan_of(labels, np.zeros(SHAPE), 0.0, field=FIELD)
    np.save(tmp_path / "scan.npy", grey)
    found, rows = {}, {}
    for rim in ("cut", "drop"):
        settings = SegmentSettings(voxel_size=VOXEL, cylinder="field", rim=rim)
        out = tmp_path / f"{rim}.tif"
        found[rim] = segment_image(tmp_path / "scan.npy", settings, out)
        with open(out.with_suffix(".csv"), encoding="utf-8") as file:
            rows[rim] = list(csv.DictReader(file))
        mine, _ = read_labels(out)
        assert (mine[~FIELD] == 0).all()
        assert stated_cylinder(out)["cut"] is (rim == "cut")
    crossed = np.unique(labels[Cylinder(50, 48, 48.5).inside(SHAPE) & ~FIELD])
    within = set(np.unique(labels[FIELD])) - set(crossed.tolist())
    assert found["drop"]["num_grains"] == len(within)
    assert found["drop"]["rim_grains_left_out"] > 5
    assert found["cut"]["num_grains"] > found["drop"]["num_grains"]
    cut = sum(row["touches_border"] == "True" for row in rows["cut"])
    assert cut > sum(row["touches_border"] == "True" for row in rows["drop"])
    assert found["cut"]["notices"][-2].startswith("cylinder (field): axis at (x, y) = (0.5, 0.48)")


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"cylinder": "field", "rim": "whole"}, "grains end of themselves only at the wall"),
        ({"cylinder_radius": 1e-3}, "a value only where cylinder ="),
        ({"cylinder": "mould", "cylinder_radius": 1e-5, "rim": "whole"}, 'rim = "whole"'),
    ],
)
def test_settings_that_contradict_each_other(more, words):
    with pytest.raises(InputError, match=words):
        SegmentSettings(**more)


def test_a_cylinder_lies_within_what_was_measured(tmp_path):
    _, grey = made(None, FIELD)
    np.save(tmp_path / "scan.npy", grey)
    for more, words in (
        ({"cylinder_radius": 48 * VOXEL}, r"cylinder_radius = 0.00048 m, expected at most"),
        ({"cylinder_middle": (30 * VOXEL, 48 * VOXEL), "cylinder_radius": 30 * VOXEL}, "at most"),
    ):
        settings = SegmentSettings(voxel_size=VOXEL, cylinder="field", **more)
        with pytest.raises(InputError, match=words):
            segment_image(tmp_path / "scan.npy", settings, tmp_path / "labels.tif")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["scan.npy"]


@pytest.mark.skipif(not SCAN.is_file(), reason="the scan is not there")
def test_a_real_round_scan(tmp_path):
    """Its field of view is the circle in its square; the zeros around are no phase."""
    part = ((40, 64), (0, 512), (0, 512))
    settings = SegmentSettings(
        voxel_size=VOXEL, cylinder="field", crop=part, cylinder_radius=100 * VOXEL
    )
    found = segment_image(SCAN, settings, tmp_path / "labels.tif")
    assert found["cylinder_x_m"] == pytest.approx(256 * VOXEL, abs=VOXEL)
    assert found["cylinder_y_m"] == pytest.approx(256 * VOXEL, abs=VOXEL)
    assert 35590 < found["threshold"] < 36690
    assert 0.4 < found["solid_fraction"] < 0.75
    assert found["num_grains"] > 50 and not found["warnings"]
