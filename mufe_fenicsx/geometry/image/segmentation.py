"""From a grey image to one label a grain: threshold, distance map, watershed, contacts."""

import math

import numpy as np
import scipy.ndimage
import skimage.morphology
import skimage.segmentation

from ...errors import InputError
from ...machine.memory import check_room
from .contact_faces import open_gaps
from .field_of_view import filled
from .image import resample, smooth
from .labels import fill_pores, grains_in, is_thick, largest_piece
from .threshold import NoThreshold, doubt_about, find_threshold
from .watershed import watershed

#: Memory at the peak of a segmentation, for each voxel of the labels [bytes].
A_VOXEL = 60


def segment(raw, settings, inside=None, closed=False):
    """Labels of a grey image: filter, threshold, pores, grains.

    Args:
        raw: Grey levels of cubic voxels, (z, y, x).
        settings: `SegmentSettings`.
        inside: True where something was measured; None: everywhere. The rest takes part in
            nothing, as if the image ended there.
        closed: Grains end where ``inside`` does, at a wall; otherwise they go on unseen.

    Returns:
        labels, and the filtered image, both on the voxels of labels; and a dictionary: threshold,
        void_grey and solid_grey (modes of the histogram, or None), warning (text or None),
        filled_pore_voxels, solid_fraction (of what was measured), field (that, on the voxels of
        labels, or None), and what `separate_grains` found.

    Raises:
        NoThreshold: see `threshold.find_threshold`.
        InputError: see `image.resample`; or the memory is too small.
    """
    if inside is not None and float(settings.upsample).is_integer():
        where = scipy.ndimage.find_objects(inside.view(np.uint8))[0]
        if raw[where].shape != raw.shape:
            found = segment(raw[where], settings, inside[where], closed)
            return _embedded(raw.shape, where, *found, int(settings.upsample))
    num_voxels = math.prod(max(1, round(n * settings.upsample)) for n in raw.shape)
    check_room(
        A_VOXEL * num_voxels,
        f"upsample = {settings.upsample:g}: to segment {num_voxels} voxels",
        "; crop takes a part of the image",
    )
    if inside is not None:
        raw = filled(raw, inside)
    grey = smooth(raw, settings.filter, settings.filter_radius)
    grey = resample(grey, settings.upsample)
    measured = grey
    if inside is not None:
        inside = resampled_mask(inside, settings.upsample, grey.shape)
        measured = grey[inside]
    try:
        threshold = find_threshold(measured, settings.threshold)
    except InputError as error:
        if measured.min() == measured.max():
            raise  # nothing to show
        raise NoThreshold(str(error), grey, inside) from None
    warning, void, full = doubt_about(measured, threshold)
    num_measured = measured.size
    del measured
    solid = grey > threshold
    if inside is not None:
        solid &= inside
    num_pores = 0
    if settings.fill_pores:
        num_pores = -np.count_nonzero(solid)
        solid = fill_pores(solid)
        if inside is not None:
            solid &= inside
        num_pores += np.count_nonzero(solid)
    phases = None if void is None else (void, full)
    labels, separated = separate_grains(
        solid,
        settings,
        settings.upsample,
        grey,
        phases,
        None if inside is None or closed else ~inside,
    )
    found = {
        "threshold": threshold,
        "void_grey": void,
        "solid_grey": full,
        "warning": warning,
        "filled_pore_voxels": int(num_pores),
        "solid_fraction": float(np.count_nonzero(labels) / num_measured),
        "field": inside,
    }
    return labels, grey, found | separated


def _embedded(shape, where, labels, grey, found, factor):
    """What `segment` found in a part of an image, in the whole of it."""
    shape = tuple(n * factor for n in shape)
    where = tuple(slice(s.start * factor, s.stop * factor) for s in where)
    parts = labels, grey, found["field"]
    wholes = []
    for part, outside in zip(parts, (0, grey.min(), False), strict=True):
        whole = np.full(shape, outside, dtype=part.dtype)
        whole[where] = part
        wholes.append(whole)
    return wholes[0], wholes[1], found | {"field": wholes[2]}


def resampled_mask(inside, factor, shape):
    """A field of view on the voxels of a resampled image."""
    if factor == 1:
        return inside
    fine = scipy.ndimage.zoom(inside.view(np.uint8), factor, order=0, mode="nearest",
                              grid_mode=True)  # fmt: skip
    return fine > 0


def separate_grains(solid, settings, scale=1.0, grey=None, phases=None, outside=None):
    """Cut a solid into grains along the necks of its distance map.

    Args:
        solid: True in grains, shape (z, y, x).
        settings: `SegmentSettings`; its lengths are in raw voxels.
        scale: Voxels of ``solid`` per raw voxel.
        grey: The filtered image on the same voxels.
        phases: Grey levels of void and solid; None: labels touch where they meet.
        outside: True where nothing was measured; None: nowhere.

    Returns:
        labels 1 … n, int32, each grain in one piece and at least two voxels thick; and a
        dictionary: merge_depth (how deep a dip of the distance map was overlooked, in voxels of
        ``solid``), opened_contacts (pairs that the grey level parts), dropped_fragments,
        dropped_voxels.
    """
    distance = distance_map(solid, outside=outside)
    depth = settings.depth * scale
    if settings.separation == "markers":
        labels = grown_markers(solid, distance, depth, settings.min_grain_voxels)
    else:
        np.negative(distance, out=distance)
        how = {"depth": depth, "relative": settings.relative}
        if settings.separation == "level":
            how = dict(zip(("threshold", "level"), settings.threshold_and_level, strict=True))
        labels, depth = watershed(distance, solid, min_voxels=settings.min_grain_voxels, **how)
    del distance
    if settings.tightening > 0:
        labels = straightened(labels, settings.tightening * scale)
    num_opened, opened = 0, np.empty(0, dtype=np.int64)
    if phases is not None and settings.contact_level > 0:
        # Noise is averaged over about a voxel of the image, whatever the filter was.
        filtered = settings.filter_radius if settings.filter == "gaussian" else 0.0
        more = scale * np.sqrt(max(0.0, 1.0 - filtered**2))
        if more > 0:
            grey = scipy.ndimage.gaussian_filter(grey, more, mode="nearest")
        num_opened, opened = open_gaps(labels, grey, *phases, settings.contact_level)
        del grey
    labels = sound_grains(labels, settings.min_grain_voxels)
    left = solid & (labels == 0)
    left.ravel()[opened] = False
    fragments, num_fragments = scipy.ndimage.label(left)
    return labels, {
        "merge_depth": float(depth),
        "opened_contacts": num_opened,
        "dropped_fragments": int(num_fragments),
        "dropped_voxels": int(np.count_nonzero(fragments)),
    }


def distance_map(solid, smoothing=1.0, outside=None):
    """Distance of each solid voxel to the void, smoothed, float32, 0 in the void [voxels].

    Faces of the image are no surfaces of grains: the distance ignores them, and what lies
    ``outside`` of the field of view. Distances to voxels are rugged; the smoothing removes false
    maxima.
    """
    distance = distance_to_void(solid if outside is None else solid | outside)
    scipy.ndimage.gaussian_filter(distance, smoothing, output=distance, mode="nearest")
    distance *= solid
    return distance


def distance_to_void(solid):
    """Distance of the middle of each solid voxel to that of the nearest void one, float32 [voxels].

    The diagonal of the image where there is no void. ITK's filter takes a third of the time of
    SciPy's, runs on all cores, and keeps no indices.

    Source: C. R. Maurer, R. Qi, V. Raghavan, IEEE Trans. Pattern Analysis and Machine
    Intelligence 25 (2003) 265-270.
    """
    import SimpleITK

    if solid.all():
        return np.full(solid.shape, np.linalg.norm(solid.shape), dtype=np.float32)
    # Squares of distances are whole numbers, and exact.
    squares = SimpleITK.SignedMaurerDistanceMap(
        SimpleITK.GetImageFromArray((~solid).view(np.uint8)),
        insideIsPositive=False, squaredDistance=True, useImageSpacing=False,
    )  # fmt: skip
    distance = SimpleITK.GetArrayFromImage(squares)
    np.maximum(distance, 0, out=distance)  # in the void it is negative
    return np.sqrt(distance, out=distance)


def grown_markers(solid, distance, depth, min_voxels):
    """Labels that markers grow to by immersion; kept for scenes that were tuned with it.

    Each marker is a maximum of the distance map that is ``depth`` above its surroundings. The
    markers of grains that come out too small are taken away and their voxels left to their
    neighbours. Necks that only voxels' edges join leave false markers.
    """
    lowered = skimage.morphology.reconstruction(distance - depth, distance)
    maxima = skimage.morphology.local_maxima(lowered, connectivity=1) & solid
    markers, _ = scipy.ndimage.label(maxima, np.ones((3, 3, 3)))
    while True:
        labels = skimage.segmentation.watershed(-distance, markers, mask=solid, connectivity=1)
        voxels = np.bincount(labels.ravel(), minlength=markers.max() + 1)
        small = voxels < min_voxels
        small[0] = False
        # Smallest first: two crumbs side by side may make one grain.
        small &= voxels <= np.median(voxels[small]) if small.any() else False
        small &= voxels > 0
        if not small.any():
            return labels
        markers[small[markers]] = 0


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
    void = labels == 0
    for _ in range(rounds):
        strongest = np.zeros(labels.shape, dtype=np.float32)
        winner = np.zeros_like(labels)
        for grain, where in grains_in(labels):
            around = tuple(slice(max(s.start - pad, 0), s.stop + pad) for s in where)
            strength = scipy.ndimage.gaussian_filter(
                (labels[around] == grain).astype(np.float32), sigma, mode="nearest", truncate=3.0
            )
            wins = strength > strongest[around]
            np.copyto(strongest[around], strength, where=wins)
            np.copyto(winner[around], grain, where=wins)
        winner[void] = 0
        labels = winner
    return labels


def sound_grains(labels, min_voxels):
    """The largest piece of each grain if it is large and thick enough, numbered anew."""
    result = np.zeros(labels.shape, dtype=np.int32)
    number = 0
    for grain, where in grains_in(labels):
        mask = largest_piece(labels[where] == grain)
        if mask.sum() >= max(min_voxels, 1) and is_thick(mask):
            number += 1
            result[where][mask] = number
    return result
