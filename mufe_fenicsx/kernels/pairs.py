"""Contact of nodes with the facets of other grains: forces and energy."""

import ctypes

import numba
import numpy as np

from .contact_law import share_of_stiffness, spring_energy, stored_energy
from .native import Pointers, aligned, load
from .points import corners_of

#: What a pair keeps, a row of 40 numbers in which a step finds all it needs: types, and columns
#: counted in numbers of that type. The rest of the row is as in pairs.h.
ROW = 40
COLUMNS = {
    "other_next_check": (np.float64, 0),
    "node": (np.int32, 2),
    "closed": (np.bool_, 12),
    "sliding": (np.bool_, 13),
    "sharp": (np.bool_, 14),
    "known": (np.bool_, 15),
    "vertices": (np.int32, slice(4, 7)),
    "corner": (np.int32, slice(7, 10)),
    "area": (np.float64, 5),
    "recess": (np.float64, 6),
    "ratio": (np.float64, 7),
    "gap": (np.float64, 8),
    "offset": (np.float64, 9),
    "stiffness": (np.float64, 10),
    "normal_force": (np.float64, 11),
    "weights": (np.float64, slice(12, 15)),
    "slip": (np.float64, 15),
    "normal": (np.float64, slice(16, 19)),
    "work": (np.float64, 19),
    "stick_point": (np.float64, slice(20, 23)),
    "largest_depth": (np.float64, 23),
    "shear": (np.float64, slice(24, 27)),
    "around": (np.int32, slice(54, 56)),
    "corner_weight": (np.float64, slice(28, 31)),
    "bound_row": (np.int32, 62),
    "friction": (np.int32, 63),
    "bulge": (np.float32, slice(64, 70)),
    "softer": (np.float32, 70),
    "yield_depth": (np.float32, 71),
    "facing": (np.float64, slice(36, 39)),
    "height": (np.float64, 39),
}


#: Parts of the pairs, in the order of pairs.h.
ALL, EARLY, OTHERS = range(3)


class _Call(ctypes.Structure):
    """What a call is given and finds, as in pairs.h."""

    _fields_ = [
        *((name, ctypes.c_double) for name in ("friction", "friction_kinetic", "range")),
        ("steepest", ctypes.c_double),
        *((name, ctypes.c_int64) for name in ("accept", "part", "num_others")),
        *((name, ctypes.c_double) for name in ("dissipated", "switched", "accepted", "deepest")),
        ("sunk", ctypes.c_double),
        ("sunken", ctypes.c_int64),
    ]


def column(state, name, columns=COLUMNS):
    """What the rows of ``state`` keep under that name, a view."""
    dtype, place = columns[name]
    return state.view(dtype)[:, place]


def rows(number, width):
    """That many rows of ``width`` numbers, all zero, the first at the start of a cache line."""
    return aligned(number * width).reshape(number, width)


def fill_rows(state, node, of_points, columns=COLUMNS):
    """Set the columns of the rows of pairs that their points ``node`` have.

    Args:
        state, node: As below.
        of_points: Names of columns and the values of points, shape (num_points,).
        columns: Of the rows.
    """
    for name, values in of_points.items():
        column(state, name, columns)[:] = values[node]


def of_dents(dents):
    """Pointers to what points keep of dents."""
    return zip(dents, (np.float64, np.float64, np.int32), strict=True)


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

    All arrays are changed where they are, and must stay there.

    Args:
        state: A row of each pair, shape (num_pairs, ROW), with the columns
            weights, normal: Closest point and normal, facet to node;
            stick_point: Weights of the stick point in the closest facet;
            shear: Friction on the node [N];
            gap, offset: Gap and its offset (<= 0, but for multipliers) [m];
            stiffness: Of closed pairs [N/m];
            largest_depth: Depth from which their force grows no more [m];
            slip: Accumulated slip [m];
            normal_force: Normal force on the node [N];
            work: Energy dissipated since the last search [J];
            closed: Whether the pair carries force;
            sliding: Whether the pair slipped in this step;
            known: Whether the facet that was closest last is: its ``vertices``, whether it is
            ``sharp``, and ``other_next_check``, the least ``candidate_next_check`` of the others.
        next_check: Bound of its motion before which a pair cannot close [m], shape (num_pairs,).
        candidate_next_check: No more than that for each candidate, float32, (num_candidates,).
        bounds: Of all relative motion of two grains so far [m], shape (num_bounds,).
        bound_row: Which one is that of each pair, int32, shape (num_pairs,).
        closest: Candidate that was closest last, -1 unknown, int64, shape (num_pairs,).
        node, first, candidate: Pairs, as in kernels.search; int32, int64, int32.
        facets, neighbour, ring_offset, ring: Surface, as in kernels.closest; int32, but for
            ``ring_offset``, int64.
        sharp: Whether a facet has a vertex on a sharp edge, shape (num_facets,).
        layer_of_node, layer_of_facet: Compliance c h/E* of a side [m/Pa].
        area: Areas that the nodes stand for [m²], shape (num_nodes,).
        area_at_node, area_of_facet: Areas of the facets at nodes, and of facets [m²], those of the
            reference configuration.
        depth_of_node, depth_of_facet: Parts of a side in the largest depth of a pair [m].
        recess: How far the nodes lie behind the surface that carries contact [m], (num_nodes,).
        ratio_of_node: Tangential over normal stiffness, shape (num_nodes,).
        around: Rows of the nodes around those that are nodes, int32, one after another.
        around_of: The first there and how many, none for points in facets, (num_nodes, 2).
        corner, corner_weight: As in kernels.points, where the nodes of pairs are points in
            facets, which hand their forces on; else of shape (0, 3).
        x: Positions [m], shape (num_nodes_with_ghosts, 3); those of points in facets are not used.
        f: Forces on surface nodes [N], shape (num_nodes_with_ghosts, 3).
        early: Whether a pair comes before all that are not, shape (num_pairs,).
        friction: Static and kinetic coefficients, shape (n, 2): a pair has to overcome the one to
            slip, and has the other while it slips, until a step in which it sticks.
        friction_row: The row there of each pair, int32; of size 0: the first of all.
        strengths, strength_offset: Of both bodies of each pair, as of contact.stiffness.strength.
        strain: Plastic one of all cells, shape (num_cells,).
        work: Plastic work of the dents beneath which they are [J], the same; empty without tables.
        cell: That beneath the point of each pair, int32, shape (num_pairs,).
        dents: What points keep of dents: depths in their own surface and in that of another grain
            [m], float64, and this grain, int32, shape (num_nodes,).
        partner: The other grain of each pair, int32.
        dent: Depths of dents, which add to the recess of the pairs [m], shape (num_pairs,).
        slope_left: Part of the law's slope that is left while a dent deepens, set then, the same.

    Raises:
        ValueError: An array is of another type, or not contiguous.
    """

    def __init__(self, state, next_check, candidate_next_check, bounds, bound_row, closest, node,
                 first, candidate, facets, neighbour, ring_offset, ring, sharp, layer_of_node,
                 layer_of_facet, area, area_at_node, area_of_facet, depth_of_node, depth_of_facet,
                 bulge_of_facet, curvature_of_point, curvature_of_facet, steepest, recess,
                 ratio_of_node, around, around_of, corner, corner_weight, x, f, early, friction,
                 friction_row, strengths, strength_offset, strain, work, cell, dents, partner,
                 dent, slope_left):  # fmt: skip
        real, short, long, flag = np.float64, np.int32, np.int64, np.bool_
        self._num_pairs = node.size
        self._found = _Call(steepest=steepest)
        scratch, seen = np.empty(2 * (node.size + 1), short), np.empty(node.size, short)
        of_points = {
            "area": area, "recess": recess, "ratio": ratio_of_node, "around": around_of,
        }  # fmt: skip
        fill_rows(state, node, of_points)
        column(state, "recess")[:] += dent
        nodes, weight = corners_of(node, corner, corner_weight)
        column(state, "corner")[:], column(state, "corner_weight")[:] = nodes, weight
        column(state, "bound_row")[:] = bound_row
        self._found.friction, self._found.friction_kinetic = friction[0]
        if friction_row.size:
            column(state, "friction")[:] = friction_row
        self._any_early = bool(early.any())
        self._pointers = Pointers(
            (state, real), (next_check, real), (candidate_next_check, np.float32), (bounds, real),
            (bound_row, short), (closest, long), (scratch, short), (seen, short), (early, flag),
            (first, long), (candidate, short),
            (facets, short), (neighbour, short), (ring_offset, long), (ring, short), (sharp, flag),
            (layer_of_node, real), (layer_of_facet, real), (area_at_node, real),
            (area_of_facet, real), (depth_of_node, real), (depth_of_facet, real),
            (bulge_of_facet, real), (curvature_of_point, real), (curvature_of_facet, real),
            (around, short),
            (x, real), (f, real), (friction, real) if friction_row.size else None,
            (strengths, real) if strengths.size else None, (strength_offset, short), (strain, real),
            (work, real), (cell, short), (node, short), (partner, short),
            *of_dents(dents), (dent, real), (recess, real), (slope_left, real),
        )  # fmt: skip
        pointer = ctypes.c_void_p
        self._call = load("pairs").mufe_add_pair_forces
        self._call.argtypes = [pointer, pointer, ctypes.c_int64]
        self._call.restype = None

    def __call__(self, longest, accept, between):
        """Add the forces at the positions ``x`` to ``f``.

        Args:
            longest: Distance up to which the bounds hold [m].
            accept: True to accept every overlap (start of a test).
            between: Called once the early pairs have their forces; without any, at the end.

        Returns:
            Energy dissipated by friction [J]; energy that springs lost where pairs passed to other
            facets [J]; number of accepted pairs; their largest depth [m]; of pairs beyond their
            largest depth the largest one over the lesser part of both sides in it, and its pair,
            -1 if none.
        """
        c = self._found
        c.range, c.accept = longest, accept
        table, call, num = self._pointers.table, ctypes.addressof(c), self._num_pairs
        c.part = EARLY if self._any_early else ALL
        self._call(table, call, num)
        between()
        if self._any_early:
            c.part = OTHERS
            self._call(table, call, num)
        return c.dissipated, c.switched, int(c.accepted), c.deepest, (c.sunk, c.sunken)


@numba.njit(cache=True)
def pair_energy(gap, offset, closed, stiffness, softer, shear, node, ratio_of_node, largest_depth):
    """Energy stored in the springs of closed pairs [J], and their number."""
    energy, count = 0.0, 0
    for p in range(node.size):
        if closed[p]:
            count += 1
            energy += stored_energy(stiffness[p], offset[p] - gap[p], largest_depth[p], softer[p])
            share = share_of_stiffness(min(offset[p] - gap[p], largest_depth[p]), softer[p])
            energy += spring_energy(shear[p], share * stiffness[p] * ratio_of_node[node[p]])
    return energy, count
