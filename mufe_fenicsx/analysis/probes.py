"""What happens at chosen places of grains in the course of a test."""

import numpy as np
from scipy.spatial import cKDTree

from mufe_fenicsx.analysis.by_grain import index_grains, sum_by_grain
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.measure import tet_volumes

#: Barycentric coordinates may be that negative: a place on a face belongs to both cells.
ON_FACE = 1e-9


def find_cells(points, cells, places):
    """Cell that holds each place, and the place's barycentric coordinates there.

    Args:
        points: Nodes [m], shape (num_nodes, 3).
        cells: Nodes of the tetrahedra, shape (num_cells, 4).
        places: [m], shape (num_places, 3).

    Returns:
        cell, shape (num_places,); weights of its four nodes, shape (num_places, 4).

    Raises:
        InputError: A place is in no cell.
    """
    places = np.asarray(places, dtype=float).reshape(-1, 3)
    corners = points[cells]
    middle = corners.mean(axis=1)
    reach = np.linalg.norm(corners - middle[:, None], axis=2).max()
    found, weights = np.empty(len(places), dtype=np.int64), np.empty((len(places), 4))
    near = cKDTree(middle).query_ball_point(places, reach * (1 + ON_FACE))
    for i, (place, candidates) in enumerate(zip(places, near, strict=True)):
        w = _barycentric(corners[candidates], place)
        best = int(np.argmax(w.min(axis=1))) if len(candidates) else -1
        if best < 0 or w[best].min() < -ON_FACE:
            x, y, z = place
            raise InputError(
                f"probe at ({x:.6g}, {y:.6g}, {z:.6g}) m is in no grain, expected a place inside "
                "one in the reference configuration"
            )
        found[i], weights[i] = candidates[best], w[best]
    return found, weights


def _barycentric(corners, place):
    edges = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    rest = np.linalg.solve(edges, (place - corners[:, 0])[:, :, None])[:, :, 0]
    return np.column_stack([1 - rest.sum(axis=1), rest])


def at_places(cells, cell, weights, point_data, cell_data):
    """Fields at places that :func:`find_cells` found: linear between nodes, even in cells.

    Args:
        cells: Nodes of the tetrahedra, shape (num_cells, 4).
        cell, weights: Of the places, shape (num_places,) and (num_places, 4).
        point_data, cell_data: dicts name -> array of values at nodes and in cells.

    Returns:
        dict name -> array, shape (num_places, …).
    """
    nodes = cells[cell]
    values = {
        name: np.einsum("pa,pa...->p...", weights, np.asarray(v)[nodes])
        for name, v in point_data.items()
    }
    return values | {name: np.asarray(v)[cell] for name, v in cell_data.items()}


def of_grains(points, cells, grain_of_cell, chosen, point_data, cell_data):
    """Means of fields over the volume of chosen grains.

    Args:
        points: Nodes [m], over whose volumes the mean is, shape (num_nodes, 3).
        cells: Nodes of the tetrahedra, shape (num_cells, 4).
        grain_of_cell: Label of each cell's grain, shape (num_cells,).
        chosen: Labels, shape (num_chosen,).
        point_data, cell_data: dicts name -> array of values at nodes and in cells.

    Returns:
        dict name -> array, shape (num_chosen, …).

    Raises:
        InputError: There is no grain of such a label.
    """
    labels = np.unique(grain_of_cell)
    unknown = np.setdiff1d(chosen, labels)
    if unknown.size:
        raise InputError(
            f"grain {unknown[0]} is not in the run, expected a label between {labels[0]} and "
            f"{labels[-1]} that it has"
        )
    mine = np.isin(grain_of_cell, chosen)
    labels, index = index_grains(grain_of_cell[mine])
    at = np.searchsorted(labels, chosen)
    cells = cells[mine]
    volume = tet_volumes(points, cells)
    total = sum_by_grain(volume, index, labels.size)

    def mean(values):
        weight = volume.reshape(-1, *(1,) * (values.ndim - 1))
        sums = sum_by_grain(weight * values, index, labels.size)[at]
        return sums / total[at].reshape(-1, *(1,) * (values.ndim - 1))

    values = {name: mean(np.asarray(v)[cells].mean(axis=1)) for name, v in point_data.items()}
    return values | {name: mean(np.asarray(v)[mine]) for name, v in cell_data.items()}
