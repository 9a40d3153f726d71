"""What a plan needs to know of the grains."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..errors import InputError
from ..geometry.form.proportions import warnings_of_proportions
from ..geometry.grains import load_grains, read_grain_table
from ..geometry.measure import boundary_triangles
from .errors import CONTACTS

#: Thickness over length below which a grain is a plate or a needle, and edges through it from which
#: it bends well: a cantilever of 8 thicknesses goes down by 0.34, 0.67, 0.81, 0.88 and 0.94 of what
#: beam theory says with 1, 2, 3, 4 and 6 edges (element = "averaged").
SLENDER, THROUGH = 0.35, 4
#: Nearest facets of each among which one of another grain is looked for: where it lies within an
#: edge there are about seven own ones.
NEAREST = 16
#: A mesh with edges at contacts below this part of those elsewhere is one with fine patches.
WITH_PATCHES = 0.8


@dataclass(frozen=True)
class Sample:
    """What a plan needs to know of the grains."""

    folder: str
    labels: tuple
    num_cells: int
    size: float  #: mean edge of the facets at contacts [m]
    inner: float  #: wanted length of edges away from them [m]
    diameter: float  #: of a ball of the grains' mean volume [m]
    slender: int = 0  #: grains that bend, with fewer than `THROUGH` edges through their thickness
    warnings: tuple = ()  #: why they are no sample, in lines

    @property
    def tets(self):
        """Tetrahedra a grain."""
        return self.num_cells / len(self.labels)

    def edge_of(self, tets):
        """Mean length of edges with so many tetrahedra a grain, all alike [m]."""
        return self.diameter * math.cbrt(math.pi * math.sqrt(2) / tets)

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
        plain = self.tets
        if self.size < WITH_PATCHES * self.inner:  # of its patches nothing is left
            plain = min(plain, math.pi * math.sqrt(2) * (self.diameter / self.inner) ** 3)
        even = plain * (self.inner / h) ** 3
        patches = plain + CONTACTS * errors.cells_of_contact(n)
        if h < self.inner and patches < even:
            return h, self.inner, patches
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
        str(folder), tuple(labels.tolist()), int(num_cells.sum()), edge_at_contacts(grains),
        grains.element_size, diameter, int(slender), tuple(warnings_of_proportions(grains)),
    )  # fmt: skip


def edge_at_contacts(grains):
    """Mean edge of facets, by area, within an edge of another grain's [m].

    As reports have it of closed contacts; without any such facet that of all.

    Args:
        grains: :class:`~mufe_fenicsx.geometry.grains.Grains`.
    """
    facets = boundary_triangles(grains.cells)
    corners = grains.points[facets]
    sides = np.roll(corners, -1, axis=1) - corners
    edge = np.linalg.norm(sides, axis=2).mean(axis=1)
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)  # twice that
    grain = np.searchsorted(grains.node_offset, facets[:, 0], side="right")
    middle = corners.mean(axis=1)
    far, near = cKDTree(middle).query(middle, k=min(NEAREST, len(facets)))
    at = ((far < edge[:, None]) & (grain[near] != grain[:, None])).any(axis=1)
    return float(np.average(edge, weights=area * (at if at.any() else 1.0)))


def _extents(points):
    """Least and largest extent of a grain along its principal axes [m]."""
    away = points - points.mean(axis=0)
    along = np.ptp(away @ np.linalg.eigh(away.T @ away)[1], axis=0)
    return float(along.min()), float(along.max())
