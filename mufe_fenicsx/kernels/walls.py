"""Contact of nodes with rigid planes, cylinders and spheres."""

import ctypes
import math

import numba
import numpy as np

from .contact_law import share_of_stiffness, spring_energy, stored_energy
from .native import Pointers, address, aligned, load
from .pairs import column, fill_rows, of_dents
from .points import corners_of

#: What a pair keeps, as in kernels.pairs; the rest of the row is as in walls.c.
ROW = 24
COLUMNS = {
    "corner": (np.int32, slice(0, 3)),
    "closed": (np.bool_, 12),
    "sliding": (np.bool_, 13),
    "wall": (np.uint16, 7),  # and above it the place in LEAD
    "recess": (np.float64, 2),
    "ratio": (np.float64, 3),
    "gap": (np.float64, 4),
    "offset": (np.float64, 5),
    "stiffness": (np.float64, 6),
    "normal_force": (np.float64, 7),
    "stick_point": (np.float64, slice(8, 11)),
    "slip": (np.float64, 11),
    "shear": (np.float64, slice(12, 15)),
    "work": (np.float64, 15),
    "softer": (np.float64, 16),
    "dent": (np.float64, 17),
    "yield_depth": (np.float64, 18),
    "edge": (np.float64, 19),
    "layer": (np.float64, 20),
    "slope_left": (np.float64, 21),
    "bend": (np.float64, 22),
}
#: Weights that one corner of a point can have, in the order of walls.c; the others share the rest.
LEAD = (1.0, 1 / 3, 2 / 3)
WALL_BITS = 14  # of a wall's number
TINY = 1e-300  # as in walls.c
#: Numbers of a wall in walls.c.
WALL = 68


@numba.njit(cache=True)
def gap_to_wall(normal_there, x, point, normal, radius):
    """Gap between a place and a wall [m]; the wall's normal there is set.

    The normal points into the sample. A wall without a radius is a plane. Else its surface is R
    away from an axis through ``point``, or from ``point`` itself where ``normal`` is zero:

        g = ±(R - d),  n = ∓e/d,  e = r - (r·a) a,  d = |e|,  r = x - point

    Args:
        normal_there: Set, shape (3,).
        x: Place [m], shape (3,).
        point, normal: Point of a plane and its normal; point and axis of a cylinder; middle of a
            sphere and zero. Shape (3,).
        radius: 0 of a plane; positive where the sample is inside, negative where outside [m].
    """
    height = square = 0.0
    for i in range(3):
        height += (x[i] - point[i]) * normal[i]
    if radius == 0.0:
        for i in range(3):
            normal_there[i] = normal[i]
        return height
    for i in range(3):
        normal_there[i] = x[i] - point[i] - height * normal[i]
        square += normal_there[i] ** 2
    distance, side = math.sqrt(square), math.copysign(1.0, radius)
    for i in range(3):
        normal_there[i] *= -side / max(distance, TINY)
    return radius - side * distance


@numba.njit(cache=True)
def gaps_to_walls(gap, normal_there, x, wall, point, normal, radius):
    """:func:`gap_to_wall` of places and their walls, both of shape (num,)."""
    for p in range(wall.size):
        w = wall[p]
        gap[p] = gap_to_wall(normal_there[p], x[p], point[w], normal[w], radius[w])


@numba.njit(cache=True)
def grow(radius, growth, side, rate, dt):
    """Radii go on by ``growth`` = dt rate, away from the axis, in place.

    Args:
        radius: As of :func:`gap_to_wall`, shape (num_walls,).
        growth: Set [m], shape (num_walls,).
        side: Sign of the radius, 0 of a plane.
        rate: [m/s], shape (num_walls,).
        dt: [s].

    Returns:
        Largest growth [m], and whether a radius has vanished.
    """
    largest, vanished = 0.0, False
    for w in range(radius.size):
        growth[w] = dt * rate[w]
        radius[w] += side[w] * growth[w]
        largest = max(largest, abs(growth[w]))
        vanished |= side[w] != 0.0 and side[w] * radius[w] <= 0.0
    return largest, vanished


@numba.njit(cache=True)
def work_of_growth(pressing, side, growth):
    """Work that grains inside do on walls that grow, less what grains outside do [J]."""
    work = 0.0
    for w in range(growth.size):
        work += pressing[w] * side[w] * growth[w]
    return work


@numba.njit(cache=True)
def farthest(x, point):
    """Largest distance of nodes from a point of each plane [m], shape (num_walls,)."""
    found = np.zeros(len(point))
    for n in range(len(x)):
        for w in range(len(point)):
            square = 0.0
            for i in range(3):
                square += (x[n, i] - point[w, i]) ** 2
            found[w] = max(found[w], square)
    return np.sqrt(found)


@numba.njit(cache=True)
def motion_to_walls(moves, field, normal, displacement, growth, turn, box, radius, dt):
    """How far a velocity field brings points to walls or away from them in a step, at most.

    Args:
        moves: Set to that distance along the normal [m], infinity for a wall that turns, shape
            (num_walls,). Of curved walls the distance in any direction across their axis.
        field: As in kernels.motion.
        normal, displacement, turn: Of the walls, as in kernels.motion, shape (num_walls, 3).
        growth: By which radii grew [m], shape (num_walls,).
        box: Least and largest positions of the points near each wall [m], shape (num_walls, 2, 3).
        radius: As of :func:`gap_to_wall`, shape (num_walls,).
        dt: Length of the step [s].
    """
    for w in range(moves.size):
        if radius[w] == 0.0:
            moves[w] = _along(field, normal[w], displacement[w], box[w], dt)
        else:
            moves[w] = _across(field, normal[w], displacement[w], box[w], dt) + abs(growth[w])
        if turn[w, 0] != 0.0 or turn[w, 1] != 0.0 or turn[w, 2] != 0.0:
            moves[w] = np.inf


@numba.njit(cache=True)
def _along(field, normal, displacement, box, dt):
    """Largest motion of the field along a normal in a box, beside that of the wall [m]."""
    # Linear in the place: largest in a corner.
    middle = spread = 0.0
    for i in range(3):
        along = velocity = 0.0
        for j in range(3):
            along += normal[j] * field[1 + i, j]
            velocity += 0.5 * (box[0, j] + box[1, j]) * field[1 + j, i]
        spread += abs(along) * 0.5 * (box[1, i] - box[0, i])
        middle += normal[i] * (dt * (field[0, i] + velocity) - displacement[i])
    return abs(middle) + dt * spread


@numba.njit(cache=True)
def _across(field, axis, displacement, box, dt):
    """Bound of the motion of the field across an axis in a box, beside that of the wall [m]."""
    square = 0.0
    # Along the three axes, each without its part along that of the wall.
    for i in range(3):
        a, b, c = -axis[i] * axis[0], -axis[i] * axis[1], -axis[i] * axis[2]
        across = (a + (i == 0), b + (i == 1), c + (i == 2))
        square += _along(field, across, displacement, box, dt) ** 2
    return math.sqrt(square)


@numba.njit(cache=True)
def find_wall_candidates(x, held, point, normal, radius, reach):
    """Nodes within ``reach`` of each wall, or behind it, but for those that it holds.

    Args:
        x: Positions [m], shape (num_nodes, 3).
        held: Whether nodes are glued to walls or cut by them, shape (num_nodes, num_walls).
        point, normal, radius: As of :func:`gap_to_wall`, of each wall.
        reach: Largest gap [m].

    Returns:
        node and wall of each pair; pairs increase in node, then in wall.
    """
    count, there = 0, np.empty(3)
    for fill in range(2):
        if fill:
            node, wall = np.empty(count, np.int32), np.empty(count, np.int32)
            count = 0
        for n in range(held.shape[0]):
            for w in range(held.shape[1]):
                if held[n, w]:
                    continue
                if gap_to_wall(there, x[n], point[w], normal[w], radius[w]) <= reach:
                    if fill:
                        node[count], wall[count] = n, w
                    count += 1
    return node, wall


def _leading(corner, weight):
    """Corners of points with the one of a weight of its own first, and its place in ``LEAD``."""
    corner, weight = (np.broadcast_to(a, (len(corner), 3)) for a in (corner, weight))
    first = weight.argmax(axis=1)[:, None]
    order = (first + np.arange(3)) % 3
    lead = np.abs(weight.max(axis=1)[:, None] - LEAD).argmin(axis=1)
    rest = 0.5 * (1.0 - np.array(LEAD))[lead]
    if not np.allclose(np.sort(weight, axis=1)[:, :2], rest[:, None], rtol=0.0, atol=1e-12):
        raise ValueError(f"weights of a point's corners, expected one of {LEAD} and the rest even")
    return np.take_along_axis(corner, order, axis=1), lead


class WallForces:
    """Adds the forces of closed node-wall pairs to nodes and walls; local.

    The law is that of :class:`~mufe_fenicsx.kernels.pairs.PairForces`, on the
    whole nodal area since one side only carries nodes; stick points move with the wall.

    All arrays are changed where they are, and must stay there.

    Args:
        state: A row of each pair, shape (num_pairs, ROW), with the columns
            stick_point: Stick point relative to ``point`` [m];
            stiffness: Area over layer [N/m], set here;
            softer: Length m of the law [m];
            dent: Depth of the dent, which adds to the recess [m];
            yield_depth: Depth from which on it deepens [m];
            slope_left: Part of the law's slope that is left while it does;
            edge, layer: Of the facet around [m, m/Pa], set here;
            shear: Friction on the node [N];
            gap, offset: Gap and its offset [m];
            slip: Accumulated slip [m];
            normal_force: Normal force on the node [N];
            work: Energy dissipated by friction since the last search [J];
            closed, sliding: As of PairForces.
        next_check, bounds, bound_row: As of PairForces, (num_pairs,) but for ``bounds``.
        node, wall: The pairs, int32, shape (num_pairs,).
        layer: Compliance c h/E* of the nodes [m/Pa], shape (num_nodes,).
        area, facet_area: Areas that the nodes stand for, and of facets there [m²], (num_nodes,).
        recess: How far the nodes lie behind the surface that carries contact [m], (num_nodes,).
        ratio: Tangential over normal stiffness, shape (num_nodes,).
        corner, corner_weight, x, f: As of PairForces.
        wall_force: Forces on walls [N], shape (num_walls, 3).
        wall_torque: Their torques about ``point`` [N m], shape (num_walls, 3).
        pressing: Sums of the normal forces on walls [N], shape (num_walls,).
        point, normal, velocity: Of the walls [m, 1, m/s], shape (num_walls, 3).
        radius: As of :func:`gap_to_wall` [m], shape (num_walls,).
        friction: Coefficients of friction that a pair has to overcome, shape (num_walls,).
        friction_kinetic: Coefficients while it slips; until a step in which it sticks.
        strengths, strength_offset, strain, work, cell, dents: As of PairForces.

    Raises:
        ValueError: An array is of another type, or not contiguous; too many walls; a point with
            weights that are not those of ``LEAD``.
    """

    def __init__(self, state, next_check, bounds, bound_row, node, wall, layer, area, facet_area,
                 recess, ratio,
                 corner, corner_weight, x, f, wall_force, wall_torque, pressing, point, normal,
                 velocity, radius, friction, friction_kinetic, strengths,
                 strength_offset, strain, work, cell, dents):  # fmt: skip
        real, short = np.float64, np.int32
        self._num_pairs = node.size
        self._totals = np.zeros(2)
        self._totals_at = address(self._totals)
        self._num_walls = len(point)
        scratch = np.empty(node.size + 1, short)
        if len(point) > 1 << WALL_BITS:
            raise ValueError(f"walls = {len(point)}, expected at most {1 << WALL_BITS}")
        edge = np.sqrt(4.0 / math.sqrt(3.0) * facet_area)
        of_points = {
            "stiffness": area / layer, "recess": recess, "ratio": ratio, "edge": edge,
            "layer": layer,
        }  # fmt: skip
        fill_rows(state, node, of_points, COLUMNS)
        corners, lead = _leading(*corners_of(node, corner, corner_weight))
        column(state, "corner", COLUMNS)[:] = corners
        column(state, "wall", COLUMNS)[:] = wall | lead << WALL_BITS
        self._pointers = Pointers(
            (state, real), (next_check, real), (bounds, real), (bound_row, short), (scratch, short),
            (aligned(WALL * len(point)), real), (x, real), (f, real), (wall_force, real),
            (wall_torque, real), (pressing, real), (point, real), (normal, real),
            (velocity, real), (radius, real), (friction, real), (friction_kinetic, real),
            (strengths, real) if strengths.size else None, (strength_offset, short), (strain, real),
            (work, real), (cell, short), (node, short), None, *of_dents(dents),
        )  # fmt: skip
        pointer, number, integer = ctypes.c_void_p, ctypes.c_double, ctypes.c_int64
        self._call = load("walls").mufe_add_wall_forces
        self._call.argtypes = [pointer, pointer, number, integer, integer, integer]
        self._call.restype = None

    def __call__(self, accept, ahead=0.0):
        """Add the forces at the positions ``x``.

        Args:
            accept: True to accept every overlap (start of a test).
            ahead: How much later than the planes the positions are [s].

        Returns:
            Energy dissipated by friction [J]; number of accepted pairs.
        """
        totals = self._totals
        self._call(
            self._pointers.table, self._totals_at, ahead, self._num_pairs, self._num_walls, accept,
        )  # fmt: skip
        dissipated, accepted = totals.tolist()
        return dissipated, int(accepted)


@numba.njit(cache=True)
def wall_energy(gap, offset, closed, softer, shear, node, layer, area, ratio):
    """Energy stored in the springs of closed node-wall pairs [J], and their number."""
    energy, count = 0.0, 0
    for p in range(node.size):
        if closed[p]:
            count += 1
            kn = area[node[p]] / layer[node[p]]
            depth = offset[p] - gap[p]
            energy += stored_energy(kn, depth, math.inf, softer[p])
            kt = kn * ratio[node[p]] * share_of_stiffness(depth, softer[p])
            energy += spring_energy(shear[p], kt)
    return energy, count


@numba.njit(cache=True)
def closed_stiffness(total, wall, closed, stiffness):
    """Set ``total`` to the stiffness of the closed pairs of each wall [N/m], shape (num_walls,)."""
    total[:] = 0.0
    for p in range(wall.size):
        if closed[p]:
            total[wall[p]] += stiffness[p]
