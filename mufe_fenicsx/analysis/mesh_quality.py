"""Quality of tetrahedra, before and after the test has deformed them."""

from dataclasses import dataclass

import numpy as np

from mufe_fenicsx.analysis.by_grain import blocks
from mufe_fenicsx.geometry.measure import (
    smallest_altitudes,
    smallest_dihedral_angles,
    tet_volumes,
)


@dataclass(frozen=True)
class MeshQuality:
    """Three numbers a tetrahedron."""

    volume: np.ndarray  #: [m³], negative if inside out, shape (num_cells,)
    altitude: np.ndarray  #: smallest altitude [m], shape (num_cells,)
    angle: np.ndarray  #: smallest angle between two faces [degrees], shape (num_cells,)


def mesh_quality(points, cells):
    """Volumes, smallest altitudes and smallest dihedral angles.

    Args:
        points: Positions of nodes [m], shape (num_nodes, 3).
        cells: Nodes of tetrahedra, shape (num_cells, 4).

    Returns:
        MeshQuality.
    """
    points = np.asarray(points, dtype=float)
    measures = (tet_volumes, smallest_altitudes, smallest_dihedral_angles)
    parts = [[f(points, cells[part]) for part in blocks(len(cells))] for f in measures]
    return MeshQuality(*map(np.concatenate, parts))
