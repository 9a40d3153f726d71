"""Labels: their pieces, and the checks that they have to pass.

Labels are integers of shape (z, y, x): 0 is void, grains are positive.
"""

import functools

import numpy as np
import scipy.ndimage

from ...errors import InputError

#: Part of a grain from which a piece of it is no crumb.
A_GRAIN = 0.2
#: Pairs that touch over those a voxel apart, below which lines were left between grains.
PARTED = 0.1
#: Largest label: tables by label have a row for each number up to it.
LARGEST = 2**24


def fill_pores(solid):
    """The solid with all voids filled that it encloses on all sides."""
    voids, num_voids = scipy.ndimage.label(~solid)
    open_ = np.zeros(num_voids + 1, dtype=bool)
    for axis in range(3):
        for end in (0, -1):
            open_[np.unique(voids.take(end, axis=axis))] = True
    open_[0] = False
    return ~open_[voids]


def fill_cavities(labels, largest=None):
    """Give voids that one grain encloses on all sides to it, in place.

    A void that reaches the border of the image, or another grain, is no cavity. Voids hang
    together by corners too, since grains do by faces.

    Args:
        labels: int32, shape (z, y, x); changed.
        largest: Only cavities of fewer voxels; None: all.

    Returns:
        Number of cavities and of their voxels, by label.
    """
    voids, num_voids = scipy.ndimage.label(labels == 0, structure=np.ones((3, 3, 3)))
    sizes = np.bincount(voids.ravel(), minlength=num_voids + 1)
    wanted = np.ones(num_voids + 1, dtype=bool) if largest is None else sizes < largest
    wanted[0] = False
    filled = {}
    for index, where in enumerate(scipy.ndimage.find_objects(voids), start=1):
        at_border = any(
            s.start == 0 or s.stop == n for s, n in zip(where, labels.shape, strict=True)
        )
        if at_border or not wanted[index]:
            continue
        around = tuple(slice(s.start - 1, s.stop + 1) for s in where)
        void = voids[around] == index
        grains = np.unique(labels[around][scipy.ndimage.binary_dilation(void) & ~void])
        if len(grains) == 1:
            labels[around][void] = grains[0]
            count, voxels = filled.get(int(grains[0]), (0, 0))
            filled[int(grains[0])] = count + 1, voxels + int(sizes[index])
    return filled


def pieces(mask):
    """Number of pieces of a mask whose voxels share faces, and their sizes."""
    numbered, num_pieces = scipy.ndimage.label(mask)
    return numbered, np.bincount(numbered.ravel(), minlength=num_pieces + 1)[1:]


def largest_piece(mask):
    """The largest part of a mask whose voxels hang together by their faces."""
    numbered, sizes = pieces(mask)
    return mask if len(sizes) < 2 else numbered == 1 + np.argmax(sizes)


def is_thick(mask):
    """True if a cube of 2 x 2 x 2 voxels fits into the mask."""
    if min(mask.shape) < 2:
        return False
    pairs = mask[1:] & mask[:-1]
    pairs = pairs[:, 1:] & pairs[:, :-1]
    return bool((pairs[:, :, 1:] & pairs[:, :, :-1]).any())


def whole_numbers(labels, source="labels"):
    """Labels as integers, where they are floating point numbers without a fraction.

    Raises:
        InputError: they have fractions, or are too large to be told apart.
    """
    if labels.dtype.kind != "f":
        return labels
    fraction = labels != np.floor(labels)
    if fraction.any():
        at = np.argwhere(fraction)[0]
        raise InputError(
            f"{source}: type of labels is {labels.dtype}, with {labels[tuple(at)]:g} at "
            f"(z, y, x) = {tuple(at.tolist())}, expected whole numbers"
        )
    largest, safe = labels.max(initial=0), 2.0 ** (np.finfo(labels.dtype).nmant + 1)
    if largest > min(safe, 2**31 - 1):
        raise InputError(
            f"{source}: largest label is {largest:g} as {labels.dtype}, "
            f"expected up to {min(safe, 2**31 - 1):.0f}"
        )
    return labels.astype(np.int32)


def plain_labels(labels, source="labels", numbers=None):
    """Labels as integers from 0 to `LARGEST`.

    Args:
        labels: Array of shape (z, y, x).
        source: Name of the labels in messages.
        numbers: A list. Where a label is larger than `LARGEST`, all are numbered anew from 1 in
            their order, and what they were is added here. None: such labels are refused.

    Raises:
        InputError: labels are not three-dimensional, not integers, negative or too large.
    """
    if labels.ndim != 3:
        raise InputError(f"{source}: {labels.ndim} axes, expected 3: (z, y, x)")
    labels = whole_numbers(labels, source)
    if labels.dtype.kind == "b":  # a mask: one grain
        labels = labels.astype(np.uint8)
    if labels.dtype.kind not in "iu":
        raise InputError(f"{source}: type of labels is {labels.dtype}, expected integers")
    if labels.dtype.kind == "i" and labels.min(initial=0) < 0:
        raise InputError(f"{source}: smallest label is {labels.min()}, expected 0 or more")
    if labels.max(initial=0) <= LARGEST:
        return labels
    if numbers is None:
        raise InputError(f"{source}: largest label is {labels.max()}, expected at most {LARGEST}")
    found = np.unique(labels)
    found = found[found > 0]
    numbers.extend(found.tolist())
    new = np.zeros(labels.shape, dtype=np.int32)
    new[labels > 0] = 1 + np.searchsorted(found, labels[labels > 0])
    return new


def checked_labels(labels, *, keep_largest_piece=False, source="labels"):
    """Labels fit for meshing, as int32.

    Args:
        labels: Array of shape (z, y, x).
        keep_largest_piece: Of a grain in several pieces keep the largest,
            instead of refusing it.
        source: Name of the labels in messages.

    Returns:
        labels; and a dictionary by label of grains from which pieces were taken: sizes of those,
        the largest first, and whether the grain lies on opposite faces of the image.

    Raises:
        InputError: labels are not three-dimensional, not integers, negative,
            hold no grain, a grain in pieces or thinner than two voxels.
    """
    labels = np.asarray(labels)
    labels = plain_labels(labels, source)
    labels = labels.astype(np.int32)
    grains = np.unique(labels[labels > 0])
    if len(grains) == 0:
        raise InputError(f"{source}: no grain, all voxels are 0, expected at least one")
    differ = _differing_neighbours(labels)
    if len(grains) > 50 and differ > 0.5:
        raise InputError(
            f"{source}: {len(grains)} labels, and {differ:.0%} of neighbouring voxels above 0 "
            "differ, expected grains of many voxels; these look like grey levels"
        )
    left_out = {}
    for grain, where in grains_in(labels):
        mask = labels[where] == grain
        numbered, sizes = pieces(mask)
        if len(sizes) > 1:
            if not keep_largest_piece:
                raise InputError(
                    f"{source}: grain {grain} is in {len(sizes)} pieces of "
                    f"{_few(np.sort(sizes)[::-1])} voxels, {_second(numbered, sizes, where)}"
                    f"{_others_in_pieces(labels, grain)}, expected one{_use(sizes)}"
                )
            mask = numbered == 1 + np.argmax(sizes)
            labels[where][(numbered > 0) & ~mask] = 0
            opposite = any(
                s.start == 0 and s.stop == n for s, n in zip(where, labels.shape, strict=True)
            )
            left_out[grain] = np.sort(sizes)[-2::-1].tolist(), opposite
        if not is_thick(mask):
            size = " x ".join(str(n) for n in mask.shape)
            raise InputError(
                f"{source}: grain {grain} of {mask.sum()} voxels within {size} is thinner than "
                "2 voxels, expected room for a cube of 2 x 2 x 2 voxels"
            )
    return labels, left_out


def left_out_lines(left_out, labels):
    """A line for each grain from which `checked_labels` took pieces, the largest loss first."""
    kept, lines = np.bincount(labels.ravel()), []
    for grain, (sizes, opposite) in sorted(left_out.items(), key=lambda item: -sum(item[1][0])):
        whole = kept[grain] + sum(sizes)
        line = (
            f"grain {grain}: {len(sizes)} pieces of {_few(sizes)} voxels left out, "
            f"{sum(sizes) / whole:.2g} of its volume"
        )
        if opposite:
            line += "; they lie on opposite faces: was the image periodic?"
        elif sizes[0] > A_GRAIN * whole:
            line += "; as large as grains: has the number been used twice?"
        lines.append(line)
    return lines


def _second(numbered, sizes, where):
    """Where the second piece of a grain is, in words."""
    at = np.argwhere(numbered == 1 + np.argsort(-sizes, kind="stable")[1])[0]
    place = tuple((at + [s.start for s in where]).tolist())
    return f"the second at (z, y, x) = {place}"


def _others_in_pieces(labels, grain):
    """How many other grains are in pieces, in words."""
    others = [g for g, where in grains_in(labels) if len(pieces(labels[where] == g)[1]) > 1]
    return f" (and {len(others) - 1} other grains are)" if others != [grain] else ""


def _use(sizes):
    """What to do about pieces of these sizes: crumbs may be left out, grains not."""
    if np.sort(sizes)[-2] > A_GRAIN * sizes.sum():
        return ": has the number been used twice, or is this a mask, which `mufe segment` parts?"
    return "; or ask to keep the largest piece"


def doubts_about(labels, source):
    """Lines on labels that are plain, and hardly meant: of void, a mask, with watershed lines."""
    lines = [] if (line := _background(labels, source)) is None else [line]
    found = np.unique(labels)
    if np.count_nonzero(found) == 1:
        lines.append(f"{source}: one label, one grain; a mask of many is parted by `mufe segment`")
    touching, parted = (touching_labels(labels, apart) for apart in (1, 2))
    if len(parted) and len(touching) < PARTED * len(parted):
        lines.append(
            f"{source}: {len(parted)} pairs of labels are one voxel of void apart, and "
            f"{len(touching)} touch: lines of a watershed keep grains from contact"
        )
    return lines


def touching_labels(labels, apart=1):
    """Pairs of labels that share faces of voxels, or so many apart, with void between them.

    Returns:
        Dictionary {(a, b), a < b: number of such voxels}.
    """
    keys, base = [np.zeros(0, dtype=np.int64)], int(labels.max(initial=0)) + 1
    for axis in range(3):
        along = np.moveaxis(labels, axis, 0)
        low, high = along[:-apart], along[apart:]
        meet = (low != high) & (low > 0) & (high > 0)
        for between in range(1, apart):
            meet &= along[between : between - apart] == 0
        low, high = low[meet].astype(np.int64), high[meet].astype(np.int64)
        keys.append(np.minimum(low, high) * base + np.maximum(low, high))
    pairs, count = np.unique(np.concatenate(keys), return_counts=True)
    return {(int(p // base), int(p % base)): int(c) for p, c in zip(pairs, count, strict=True)}


def _background(labels, source):
    """A line that warns of a label that surrounds the others, as if voids had a number; or None."""
    ends = [np.unique(labels.take(end, axis=axis)) for axis in range(3) for end in (0, -1)]
    found = [n for n in functools.reduce(np.intersect1d, ends).tolist() if n > 0]
    others = np.setdiff1d(np.unique(labels), [0, *found])
    for label in found if len(others) > 0 else ():
        around = scipy.ndimage.binary_dilation(labels == label)
        touched = np.intersect1d(np.unique(labels[around]), others)
        if len(touched) >= 0.9 * len(others):
            return (
                f"{source}: label {label} is on all six faces of the image and surrounds "
                f"{len(touched)} of {len(others)} other labels: is it the void, which is 0 here?"
            )
    return None


def grains_in(labels):
    """Each label > 0 with the slices of the box around its grain."""
    for index, where in enumerate(scipy.ndimage.find_objects(labels)):
        if where is not None:
            yield index + 1, where


def _differing_neighbours(labels):
    """Of the voxels above 0 that are neighbours along x, the part that differs."""
    a, b = labels[:, :, :-1], labels[:, :, 1:]
    solid = (a > 0) & (b > 0)
    return np.count_nonzero((a != b) & solid) / max(np.count_nonzero(solid), 1)


def _few(numbers):
    text = ", ".join(str(n) for n in numbers[:4])
    return text + (", …" if len(numbers) > 4 else "")
