"""What a plan needs to know of the grains."""

import math
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..geometry.form.proportions import warnings_of_proportions
from ..geometry.grains import load_grains, read_grain_table
from .errors import CONTACTS

#: Thickness over length below which a grain is a plate or a needle, and edges through it from which
#: it bends well: a cantilever of 8 thicknesses goes down by 0.34, 0.67, 0.81, 0.88 and 0.94 of what
#: beam theory says with 1, 2, 3, 4 and 6 edges (element = "averaged").
SLENDER, THROUGH = 0.35, 4


@dataclass(frozen=True)
class Sample:
    """What a plan needs to know of the grains."""

    folder: str
    labels: tuple
    num_cells: int
    size: float  #: wanted length of edges [m]
    diameter: float  #: of a ball of the grains' mean volume [m]
    slender: int = 0  #: grains that bend, with fewer than `THROUGH` edges through their thickness
    warnings: tuple = ()  #: why they are no sample, in lines

    @property
    def tets(self):
        """Tetrahedra a grain."""
        return self.num_cells / len(self.labels)

    def mesh_for(self, n, radius, errors):
        """A mesh of n elements per contact radius.

        Finer than it is the sample gets either even edges or fine patches at its contacts.

        Args:
            n: Elements per contact radius.
            radius: Of a typical contact over the diameter.
            errors: :class:`~.errors.Errors`, which know the tetrahedra of a patch.

        Returns:
            Length of edges at contacts and inside [m], and tetrahedra a grain.
        """
        h = radius * self.diameter / n
        even = self.tets * (self.size / h) ** 3
        patches = self.tets + CONTACTS * errors.cells_of_contact(n)
        if h < self.size and patches < even:
            return h, self.size, patches
        return h, h, even


def read_sample(folder):
    """The :class:`Sample` in a folder that `mufe mesh` wrote.

    Raises:
        InputError: There is none.
    """
    if folder is None:
        raise InputError(
            "sample.grains is missing, expected the folder that `mufe mesh` wrote: a plan needs "
            "the grains, meshed with edges of any length"
        )
    labels, num_cells, _, _ = read_grain_table(folder)
    grains = load_grains(folder)
    slender = sum(
        thickness < min(SLENDER * length, THROUGH * grains.element_size)
        for thickness, length in (_extents(grains.grain(g)[0]) for g in range(grains.num_grains))
    )
    diameter = (6 / math.pi * float(grains.volumes.mean())) ** (1 / 3)
    return Sample(
        str(folder), tuple(labels.tolist()), int(num_cells.sum()), grains.element_size, diameter,
        int(slender), tuple(warnings_of_proportions(grains)),
    )  # fmt: skip


def _extents(points):
    """Least and largest extent of a grain along its principal axes [m]."""
    away = points - points.mean(axis=0)
    along = np.ptp(away @ np.linalg.eigh(away.T @ away)[1], axis=0)
    return float(along.min()), float(along.max())
