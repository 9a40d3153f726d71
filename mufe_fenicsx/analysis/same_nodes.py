"""Nodes of one stored state among those of another of the same run."""

import numpy as np

from mufe_fenicsx.errors import InputError


def same_nodes(first, other):
    """For each node of one state the node of another that is the same.

    A run that went on on another number of ranks has its nodes in another order from there on;
    a node is known by its grain and its place in the reference configuration.

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
    if places[0].shape != places[1].shape or not np.array_equal(*places):
        raise InputError("its nodes are not those of the first state, expected the same grains")
    same = np.empty(len(orders[0]), np.int64)
    same[orders[0]] = orders[1]
    return same
