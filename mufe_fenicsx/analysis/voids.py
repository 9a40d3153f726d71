"""Void ratio of a sample between its walls, and away from them, where these order no grains."""

import numpy as np

from mufe_fenicsx.analysis.grain_means import void_ratio
from mufe_fenicsx.container import BOX
from mufe_fenicsx.kernels.geometry.voids import box_of_centres, solid_of_octants
from mufe_fenicsx.output.history import VOIDS

#: Median diameters that the inner part keeps away from all walls, and that it is wide at least.
MARGIN, WIDTH = 0.5, 1.0
#: Parts of the inner one, whose spread tells the uncertainty.
OCTANTS = 8


class Voids:
    """Void ratios of a sample as it goes on. Collective.

    Args:
        comm: MPI communicator.
        container: :class:`~mufe_fenicsx.container.Container` of the sample.
        cells: Of this rank's grains, shape (num_cells, 4).
        volume: Their volumes at the start, which count as solid [m³], shape (num_cells,).
        diameter: Median diameter of the grains [m].
    """

    def __init__(self, comm, container, cells, volume, diameter):
        self.comm, self.container, self.cells, self.volume = comm, container, cells, volume
        self.diameter = diameter
        self.solid = comm.allreduce(float(volume.sum()))  #: [m³]

    def row(self, x, lengths):
        """Columns of history.csv at positions ``x`` [m] and lengths of the sample [m]."""
        outer = float(void_ratio(self.solid, self.container.volume(lengths)))
        inner, error = self._inside(x, lengths)
        porosity = outer / (1.0 + outer)
        return dict(zip(VOIDS, (outer, porosity, inner, error), strict=True))

    def _inside(self, x, lengths):
        comm, (low, high) = self.comm, box_of_centres(x, self.cells)
        # All at once: the lowest corner, and the highest with its sign turned.
        ends = comm.allreduce(np.append(low, -high), op=_least)
        middle, hollow = 0.5 * (ends[:3] - ends[3:]), len(self.container.widths) == 2
        is_round = self.container.shape != BOX.shape
        inner = inner_lengths(lengths, self.diameter, is_round and hollow)
        if inner is None:
            return 0.0, 0.0
        half = 0.5 * (inner[[0, 0, -1]] if is_round else inner)
        hole = 0.5 * float(inner[1]) if is_round and hollow else 0.0
        found = solid_of_octants(x, self.cells, self.volume, middle, half, is_round, hole)
        return inner_void_ratio(comm.allreduce(found), float(self.container.volume(inner)))


def _least(a, b):
    return np.minimum(a, b)


def inner_lengths(lengths, diameter, hollow=False):
    """Lengths of the part of a sample that counts as away from walls; None: too narrow.

    It begins half a median diameter from each wall, and is one wide at least.

    Args:
        lengths: Of the sample, along its axes [m], shape (num_axes,).
        diameter: Median diameter of its grains [m].
        hollow: Whether the second is the diameter of a hole.
    """
    off = np.full(len(lengths), -2.0 * MARGIN * diameter)
    off[1] *= -1.0 if hollow else 1.0
    inner = np.asarray(lengths) + off
    widths = inner.copy()
    if hollow:
        widths[1] = 0.5 * (inner[0] - inner[1])
    return inner if widths.min() >= WIDTH * diameter else None


def inner_void_ratio(solids, inner_volume):
    """Void ratio of the inner part and its standard error; zeros where it has no solid.

    Args:
        solids: Of :func:`solid_of_octants`, of all ranks.
        inner_volume: Of the inner part [m³].
    """
    total = float(solids.sum())
    if not (total > 0.0 and inner_volume > 0.0):
        return 0.0, 0.0
    part = solids * OCTANTS / inner_volume  # solid fraction of each
    error = float(part.std(ddof=1) / np.sqrt(OCTANTS))
    fraction = total / inner_volume
    return float(void_ratio(total, inner_volume)), error / fraction**2
