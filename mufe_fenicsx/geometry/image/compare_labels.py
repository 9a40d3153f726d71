"""Labels against other labels: grains found one-to-one, contacts, sizes, agreement of pairs."""

import numpy as np
import scipy.ndimage

from ...errors import InputError
from ...units import with_unit
from .image import to_cubes
from .image_files import check_crop, read_with_size
from .label_files import labels_key
from .labels import plain_labels, touching_labels


def matched_grains(found, true, overlap=0.5):
    """Grains that are the same in both: each holds more than ``overlap`` of the other's voxels.

    With an overlap of at least one half no grain can have two partners.

    Returns:
        Dictionary {label in ``true``: label in ``found``}.
    """
    both = (found > 0) & (true > 0)
    base = int(found.max()) + 1
    key, count = np.unique(true[both].astype(np.int64) * base + found[both], return_counts=True)
    t, f = key // base, key % base
    size_t, size_f = np.bincount(true.ravel()), np.bincount(found.ravel())
    same = (count > overlap * size_t[t]) & (count > overlap * size_f[f])
    return dict(zip(t[same].tolist(), f[same].tolist(), strict=True))


def compare_labels(found, true, *, min_voxels=0, min_faces=1, true_contacts=None):
    """How well labels agree with the true ones.

    Args:
        found: Labels of a segmentation, (z, y, x).
        true: True labels on the same voxels.
        min_voxels: Smaller true grains (slivers that the border cuts off) are not asked for, and
            found grains that lie mostly in them not counted as false.
        min_faces: Voxel faces that a contact has at least, in both.
        true_contacts: Pairs of true labels that touch, a < b; None: those that share at least
            ``min_faces`` voxel faces in ``true``.

    Returns:
        A dictionary: num_true, num_found, num_matched, matched_share (of the true grains),
        false_grains (found ones without a partner), split (true grains without a partner
        in which several found ones lie), merged (those that lie in a found one with
        others), contact_precision, contact_recall,
        num_true_contacts, num_found_contacts, mean_diameter_error (relative, signed),
        largest_diameter_error, diameter_error_95 (of 95 % of the matched grains, absolute),
        solid_fraction_error, wrong_voxels (share of the voxels solid in both of matched grains).

    Raises:
        InputError: the shapes differ, or ``true`` holds no grain.
    """
    if found.shape != true.shape:
        raise InputError(f"labels of shape {found.shape}, expected {true.shape} as the true ones")
    size_t, size_f = np.bincount(true.ravel()), np.bincount(found.ravel())
    asked = np.flatnonzero(size_t >= max(min_voxels, 1))
    asked = asked[asked > 0]
    if len(asked) == 0:
        raise InputError(f"true labels hold no grain of {min_voxels} voxels, expected some")
    match = matched_grains(found, true)
    matched = [t for t in asked.tolist() if t in match]
    partner = {f: t for t, f in match.items()}

    fate_f = _largest_share(found, true)  # true grain that holds most of each found one
    spare = [
        f for f in np.flatnonzero(size_f) if f > 0 and f not in partner
        and not (fate_f[f] > 0 and size_t[fate_f[f]] < min_voxels)
    ]  # fmt: skip
    fate_t = _largest_share(true, found)
    lost = [t for t in asked.tolist() if t not in match]
    split = sum(sum(fate_f[f] == t for f in spare) > 1 for t in lost)
    sharing = np.bincount(fate_t[asked])
    merged = sum(fate_t[t] > 0 and sharing[fate_t[t]] > 1 for t in lost)

    asked_set, false_set = set(asked.tolist()), set(spare)
    if true_contacts is None:
        true_contacts = {p for p, n in touching_labels(true).items() if n >= min_faces}
    wanted = {tuple(sorted(p)) for p in true_contacts if asked_set.issuperset(p)}
    got = set()
    for (a, b), n in touching_labels(found).items():
        if n >= min_faces:
            # A false grain counts, with none of the true contacts; what lies in a grain that is
            # not asked for does not.
            ends = [partner.get(f, -f) for f in (a, b)]
            if all(t in asked_set if t > 0 else -t in false_set for t in ends):
                got.add((min(ends), max(ends)))
    hit = len(got & wanted)

    ratio = np.array([np.cbrt(size_f[match[t]] / size_t[t]) for t in matched]) - 1
    same = np.zeros(len(size_t), dtype=np.int64)
    same[list(match)] = list(match.values())
    solid = (true > 0) & (found > 0) & (same[true] > 0)
    return {
        "num_true": len(asked),
        "num_found": int((size_f[1:] > 0).sum()),
        "num_matched": len(matched),
        "matched_share": len(matched) / len(asked),
        "false_grains": len(spare),
        "split": int(split),
        "merged": int(merged),
        "num_true_contacts": len(wanted),
        "num_found_contacts": len(got),
        "contact_precision": hit / len(got) if got else float(not wanted),
        "contact_recall": hit / len(wanted) if wanted else 1.0,
        "mean_diameter_error": float(ratio.mean()) if len(ratio) else 0.0,
        "largest_diameter_error": float(np.abs(ratio).max()) if len(ratio) else 0.0,
        "diameter_error_95": float(np.percentile(np.abs(ratio), 95)) if len(ratio) else 0.0,
        "solid_fraction_error": float((found > 0).mean() - (true > 0).mean()),
        "wrong_voxels": float((found[solid] != same[true[solid]]).mean()) if solid.any() else 0.0,
    }


def true_labels(path, shape, voxel_size, settings, notices):
    """Labels to hold a segmentation against, of the image or of its part, on cubes.

    Args:
        path: A label image, from here or elsewhere.
        shape: Voxels of the image as it was read, (z, y, x).
        voxel_size: Of the image, (z, y, x) [m].
        settings: `SegmentSettings` of the image; its order of axes is that of the labels, too.
        notices: A list to which a line is added where the file states voxels of another size.

    Raises:
        InputError: the file cannot be read, or has another size.
    """
    true, size = read_with_size(path, key=labels_key(path), axes=settings.axes, notices=notices)
    if isinstance(size, tuple) and not np.allclose(size, voxel_size, rtol=1e-3, atol=0):
        stated = " x ".join(with_unit(edge, "m") for edge in size)
        notices.append(
            f"true labels {path} state voxels of {stated}, the image has others: taken as the "
            "image's"
        )
    whole = true.shape
    if settings.crop is not None and whole != tuple(shape):
        ranges = check_crop(settings.crop, whole)
        true = true[tuple(slice(*ends) for ends in ranges)]
    if true.shape != tuple(shape):
        raise InputError(
            f"true labels {path} have shape {whole}, expected {tuple(shape)} as the image"
            f"{', or of all of it' if settings.crop is not None else ''}"
        )
    true = plain_labels(true, str(path), numbers=[])
    return to_cubes(true, voxel_size, labels=True)[0]


def fitted(labels, shape):
    """Labels on as many voxels as those that they are held against: the nearest voxel's."""
    if labels.shape == tuple(shape):
        return labels
    factors = [n / m for n, m in zip(shape, labels.shape, strict=True)]
    return scipy.ndimage.zoom(labels, factors, order=0, mode="nearest", grid_mode=True)


def _largest_share(a, b):
    """For each label of ``a`` the label of ``b``, or 0, that holds most of its solid voxels."""
    base = int(b.max()) + 1
    both = (a > 0) & (b > 0)
    key, count = np.unique(a[both].astype(np.int64) * base + b[both], return_counts=True)
    order = np.argsort(count, kind="stable")
    out = np.zeros(int(a.max()) + 1, dtype=np.int64)
    out[key[order] // base] = key[order] % base
    return out
