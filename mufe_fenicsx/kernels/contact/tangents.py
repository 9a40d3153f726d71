"""Derivatives of the forces of closed pairs by the positions of their nodes, as blocks of two."""

import ctypes

import numpy as np

from ..build.native import Pointers, load
from .edges import arrays_of


def pair_tangent(blocks, x, num_before, pairs, mark, points, friction):
    """Minus the derivative of the forces of all closed pairs, in turn, as blocks of two nodes.

    Args:
        blocks: Written: nodes of each block, rows and columns, int32, shape (36 num_closed,), and
            blocks [N/m], shape (36 num_closed, 3, 3).
        x: Positions of points and nodes of the last evaluation [m].
        num_before: Rows of ``x`` before those of nodes.
        pairs: :class:`~mufe_fenicsx.contact.pairs.facet_pairs.Pairs` after that evaluation.
        mark: Their ``state`` and ``dents`` before the increment. Stick points of those that were
            not closed begin where they are now, without friction yet.
        points: :class:`~mufe_fenicsx.contact.surface.points.Points`.
        friction: As of :class:`~.pairs.PairForces`.
    """
    reals = *_dents(pairs, mark), points.rules, friction, x
    _call("pair", blocks, num_before, pairs, mark, reals)


def edge_tangent(blocks, x, pairs, mark, edges, friction):
    """The same of crossing edges, 16 blocks each.

    Args:
        x: Positions of nodes [m].
        pairs: :class:`~mufe_fenicsx.contact.pairs.edge_pairs.EdgePairs`.
        mark: Their ``state`` before the increment.
        edges: As of :class:`~.edges.EdgeForces`.
        others: As of :func:`pair_tangent`.
    """
    reals = None, None, None, friction, x, None, None, None
    _call("edge", blocks, 0, pairs, mark, reals, arrays_of(edges))


def wall_tangent(blocks, x, num_before, pairs, mark, points, walls):
    """The same of pairs with walls, 9 blocks each. On a curved wall the normal turns.

    Args:
        pairs: :class:`~mufe_fenicsx.contact.pairs.wall_pairs.WallPairs`.
        walls: :class:`~mufe_fenicsx.contact.walls.Walls`.
        others: As of :func:`pair_tangent`.
    """
    of_walls = walls.friction_kinetic, x, walls.point, walls.normal, walls.curved.radius
    _call("wall", blocks, num_before, pairs, mark, (*_dents(pairs, mark), points.rules, *of_walls))


def _dents(pairs, mark):
    return (pairs.dents, mark["dents"]) if pairs.yields else (None, None)


def _call(kind, blocks, num_before, pairs, mark, reals, others=()):
    real, short = np.float64, np.int32
    arrays = Pointers(
        *zip(blocks, (short, short, real), strict=True), (pairs.state, real), (mark["state"], real),
        *(None if array is None else (array, real) for array in reals), *others,
    )  # fmt: skip
    call = getattr(load("tangents"), f"mufe_{kind}_tangent")
    call.argtypes, call.restype = [ctypes.c_void_p, ctypes.c_int64, ctypes.c_int64], None
    call(arrays.table, num_before, len(pairs.state))
