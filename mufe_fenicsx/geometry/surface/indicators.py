"""Nodes of a complex of facets moved to where the smoothed indicators of their labels are equal.

A complex is a :class:`~.shared_surface.SharedSurface`, lengths are voxels of the image.
"""

import numpy as np
import scipy.ndimage
import scipy.sparse

from ...kernels.contact.spline import spline_value_and_gradient
from ..image.labels import grains_in
from .level_set import margin

#: Labels that meet at a node at most; rarer meetings keep the first ones.
MOST_LABELS = 4
#: Difference of smoothed indicators at which a node is not near a place where they are equal.
LOST = 0.25
#: Area of facets at least, over the square of a cell's edge, where nodes move.
FOLD = 0.1


def smoothed_indicators(labels, sigma):
    """The smoothed indicators of the void and of each grain: {label: :class:`Field`}.

    Args:
        labels: 0 void, grains from 1, shape (nz, ny, nx).
        sigma: Standard deviation of the filter [voxels].
    """
    fields = {0: Field(labels == 0, (0, 0, 0), sigma)}
    for label, where in grains_in(labels):
        pad = margin(sigma)
        low = np.array([max(s.start - pad, 0) for s in where])
        part = tuple(slice(a, s.stop + pad) for a, s in zip(low, where, strict=True))
        fields[label] = Field(labels[part] == label, low, sigma)
    return fields


class Field:
    """The smoothed indicator of one label on the voxels around it.

    Called with points, shape (n, 3), it gives their values, shape (n,), and gradients, (n, 3).
    """

    def __init__(self, inside, low, sigma):
        smooth = scipy.ndimage.gaussian_filter(inside.astype(np.float32), sigma, mode="nearest")
        self.coefficients = scipy.ndimage.spline_filter(smooth, mode="nearest", output=np.float64)
        self.low = np.asarray(low)

    def __call__(self, x):
        """Values at x [voxels], shape (n, 3), and gradients [1/voxel]: shapes (n,) and (n, 3)."""
        value, gradient = np.empty(len(x)), np.empty((len(x), 3))
        spline_value_and_gradient(value, gradient, self.coefficients, x - 0.5 - self.low)
        return value, gradient


def moved(surface, start, fields, offset, shape, spacing, rounds):
    """Nodes on the level sets of their labels, in so many rounds evenly along them.

    Args:
        surface: A `SharedSurface`.
        start: Places that nodes stay near, within a cell, shape (num_nodes, 3).
        fields: A `Field` a label.
        offset: What the indicator of the void gains around each label, shape (largest label + 1,).
        shape: Of the image.
        spacing: Edge of the cells.
        rounds: Of evening out.
    """
    x = surface.x.copy()
    average = _average_within(surface) if rounds else None
    for turn in range(rounds + 4):
        residual, slopes = constraints(surface, fields, x, offset)
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
        x = x + step * without_folds(surface.facets, x, step, wanted, FOLD * spacing**2)[:, None]
    return x


def without_folds(facets, x, step, wanted, least):
    """Parts of the steps that let no facet turn over or shrink below an area, shape (num_nodes,).

    Args:
        facets: Shape (num_facets, 3).
        x, step: Nodes and their moves, shape (num_nodes, 3).
        wanted: Unit normals that facets ought to have, shape (num_facets, 3).
        least: Area along that normal below which a facet may only grow.
    """
    part = np.ones(len(x))
    around = np.flatnonzero(step[facets].any(axis=(1, 2)))
    before = (area_vectors(x, facets[around]) * wanted[around]).sum(axis=1)
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


def area_vectors(x, facets):
    """Area vectors of facets."""
    a, b, c = x[facets[:, 0]], x[facets[:, 1]], x[facets[:, 2]]
    return np.cross(b - a, c - a) / 2


def _wanted_normals(surface, fields, x):
    """Normals of the smooth faces at the centres of facets; of the image's faces where they lie."""
    centre = x[surface.facets].mean(axis=1)
    slope = np.zeros((len(centre), 3))
    for side, sign in ((0, 1.0), (1, -1.0)):
        for label, at in _places(surface.sides[:, side]).items():
            slope[at] += sign * fields[label](centre[at])[1]
    held = surface.held[surface.facets].all(axis=1)
    areas = area_vectors(x, surface.facets)
    # On a face of the image, and where no slope is left, the normal that there is.
    keep = held.any(axis=1) | (np.linalg.norm(slope, axis=1) < 1e-6)
    sign = np.sign((slope * areas).sum(axis=1)[~keep].sum())
    slope[keep] = sign * np.where(held, areas, 0)[keep] if keep.any() else slope[keep]
    return sign * slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-12)


def constraints(surface, fields, x, offset):
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
