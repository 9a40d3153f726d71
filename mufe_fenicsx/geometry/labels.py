"""From grains and voids to one label a grain, and the checks that labels have to pass.

Labels are integers of shape (z, y, x): 0 is void, grains are positive.
"""

import numpy as np
import scipy.ndimage
import skimage.morphology
import skimage.segmentation

from ..errors import InputError


def separate_grains(solid, marker_depth=1.5, min_grain_voxels=0, tightening=3.0):
    """Cut a solid into grains along the necks of its distance map.

    Each marker is a maximum of the distance map (distance to the void) from
    which every way to a higher one dips by at least ``marker_depth``; the
    watershed of the inverted distance map grows the markers until they meet.
    The markers of grains that come out too small are taken away and their
    voxels left to their neighbours; what has no neighbour is dropped.

    Args:
        solid: True in grains, shape (z, y, x).
        marker_depth: Least dip between two grains [voxels].
        min_grain_voxels: Least size of a grain [voxels].
        tightening: Width over which faces between grains are drawn tight
            [voxels]; 0: they stay as the watershed left them.

    Returns:
        labels 1 … n, int32, each grain in one piece and at least two voxels
        thick; the number of fragments that were dropped and their voxels.
    """
    # Faces of the image are no surfaces of grains: the distance ignores them.
    distance = scipy.ndimage.distance_transform_edt(solid)
    # Distances to voxels are rugged; a little smoothing removes false maxima.
    distance = scipy.ndimage.gaussian_filter(distance, 1.0, mode="nearest") * solid
    lowered = skimage.morphology.reconstruction(distance - marker_depth, distance)
    maxima = skimage.morphology.local_maxima(lowered, connectivity=1) & solid
    markers, _ = scipy.ndimage.label(maxima, np.ones((3, 3, 3)))
    while True:
        labels = skimage.segmentation.watershed(-distance, markers, mask=solid, connectivity=1)
        voxels = np.bincount(labels.ravel(), minlength=markers.max() + 1)
        small = voxels < min_grain_voxels
        small[0] = False
        # Smallest first: two crumbs side by side may make one grain.
        small &= voxels <= np.median(voxels[small]) if small.any() else False
        small &= voxels > 0
        if not small.any():
            break
        markers[small[markers]] = 0
    if tightening > 0:
        labels = straightened(labels, tightening)
    labels = _sound_grains(labels, min_grain_voxels)
    fragments, _ = scipy.ndimage.label(solid & (labels == 0))
    return labels, int(fragments.max()), int(np.count_nonzero(fragments))


def straightened(labels, sigma, rounds=4):
    """Labels whose faces between grains have been drawn tight.

    The watershed cuts along the directions of the grid. Each round smooths
    the indicator of every grain and gives each voxel of the solid to the grain
    that is strongest there; faces so shrink towards the narrowest cut near
    them. The solid does not change.

    Source: B. Merriman, J. K. Bence, S. J. Osher, J. Computational Physics 112
    (1994) 334-363.

    Args:
        labels: 0 void, grains from 1.
        sigma: Standard deviation of the Gaussian [voxels].
        rounds: Times that this is done.
    """
    pad = int(np.ceil(3 * sigma))
    solid = labels > 0
    for _ in range(rounds):
        strongest = np.zeros(labels.shape, dtype=np.float32)
        winner = np.zeros_like(labels)
        for grain, where in grains_in(labels):
            around = tuple(slice(max(s.start - pad, 0), s.stop + pad) for s in where)
            strength = scipy.ndimage.gaussian_filter(
                (labels[around] == grain).astype(np.float32), sigma, mode="nearest", truncate=3.0
            )
            wins = strength > strongest[around]
            strongest[around][wins] = strength[wins]
            winner[around][wins] = grain
        labels = np.where(solid, winner, 0)
    return labels


def _sound_grains(labels, min_voxels):
    """The largest piece of each grain if it is large and thick enough, numbered anew."""
    result = np.zeros(labels.shape, dtype=np.int32)
    number = 0
    for grain, where in enumerate(scipy.ndimage.find_objects(labels), start=1):
        if where is None:
            continue
        mask = largest_piece(labels[where] == grain)
        if mask.sum() >= max(min_voxels, 1) and is_thick(mask):
            number += 1
            result[where][mask] = number
    return result


def fill_pores(solid):
    """The solid with all voids filled that it encloses on all sides."""
    return scipy.ndimage.binary_fill_holes(solid)


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


def checked_labels(labels, *, keep_largest_piece=False, source="labels"):
    """Labels fit for meshing, as int32.

    Args:
        labels: Array of shape (z, y, x).
        keep_largest_piece: Of a grain in several pieces keep the largest,
            instead of refusing it.
        source: Name of the labels in messages.

    Returns:
        labels; and the labels of the grains from which pieces were taken.

    Raises:
        InputError: labels are not three-dimensional, not integers, negative,
            hold less than two grains, a grain in pieces or thinner than two voxels.
    """
    labels = np.asarray(labels)
    if labels.ndim != 3:
        raise InputError(f"{source}: {labels.ndim} axes, expected 3: (z, y, x)")
    if labels.dtype.kind not in "biu":
        raise InputError(f"{source}: type of labels is {labels.dtype}, expected integers")
    if labels.dtype.kind == "i" and labels.min() < 0:
        raise InputError(f"{source}: smallest label is {labels.min()}, expected 0 or more")
    if labels.max() > np.iinfo(np.int32).max:
        raise InputError(f"{source}: largest label is {labels.max()}, expected less than 2^31")
    labels = labels.astype(np.int32)
    grains = np.unique(labels[labels > 0])
    if len(grains) == 0:
        raise InputError(f"{source}: no grain, all voxels are 0, expected at least two grains")
    if len(grains) == 1:
        raise InputError(f"{source}: one grain only, label {grains[0]}, expected at least two")
    trimmed = []
    for grain, where in grains_in(labels):
        mask = labels[where] == grain
        numbered, sizes = pieces(mask)
        if len(sizes) > 1:
            if not keep_largest_piece:
                raise InputError(
                    f"{source}: grain {grain} is in {len(sizes)} pieces of "
                    f"{_few(np.sort(sizes)[::-1])} voxels, expected one; "
                    "or ask to keep the largest piece"
                )
            mask = numbered == 1 + np.argmax(sizes)
            labels[where][(numbered > 0) & ~mask] = 0
            trimmed.append(int(grain))
        if not is_thick(mask):
            size = " x ".join(str(n) for n in mask.shape)
            raise InputError(
                f"{source}: grain {grain} of {mask.sum()} voxels within {size} is thinner than "
                "2 voxels, expected room for a cube of 2 x 2 x 2 voxels"
            )
    return labels, trimmed


def grains_in(labels):
    """Each label > 0 with the slices of the box around its grain."""
    for index, where in enumerate(scipy.ndimage.find_objects(labels)):
        if where is not None:
            yield index + 1, where


def _few(numbers):
    text = ", ".join(str(n) for n in numbers[:4])
    return text + (", …" if len(numbers) > 4 else "")
