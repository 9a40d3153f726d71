"""Strain between the centres of neighbouring grains, by the Delaunay cells that they span.

The displacement of the grains is linear within each tetrahedron of four neighbours. A grain has
the mean over all tetrahedra at its centre, which is a mean over the polyhedron of its neighbours:
what its own wobbling adds to some of them it takes from the others.

Compression is positive, as in the history of a run.

Sources: K. Bagi, Mech. Mater. 22, 1996, 165-177; O. Durán, N. P. Kruyt & S. Luding, Int. J.
Solids Struct. 47, 2010, 2234-2245. Here strains are finite: logarithmic (Hencky).
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, Delaunay, QhullError, Voronoi
from scipy.spatial.transform import Rotation

from mufe_fenicsx.analysis.by_grain import sum_by_grain
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.measure import face_normals, smallest_altitudes, tet_volumes

#: A cell is flat if its least height is less than this part of its longest edge.
FLAT = 0.1
#: A cell is long if an edge, over the distance of its two grains in contact, exceeds so many times
#: the median of all edges: others have room between these two.
LONG = 2.0
#: Volume over the cube of the longest edge below which a cell has none: rounding.
NO_VOLUME = 1e-9


@dataclass(frozen=True)
class DelaunayCells:
    """Tetrahedra between the centres of grains that are neighbours."""

    corners: np.ndarray  #: places of the grains in the list, shape (num_cells, 4)
    volume: np.ndarray  #: [m³], shape (num_cells,)
    inside: np.ndarray  #: whether cells close round a grain, shape (num_grains,)

    @property
    def num_grains(self):
        """Number of grains, those without a cell too."""
        return self.inside.size

    def sum_at_grains(self, values):
        """Sums over the cells at each grain, shape (num_grains, …).

        Args:
            values: Of each cell, shape (num_cells, …).
        """
        return sum_by_grain(np.repeat(values, 4, axis=0), self.corners.ravel(), self.num_grains)


def delaunay_cells(centre, radius):
    """The tetrahedra between neighbouring grains, without the hull's flat and long ones.

    Centres near a wall lie nearly in a plane, or beside a gap: cells there are flat, or join
    grains that are no neighbours. From the hull inwards cells are left out while they are flat
    (:data:`FLAT`) or long (:data:`LONG`); inside, such a cell is a part of the whole and stays.
    Cells without a volume, as those of a lattice, are left out everywhere.

    Args:
        centre: Centres of the grains [m], shape (num_grains, 3).
        radius: Of balls of their volumes [m], shape (num_grains,).

    Returns:
        :class:`DelaunayCells`; there is one at least.

    Raises:
        InputError: There are fewer than four grains, or they lie in a plane or far apart.
    """
    centre, radius = np.asarray(centre, dtype=float), np.asarray(radius, dtype=float)
    what = f"{len(centre)} centres of grains span no cell, expected four neighbours at least"
    if len(centre) < 4:
        raise InputError(what)
    middle, size = centre.mean(axis=0), np.ptp(centre, axis=0).max() or 1.0
    try:
        found = Delaunay((centre - middle) / size)
    except QhullError as error:
        raise InputError(f"{what} that are not in a plane") from error
    corners = found.simplices.astype(np.int64)
    volume = tet_volumes(centre, corners)
    turned = volume < 0
    corners[turned] = corners[turned][:, [1, 0, 2, 3]]
    neighbours = found.neighbors.copy()
    neighbours[turned] = neighbours[turned][:, [1, 0, 2, 3]]
    volume = np.abs(volume)
    left_out = _peeled(centre, radius, corners, neighbours)
    hull = np.append(left_out, True)[neighbours] & ~left_out[:, None]  # faces without a cell beyond
    _, longest = _edges(centre, corners)
    kept = ~left_out & (volume > NO_VOLUME * longest**3)
    if not kept.any():
        raise InputError(what)
    inside = np.zeros(len(centre), dtype=bool)
    inside[corners[kept]] = True
    cell, face = np.nonzero(hull)
    for k in range(1, 4):  # the corners of a face are all but the one that it is opposite to
        inside[corners[cell, (face + k) % 4]] = False
    return DelaunayCells(corners[kept], volume[kept], inside)


def _edges(centre, corners):
    """Lengths of the six edges of each cell, in the order of triu_indices, and the longest [m]."""
    i, j = np.triu_indices(4, 1)
    length = np.linalg.norm(centre[corners[:, i]] - centre[corners[:, j]], axis=2)
    return length, length.max(axis=1)


def _peeled(centre, radius, corners, neighbours):
    """Whether a cell is left out, from the hull inwards, shape (num_cells,)."""
    length, longest = _edges(centre, corners)
    i, j = np.triu_indices(4, 1)
    apart = length / (radius[corners[:, i]] + radius[corners[:, j]])  # 1: they touch
    flat = smallest_altitudes(centre, corners) < FLAT * longest
    poor = flat | (apart > LONG * np.median(apart)).any(axis=1)
    gone = np.zeros(len(corners), dtype=bool)
    while True:
        at_hull = np.append(gone, True)[neighbours].any(axis=1)  # a neighbour of -1 is none
        more = poor & at_hull & ~gone
        if not more.any():
            return gone
        gone |= more


@dataclass(frozen=True)
class GrainStrain:
    """What the cells around each grain do between two states; nan where a grain has none."""

    num_cells: np.ndarray  #: at the grain, shape (num_grains,)
    inside: np.ndarray  #: whether they close round it, shape (num_grains,)
    volume: np.ndarray  #: a quarter of its cells before and now [m³], shape (2, num_grains)
    gradient: np.ndarray  #: mean deformation gradient [-], shape (num_grains, 3, 3)
    rotation: np.ndarray  #: of it, proper matrices, shape (num_grains, 3, 3)
    strain: np.ndarray  #: -ln U, compression positive [-], shape (num_grains, 3, 3)

    @property
    def strain_volume(self):
        """Loss of volume of the cells, -ln(V/V₀) [-], shape (num_grains,)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return -np.log(self.volume[1] / self.volume[0])

    @property
    def strain_deviator(self):
        """√(2/3 e:e) of the deviator e of the strain [-], shape (num_grains,)."""
        mean = np.trace(self.strain, axis1=1, axis2=2) / 3
        e = self.strain - mean[:, None, None] * np.eye(3)
        return np.sqrt(2 / 3 * (e**2).sum(axis=(1, 2)))


def grain_strain(cells, before, now):
    """Mean deformation of the cells around each grain.

    With the area vectors A of a cell, outward and opposite to its corners, its deformation
    gradient times its volume is V F = -Σ x ⊗ A / 3 over its corners: no flat cell is divided by.
    The mean of a grain is F̄ = Σ V F / Σ V over its cells, and its polar decomposition F̄ = R U
    gives the rotation of the neighbourhood and the strain ln U.

    Args:
        cells: :class:`DelaunayCells` of the centres before.
        before, now: Centres [m], shape (num_grains, 3).

    Returns:
        :class:`GrainStrain`; nan where cells turn inside out in the mean, too.
    """
    before, now = np.asarray(before, dtype=float), np.asarray(now, dtype=float)
    areas = face_normals(before, cells.corners)
    gradient = -np.einsum("cai,caj->cij", now[cells.corners], areas) / 3
    volume_now = tet_volumes(now, cells.corners)
    total = cells.sum_at_grains(cells.volume[:, None])[:, 0]
    total_now = cells.sum_at_grains(volume_now[:, None])[:, 0]
    some = (total > 0) & (total_now > 0)
    mean = np.full((cells.num_grains, 3, 3), np.nan)
    mean[some] = cells.sum_at_grains(gradient)[some] / total[some, None, None]
    good = some & (np.linalg.det(np.where(some[:, None, None], mean, np.eye(3))) > 0)
    rotation, strain = (np.full(mean.shape, np.nan) for _ in range(2))
    u, stretch, vt = np.linalg.svd(mean[good])
    rotation[good] = u @ vt
    strain[good] = -np.swapaxes(vt, 1, 2) @ (np.log(stretch)[:, :, None] * vt)
    return GrainStrain(
        num_cells=np.bincount(cells.corners.ravel(), minlength=cells.num_grains),
        inside=cells.inside & good,
        volume=0.25 * np.where(some, [total, total_now], np.nan),
        gradient=mean,
        rotation=rotation,
        strain=strain,
    )


def rotation_vectors(rotation):
    """Axis times angle [rad], shape (num_grains, 3); nan where there is no rotation.

    A grain that turns by R_g turns beyond its neighbours, which turn by R̄, by R_g R̄ᵀ.

    Args:
        rotation: Proper rotation matrices, or nan, shape (num_grains, 3, 3).
    """
    found = np.full((len(rotation), 3), np.nan)
    known = np.isfinite(rotation).all(axis=(1, 2))
    if known.any():
        found[known] = Rotation.from_matrix(rotation[known]).as_rotvec()
    return found


def voronoi_volumes(centre, chosen):
    """Volumes of the Voronoi cells of some grains [m³], shape (num_grains,); nan of others.

    A cell is all that is nearer to its grain's centre than to any other: grain and voids. It has
    no end where a grain is at the hull, and does not see walls.

    Args:
        centre: Centres of all grains [m], shape (num_grains, 3).
        chosen: Which ones, such as :attr:`DelaunayCells.inside`, shape (num_grains,).
    """
    centre = np.asarray(centre, dtype=float)
    size, volume = np.ptp(centre, axis=0).max(), np.full(len(centre), np.nan)
    if not chosen.any():
        return volume
    found = Voronoi((centre - centre.mean(axis=0)) / size)
    for grain in np.flatnonzero(chosen):
        region = found.regions[found.point_region[grain]]
        if region and -1 not in region:
            volume[grain] = size**3 * ConvexHull(found.vertices[region]).volume
    return volume
