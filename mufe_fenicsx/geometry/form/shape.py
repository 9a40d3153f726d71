"""Size and form of grains: what is reported of a grain of sand.

Length L, width W and thickness T are the extents along the principal axes of inertia, sorted, as
callipers along these axes would read them. Elongation W/L and flatness T/W
are those of Th. Zingg (Schweiz. mineral. petrogr. Mitt. 15, 1935, 39-140). Sphericity is
the surface of the ball of equal volume over that of the grain (H. Wadell, J. Geol. 40, 1932,
443-451), convexity the volume over that of the convex hull.
"""

import math

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.spatial import ConvexHull

from ...errors import InputError
from ..image.labels import grains_in
from ..measure import boundary_triangles, surface_area, tet_volumes

#: Standard deviation of the filter of voxels before their surface is drawn [voxels].
SMOOTHING = 0.7

#: What the lengths of the table are, in a line.
LENGTHS = (
    "length L >= width W >= thickness T: extents along the grain's principal axes of inertia, "
    "sorted; elongation W/L, flatness T/W"
)
#: Columns of the table, with units.
COLUMNS = (
    "label", "volume_m3", "surface_m2", "equivalent_diameter_m", "length_m", "width_m",
    "thickness_m", "elongation", "flatness", "sphericity", "convexity",
    *(f"inertia_{a}_m5" for a in ("xx", "yy", "zz", "xy", "yz", "xz")),
    *(f"principal_{k}_m5" for k in (1, 2, 3)),
    *(f"axis_{k}_{a}" for k in (1, 2, 3) for a in "xyz"),
    "azimuth_deg", "inclination_deg", "centroid_x_m", "centroid_y_m", "centroid_z_m",
)  # fmt: skip


def tet_moments(points, cells):
    """Volume, centroid and second moment of a body of tetrahedra, exact for the mesh.

    Args:
        points: Nodes [m], shape (n, 3).
        cells: Tetrahedra, shape (m, 4).

    Returns:
        Volume [m³]; centroid [m], shape (3,); integral of r rᵀ about it [m⁵], shape (3, 3).
    """
    volume = tet_volumes(points, cells)
    total = volume.sum()
    centroid = volume @ points[cells].mean(axis=1) / total
    x = points[cells] - centroid
    sums = x.sum(axis=1)
    second = np.einsum("c,cai,caj->ij", volume, x, x) + np.einsum("c,ci,cj->ij", volume, sums, sums)
    return float(total), centroid, second / 20


def voxel_moments(coordinates, voxel_size):
    """The same of a set of cubes.

    Args:
        coordinates: Their centres [m], shape (n, 3).
        voxel_size: Their edge [m].
    """
    cube = voxel_size**3
    centroid = coordinates.mean(axis=0)
    r = coordinates - centroid
    second = cube * (r.T @ r) + len(r) * cube * voxel_size**2 / 12 * np.eye(3)
    return len(r) * cube, centroid, second


def inertia_of(second):
    """Inertia tensor for unit density [m⁵] from the second moment: tr(S) 1 - S (eq. 8)."""
    return np.trace(second) * np.eye(3) - second


def principal(inertia):
    """Principal moments, smallest first, and axes in rows, right-handed; the first points up.

    The first is the axis of the smallest moment: the long axis of the grain.
    """
    moments, vectors = np.linalg.eigh(inertia)
    axes = vectors.T
    for k in (0, 1):
        # z >= 0, or the first of x and y that is not zero positive.
        lead = next(c for c in (*axes[k][::-1], 1.0) if abs(c) > 1e-12)
        axes[k] *= math.copysign(1.0, lead)
    axes[2] = np.cross(axes[0], axes[1])
    return moments, axes


def describe(label, moments, surface_points, area):
    """One row of the table, a dict with the keys `COLUMNS`.

    Args:
        label: Of the grain.
        moments: Volume, centroid, second moment, as by `tet_moments`.
        surface_points: Points on the surface [m], shape (n, 3).
        area: Of the surface [m²].
    """
    volume, centroid, second = moments
    inertia = inertia_of(second)
    values, axes = principal(inertia)
    along = (surface_points - centroid) @ axes.T
    # Symmetric bodies leave axes open: the long one is the longest as measured.
    short, middle, long = np.sort(np.ptp(along, axis=0))
    hull = ConvexHull(surface_points - centroid).volume
    x, y, z = axes[0]
    row = {
        "label": int(label),
        "volume_m3": volume,
        "surface_m2": area,
        "equivalent_diameter_m": (6 * volume / math.pi) ** (1 / 3),
        "length_m": long,
        "width_m": middle,
        "thickness_m": short,
        "elongation": middle / long,
        "flatness": short / middle,
        "sphericity": math.pi ** (1 / 3) * (6 * volume) ** (2 / 3) / area,
        "convexity": volume / hull,
        "azimuth_deg": math.degrees(math.atan2(y, x)) % 360,
        "inclination_deg": math.degrees(math.asin(min(abs(z), 1.0))),
    }
    for name, (i, j) in zip(
        ("xx", "yy", "zz", "xy", "yz", "xz"),
        ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)),
        strict=True,
    ):
        row[f"inertia_{name}_m5"] = inertia[i, j]
    for k in range(3):
        row[f"principal_{k + 1}_m5"] = values[k]
        for a, value in zip("xyz", axes[k], strict=True):
            row[f"axis_{k + 1}_{a}"] = value
    for a, value in zip("xyz", centroid, strict=True):
        row[f"centroid_{a}_m"] = value
    return {name: row[name] if name == "label" else float(row[name]) for name in COLUMNS}


def shapes_of_meshes(grains):
    """Rows of the table for :class:`~mufe_fenicsx.geometry.grains.Grains`, one a grain."""
    rows = []
    for g, label in enumerate(grains.labels):
        points, cells = grains.grain(g)
        triangles = boundary_triangles(cells)
        rows.append(
            describe(
                label,
                tet_moments(points, cells),
                points[np.unique(triangles)],
                surface_area(points, triangles),
            )
        )
    return rows


def label_surface(labels, label, box, voxel_size):
    """Surface of a label, at half of its voxels' smoothed indicator, with the volume of these.

    Args:
        labels: (z, y, x).
        label: One of them.
        box: Slices (z, y, x) around it.
        voxel_size: [m].

    Returns:
        Points (x, y, z) from the image's corner [m], outward triangles, and moments of its voxels
        (:func:`voxel_moments`).

    Raises:
        InputError: It is a voxel thick.
    """
    from skimage.measure import marching_cubes

    mask = np.pad(labels[box] == label, 4)
    corner = np.array([side.start - 4 for side in box])
    coordinates = ((np.argwhere(mask) + corner + 0.5) * voxel_size)[:, ::-1]
    moments = voxel_moments(coordinates, voxel_size)
    smooth = gaussian_filter(mask.astype(np.float32), SMOOTHING)
    if smooth.max() <= 0.5:
        raise InputError(
            f"grain {label} has {len(coordinates)} voxels, expected grains thicker than one"
        )
    vertices, triangles, *_ = marching_cubes(smooth, 0.5)
    vertices = ((vertices + corner + 0.5) * voxel_size)[:, ::-1]
    inside = vertices - moments[1]
    x = inside[triangles]
    volume = np.einsum("ij,ij->", x[:, 0], np.cross(x[:, 1], x[:, 2])) / 6
    factor = (moments[0] / abs(volume)) ** (1 / 3)
    triangles = triangles if volume > 0 else triangles[:, ::-1]
    return moments[1] + factor * inside, triangles, moments


def shapes_of_labels(labels, voxel_size):
    """Rows of the table for labelled voxels, one a grain.

    Volume and inertia are those of the cubes. Surface, lengths and hull belong to the
    surface at half of the voxels' smoothed indicator, scaled to the volume of the cubes: staircases
    of voxels have an area of their own.

    Args:
        labels: 0 void, else grains, shape (nz, ny, nx).
        voxel_size: [m].

    Raises:
        InputError: labels that cannot be used.
    """
    labels = np.asarray(labels)
    if labels.ndim != 3 or labels.dtype.kind not in "biu":
        raise InputError(
            f"labels have {labels.ndim} axes of type {labels.dtype}, expected integers, (z, y, x)"
        )
    if labels.min() < 0 or labels.max() == 0:
        raise InputError(
            f"labels are {labels.min()} to {labels.max()}, expected 0 for void and grains from 1"
        )
    rows = []
    for label, box in grains_in(labels.astype(np.int32)):
        surface, triangles, moments = label_surface(labels, label, box, voxel_size)
        rows.append(describe(label, moments, surface, surface_area(surface, triangles)))
    return rows


def sizes_by_mass(rows):
    """Particle size distribution: equivalent diameters [m] and the mass finer than each [-].

    Half of a grain's own mass counts as finer than it, so that the median does not depend on
    the order of ties.
    """
    diameter = np.array([row["equivalent_diameter_m"] for row in rows])
    volume = np.array([row["volume_m3"] for row in rows])
    order = np.argsort(diameter)
    finer = (np.cumsum(volume[order]) - 0.5 * volume[order]) / volume.sum()
    return diameter[order], finer


def size_at(rows, part):
    """Diameter than which ``part`` of the mass is finer, d50 for 0.5 [m]."""
    diameter, finer = sizes_by_mass(rows)
    return float(np.interp(part, finer, diameter))
