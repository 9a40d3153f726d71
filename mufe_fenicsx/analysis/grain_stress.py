"""Stress and yield in grains: means, peaks, who is unstressed, who yields first."""

from dataclasses import dataclass

import numpy as np

from mufe_fenicsx.analysis.by_grain import index_grains, sum_by_grain

#: Below this part of the sample's mean a grain counts as unstressed.
UNSTRESSED = 0.01


@dataclass(frozen=True)
class GrainStress:
    """Stress of each grain over its volume."""

    labels: np.ndarray  #: shape (num_grains,)
    volume: np.ndarray  #: [m³], shape (num_grains,)
    stress: np.ndarray  #: mean Cauchy stress xx, yy, zz, xy, yz, xz [Pa], shape (num_grains, 6)
    mean: np.ndarray  #: mean von Mises stress [Pa], shape (num_grains,)
    peak: np.ndarray  #: largest von Mises stress [Pa], shape (num_grains,)
    percentile: np.ndarray  #: of von Mises stress, by volume [Pa], shape (num_grains,)
    plastic_fraction: np.ndarray  #: volume with plastic strain over all [-], shape (num_grains,)


def grain_stress(stress, von_mises, plastic_strain, volume, grain_of_cell, percentile=95.0):
    """Stress of each grain from the cells of a stored state.

    Args:
        stress: Cauchy stress [Pa], tension positive, shape (num_cells, 6).
        von_mises: [Pa], shape (num_cells,).
        plastic_strain: Equivalent plastic strain [-], shape (num_cells,).
        volume: Present volumes [m³], shape (num_cells,).
        grain_of_cell: Label of each cell's grain, shape (num_cells,).
        percentile: The smallest von Mises stress that at least this part of a grain's volume
            does not exceed [%]: one bad element does not show in it, as it does in the peak.

    Returns:
        :class:`GrainStress`, grains in the order of their labels.
    """
    labels, index = index_grains(grain_of_cell)
    n = labels.size
    total = sum_by_grain(volume, index, n)
    order = np.lexsort((von_mises, index))
    last = np.cumsum(np.bincount(index, minlength=n))
    first = np.append(0, last[:-1])
    upto = np.cumsum(volume[order])
    upto -= np.append(0.0, upto[last[:-1] - 1])[index[order]]  # within each grain
    # Sums over all grains before leave some rounding.
    enough = upto >= (percentile / 100 - 1e-9) * total[index[order]]
    enough = np.append(np.flatnonzero(enough), len(order))
    at = np.minimum(enough[np.searchsorted(enough, first)], last - 1)
    return GrainStress(
        labels=labels,
        volume=total,
        stress=sum_by_grain(volume[:, None] * stress, index, n) / total[:, None],
        mean=sum_by_grain(volume * von_mises, index, n) / total,
        peak=von_mises[order[last - 1]],
        percentile=von_mises[order[at]],
        plastic_fraction=sum_by_grain(volume * (plastic_strain > 0), index, n) / total,
    )


def unstressed(mean, volume, part=UNSTRESSED):
    """Grains whose mean von Mises stress is below a part of the sample's, shape (num_grains,).

    Args:
        mean: Mean von Mises stress of each grain [Pa].
        volume: Of each grain [m³].
        part: Of the mean over the volume of all grains [-].
    """
    return mean < part * (volume @ mean / np.sum(volume))


@dataclass(frozen=True)
class FirstYield:
    """When each grain was first seen to yield; stored states resolve no more than that."""

    labels: np.ndarray  #: shape (num_grains,)
    state: np.ndarray  #: place of the first state with plastic strain, -1: none did
    rank: np.ndarray  #: 1 for those that yielded first, the same within a state; 0: none did


def first_yield(states):
    """The order in which grains yield, as far as stored states tell it apart.

    Args:
        states: For each state in order of time, plastic strain and label of the grain of the
            cells, a pair of arrays of shape (num_cells,); cells may change their order. An
            iterable, so that memory need not hold all.

    Returns:
        :class:`FirstYield`, grains in the order of their labels.
    """
    labels, found = np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    for number, (plastic_strain, grain_of_cell) in enumerate(states):
        if not labels.size:
            labels = np.unique(grain_of_cell)
            found = np.full(labels.size, -1)
        yielded = np.isin(labels, np.unique(grain_of_cell[plastic_strain > 0]))
        found[yielded & (found < 0)] = number
    rank = np.zeros(labels.size, dtype=np.int64)
    seen = found >= 0
    rank[seen] = np.unique(found[seen], return_inverse=True)[1] + 1
    return FirstYield(labels, found, rank)
