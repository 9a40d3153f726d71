"""Defects of labels from elsewhere are told by number and place."""

import numpy as np

from mufe_fenicsx.geometry.image.label_defects import MOST, defects_of


def cube_labels():
    """Two cubes that touch, 1 and 2, with room around."""
    labels = np.zeros((12, 12, 22), dtype=np.int32)
    labels[2:10, 2:10, 2:11], labels[2:10, 2:10, 11:20] = 1, 2
    return labels


def test_sound_labels_have_no_defects():
    """Nor has a cavity in one grain, a pore where two touch, or a void at the border."""
    labels = cube_labels()
    labels[5, 5, 5] = labels[4, 5, 10:12] = 0
    assert defects_of(labels, "l.tif") == []
    labels = np.ones((6, 6, 6), dtype=np.int32)
    labels[:, :, 3:], labels[0, 2, 2:4] = 2, 0
    assert defects_of(labels, "l.tif") == []


def test_each_defect_is_told_by_number_and_place():
    labels = cube_labels()
    labels[4:6, 4:6, 4:6] = 7  # inside 1
    labels[5:7, 5:7, 10:12] = 0  # between 1 and 2
    labels[0, 0, 0:3] = 2  # away from the rest of 2
    assert defects_of(labels, "l.tif") == [
        "l.tif: label 2 is in 2 pieces of 572, 3 voxels, the second at (z, y, x) = (0, 0, 0)",
        "l.tif: label 7 of 8 voxels at (z, y, x) = (4, 4, 4) lies inside label 1",
        "l.tif: hole of 8 voxels at (z, y, x) = (5, 5, 10) between labels 1, 2",
    ]


def test_a_label_between_two_is_inside_of_none():
    labels = cube_labels()
    labels[5, 5, 10:12] = 7
    assert defects_of(labels, "l.tif") == []


def test_of_many_the_largest_are_told_and_how_many_more():
    labels = np.ones((5, 5, 40), dtype=np.int32)
    for k in range(9):
        labels[2, 2, 2 + 4 * k : (4 if k else 5) + 4 * k] = 10 + k
    lines = defects_of(labels, "l.tif")
    assert len(lines) == MOST + 1 and lines[0].startswith("l.tif: label 10 of 3 voxels")
    assert lines[-1] == "l.tif: 9 labels inside another one in all, these are the largest"
