"""Means over the volume of grains and of the sample."""

import numpy as np

from mufe_fenicsx.analysis.by_grain import index_grains


def grain_means(values, volumes, grain_of_cell):
    """Volume mean of a scalar in each grain.

    Args:
        values: A value a cell, shape (num_cells,).
        volumes: Their volumes [m³], shape (num_cells,).
        grain_of_cell: Their grains' labels, shape (num_cells,).

    Returns:
        labels, increasing, and means, both of shape (num_grains,).
    """
    labels, index = index_grains(grain_of_cell)
    total = np.bincount(index, weights=volumes)
    return labels, np.bincount(index, weights=values * volumes) / total


def sample_stress(stress, volumes, sample_volume):
    """Mean stress of the sample, voids included: Σ V σ / V_sample [Pa], shape (6,).

    In equilibrium the divergence theorem gives Σ V σ = ∮ t ⊗ x dA over the walls, so its
    zz part is minus the vertical stress of the platens: a check of the walls' forces
    against the stress in the grains.

    Args:
        stress: Cauchy stress of the cells [Pa], shape (num_cells, 6).
        volumes: Their current volumes [m³], shape (num_cells,).
        sample_volume: Grains and voids [m³].
    """
    return np.asarray(volumes) @ np.asarray(stress) / sample_volume


def void_ratio(solid_volume, sample_volume):
    """e = V_voids / V_solids [-]."""
    return sample_volume / solid_volume - 1
