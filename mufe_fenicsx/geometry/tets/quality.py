"""The quality table: a row for each grain, of its mesh or of why it has none."""

import numpy as np

from .. import measure

#: Its columns.
QUALITY = (
    "label",
    "status",
    "tets",
    "nodes",
    "surface_nodes",
    "volume_m3",
    "voxel_volume_m3",
    "volume_ratio",
    "thickness_m",
    "min_dihedral_deg",
    "mean_dihedral_deg",
    "min_surface_angle_deg",
    "min_altitude_over_h",
    "mean_altitude_over_h",
    "share_below_quarter_h",
    "distance_median_m",
    "distance_95_m",
    "attempts",
    "seconds",
    "reason",
)


def measured_row(label, given_volume, points, cells, h):
    """A row of the table; altitudes over h, or over the mean edge of each element."""
    length = measure.mean_edges(points, cells) if h is None else h
    altitudes = measure.smallest_altitudes(points, cells) / length
    surface = measure.boundary_triangles(cells)
    angles = measure.smallest_dihedral_angles(points, cells)
    volume = measure.tet_volumes(points, cells).sum()
    area = measure.surface_area(points, surface)
    return quality_row(
        label,
        "ok",
        tets=len(cells),
        nodes=len(points),
        surface_nodes=len(np.unique(surface)),
        volume_m3=float(volume),
        voxel_volume_m3=float(given_volume),
        volume_ratio=float(volume / given_volume),
        thickness_m=float(2 * volume / area),
        min_dihedral_deg=float(angles.min()),
        mean_dihedral_deg=float(angles.mean()),
        min_surface_angle_deg=measure.smallest_angle(points, surface),
        min_altitude_over_h=float(altitudes.min()),
        mean_altitude_over_h=float(altitudes.mean()),
        share_below_quarter_h=float((altitudes < 0.25).mean()),
    )


def quality_row(label, status, **values):
    """A row of the table; columns without a value are empty."""
    return dict.fromkeys(QUALITY, "") | {"label": int(label), "status": status, **values}
