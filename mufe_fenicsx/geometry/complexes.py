"""One surface for all grains: faces that two grains share are there once.

A grid of cells of half the wanted length of edges takes in each cell the label that prevails
there. Surface nets (S. F. F. Gibson, MICCAI 1998, 888-898; here VTK's) put a node where cells of
different labels meet and a facet between each two of them. Nodes then move to where the smoothed
indicators phi of all labels around them are equal,

    phi_a = phi_b        on a face (void counts as a label),
    phi_a = phi_b = phi_c  on a line where three meet, and so on,

and evenly along these, while edges are brought to the wanted length (`complex_edges`). Contacts
that are narrower than an element are opened: both grains get a face of their own. Lengths in
voxels of the image, positions (z, y, x) from its corner.
"""

from dataclasses import dataclass

import numpy as np
import pyvista
import scipy.ndimage
import scipy.sparse
import vtk

from ..kernels.spline import spline_value_and_gradient
from .cells import prevailing
from .complex_edges import evened, opened
from .joined import parted
from .labels import grains_in
from .level_set import BETA, margin
from .measure import surface_volume

#: Labels that meet at a node at most; rarer meetings keep the first ones.
MOST_LABELS = 4
#: Standard deviation of the filter by which cells choose their label, over their edge, at least.
PREVAIL = 0.35
#: Edge of cells over the wanted length of edges.
CELL = 0.5
#: Rounds of moving nodes evenly along their faces.
ROUNDS = 6
#: Lengths that edges are brought to in turn, over the wanted one.
COARSENED = (0.7, 1.0, 1.0, 1.0)
#: Area of a face between two grains at least, over the square of the wanted length of edges.
SMALLEST = 0.8
#: Difference of smoothed indicators at which a node is not near a place where they are equal.
LOST = 0.25
#: Area of facets at least, over the square of a cell's edge, where nodes move.
FOLD = 0.1


@dataclass
class Complex:
    """Facets between labels."""

    x: np.ndarray  #: nodes, shape (num_nodes, 3)
    facets: np.ndarray  #: shape (num_facets, 3), seen from the second label of each
    sides: np.ndarray  #: labels on both sides of a facet, 0 void, shape (num_facets, 2)
    labels: np.ndarray  #: labels around each node, -1 none, shape (num_nodes, MOST_LABELS)
    held: np.ndarray  #: nodes on a face of the image normal to an axis, shape (num_nodes, 3)

    def grain(self, label):
        """Nodes of a grain, its triangles seen from outside, and which nodes it shares."""
        mine = (self.sides == label).any(axis=1)
        triangles = self.facets[mine].copy()
        inward = self.sides[mine, 1] == label
        triangles[inward] = triangles[inward][:, ::-1]
        nodes, numbered = np.unique(triangles, return_inverse=True)
        other = np.where(inward, self.sides[mine, 0], self.sides[mine, 1])
        shared = np.isin(nodes, triangles[other > 0])
        return nodes, numbered.reshape(-1, 3), shared


def grain_complex(labels, size, smoothing, keep_volume=True):
    """The facets between all grains of an image, and between them and the void.

    Args:
        labels: 0 void, grains from 1.
        size: Wanted length of edges [voxels].
        smoothing: Standard deviation of the filter of surfaces [voxels].
        keep_volume: Move free faces so that each grain keeps the volume of its voxels.

    Returns:
        A `Complex`.
    """
    wide = max(smoothing, PREVAIL * CELL * size)
    surface, spacing = raw_complex(labels, CELL * size, wide)
    start, offset, shape = surface.x, np.zeros(labels.max() + 1), np.array(labels.shape)
    fields = _smoothed(labels, wide)
    surface.x = _moved(surface, start, fields, offset, shape, spacing.min(), ROUNDS)
    if wide > smoothing:
        # The wider filter had slopes that reach nodes which are far from where they belong.
        fields = _smoothed(labels, smoothing)
        surface.x = _moved(surface, start, fields, offset, shape, spacing.min(), ROUNDS)
    for coarse in COARSENED:
        surface = _evened(surface, coarse * size)
        surface.x = _moved(surface, surface.x, fields, offset, shape, spacing.min(), 6)
    start = surface.x
    for _ in range(4 if keep_volume else 0):
        offset = _offsets(surface, fields, offset, np.bincount(labels.ravel()))
        surface.x = _moved(surface, start, fields, offset, shape, spacing.min(), 0)
    surface = _evened(surface, size)
    _part(surface, size)
    return surface


def raw_complex(labels, size, smoothing):
    """The complex of cells of about a size, and their edges along each axis.

    Args:
        labels: 0 void, grains from 1.
        size: Edge of cells [voxels].
        smoothing: Standard deviation of the filter by which cells choose their label [voxels].
    """
    cells, spacing = prevailing(labels, size, smoothing)
    return _surface_nets(cells, spacing), spacing


def _part(surface, size):
    """Move nodes out of grains that they are inside of: faces of coarse facets near an edge."""
    facets, owner = [], []
    for label in np.unique(surface.sides[surface.sides > 0]):
        nodes, triangles, _ = surface.grain(label)
        x = surface.x[nodes]
        if surface_volume(x, triangles) < 0:
            triangles = triangles[:, ::-1]
        facets.append(nodes[triangles])
        owner.append(np.full(len(triangles), label))
    areas = _areas(surface.x, surface.facets)
    normal = areas / np.maximum(np.linalg.norm(areas, axis=1, keepdims=True), 1e-300)

    def safe(new, step):
        step[surface.held] = 0
        return _without_folds(surface.facets, new - step, step, normal, FOLD * size**2)

    return parted(surface.x, np.concatenate(facets), np.concatenate(owner), size, safe)


def _offsets(surface, fields, offset, volumes):
    """What phi of the void gains around each grain, whose free face then encloses its volume."""
    offset = offset.copy()
    x = surface.x
    areas = _areas(x, surface.facets)
    # Facets are seen from their second side.
    inside = np.einsum("ij,ij->i", x[surface.facets].mean(axis=1), areas) / 3
    size = np.linalg.norm(areas, axis=1)
    free = (surface.sides == 0).any(axis=1) & ~surface.held[surface.facets].all(axis=1).any(axis=1)
    _, slopes = _constraints(surface, fields, x, offset)
    slope = np.linalg.norm(slopes[:, 0], axis=1)[surface.facets].mean(axis=1)
    for label in fields:
        first, second = surface.sides[:, 0] == label, surface.sides[:, 1] == label
        own = free & (first | second)
        if label == 0 or not own.any():
            continue
        volume = abs(inside[first].sum() - inside[second].sum())
        # Moved out by d, a face gains d times its area, and phi falls by its slope times d.
        change = (volumes[label] - volume) / max(size[own].sum(), 1e-12)
        mean_slope = (slope * size)[own].sum() / max(size[own].sum(), 1e-12)
        offset[label] = np.clip(offset[label] - mean_slope * change, *BETA)
    return offset


def _smoothed(labels, sigma):
    """A `_Field` for the void and for each grain."""
    fields = {0: _Field(labels == 0, (0, 0, 0), sigma)}
    for label, where in grains_in(labels):
        pad = margin(sigma)
        low = np.array([max(s.start - pad, 0) for s in where])
        part = tuple(slice(a, s.stop + pad) for a, s in zip(low, where, strict=True))
        fields[label] = _Field(labels[part] == label, low, sigma)
    return fields


class _Field:
    """The smoothed indicator of one label on the voxels around it."""

    def __init__(self, inside, low, sigma):
        smooth = scipy.ndimage.gaussian_filter(inside.astype(np.float32), sigma, mode="nearest")
        self.coefficients = scipy.ndimage.spline_filter(smooth, mode="nearest", output=np.float64)
        self.low = np.asarray(low)

    def __call__(self, x):
        value, gradient = np.empty(len(x)), np.empty((len(x), 3))
        spline_value_and_gradient(value, gradient, self.coefficients, x - 0.5 - self.low)
        return value, gradient


def _surface_nets(cells, spacing):
    """Surface nets of labelled cells, nodes at the corners of cells."""
    padded = np.pad(cells, 1)
    image = pyvista.ImageData(dimensions=padded.shape[::-1])
    image["label"] = padded.ravel()
    nets = vtk.vtkSurfaceNets3D()
    nets.SetInputData(image)
    nets.SetOutputMeshTypeToTriangles()
    nets.SmoothingOff()
    nets.SetBackgroundLabel(0)
    labels = np.unique(cells[cells > 0])
    nets.SetNumberOfLabels(len(labels))
    for i, label in enumerate(labels):
        nets.SetLabel(i, int(label))
    nets.Update()
    found = pyvista.wrap(nets.GetOutput())
    corner = np.round(np.asarray(found.points, dtype=float)[:, ::-1] - 0.5).astype(int)
    facets = np.array(found.regular_faces, dtype=np.int64)
    sides = np.array(found.cell_data["BoundaryLabels"], dtype=np.int64)
    sides[sides < 0] = 0
    # The eight cells around a node, those of the image only.
    around = np.full((len(corner), 8), -1)
    for k, step in enumerate(np.ndindex(2, 2, 2)):
        at = corner + step - 1
        inside = np.all((at >= 0) & (at < cells.shape), axis=1)
        around[inside, k] = cells[tuple(at[inside].T)]
    around = np.sort(around, axis=1)
    around[:, 1:][around[:, 1:] == around[:, :-1]] = -1
    around = -np.sort(-around, axis=1)[:, :MOST_LABELS]
    held = (corner == 0) | (corner == np.array(cells.shape))
    return Complex(corner * spacing, facets, sides, around, held)


def _evened(surface, size):
    """The same faces of triangles whose edges are of a length: a new `Complex`."""
    bits = surface.held[surface.facets].all(axis=1) @ np.array([1, 2, 4])
    found = opened(surface.x, surface.facets, surface.sides, bits, SMALLEST * size**2)
    x, facets, sides, bits = evened(*found, size)
    # What a node lies on: what the facets around it part.
    base = sides.max() + 1
    corner, free = np.repeat(facets.ravel(), 2), np.repeat(sides, 3, axis=0).ravel()
    known = (free > 0) | (np.repeat(bits, 6) == 0)
    node, label = np.divmod(np.unique(corner[known] * base + free[known]), base)
    place = np.arange(len(node)) - np.searchsorted(node, node)
    labels = np.full((len(x), MOST_LABELS), -1)
    labels[node[place < MOST_LABELS], place[place < MOST_LABELS]] = label[place < MOST_LABELS]
    held = np.zeros((len(x), 3), dtype=bool)
    for axis in range(3):
        held[facets[bits >> axis & 1 == 1].ravel(), axis] = True
    return Complex(x, facets, sides, labels, held)


def _moved(surface, start, fields, offset, shape, spacing, rounds):
    """Nodes on the level sets of their labels, in so many rounds evenly along them.

    Args:
        surface: A `Complex`.
        start: Places that nodes stay near, within a cell, shape (num_nodes, 3).
        fields: A `_Field` a label.
        offset: See `_offsets`, shape (largest label + 1,).
        shape: Of the image.
        spacing: Edge of the cells.
        rounds: Of evening out.
    """
    x = surface.x.copy()
    average = _average_within(surface) if rounds else None
    for turn in range(rounds + 4):
        residual, slopes = _constraints(surface, fields, x, offset)
        inverse = _inverse(slopes)
        if turn >= rounds // 2:
            # In a gap thinner than the filter there is no such place: such nodes are evened out.
            far = LOST + np.abs(offset).max()
            inverse[np.abs(residual).max(axis=1) > far] = 0
        step = np.zeros_like(x)
        if turn < rounds:
            along = average @ x - x
            across = np.einsum("njk,nk->nj", slopes, along)
            step = 0.5 * (along - np.einsum("nij,nj->ni", inverse, across))
        back = -np.einsum("nij,nj->ni", inverse, residual)
        step += (
            back
            * np.minimum(1, 0.3 * spacing / np.maximum(np.linalg.norm(back, axis=1), 1e-12))[
                :, None
            ]
        )
        new = np.clip(x + np.where(surface.held, 0, step), start - spacing, start + spacing)
        step = np.clip(new, 0, shape) - x
        if turn % 5 == 0:
            wanted = _wanted_normals(surface, fields, x)
        x = x + step * _without_folds(surface.facets, x, step, wanted, FOLD * spacing**2)[:, None]
    return x


def _without_folds(facets, x, step, wanted, least):
    """Parts of the steps that let no facet turn over or shrink below an area, shape (num_nodes,).

    Args:
        facets: Shape (num_facets, 3).
        x, step: Nodes and their moves, shape (num_nodes, 3).
        wanted: Unit normals that facets ought to have, shape (num_facets, 3).
        least: Area along that normal below which a facet may only grow.
    """
    part = np.ones(len(x))
    around = np.flatnonzero(step[facets].any(axis=(1, 2)))
    before = (_areas(x, facets[around]) * wanted[around]).sum(axis=1)
    for turn in range(30):
        corners = facets[around]
        new = x[corners] + part[corners][..., None] * step[corners]
        after = np.cross(new[:, 1] - new[:, 0], new[:, 2] - new[:, 0]) / 2
        after = (after * wanted[around]).sum(axis=1)
        bad = (after < least) & (after < before - 1e-9 * least)
        if not bad.any():
            return part
        slower = np.zeros(len(x), dtype=bool)
        slower[corners[bad]] = True
        part[slower] *= 0.4 if turn < 4 else 0.0
        near = slower[corners].any(axis=1)
        around, before = around[near], before[near]
    return np.zeros(len(x))


def _areas(x, facets):
    """Area vectors of facets."""
    a, b, c = x[facets[:, 0]], x[facets[:, 1]], x[facets[:, 2]]
    return np.cross(b - a, c - a) / 2


def _wanted_normals(surface, fields, x):
    """Normals of the smooth faces at the centres of facets; of the image's faces where they lie."""
    center = x[surface.facets].mean(axis=1)
    slope = np.zeros((len(center), 3))
    for side, sign in ((0, 1.0), (1, -1.0)):
        for label, at in _places(surface.sides[:, side]).items():
            slope[at] += sign * fields[label](center[at])[1]
    held = surface.held[surface.facets].all(axis=1)
    areas = _areas(x, surface.facets)
    # On a face of the image, and where no slope is left, the normal that there is.
    keep = held.any(axis=1) | (np.linalg.norm(slope, axis=1) < 1e-6)
    sign = np.sign((slope * areas).sum(axis=1)[~keep].sum())
    slope[keep] = sign * np.where(held, areas, 0)[keep] if keep.any() else slope[keep]
    return sign * slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-12)


def _constraints(surface, fields, x, offset):
    """phi_k - phi_first for the labels around each node and their gradients; zero where fewer.

    On a free face 2 phi_a - 1 = 2 b phi_0 in place of phi_a = phi_0 + b, b being its offset: the
    same where no other grain is near, while faces of two grains across a thin gap, where the void
    nowhere prevails, stay apart.
    """
    n = len(x)
    values, slopes = np.zeros((n, MOST_LABELS)), np.zeros((n, MOST_LABELS, 3))
    for label, at in _places(surface.labels).items():
        if label >= 0:
            node, which = np.divmod(at, MOST_LABELS)
            values[node, which], slopes[node, which] = fields[label](x[node])
    known, void, grains = surface.labels >= 0, surface.labels == 0, surface.labels > 0
    gained = np.where(grains, offset[np.maximum(surface.labels, 0)], 0).sum(axis=1)
    gained /= np.maximum(grains.sum(axis=1), 1)
    free = np.flatnonzero((known.sum(axis=1) == 2) & void.any(axis=1))
    own, other = np.argmax(grains[free], axis=1), np.argmax(void[free], axis=1)
    b = gained[free]
    face = 2 * values[free, own] - 1 - 2 * b * values[free, other]
    across = 2 * slopes[free, own] - 2 * b[:, None] * slopes[free, other]
    values += np.where(void, gained[:, None], 0)
    residual = np.where(known[:, 1:], values[:, 1:] - values[:, :1], 0)
    gradient = np.where(known[:, 1:, None], slopes[:, 1:] - slopes[:, :1], 0)
    residual[free], gradient[free] = 0, 0
    residual[free, 0], gradient[free, 0] = face, across
    gradient[np.broadcast_to(surface.held[:, None, :], gradient.shape)] = 0
    return residual, gradient


def _inverse(slopes):
    """Pseudo-inverses, shape (num_nodes, 3, MOST_LABELS - 1); of nodes on faces in closed form."""
    inverse = np.zeros((len(slopes), 3, slopes.shape[1]))
    square = (slopes[:, 0] ** 2).sum(axis=1)
    inverse[:, :, 0] = slopes[:, 0] / np.maximum(square, 1e-12)[:, None]
    lines = slopes[:, 1:].any(axis=(1, 2))
    inverse[lines] = np.linalg.pinv(slopes[lines], rcond=0.1)
    return inverse


def _places(labels):
    """Where each label stands in an array, as indices into it laid flat."""
    flat = labels.ravel()
    order = np.argsort(flat, kind="stable")
    found, first = np.unique(flat[order], return_index=True)
    return dict(zip(found.tolist(), np.split(order, first[1:]), strict=True))


def _average_within(surface):
    """Mean over those neighbours of a node that lie on all that it lies on."""
    ends = np.concatenate([surface.facets[:, [i, j]] for i, j in ((0, 1), (1, 2), (2, 0))])
    ends = np.concatenate([ends, ends[:, ::-1]])
    key = np.sort(ends @ [len(surface.x), 1])
    ends = np.column_stack(np.divmod(key[np.diff(key, prepend=-1) > 0], len(surface.x)))
    mine, other = surface.labels[ends[:, 0]], surface.labels[ends[:, 1]]
    within = ((mine[:, :, None] == other[:, None, :]).any(axis=2) | (mine < 0)).all(axis=1)
    within &= (~surface.held[ends[:, 0]] | surface.held[ends[:, 1]]).all(axis=1)
    ends, n = ends[within], len(surface.x)
    count = np.bincount(ends[:, 0], minlength=n)
    alone = np.flatnonzero(count == 0)
    ends = np.concatenate([ends, np.column_stack([alone, alone])])
    weight = 1.0 / np.maximum(count, 1)[ends[:, 0]]
    return scipy.sparse.csr_array((weight, ends.T), shape=(n, n))
