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
import vtk

from ..image.coarse_labels import prevailing
from ..measure import surface_volume
from ..tets.joint_quality import parted
from .indicators import (
    FOLD,
    MOST_LABELS,
    area_vectors,
    constraints,
    moved,
    smoothed_indicators,
    without_folds,
)
from .level_set import BETA
from .shared_edges import evened, opened

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


@dataclass
class SharedSurface:
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
        A `SharedSurface`.
    """
    wide = max(smoothing, PREVAIL * CELL * size)
    surface, spacing = raw_complex(labels, CELL * size, wide)
    start, offset, shape = surface.x, np.zeros(labels.max() + 1), np.array(labels.shape)
    fields = smoothed_indicators(labels, wide)
    surface.x = moved(surface, start, fields, offset, shape, spacing.min(), ROUNDS)
    if wide > smoothing:
        # The wider filter had slopes that reach nodes which are far from where they belong.
        fields = smoothed_indicators(labels, smoothing)
        surface.x = moved(surface, start, fields, offset, shape, spacing.min(), ROUNDS)
    for coarse in COARSENED:
        surface = _evened(surface, coarse * size)
        surface.x = moved(surface, surface.x, fields, offset, shape, spacing.min(), 6)
    start = surface.x
    for _ in range(4 if keep_volume else 0):
        offset = _offsets(surface, fields, offset, np.bincount(labels.ravel()))
        surface.x = moved(surface, start, fields, offset, shape, spacing.min(), 0)
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
    areas = area_vectors(surface.x, surface.facets)
    normal = areas / np.maximum(np.linalg.norm(areas, axis=1, keepdims=True), 1e-300)

    def safe(new, step):
        step[surface.held] = 0
        return without_folds(surface.facets, new - step, step, normal, FOLD * size**2)

    return parted(surface.x, np.concatenate(facets), np.concatenate(owner), size, safe)


def _offsets(surface, fields, offset, volumes):
    """What phi of the void gains around each grain, whose free face then encloses its volume."""
    offset = offset.copy()
    x = surface.x
    areas = area_vectors(x, surface.facets)
    # Facets are seen from their second side.
    inside = np.einsum("ij,ij->i", x[surface.facets].mean(axis=1), areas) / 3
    size = np.linalg.norm(areas, axis=1)
    free = (surface.sides == 0).any(axis=1) & ~surface.held[surface.facets].all(axis=1).any(axis=1)
    _, slopes = constraints(surface, fields, x, offset)
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
    return SharedSurface(corner * spacing, facets, sides, around, held)


def _evened(surface, size):
    """The same faces of triangles whose edges are of a length: a new `SharedSurface`."""
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
    return SharedSurface(x, facets, sides, labels, held)
