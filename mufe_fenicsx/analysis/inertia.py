"""Inertia of grains made of tetrahedra, exact for the mesh."""

from dataclasses import dataclass

import numpy as np

from mufe_fenicsx.analysis.by_grain import blocks, index_grains, sum_by_grain
from mufe_fenicsx.geometry.form.shape import inertia_of, principal
from mufe_fenicsx.geometry.measure import tet_volumes

#: Rounding that the inequalities of :func:`unphysical` allow, relative to the largest moment.
ROUNDING = 1e-12


@dataclass(frozen=True)
class Inertia:
    """Mass properties of grains of one density."""

    labels: np.ndarray  #: shape (num_grains,)
    mass: np.ndarray  #: [kg], shape (num_grains,)
    centroid: np.ndarray  #: [m], shape (num_grains, 3)
    tensor: np.ndarray  #: about the centroid [kg m²], shape (num_grains, 3, 3)
    moments: np.ndarray  #: principal ones, smallest first [kg m²], shape (num_grains, 3)
    axes: np.ndarray  #: their axes in rows, right-handed, shape (num_grains, 3, 3)


def grain_inertia(points, cells, grain_of_cell, rho=1.0):
    """Mass, centre, inertia tensor and principal axes of each grain.

    Over a tetrahedron of volume V with corners x_a, s their sum, the integral of r rᵀ is
    V/20 (Σ x_a x_aᵀ + s sᵀ); the inertia is I = ρ (tr(S) 1 - S) of the sum S over the grain.

    Args:
        points: Positions of the nodes [m], shape (num_nodes, 3).
        cells: Nodes of the tetrahedra, shape (num_cells, 4).
        grain_of_cell: Label of each cell's grain, shape (num_cells,).
        rho: Density [kg/m³]; 1 gives volumes [m³] and their moments [m⁵].

    Returns:
        :class:`Inertia`, grains in the order of their labels.
    """
    labels, index = index_grains(grain_of_cell)
    n = labels.size
    volume = tet_volumes(points, cells)
    total = sum_by_grain(volume, index, n)
    centre, second = np.zeros((n, 3)), np.zeros((n, 3, 3))
    for part in blocks(len(cells)):
        mass = volume[part, None] / total[index[part], None]
        centre += sum_by_grain(mass * points[cells[part]].mean(axis=1), index[part], n)
    for part in blocks(len(cells)):
        corners = points[cells[part]] - centre[index[part]][:, None]
        sums = corners.sum(axis=1)
        squares = np.swapaxes(corners, 1, 2) @ corners + sums[:, :, None] * sums[:, None, :]
        second += sum_by_grain(volume[part, None, None] / 20 * squares, index[part], n)
    tensor = rho * np.array([inertia_of(s) for s in second])
    moments, axes = zip(*(principal(t) for t in tensor), strict=True)
    return Inertia(labels, rho * total, centre, tensor, np.array(moments), np.array(axes))


def unphysical(moments):
    """Where principal moments belong to no body: one is not positive, or one exceeds the sum.

    Every body of positive mass has I > 0 and I₃ ≤ I₁ + I₂.

    Args:
        moments: Three of each grain, shape (num_grains, 3).

    Returns:
        True where one of these does not hold, shape (num_grains,).
    """
    low, middle, high = np.sort(np.asarray(moments, dtype=float), axis=-1).T
    return ~((low > 0) & (high - low - middle <= ROUNDING * high))
