"""Contact of nodes with the facets of other grains: forces and energy."""

import ctypes

import numpy as np

from ..build.native import Pointers, address, load
from ..build.pair_rows import PAIR

#: Parts of the pairs, in the order of pairs.h.
ALL, EARLY, OTHERS = range(3)


class _Call(ctypes.Structure):
    """What a call is given and finds, as in pairs.h."""

    _fields_ = [
        *((name, ctypes.c_double) for name in ("friction", "friction_kinetic", "range")),
        *((name, ctypes.c_double) for name in ("left", "highest", "steepest")),
        *((name, ctypes.c_int64) for name in ("accept", "part", "num_others")),
        *((name, ctypes.c_double) for name in ("dissipated", "switched", "accepted", "deepest")),
        ("sunk", ctypes.c_double),
        ("sunken", ctypes.c_int64),
    ]


def fill_points(table, points, ghosts, layers):
    """Set in the rows of pairs what their points have.

    Args:
        table: :class:`~mufe_fenicsx.contact.pairs.table.PairTable`.
        points, ghosts, layers: As below.

    Returns:
        Rows of the nodes around the points of pairs, shape (num_pairs, 3), and of their weights.
    """
    node = table.node
    table.ratio[:] = layers.ratio[node]
    return points.corner[node] + ghosts.num_before, points.rule_of(node)


def of_strength(table, layers, work):
    """Pointers to what says how bodies yield, as in contact_law.h."""
    real = np.float64
    return (
        (layers.strengths.tables, real) if table.yields else None, (table.dents, real),
        (layers.plastic_strain, real), (work, real), (layers.dents, layers.dents.dtype),
    )  # fmt: skip


class PairForces:
    """Finds the gaps of all pairs and adds the forces of the closed ones; local.

    A closed pair with gap g (less its offset) carries the normal force -k g and the
    tangential force of a spring between the node and its stick point, a point that
    sticks to the facet until Coulomb's limit drags it along. The facet receives
    the opposite force at the closest point, and the couple gap x friction, so that
    linear and angular momentum are kept.

    The normal force follows from where the pair is now: stiffness and largest depth are those of
    its point and the facet that it is closest to now, whatever was before. Where it passes to
    another facet they change, and so does the energy of its springs at once: that is
    counted. What overlaps at the start is accepted: its depth becomes the offset of its gap.

    All arrays are changed where they are, and must stay there. What a pair keeps is declared in
    kernels.build.pair_rows.

    Args:
        pairs: :class:`~mufe_fenicsx.contact.pairs.facet_pairs.Pairs`, with ``friction_row``, the
            row of ``friction`` of each; of size 0: the first of all.
        points: :class:`~mufe_fenicsx.contact.surface.points.Points` of this rank.
        surface: :class:`~mufe_fenicsx.contact.surface.exchange.Surface`, of other ranks too.
        ghosts: :class:`~mufe_fenicsx.contact.surface.ghosts.Ghosts`: positions [m], forces [N].
        layers: :class:`~mufe_fenicsx.contact.stiffness.layers.SurfaceLayers`.
        sharp: Whether a facet has a vertex on a sharp edge, shape (num_facets,).
        early: Whether a pair comes before all that are not, shape (num_pairs,).
        friction: Static and kinetic coefficients, shape (n, 2): a pair has to overcome the one to
            slip, and has the other while it slips, until a step in which it sticks.
        work: Plastic work of the dents beneath which cells are [J], shape (num_cells,).

    Raises:
        ValueError: An array is of another type, or not contiguous.
    """

    def __init__(self, pairs, points, surface, ghosts, layers, sharp, early, friction, work):
        real, short, long, flag = np.float64, np.int32, np.int64, np.bool_
        num = self._num_pairs = pairs.node.size
        self._found = _Call(steepest=layers.steepest, highest=layers.highest)
        self._found.friction, self._found.friction_kinetic = friction[0]
        corner, rule = fill_points(pairs, points, ghosts, layers)
        pairs.corner[:], pairs.rule[:] = corner, rule
        pairs.area[:] = points.area[pairs.node]
        pairs.around[:], pairs.num_around[:] = points.around_of[pairs.node].T
        pairs.bound_row[:] = pairs.motion_bounds.of
        if pairs.friction_row.size:
            pairs.friction[:] = pairs.friction_row
        self._any_early = bool(early.any())
        s = surface
        self._pointers = Pointers(
            (pairs.state, real), (pairs.next_check, real),
            (pairs.candidate_next_check, np.float32), (pairs.bounds, real),
            (pairs.motion_bounds.of, short), (pairs.closest, long),
            (np.empty(2 * (num + 1), short), short), (np.empty(num, short), short), (early, flag),
            (pairs.first, long), (pairs.candidate, short),
            (ghosts.facets, short), (s.neighbour, short), (ghosts.ring_offset, long),
            (ghosts.ring, short), (sharp, flag),
            (points.area, real), (points.layer, real), (s.layer_of_facet, real),
            (points.facet_area, real), (s.area_of_facet, real), (points.depth, real),
            (s.depth_of_facet, real),
            (s.bulge_of_facet, real), (points.curvature, real), (s.curvature_of_facet, real),
            (points.rules, real), (ghosts.around, short),
            (ghosts.positions.array, real), (ghosts.forces.array, real),
            (friction, real) if pairs.friction_row.size else None,
            *of_strength(pairs, layers, work),
        )  # fmt: skip
        pointer = ctypes.c_void_p
        self._call = load("pairs").mufe_add_pair_forces
        self._call.argtypes = [pointer, pointer, ctypes.c_int64]
        self._call.restype = None

    def __call__(self, longest, left, accept, between):
        """Add the forces at the positions ``x`` to ``f``.

        Args:
            longest: Distance up to which the bounds hold [m].
            left: Motion from now on before which nothing can be met but candidates [m].
            accept: True to accept every overlap (start of a test).
            between: Called once the early pairs have their forces; without any, at the end.

        Returns:
            Energy dissipated by friction [J]; energy that springs lost where pairs passed to other
            facets [J]; number of accepted pairs; their largest depth [m]; of pairs beyond their
            largest depth the largest one over the lesser part of both sides in it, and its pair,
            -1 if none.
        """
        c = self._found
        c.range, c.left, c.accept = longest, left, accept
        table, call, num = self._pointers.table, ctypes.addressof(c), self._num_pairs
        c.part = EARLY if self._any_early else ALL
        self._call(table, call, num)
        between()
        if self._any_early:
            c.part = OTHERS
            self._call(table, call, num)
        return c.dissipated, c.switched, int(c.accepted), c.deepest, (c.sunk, c.sunken)


def pair_energy(state, closed):
    """Energy stored in the springs of closed pairs [J], and their number. Local.

    Args:
        state: Rows of pairs.
        closed: Whether a pair counts, shape (num_pairs,).
    """
    return energy_of_rows("pairs", PAIR, state, closed)


def energy_of_rows(library, row, state, closed):
    """:func:`pair_energy` of the rows that a library of C knows."""
    call = load(library).mufe_energy
    call.restype = ctypes.c_double
    call.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64]
    closed = np.ascontiguousarray(closed & row.view(state, "closed"))
    return call(address(state), address(closed, np.bool_), len(state)), int(closed.sum())
