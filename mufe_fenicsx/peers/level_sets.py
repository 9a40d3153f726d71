"""Grains as level sets: signed distances on a regular grid along the principal axes.

The rigid grains of level-set discrete elements (R. Kawamoto, E. Andò, G. Viggiani & J. E. Andrade,
J. Mech. Phys. Solids 91, 2016, 1-13; J. Duriez & S. Bonelli, Comput. Geotech. 134, 2021, 104033)
touch where surface nodes of one grain have a negative distance in the grid of another one.
"""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError

#: Layers of the grid beyond the grain.
MARGIN = 3
#: Most nodes of the grid of one grain.
LARGEST = 20_000_000


@dataclass(frozen=True)
class LevelSet:
    """Signed distances of one grain; the nodes of the grid are origin + spacing (i, j, k)."""

    origin: np.ndarray  #: in the frame of the principal axes, about the centroid [m], shape (3,)
    spacing: float  #: [m]
    distance: np.ndarray  #: negative inside [m], shape (nx, ny, nz)


def level_set(body, spacing):
    """The :class:`LevelSet` of a :class:`~mufe_fenicsx.peers.body.Body`.

    The centroid is a node of the grid. Distances are exact for the triangles at every node,
    not only near the surface.

    Args:
        body: The grain.
        spacing: Of the grid [m].

    Raises:
        InputError: the grid would have more than `LARGEST` nodes.
    """
    low = np.floor(body.points.min(axis=0) / spacing).astype(np.int64) - MARGIN
    high = np.ceil(body.points.max(axis=0) / spacing).astype(np.int64) + MARGIN
    shape = high - low + 1
    if shape.prod() > LARGEST:
        raise InputError(
            f"--spacing = {spacing:g} m, expected a grid of at most {LARGEST:,} nodes a grain; "
            f"grain {body.label} would have {shape.prod():,}"
        )
    axes = [spacing * np.arange(a, b + 1) for a, b in zip(low, high, strict=True)]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    distance = body.signed_distance(nodes).reshape(shape)
    return LevelSet(low * spacing, float(spacing), distance)
