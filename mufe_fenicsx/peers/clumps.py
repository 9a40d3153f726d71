"""A grain as a clump of overlapping spheres.

Centres lie on the medial axis of the grain, where its distance map has its ridge; each sphere is
the largest that fits there. This is the distance map of V. Angelidakis, S. Nadimi, M. Otsubo
& S. Utili, CLUMP: A code library to generate universal multi-sphere particles, SoftwareX 15,
2021, 100735, but the distances are those of the triangles, not of voxels, and the next sphere
is the one that covers most of what is not covered yet. That greedy choice covers at
least 1 - 1/e of what the best choice of as many spheres would (G. L. Nemhauser, L. A. Wolsey
& M. L. Fisher, Math. Program. 14, 1978, 265-294).

Spheres inside a grain cover less than all of it. So all radii grow by one length, until the
union of the spheres has the volume of the grain; what remains is told by its errors.
"""

import heapq
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter
from scipy.optimize import brentq
from scipy.spatial import cKDTree

from ..geometry.form.shape import inertia_of

#: Cells of the grid in the diameter of the ball of equal volume.
CELLS = 32
#: A centre is on the medial axis where distances to neighbouring cells rise by less than this
#: part of the way to them; elsewhere they rise by all of it, towards the axis.
RIDGE = 0.85


@dataclass(frozen=True)
class Clump:
    """Spheres of one grain, in the frame of its principal axes, and how they differ from it."""

    centres: np.ndarray  #: [m], shape (n, 3)
    radii: np.ndarray  #: [m], shape (n,)
    growth: float  #: by which radii exceed the largest that fit [m]
    volume_error: float  #: of the union of the spheres, over the grain's volume [-]
    centroid_error: float  #: distance of the centroids over the diameter of the grain [-]
    inertia_error: float  #: norm of the difference of the inertia tensors over the grain's [-]
    missing: float  #: part of the grain's volume that no sphere covers [-]
    protruding: float  #: volume of the clump outside the grain, over the grain's [-]


def clump_of(body, num_spheres=20, missing=0.0, grow=True):
    """The :class:`Clump` of a :class:`~mufe_fenicsx.peers.body.Body`.

    Args:
        body: The grain.
        num_spheres: Most spheres.
        missing: Part of the volume that may stay uncovered: fewer spheres are taken once
            no more than that is.
        grow: Let all radii grow by one length, so that the union has the grain's volume.
    """
    cell = body.diameter / CELLS
    half = np.ceil(np.abs(body.points).max(axis=0) / cell).astype(np.int64) + 3
    axes = [cell * np.arange(-n, n + 1) for n in half]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    depth = -body.signed_distance(nodes.reshape(-1, 3)).reshape(nodes.shape[:3])
    on_axis = _medial(depth, cell)
    inside = depth > 0
    chosen = greedy_cover(
        nodes[on_axis], depth[on_axis], nodes[inside], num_spheres, missing * inside.sum()
    )
    centres, radii = nodes[on_axis][chosen], depth[on_axis][chosen]
    far = _outside(nodes.reshape(-1, 3), centres, radii).reshape(depth.shape)

    def part_within(field):
        """Part of each cell where a signed distance is below 0, to first order."""
        return np.clip(0.5 - field / cell, 0, 1)

    growth = 0.0
    if grow:
        most = float(np.abs(depth.min())) + far.max()
        growth = brentq(
            lambda g: part_within(far - g).sum() * cell**3 - body.volume, -radii.min(), most
        )
        growth = max(growth, 0.0)
    clump, grain = part_within(far - growth), part_within(-depth)
    volume = clump.sum() * cell**3
    weight = clump.ravel() / clump.sum()
    centroid = weight @ nodes.reshape(-1, 3)
    arm = nodes.reshape(-1, 3) - centroid
    second = volume * ((arm * weight[:, None]).T @ arm)
    own = np.diag(body.moments)
    return Clump(
        centres=centres,
        radii=radii + growth,
        growth=float(growth),
        volume_error=float(volume / body.volume - 1),
        centroid_error=float(np.linalg.norm(centroid) / body.diameter),
        inertia_error=float(np.linalg.norm(inertia_of(second) - own) / np.linalg.norm(own)),
        missing=float(np.maximum(grain - clump, 0).sum() / grain.sum()),
        protruding=float(np.maximum(clump - grain, 0).sum() / grain.sum()),
    )


def greedy_cover(centres, radii, targets, most, left=0.0):
    """Spheres in turn, each the one that covers most targets that none before it covers.

    What a sphere adds only falls as others come, so that an old count is a bound, and
    few spheres are counted anew for each choice.

    Args:
        centres, radii: Of the spheres to choose from, shapes (n, 3) and (n,).
        targets: Points to cover, shape (m, 3).
        most: Number of spheres.
        left: Number of targets that may stay uncovered.

    Returns:
        Indices of the chosen spheres, at least one; fewer than ``most`` where none adds anything.
    """
    open_ = np.asarray(targets, dtype=float)
    # A little more than the radius: a bound, whatever the rounding.
    first = cKDTree(open_).query_ball_point(centres, (1 + 1e-9) * radii, return_length=True)
    heap = [(-float(n), -radius, k) for k, (n, radius) in enumerate(zip(first, radii, strict=True))]
    heapq.heapify(heap)
    chosen = []
    while heap and len(chosen) < most and len(open_) > left:
        added = {}
        while True:
            bound, tie, k = heap[0]
            if k in added:
                break
            arm = open_ - centres[k]
            added[k] = np.einsum("ij,ij->i", arm, arm) <= radii[k] ** 2
            heapq.heapreplace(heap, (-float(np.count_nonzero(added[k])), tie, k))
        if bound == 0:
            break
        heapq.heappop(heap)
        chosen.append(k)
        open_ = open_[~added[k]]
    return np.array(chosen or [int(np.argmax(radii))], dtype=np.int64)


def _medial(depth, cell):
    """Nodes of the grid inside the grain that lie on its medial axis."""
    rise = np.full(depth.shape, -np.inf)
    cross = np.zeros((3, 3, 3), dtype=bool)
    for way, norm in ((1, 1.0), (2, np.sqrt(2)), (3, np.sqrt(3))):
        cross[:] = np.abs(np.indices((3, 3, 3)) - 1).sum(axis=0) == way
        rise = np.maximum(rise, (maximum_filter(depth, footprint=cross) - depth) / (cell * norm))
    found = (depth > 0.5 * cell) & (rise < RIDGE)
    # The deepest node is on it whatever the grid.
    found.ravel()[np.argmax(depth)] = True
    return found


def _outside(points, centres, radii):
    """Distance of points from the union of spheres, negative inside it."""
    nearest = np.full(len(points), np.inf)
    for centre, radius in zip(centres, radii, strict=True):
        np.minimum(nearest, np.linalg.norm(points - centre, axis=1) - radius, out=nearest)
    return nearest
