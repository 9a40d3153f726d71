"""Motions of grains that SPAM and CCPi's iDVC have tracked, read as these write them.

Both count lengths in voxels, and places from the middle of the first voxel. SPAM's tables
(`spam-ddic`, `spam-ldic` and what else `spam.helpers.readCorrelationTSV` reads) are tab-separated,
with columns in the order z, y, x: ``Label`` or ``NodeNumber``, ``Zpos``, ``Ypos``, ``Xpos``,
``Zdisp``, ``Ydisp``, ``Xdisp``, ``Fzz`` … ``Fxx`` and ``returnStatus``, 2 where the search has
converged; F maps x - c to x' - c - u. A result of iDVC (`.disp`) has ``n``, ``x``, ``y``, ``z``,
``status`` (0: found), ``objmin``, ``u``, ``v``, ``w`` and angles, whose order its manual does not
tell: they are not read.

Where the points of a table are no grains, each grain has the rigid motion that fits the points
within its label best (W. Kabsch, Acta Cryst. A32, 1976, 922-923); with fewer than three, or all in
a line, only their mean displacement.
"""

from pathlib import Path

import numpy as np
import pandas
from scipy.spatial.transform import Rotation

from ..errors import InputError, shortened
from ..geometry.tracking.track import Track
from ..machine.files import reason, regular

#: What SPAM writes where a search has converged, and iDVC where a point was found.
CONVERGED, POINT_GOOD = 2, 0
#: Distance between the centre of a label and that in a table from which on they are not the same.
SAME = 2.0
#: Spread of points across a line below which they tell no rotation [voxels].
IN_LINE = 0.5
#: Columns that tell a table of SPAM, and one of iDVC.
OF_SPAM = tuple(f"{a}{what}" for what in ("pos", "disp") for a in "ZYX")
OF_IDVC = ("n", "x", "y", "z", "status", "objmin", "u", "v", "w")
#: Of SPAM's gradient of the motion, with which a table has its rotations.
GRADIENT = tuple(f"F{a}{b}" for a in "zyx" for b in "zyx")


def read_track(path, bodies, voxel_size):
    """The :class:`~mufe_fenicsx.geometry.tracking.track.Track` that a table of others has.

    Args:
        path: Of the table.
        bodies: :class:`~mufe_fenicsx.geometry.tracking.bodies.Bodies` of the first scan, whose
            labels the table is about.
        voxel_size: [m].

    Raises:
        InputError: It cannot be read, lacks columns, or is about other labels.
    """
    table = _read(path)
    if set(OF_SPAM) <= set(table):
        place = table[[f"{a}pos" for a in "XYZ"]].to_numpy(dtype=float) + 0.5
        moved = table[[f"{a}disp" for a in "XYZ"]].to_numpy(dtype=float)
        good = np.ones(len(table), dtype=bool)
        if "returnStatus" in table:
            good = (table["returnStatus"] == CONVERGED).to_numpy()
        if "Label" in table:
            return _by_label(path, table, (place, moved, good), bodies, voxel_size)
    elif set(OF_IDVC) <= set(table):
        place = table[["x", "y", "z"]].to_numpy(dtype=float) + 0.5
        moved = table[["u", "v", "w"]].to_numpy(dtype=float)
        good = table["status"] == POINT_GOOD
    else:
        lacking = [name for name in OF_SPAM if name not in table]
        raise InputError(
            f"track {path} has columns {shortened(', '.join(map(str, table.columns[:8])))}, "
            f"expected those of SPAM ({', '.join(lacking[:3])} … are missing) or of a result of "
            f"iDVC ({' '.join(OF_IDVC)})"
        )
    good = good & np.isfinite(place).all(axis=1) & np.isfinite(moved).all(axis=1)
    return _by_points(path, place[good], moved[good], bodies, voxel_size)


def _read(path):
    """A table with a line of names, of numbers."""
    path = Path(path)
    try:
        text = regular(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"track {path} cannot be read ({reason(error)})") from error
    lines = [line.split() for line in text.splitlines() if line.strip()]
    if len(lines) < 2:
        raise InputError(f"track {path} has {len(lines)} lines, expected names of columns and rows")
    names, *rows = lines
    for k, row in enumerate(rows, start=2):
        if len(row) != len(names):
            raise InputError(
                f"track {path}: line {k} has {len(row)} values, expected {len(names)} as names"
            )
    try:
        return pandas.DataFrame(np.array(rows, dtype=float), columns=names)
    except ValueError as error:
        raise InputError(f"track {path} is no table of numbers ({reason(error)})") from error


def _by_label(path, table, values, bodies, voxel_size):
    """The track of a table with a row a label."""
    place, moved, good = values
    row_of = {n: k for k, n in enumerate(table["Label"].tolist())}
    at = np.array([row_of.get(float(n), -1) for n in bodies.label])
    finite = np.isfinite(place[at]).all(axis=1) & np.isfinite(moved[at]).all(axis=1)
    known = (at >= 0) & good[at] & finite
    off = np.linalg.norm(place[at] - bodies.centre, axis=1)
    away = off[known] > SAME + 0.02 * bodies.diameter
    if not known.any() or away.sum() > 0.5 * known.sum():
        raise InputError(
            f"track {path}: {int(known.sum() - away.sum())} of {len(bodies.label)} labels lie "
            "where the table has them, expected the labels that were tracked"
        )
    n = len(bodies.label)
    rotation = np.full((n, 3, 3), np.nan)
    if set(GRADIENT) <= set(table):
        gradient = table[list(GRADIENT)].to_numpy(dtype=float).reshape(-1, 3, 3)[at]
        gradient = gradient[:, ::-1, ::-1]  # from z, y, x
        usable = known & np.isfinite(gradient).all(axis=(1, 2))
        u, _, vt = np.linalg.svd(gradient[usable])
        u[:, :, 2] *= np.linalg.det(u @ vt)[:, None]
        rotation[usable] = u @ vt
    centre = np.where(known[:, None], place[at], bodies.centre)
    return Track(
        label=bodies.label,
        label_now=np.zeros(n, dtype=np.int64),
        centre=centre * voxel_size,
        displacement=np.where(known[:, None], moved[at], np.nan) * voxel_size,
        rotation=rotation,
        misfit=np.full(n, np.nan),
    )


def _by_points(path, place, moved, bodies, voxel_size):
    """The track of points of a cloud: the rigid motion of those in each label."""
    voxel = np.floor(place).astype(np.int64)[:, ::-1]
    inside = ((voxel >= 0) & (voxel < bodies.image.shape)).all(axis=1)
    label = np.zeros(len(place), dtype=np.int64)
    label[inside] = bodies.image[tuple(voxel[inside].T)]
    if not label.any():
        raise InputError(
            f"track {path}: none of {len(place)} found points lies in a label, expected places in "
            "voxels of the first scan"
        )
    n = len(bodies.label)
    displacement, rotation = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
    order = np.argsort(label, kind="stable")
    ends = np.searchsorted(label[order], bodies.label, side="right")
    starts = np.searchsorted(label[order], bodies.label)
    for k in range(n):
        mine = order[starts[k] : ends[k]]
        if mine.size == 0:
            continue
        mean, motion = place[mine].mean(axis=0), moved[mine].mean(axis=0)
        away = place[mine] - mean
        displacement[k] = motion
        if mine.size > 2 and np.linalg.svd(away, compute_uv=False)[1] > IN_LINE:
            turn, _ = Rotation.align_vectors(away + moved[mine] - motion, away)
            rotation[k] = turn.as_matrix()
            off = bodies.centre[k] - mean
            displacement[k] += turn.apply(off) - off
    return Track(
        label=bodies.label,
        label_now=np.zeros(n, dtype=np.int64),
        centre=bodies.centre * voxel_size,
        displacement=displacement * voxel_size,
        rotation=rotation,
        misfit=np.full(n, np.nan),
    )
