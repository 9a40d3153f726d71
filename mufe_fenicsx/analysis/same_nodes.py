"""Nodes of one stored state among those of another of the same run."""

import numpy as np

from mufe_fenicsx.errors import InputError


def same_nodes(first, other):
    """For each node of one state the node of another that is the same.

    A run that went on on another number of ranks has its nodes in another order from there on;
    a node is known by its grain and its place in the reference configuration. Where grains broke
    several nodes are at a place: these are known by their cells. A node that has parted in the
    other state is one of its parts there.

    Args:
        first, other: (reference positions, cells, label of each cell's grain) of both.

    Returns:
        Nodes of ``other``, shape (num_nodes,).

    Raises:
        InputError: They are not the same grains.
    """
    if first[0].shape == other[0].shape and np.array_equal(first[1], other[1]):
        return np.arange(len(first[0]))
    orders, places = [], []
    for reference, cells, grain in (first, other):
        label = np.zeros(len(reference), np.int64)
        label[cells] = grain[:, None]
        order = np.lexsort((*reference.T, label))
        orders.append(order)
        places.append(np.column_stack([label, reference])[order])
    same = np.empty(len(orders[0]), np.int64)
    firsts = [_firsts(place) for place in places]
    once = [place[is_first] for place, is_first in zip(places, firsts, strict=True)]
    if not np.array_equal(*once):
        raise InputError("its nodes are not those of the first state, expected the same grains")
    if all(is_first.all() for is_first in firsts):
        same[orders[0]] = orders[1]
        return same
    corners = []
    for (_, cells, _), order, is_first in zip((first, other), orders, firsts, strict=True):
        place = np.empty(len(order), np.int64)
        place[order] = np.cumsum(is_first)
        at = place[cells]
        cells = np.take_along_axis(cells, np.argsort(at, axis=1), axis=1)
        corners.append(cells[np.lexsort(np.sort(at, axis=1).T)])
    same[corners[0]] = corners[1]
    return same


def _firsts(place):
    """Which of sorted rows are not as the one before, shape (num_rows,)."""
    return np.append(True, (place[1:] != place[:-1]).any(axis=1))
