"""A cylindrical sample of an image: what of the image belongs to it, and which grains."""

from dataclasses import dataclass

import numpy as np
import scipy.ndimage

from ...errors import InputError
from ..settings import CUT, DROP, FIELD, GIVEN, MOULD, WHOLE
from .circles import field_circle, mould_circle
from .cylinder import Cylinder
from .field_of_view import filled
from .labels import is_thick, pieces
from .segmentation import sound_grains

#: Voxels within a wall whose levels the wall changes too: the blur of the image.
BLUR = 1.5
#: What is looked at around a cylinder that is smaller than the field of view: a part of its radius,
#: and at least so many voxels.
AROUND, LEAST_AROUND = 0.5, 50.0
#: The axis of a wall may lean over the height by this part of the radius.
LEAN = 0.1


@dataclass(frozen=True)
class RoundSample:
    """The cylinder that is the sample, in voxels of the image, and what becomes of its rim."""

    cylinder: Cylinder  #: upright
    rim: str  #: `CUT`, `DROP` or `WHOLE`
    closed: bool  #: whether grains end at a wall
    lines: tuple  #: what was found, in words

    def cut(self, labels, field, settings):
        """Labels of the sample alone, numbered anew.

        Args:
            labels: (z, y, x), on ``settings.upsample`` voxels for one of the image.
            field: True where something was measured, on the same voxels, or None.
            settings: `SegmentSettings`.

        Returns:
            labels; True inside the cylinder; and numbers: solid_fraction, num_dropped.
        """
        scaled = self.cylinder.scaled(settings.upsample)
        inside = scaled.inside(labels.shape)
        num_before, dropped = np.count_nonzero(np.bincount(labels.ravel())[1:]), 0
        if self.rim == DROP:
            beyond = ~inside
            if field is not None:
                beyond |= scipy.ndimage.binary_dilation(~field)
            gone = np.zeros(labels.max() + 1, dtype=bool)
            gone[np.unique(labels[beyond])] = True
            labels = np.where(gone[labels], 0, labels)
        elif self.rim == CUT:
            labels = np.where(inside, labels, 0)
        if self.rim != WHOLE:
            labels = sound_grains(labels, settings.min_grain_voxels)
            dropped = num_before - int(labels.max())
        solid = np.count_nonzero(labels) / np.count_nonzero(inside)
        return labels, inside, {"solid_fraction": float(solid), "rim_grains_left_out": int(dropped)}


def cut_labels(labels, cylinder, lost=None):
    """Labels within a cylinder alone, of each grain the largest piece; and how many are left out.

    Left out are grains of which a sheet of a voxel is left. Labels keep their numbers.

    Args:
        labels: Integers, (z, y, x).
        cylinder: `Cylinder`, upright, in voxels.
        lost: A dictionary, to which sizes of other pieces are added, as by
            `labels.checked_labels`.
    """
    inside, labels = cylinder.inside(labels.shape), labels.astype(np.int32)
    result = np.where(inside, labels, 0)
    crossed = np.unique(labels[~inside])
    left_out = 0
    boxes = scipy.ndimage.find_objects(result)
    for label in crossed[crossed > 0]:
        where = boxes[label - 1] if label <= len(boxes) else None
        if where is None:
            continue
        mine = result[where] == label
        numbered, sizes = pieces(mine)
        kept = numbered == 1 + np.argmax(sizes)
        if lost is not None and len(sizes) > 1:
            lost[int(label)] = np.sort(sizes)[-2::-1].tolist(), False
        if not is_thick(kept):
            left_out += 1
            kept = np.zeros_like(mine)
        result[where][mine & ~kept] = 0
    return result, left_out


def round_sample(raw, inside, settings, edge, source):
    """The cylinder that settings ask for.

    Args:
        raw: Grey levels of cubes, (z, y, x).
        inside: True where something was measured, or None.
        settings: `SegmentSettings` with a ``cylinder``.
        edge: Of the cubes [m].
        source: Name of the image in messages.

    Returns:
        Grey levels, those of a wall and next to it replaced by the nearest ones of the sample;
        True where grains are looked for; and the `RoundSample`.

    Raises:
        InputError: Nothing is recognised, or the cylinder is not in the image.
    """
    found, line = _recognised(raw, inside, settings, edge, source)
    height, rim = len(raw), settings.rim_of_cylinder
    shift = found.shift(height)
    if shift > LEAN * found.radius:
        raise InputError(
            f"cylinder: its axis moves sideways by {shift:.3g} voxels over the height, expected at "
            f"most {LEAN:g} of the radius, {LEAN * found.radius:.3g}: turn the image upright"
        )
    closed = settings.cylinder == MOULD or rim == WHOLE
    if closed:
        mine = found.inside(raw.shape)
        mine = mine if inside is None else mine & inside
        raw = filled(raw, mine & found.inside(raw.shape, BLUR))
        inside = mine
    upright = found.upright(height, inscribed=rim != WHOLE)
    if settings.cylinder != GIVEN:
        upright = _changed(upright, settings, edge)
    _require_in_image(upright, raw.shape, edge)
    if rim != WHOLE:
        inside = _around(upright, raw.shape, inside)
    lines = [_line(settings.cylinder, upright, edge, shift)] + ([line] if line else [])
    return raw, inside, RoundSample(upright, rim, closed, tuple(lines))


def _recognised(raw, inside, settings, edge, source):
    """The `Cylinder` of the field of view or wall, or the one that is given; and a line or None."""
    if settings.cylinder == MOULD:
        return mould_circle(raw, inside, source)
    if settings.cylinder == FIELD:
        return field_circle(inside, source)
    ny, nx = raw.shape[1:]
    x, y = nx / 2, ny / 2
    if settings.cylinder_middle is not None:
        x, y = (place / edge for place in settings.cylinder_middle)
    radius = settings.cylinder_radius
    room = min(x, y, nx - x, ny - y)
    return Cylinder(x, y, room if radius is None else radius / edge), None


def _around(cylinder, shape, inside):
    """True where grains are looked for around a cylinder that is cut out; None: everywhere."""
    more = max(AROUND * cylinder.radius, LEAST_AROUND)
    near = cylinder.inside(shape, -more)
    if near.all():
        return inside
    return near if inside is None else near & inside


def _changed(cylinder, settings, edge):
    """A cylinder with the middle and the radius that settings state."""
    x, y, radius = cylinder.x, cylinder.y, cylinder.radius
    if settings.cylinder_middle is not None:
        x, y = (place / edge for place in settings.cylinder_middle)
        radius -= np.hypot(x - cylinder.x, y - cylinder.y)
    if settings.cylinder_radius is not None:
        given = settings.cylinder_radius / edge
        if given > radius * (1 + 1e-9):
            raise InputError(
                f"cylinder_radius = {settings.cylinder_radius:g} m, expected at most "
                f"{radius * edge:g} m, the cylinder that is recognised"
            )
        radius = given
    return Cylinder(x, y, radius)


def _require_in_image(cylinder, shape, edge):
    """Raise InputError unless a cylinder lies within the image."""
    x, y, r = cylinder.x, cylinder.y, cylinder.radius
    room = min(x, y, shape[2] - x, shape[1] - y)
    if not 0 < r <= room + 1:
        raise InputError(
            f"cylinder of radius {r * edge:g} m about (x, y) = ({x * edge:g}, {y * edge:g}) m, "
            f"expected within the image of {shape[2] * edge:g} x {shape[1] * edge:g} m"
        )


def _line(by, cylinder, edge, shift):
    mm = 1e3 * edge
    line = (
        f"cylinder ({by}): axis at (x, y) = ({cylinder.x * mm:.4g}, {cylinder.y * mm:.4g}) mm, "
        f"radius {cylinder.radius * mm:.4g} mm ({cylinder.radius:.1f} voxels)"
    )
    return line + (f", the axis leans by {shift:.2g} voxels over the height" if shift else "")
