"""Quality of tetrahedra, before and after the test has deformed them."""

from dataclasses import dataclass

import numpy as np

from mufe_fenicsx.analysis.by_grain import blocks
from mufe_fenicsx.contact.laws import edge_of_area
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


def edges_per_diameter(points, cells, facets, num_grains):
    """Diameter of a ball of the grains' mean volume over the edge of their mean facet [-].

    Args:
        points: Positions of nodes [m], shape (num_nodes, 3).
        cells: Nodes of tetrahedra, shape (num_cells, 4).
        facets: Nodes of the facets of their surfaces, shape (num_facets, 3).
        num_grains: Of which they are.
    """
    volume = tet_volumes(points, cells).sum() / num_grains
    a, b, c = points[facets].transpose(1, 0, 2)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return np.cbrt(6 / np.pi * volume) / edge_of_area(area.mean(), 1)


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
