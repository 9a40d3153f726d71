"""Contact of nodes with rigid planes, cylinders and spheres."""

import ctypes
import math

import numba
import numpy as np

from ..build.native import Pointers, address, load
from ..build.pair_rows import WALL_PAIR
from ..build.rows import aligned
from .pairs import energy_of_rows, fill_points, of_strength

RULE_BITS = 4  # of the rule of a point, above the number of its wall
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
        field: As in kernels.bulk.motion.
        normal, displacement, turn: Of the walls, as in kernels.bulk.motion, shape (num_walls, 3).
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


class WallForces:
    """Adds the forces of closed node-wall pairs to nodes and walls; local.

    The law is that of :class:`~mufe_fenicsx.kernels.contact.pairs.PairForces`, on the
    whole nodal area since one side only carries nodes; stick points move with the wall.

    All arrays are changed where they are, and must stay there.

    Args:
        pairs: :class:`~mufe_fenicsx.contact.pairs.wall_pairs.WallPairs`.
        walls: :class:`~mufe_fenicsx.contact.walls.Walls`.
        points, ghosts, layers, work: As of PairForces.

    Raises:
        ValueError: An array is of another type, or not contiguous; too many walls.
    """

    def __init__(self, pairs, walls, points, ghosts, layers, work):
        real, short = np.float64, np.int32
        self._num_pairs, self._num_walls = pairs.node.size, len(walls.point)
        self._totals = np.zeros(2)
        self._totals_at = address(self._totals)
        most = 1 << (16 - RULE_BITS)
        if self._num_walls > most:
            raise ValueError(f"walls = {self._num_walls}, expected at most {most}")
        corner, rule = fill_points(pairs, points, ghosts, layers)
        pairs.corner[:] = corner
        WALL_PAIR.view(pairs.state, "wall")[:] = pairs.wall << RULE_BITS | rule
        pairs.stiffness[:] = points.area[pairs.node] / points.layer[pairs.node]
        curved = walls.curved
        self._pointers = Pointers(
            (pairs.state, real), (pairs.next_check, real), (pairs.bounds, real),
            (pairs.motion_bounds.of, short), (np.empty(pairs.node.size + 1, short), short),
            (aligned(WALL * self._num_walls), real), (points.rules, real),
            (ghosts.positions.array, real), (ghosts.forces.array, real), (walls.force, real),
            (walls.torque, real), (curved.pressing, real), (walls.point, real),
            (walls.normal, real), (walls.velocity, real), (curved.radius, real),
            (walls.friction, real), (walls.friction_kinetic, real),
            *of_strength(pairs, layers, work),
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


def wall_energy(state, closed):
    """:func:`~.pairs.pair_energy` of pairs with walls."""
    return energy_of_rows("walls", WALL_PAIR, state, closed)


def normal_forces(state):
    """Normal forces of the rows of pairs with walls [N], made anew, shape (num_pairs,)."""
    out = np.zeros(len(state))
    call = load("walls").mufe_normal_forces
    call.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64]
    call.restype = None
    call(address(out), address(state), len(state))
    return out


@numba.njit(cache=True)
def closed_stiffness(total, wall, closed, stiffness):
    """Set ``total`` to the stiffness of the closed pairs of each wall [N/m], shape (num_walls,)."""
    total[:] = 0.0
    for p in range(wall.size):
        if closed[p]:
            total[wall[p]] += stiffness[p]
