"""What is wrong with labels in places: in pieces, inside of one another, with holes in between."""

import numpy as np
import scipy.ndimage
from skimage.measure import label as connected

#: Lines about defects of one kind, before one that says how many more there are.
MOST = 4
#: Voxels from which on a hole is told: pores of touching grains are smaller, and no mesh has them.
LEAST = 8


def defects_of(labels, source):
    """Lines on labels in several pieces, inside of another one, and holes between labels.

    Voxels of a piece hang together by faces, those of a hole by corners too. A label is inside of
    another one if it has no other neighbour and is not at the border of the image. Holes have
    LEAST voxels or more. One that a single label encloses is a cavity of its grain, and none of
    these (:func:`.labels.fill_cavities`).

    Args:
        labels: Integers, 0 is void, (z, y, x).
        source: Their name in the lines.

    Returns:
        Lines with numbers and places (z, y, x), of many the largest and how many more.
    """
    piece = connected(labels, background=0, connectivity=1)
    size = np.bincount(piece.ravel())
    label_of = np.zeros(len(size), dtype=np.int64)
    label_of[piece.ravel()] = labels.ravel()
    boxes = scipy.ndimage.find_objects(piece)
    lines = _in_pieces(piece, size, label_of, boxes) + _inside(labels, piece, size, label_of, boxes)
    return [f"{source}: {line}" for line in lines + _holes(labels)]


def _in_pieces(piece, size, label_of, boxes):
    """Lines on labels in several pieces, the one with the largest second piece first."""
    order = np.lexsort((-size[1:], label_of[1:])) + 1
    starts = np.flatnonzero(np.diff(label_of[order], prepend=-1))
    found = []
    for of_label in np.split(order, starts[1:]):
        if len(of_label) > 1:
            sizes = ", ".join(str(n) for n in size[of_label[:4]])
            more = ", …" if len(of_label) > 4 else ""
            line = (
                f"label {label_of[of_label[0]]} is in {len(of_label)} pieces of {sizes}{more} "
                f"voxels, the second at {_place(piece, of_label[1], boxes)}"
            )
            found.append((size[of_label[1]], line))
    return _first(found, "labels in pieces")


def _inside(labels, piece, size, label_of, boxes):
    """Lines on labels that another one encloses on all sides, the largest first."""
    pairs = []
    for axis in range(3):
        a, b = (np.moveaxis(piece, axis, 0)[part] for part in (slice(None, -1), slice(1, None)))
        differ = a != b
        pairs += [np.column_stack([a[differ], b[differ]]), np.column_stack([b[differ], a[differ]])]
    pairs = np.unique(np.concatenate(pairs), axis=0)
    count = np.bincount(pairs[:, 0], minlength=len(size))
    found = []
    for one, other in pairs[(count[pairs[:, 0]] == 1) & (pairs > 0).all(axis=1)].tolist():
        if not _at_border(boxes[one - 1], labels.shape):
            line = (
                f"label {label_of[one]} of {size[one]} voxels at {_place(piece, one, boxes)} lies "
                f"inside label {label_of[other]}"
            )
            found.append((size[one], line))
    return _first(found, "labels inside another one")


def _holes(labels):
    """Lines on voids that several labels enclose, the largest first."""
    hole, num = scipy.ndimage.label(labels == 0, structure=np.ones((3, 3, 3)))
    size, boxes, found = (
        np.bincount(hole.ravel(), minlength=num + 1),
        scipy.ndimage.find_objects(hole),
        [],
    )
    for k, box in enumerate(boxes, start=1):
        if size[k] < LEAST or _at_border(box, labels.shape):
            continue
        around = tuple(slice(s.start - 1, s.stop + 1) for s in box)
        mine = hole[around] == k
        beside = np.unique(labels[around][scipy.ndimage.binary_dilation(mine) & ~mine])
        if len(beside) > 1:
            names = ", ".join(map(str, beside[:4])) + (", …" if len(beside) > 4 else "")
            line = f"hole of {size[k]} voxels at {_place(hole, k, boxes)} between labels {names}"
            found.append((size[k], line))
    return _first(found, "holes between labels")


def _at_border(box, shape):
    """Whether slices reach the border of an image."""
    return any(s.start == 0 or s.stop == n for s, n in zip(box, shape, strict=True))


def _place(numbered, number, boxes):
    """A voxel of a piece, in words."""
    box = boxes[number - 1]
    at = np.argwhere(numbered[box] == number)[0] + [s.start for s in box]
    return f"(z, y, x) = {tuple(at.tolist())}"


def _first(found, what):
    """The lines of the largest, and one with the number of all where there are more."""
    found.sort(key=lambda entry: -entry[0])
    lines = [line for _, line in found[:MOST]]
    if len(found) > MOST:
        lines.append(f"{len(found)} {what} in all, these are the largest")
    return lines
