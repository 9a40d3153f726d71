"""The surface of a grain in an image: closed, oriented, evenly meshed triangles."""

import numpy as np
import scipy.sparse
import skimage.measure

from ..measure import compact, smallest_angle, surface_defect, surface_volume
from .creases import Creases
from .level_set import BETA, FIRST_BETA
from .remesh import (
    SurfaceError,
    collapse_short_edges,
    flip_long_edges,
    num_nodes,
    oriented,
    remesh,
    split_long_edges,
    with_cavities,
)
from .remesh_creased import remesh_creased
from .round_cut import ROUND, RoundGrid, reaches_cut
from .self_crossing import crossing_triangles
from .shells import in_largest_body

#: Free surfaces keep this distance from the border of the image, except where they end there
#: [voxels].
CLEARANCE = 0.05
#: A triangle with a smaller angle is a line [degrees].
LEAST_ANGLE = 0.5


def grain_surface(level_set, sizes, volume=None, nodes=None):
    """Triangles of the wanted size on the zero of a level set.

    Where the border of the image cuts the grain, its surface is plane and has a sharp edge.

    Args:
        level_set: `LevelSet` of the grain; its beta is changed.
        sizes: Called with the points of its isosurface; returns `Sizes` in voxels, for positions
            (z, y, x) as those of the level set.
        volume: Volume that the surface is to enclose [voxels]; None: as it comes.
        nodes: Nodes that the surface is to take, as `fitted`; None: as many as it takes.

    Returns:
        points in voxels, order (x, y, z) and counted from the corner of the
        image, shape (n, 3); triangles seen from outside, shape (m, 3); `Sizes`; which coordinates
        of each point the border of the image holds, shape (n, 3), all three where its edges meet;
        the neighbours of each point along its edges, shape (n, 2), -1 where there are none; and
        which points lie on the cylinder that cuts the grain, shape (n,).

    Raises:
        SurfaceError: the grain is too small for its size or its surface is not sound.
    """
    if volume is not None:
        level_set.beta = FIRST_BETA
    fine = isosurface(level_set)
    if volume is not None and fine[2].any():
        fine = _isosurface_around(level_set, volume, fine)
    points, triangles, tags = fine
    sizes = fitted(sizes(points), points, triangles, nodes)
    x, faces, tags = with_cavities(points, triangles, tags, sizes, _outer)
    x = relaxed(x, faces, tags, level_set)
    for _ in range(3):
        x, faces, tags = split_long_edges(x, faces, 1.6, sizes, tags)
        x, faces, tags = collapse_short_edges(x, faces, 0.55, sizes, tags)
        faces = flip_long_edges(x, faces, tags=tags)
        x = relaxed(x, faces, tags, level_set)
    if volume is not None:
        x = _restore_volume(x, faces, tags, level_set, volume)

    xyz = np.ascontiguousarray(x[:, ::-1] + 0.5)
    held = Held(x, faces, tags, level_set)
    planes, along = held.planes[:, ::-1].copy(), held.along
    planes[held.creases.rank == 2] = True
    faces = oriented(xyz, faces)
    defect = surface_defect(xyz, faces)
    if not defect and tags.any():
        if smallest_angle(xyz, faces) < LEAST_ANGLE:
            defect = "triangles without area"
        elif len(crossing_triangles(xyz, faces)):
            defect = "triangles that cut through each other"
    if defect:
        raise SurfaceError(f"surface has {defect}")
    return xyz, faces, sizes, planes, along, held.round


def _outer(points, triangles, tags, sizes):
    """The outer surface remeshed, with its creases if it has some."""
    if tags.any():
        return remesh_creased(points, triangles, tags, sizes)
    x, faces = remesh(points, triangles, sizes)
    return x, faces, np.zeros(len(faces), dtype=np.int64)


def fitted(sizes, points, triangles, nodes):
    """Sizes times the factor that gives a surface so many nodes; as they are if that is None."""
    if nodes is None:
        return sizes
    return sizes.times((num_nodes(points, triangles, sizes) / nodes) ** 0.5)


def isosurface(level_set):
    """Marching cubes on the level set; the surface of the largest body with its cavities.

    Returns:
        points (z, y, x) in voxels, triangles, and a tag for each: 0 on the free surface, otherwise
        `level_set.face_tag` of the face of the image that it lies in.
    """
    grid = RoundGrid(level_set) if reaches_cut(level_set) else level_set
    field, positions, ends = grid.nodes()
    if not field.max() > 0:
        raise SurfaceError("grain vanishes when its surface is smoothed")
    at, triangles, _, _ = skimage.measure.marching_cubes(field, 0.0, allow_degenerate=False)
    at, triangles = at.astype(float), triangles.astype(np.int64)
    # Between the two outermost layers, which are in the same place, lie the faces of the image.
    middle, tags = at[triangles].mean(axis=1), np.zeros(len(triangles), dtype=np.int64)
    for axis in range(3):
        first, last = middle[:, axis] < 1, middle[:, axis] > field.shape[axis] - 2
        tags = np.where(first & (ends[axis, 0] > 0), ends[axis, 0], tags)
        tags = np.where(last & (ends[axis, 1] > 0), ends[axis, 1], tags)
    points = np.column_stack(
        [np.interp(at[:, i], np.arange(len(positions[i])), positions[i]) for i in range(3)]
    )
    if tags.any():  # points on edges of the image have come together
        on_faces = np.zeros(points.shape, dtype=bool)
        for axis in range(3):
            for side in np.flatnonzero(ends[axis]):
                on_faces[:, axis] |= points[:, axis] == positions[axis][-side]
        together = np.flatnonzero(on_faces.sum(axis=1) > 1)
        _, first, number = np.unique(
            points[together], axis=0, return_index=True, return_inverse=True
        )
        same = np.arange(len(points))
        same[together] = together[first][number.ravel()]
        a, b, c = (triangles := same[triangles]).T
        kept = (a != b) & (b != c) & (c != a)
        triangles, tags = triangles[kept], tags[kept]
    points = grid.placed(points)
    kept = in_largest_body(points, triangles)
    return *compact(points, triangles[kept]), tags[kept]


def _isosurface_around(level_set, volume, found):
    """The isosurface after beta was set so that it encloses about ``volume`` (secant rule).

    The faces that the border cuts are then as large, and as many, as they are to be: a small one
    would otherwise vanish later, when the volume is restored.
    """
    beta0, excess0 = level_set.beta, abs(surface_volume(*found[:2])) - volume
    beta1 = beta0 - np.sign(excess0) * 0.1
    for _ in range(5):
        level_set.beta = float(np.clip(beta1, *BETA))
        found = isosurface(level_set)
        excess1 = abs(surface_volume(*found[:2])) - volume
        if abs(excess1) < 2e-3 * volume or excess1 == excess0:
            break
        slope = (excess1 - excess0) / (level_set.beta - beta0)
        beta0, excess0 = level_set.beta, excess1
        beta1 = float(np.clip(beta0 - excess1 / slope, *BETA))
        if beta1 == beta0:
            break
    return found


class Held:
    """What each vertex of a surface is held by, from the tags of the triangles around it.

    Args:
        x, faces, tags: The surface, as of `isosurface`.
        level_set: `LevelSet`.
    """

    def __init__(self, x, faces, tags, level_set):
        n = len(x)
        #: Where the vertex stays in a face of the image normal to that axis, shape (n, 3).
        self.planes = np.zeros((n, 3), dtype=bool)
        #: Where it is on the free surface, shape (n,).
        self.free = np.zeros(n, dtype=bool)
        self.free[faces[tags == 0]] = True
        self.cut = level_set.cut
        #: Where it stays on the cylinder that cuts the grain, shape (n,).
        self.round = np.zeros(n, dtype=bool)
        self.round[faces[tags == ROUND]] = True
        for tag in np.unique(tags[(tags > 0) & (tags != ROUND)]):
            self.planes[faces[tags == tag], (tag - 1) // 2] = True
        lower = x - level_set.lower < level_set.upper - x
        #: Positions along each axis that it is held at.
        self.place = np.where(lower, level_set.lower, level_set.upper)
        self.creases = Creases(faces, tags, n)
        self._average = _neighbour_average(faces, n)
        #: Neighbours along the edge that it is on, -1 if it is on none, shape (n, 2).
        self.along = self.creases.neighbours()

    def restrict(self, vectors, x):
        """Set the parts of vectors at vertices to zero, in place, that faces do not allow."""
        if self.cut is not None and self.round.any():
            vectors[:] = self.cut.without_radial(vectors, x, self.round)
        vectors[self.planes] = 0
        vectors[~self.free] = 0

    def within(self, x, level_set):
        """Vertices kept in the image: those of faces in them, others a little off."""
        off = np.where(self.planes.any(axis=1) | self.round, 0.0, CLEARANCE)[:, None]
        low, high = level_set.lower + off, level_set.upper - off
        if self.cut is None:
            return np.clip(x, low, high)
        x = x.copy()
        x[:, 0] = np.clip(x[:, 0], low[:, 0], high[:, 0])
        return self.cut.kept(x, self.round, CLEARANCE)

    def evened(self, x):
        """Moves that bring vertices half-way to the mean of their neighbours.

        On an edge, those that make the distances to both neighbours along it more alike (means of
        neighbours would draw three vertices around a small face into one). Where edges meet, none.
        """
        move = 0.5 * (self._average @ x - x)
        move[self.creases.rank > 0] = 0
        on = np.flatnonzero(self.creases.rank == 1)
        before, after = x[self.along[on]].transpose(1, 0, 2)
        tangent = after - before
        tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
        differ = np.linalg.norm(after - x[on], axis=1) - np.linalg.norm(before - x[on], axis=1)
        move[on] = 0.25 * differ[:, None] * tangent
        return move


def relaxed(x, faces, tags, level_set, rounds=5):
    """Vertices evened out along the surface and put back onto it."""
    held = Held(x, faces, tags, level_set)
    x = project(x, level_set, held)
    for _ in range(rounds):
        move = held.evened(x)
        _, normal = level_set.value_and_gradient(x)
        held.restrict(normal, x)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        along = move - np.einsum("ij,ij->i", move, normal)[:, None] * normal
        x = project(x + along, level_set, held)
    return x


def project(x, level_set, held, rounds=4):
    """Positions moved along the gradient onto psi = 0 and kept within the image.

    Vertices in faces of the image stay in them; where these are not free they stay as they are.
    """
    x = np.where(held.planes, held.place, x)
    if held.cut is not None:
        x = held.within(x, level_set)
    for _ in range(rounds):
        psi, gradient = level_set.value_and_gradient(x)
        held.restrict(gradient, x)
        step = -psi[:, None] * gradient / np.maximum((gradient**2).sum(axis=1), 1e-4)[:, None]
        length = np.linalg.norm(step, axis=1, keepdims=True)
        x = held.within(x + step * np.minimum(1, 0.5 / np.maximum(length, 1e-12)), level_set)
    return x


def _restore_volume(x, faces, tags, level_set, volume):
    """Vertices after beta was set so that the triangles enclose ``volume`` (secant rule)."""
    held = Held(x, faces, tags, level_set)

    def enclosed(beta, start):
        level_set.beta = float(np.clip(beta, *BETA))
        moved = project(start, level_set, held)
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
