"""The surface of a grain in an image: closed, oriented, evenly meshed triangles."""

import numpy as np
import scipy.sparse
import skimage.measure

from .level_set import BETA
from .measure import surface_defect, surface_volume
from .remesh import (
    SurfaceError,
    collapse_short_edges,
    flip_long_edges,
    largest_surface,
    num_nodes,
    oriented,
    remesh,
    split_long_edges,
)

#: Vertices closer to a face of the image than this are put onto it [voxels].
SNAP = 0.1


def grain_surface(level_set, sizes, volume=None, nodes=None):
    """Triangles of the wanted size on the zero of a level set.

    Args:
        level_set: `LevelSet` of the grain; its beta is changed.
        sizes: Called with the level set and its isosurface; returns `Sizes` in voxels, for
            positions (z, y, x) as those of the level set.
        volume: Volume that the surface is to enclose [voxels]; None: as it comes.
        nodes: Nodes that the surface is to take, as `fitted`; None: as many as it takes.

    Returns:
        points in voxels, order (x, y, z) and counted from the corner of the
        image, shape (n, 3); triangles seen from outside, shape (m, 3); `Sizes`.

    Raises:
        SurfaceError: the grain is too small for its size or its surface is not sound.
    """
    if volume is not None:
        level_set.beta = BETA[1] / 2
    fine = isosurface(level_set)
    sizes = fitted(sizes(level_set, *fine), *fine, nodes)
    x, faces = remesh(*fine, sizes)
    x = relaxed(x, faces, level_set)
    for _ in range(3):
        x, faces = split_long_edges(x, faces, 1.6, sizes)
        x, faces = collapse_short_edges(x, faces, 0.55, sizes)
        faces = flip_long_edges(x, faces)
        x = relaxed(x, faces, level_set)
    if volume is not None:
        x = _restore_volume(x, faces, level_set, volume)
    for face in (level_set.lower, level_set.upper):
        x = np.where(np.abs(x - face) < SNAP, face, x)

    xyz = np.ascontiguousarray(x[:, ::-1] + 0.5)
    faces = oriented(xyz, faces)
    defect = surface_defect(xyz, faces)
    if defect:
        raise SurfaceError(f"surface has {defect}")
    return xyz, faces, sizes


def fitted(sizes, points, triangles, nodes):
    """Sizes times the factor that gives a surface so many nodes; as they are if that is None."""
    if nodes is None:
        return sizes
    return sizes.times((num_nodes(points, triangles, sizes) / nodes) ** 0.5)


def isosurface(level_set):
    """Marching cubes on the level set; the largest surface, (z, y, x) in voxels."""
    field = np.pad(level_set.nodes(), 1, constant_values=-0.5)
    if not field.max() > 0:
        raise SurfaceError("grain vanishes when its surface is smoothed")
    points, triangles, _, _ = skimage.measure.marching_cubes(field, 0.0, allow_degenerate=False)
    points, triangles = largest_surface(points.astype(float), triangles.astype(np.int64))
    return points - 1 + level_set.offset, triangles


def relaxed(x, faces, level_set, rounds=5):
    """Vertices evened out along the surface and put back onto it."""
    average = _neighbour_average(faces, len(x))
    x = project(x, level_set)
    for _ in range(rounds):
        move = 0.5 * (average @ x - x)
        _, normal = level_set.value_and_gradient(x)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        along = move - np.einsum("ij,ij->i", move, normal)[:, None] * normal
        x = project(x + along, level_set)
    return x


def project(x, level_set, rounds=4):
    """Positions moved along the gradient onto psi = 0 and kept within the image."""
    for _ in range(rounds):
        psi, gradient = level_set.value_and_gradient(x)
        step = -psi[:, None] * gradient / np.maximum((gradient**2).sum(axis=1), 1e-4)[:, None]
        length = np.linalg.norm(step, axis=1, keepdims=True)
        x = x + step * np.minimum(1, 0.5 / np.maximum(length, 1e-12))
        x = np.clip(x, level_set.lower, level_set.upper)
    return x


def _restore_volume(x, faces, level_set, volume):
    """Vertices after beta was set so that the triangles enclose ``volume`` (secant rule)."""

    def enclosed(beta, start):
        level_set.beta = float(np.clip(beta, *BETA))
        moved = project(start, level_set)
        return moved, abs(surface_volume(moved, faces)) - volume

    beta0, (x, excess0) = level_set.beta, enclosed(level_set.beta, x)
    beta1 = beta0 - np.sign(excess0) * 0.05
    for _ in range(6):
        x, excess1 = enclosed(beta1, x)
        if abs(excess1) < 1e-4 * volume or excess1 == excess0:
            break
        slope = (excess1 - excess0) / (beta1 - beta0)
        beta0, excess0 = beta1, excess1
        beta1 = float(np.clip(beta1 - excess1 / slope, *BETA))
        if beta1 == beta0:
            break
    return x


def _neighbour_average(faces, n):
    """Sparse matrix that takes the mean over the neighbours of each vertex."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    rows, columns = np.concatenate([edges, edges[:, ::-1]]).T
    matrix = scipy.sparse.coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(n, n)).tocsr()
    matrix.data[:] = 1
    degree = np.maximum(np.asarray(matrix.sum(axis=1)).ravel(), 1)
    return scipy.sparse.diags_array(1 / degree) @ matrix
