"""Pictures to judge a segmentation and meshes by."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from mufe_fenicsx.geometry.image.compare_labels import touching_labels
from mufe_fenicsx.geometry.image.cylinder import Cylinder
from mufe_fenicsx.geometry.image.picture import (
    PALETTE,
    draw_quality,
    draw_segmentation,
    label_colours,
)


def apart(colours, pairs):
    """Smallest distance of the colours of two that touch, in RGB of 0 to 1."""
    return min(np.linalg.norm(colours[a] - colours[b]) for a, b in pairs)


def test_labels_that_touch_have_colours_that_can_be_told_apart():
    """Cells around random points in space and in a slice, each of which touches many others."""
    rng = np.random.default_rng(2)
    grid = np.stack(np.meshgrid(*[np.arange(16)] * 3, indexing="ij"), axis=-1)
    points = 16 * rng.random((100, 3))
    labels = 1 + np.linalg.norm(grid[..., None, :] - points, axis=-1).argmin(axis=-1)
    for part, least in ((labels, 0.03), (labels[8][None], 0.3)):  # in space also with greys
        pairs = touching_labels(part)
        colours = label_colours(100, pairs)
        assert colours.shape == (101, 3) and (colours[0] == 1).all()
        assert apart(colours, pairs) > least
    assert len({tuple(c) for c in label_colours(50, ())}) == 1 + len(PALETTE)


@pytest.fixture
def drawn(monkeypatch):
    """Figures as they are saved."""
    figures = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, path: figures.append(figure))
    return figures


def test_six_slices_show_neighbours_in_other_colours_and_necks_in_doubt(drawn, tmp_path):
    """Grains in three layers each way, some parted by a voxel of void; two necks are doubted."""
    labels = np.kron(np.arange(1, 28).reshape(3, 3, 3), np.ones((4, 4, 4), dtype=int))
    labels[:, :, 3] = 0  # neighbours across a gap look like one grain, too, in one colour
    names = ("label_a", "label_b", "doubt")  # across the gap; two in y, one of them sound
    rows = [(5, 4, "wide neck"), (14, 17, "wide neck"), (11, 14, "")]
    contacts = [dict(zip(names, row, strict=True)) for row in rows]
    draw_segmentation(tmp_path / "a.png", labels * 1.0, labels, 1e-5, contacts=contacts)
    told = [text.get_text() for text in drawn[0].legends[0].get_texts()]
    words = ("outlines of the grains", "a colour a grain", "necks in doubt, black below: 2")
    assert len(told) == 3 and all(w in text for w, text in zip(words, told, strict=True))
    panels = np.array(drawn[0].axes).reshape(4, 3)
    titles = [axis.get_title() for axis in panels[::2].ravel()]
    assert titles == [f"{a} = {place} µm" for place in (45, 85) for a in "zyx"]
    for top, bottom in zip(panels[::2].ravel(), panels[1::2].ravel(), strict=True):
        assert top.get_xlim() == bottom.get_xlim() and top.get_ylim() == bottom.get_ylim()
        blocks = np.asarray(bottom.images[0].get_array())[2::4, 2::4]
        for a, b in ((blocks[1:], blocks[:-1]), (blocks[:, 1:], blocks[:, :-1])):
            assert np.linalg.norm(a - b, axis=-1).min() > 0.3
        outlined = [len(lines.get_segments()) for lines in (*top.collections, *bottom.collections)]
        assert outlined[1] == outlined[2] and outlined[0] > outlined[1]
        # Label 14 is in the middle: two of the slices at a third meet its neck with 17.
        met = {"z = 45 µm": 4, "x = 45 µm": 4}
        assert outlined[2] == met.get(top.get_title(), 0)


def test_both_panels_of_a_round_sample_show_the_cylinder(drawn, tmp_path):
    labels = np.pad(np.ones((6, 8, 8), dtype=int), ((0, 0), (10, 14), (20, 4)))
    cylinder = Cylinder(24e-5, 14e-5, 5e-5)
    draw_segmentation(tmp_path / "a.png", labels * 1.0, labels, 1e-5, cylinder=cylinder)
    told = [text.get_text() for text in drawn[0].legends[0].get_texts()]
    assert len(told) == 3 and "cylinder" in told[2]
    for axis in np.array(drawn[0].axes).reshape(4, 3)[:, 0]:
        assert np.allclose(axis.get_xlim(), (180, 300), atol=11)
        assert np.allclose(axis.get_ylim(), (80, 200), atol=11)


def test_volumes_of_meshes_are_told_in_per_cent(drawn, tmp_path):
    rows = [
        {"status": "ok", "tets": 100, "volume_ratio": ratio, "min_altitude_over_h": 0.5,
         "min_dihedral_deg": 20.0}
        for ratio in (0.98, 1.0, 1.01)
    ]  # fmt: skip
    draw_quality(tmp_path / "quality.png", rows, 1e-5)
    axis = drawn[0].axes[1]
    assert axis.get_xlabel() == "mesh volume off that given: %"
    assert axis.get_title(loc="left") == "min -2, mean -0.333 (line), max 1"
    for row in rows:
        row["volume_ratio"] = 1 + 1e-15
    draw_quality(tmp_path / "quality.png", rows, 1e-5)
    assert drawn[1].axes[1].get_title(loc="left") == "min 0, mean 0 (line), max 0"


def test_bars_hold_every_grain_the_worst_one_too(drawn, tmp_path):
    """The ends of the bars are not off by round-off."""
    rng = np.random.default_rng(1)
    for _ in range(20):
        rows = [
            {"status": "ok", "tets": 100, "volume_ratio": 1 + 0.01 * a, "min_altitude_over_h": b,
             "min_dihedral_deg": 30 * c}
            for a, b, c in rng.random((12, 3))
        ]  # fmt: skip
        draw_quality(tmp_path / "quality.png", rows, 1e-5)
    for figure in drawn:
        for axis in figure.axes:
            assert sum(bar.get_height() for bar in axis.patches) == 12
