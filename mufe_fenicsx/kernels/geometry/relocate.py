"""Nodes of a tetrahedral mesh moved so that the smallest altitude around them grows."""

import math

import numba
import numpy as np

from .closest import closest_point

FIXED, INTERIOR, SURFACE, EDGE = 0, 1, 2, 3

#: Directions from a node to try: the corners, edges and faces of a cube around it.
CUBE = np.array(
    [(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1) if i or j or k],
    dtype=np.float64,
)
CUBE /= np.linalg.norm(CUBE, axis=1, keepdims=True)


@numba.njit(cache=True, error_model="numpy")
def altitude(x, a, b, c, d):
    """Smallest altitude of a tetrahedron, 3 V over its largest face; < 0 inside out."""
    ux, uy, uz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    vx, vy, vz = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
    wx, wy, wz = x[d, 0] - x[a, 0], x[d, 1] - x[a, 1], x[d, 2] - x[a, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    volume6 = nx * wx + ny * wy + nz * wz
    largest = nx * nx + ny * ny + nz * nz
    px, py, pz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
    largest = max(largest, px * px + py * py + pz * pz)
    qx, qy, qz = vy * wz - vz * wy, vz * wx - vx * wz, vx * wy - vy * wx
    largest = max(largest, qx * qx + qy * qy + qz * qz)
    # The fourth face: (b - a, c - a, d - a) crossed pairwise add up to it.
    rx, ry, rz = nx - px + qx, ny - py + qy, nz - pz + qz
    largest = max(largest, rx * rx + ry * ry + rz * rz)
    return volume6 / math.sqrt(largest) if largest > 0.0 else 0.0


@numba.njit(cache=True, error_model="numpy")
def relocate(x, drift, cells, size, star_offset, star, facets, ring_offset, ring, kind, along,
             target, tolerance, rounds):  # fmt: skip
    """Move nodes, one after the other, where that raises the smallest altitude around them.

    Only nodes with an altitude below ``target`` around them move: along the directions of a
    cube, those of the surface along it, by steps that shrink from a quarter to a sixtieth of the
    elements' size (compass search). A node of the surface may leave the facets around it, and these
    leave its old place, by no more than ``tolerance`` in all, so that edges and corners stay. Nodes
    of kind EDGE move towards their neighbours along an edge of the body only.

    Args:
        x: Positions, shape (num_nodes, 3).
        drift: What each node of the surface has left it by so far, shape (num_nodes,).
        cells: Shape (num_cells, 4).
        size: Length by which altitudes around each node are measured, shape (num_cells,).
        star_offset, star: Cells around each node, compressed rows.
        facets: Triangles of the surface, shape (num_facets, 3).
        ring_offset, ring: Facets around each node, compressed rows.
        kind: FIXED, INTERIOR, SURFACE or EDGE, shape (num_nodes,).
        along: Neighbours along their edge of nodes of kind EDGE, shape (num_nodes, 2).
        target: Altitude over size that is good enough.
        tolerance: Of the surface, a length.
        rounds: Sweeps over the nodes at most.

    Returns:
        Number of moves.
    """
    moves = 0
    directions = np.empty((64, 3))
    for _ in range(rounds):
        before = moves
        for v in range(x.shape[0]):
            if kind[v] == FIXED:
                continue
            quality = _worst(x, cells, size, star_offset, star, v)
            if quality >= target:
                continue
            if kind[v] == EDGE:
                count = _along_edge(directions, x, along, v)
            else:
                on_surface = kind[v] == SURFACE
                count = _directions(directions, x, facets, ring_offset, ring, v, on_surface)
            length = 0.0
            for s in range(star_offset[v], star_offset[v + 1]):
                length += size[star[s]]
            step = 0.25 * length / (star_offset[v + 1] - star_offset[v])
            while step > 0.015 * length / (star_offset[v + 1] - star_offset[v]):
                ox, oy, oz = x[v, 0], x[v, 1], x[v, 2]
                best, best_direction, best_left = quality, -1, 0.0
                for d in range(count):
                    x[v, 0] = ox + step * directions[d, 0]
                    x[v, 1] = oy + step * directions[d, 1]
                    x[v, 2] = oz + step * directions[d, 2]
                    found = _worst(x, cells, size, star_offset, star, v)
                    if found <= best + 1e-4:
                        continue
                    left = 0.0
                    if kind[v] != INTERIOR:
                        left = _left(x, facets, ring_offset, ring, v, ox, oy, oz)
                        if drift[v] + left > tolerance:
                            continue
                    best, best_direction, best_left = found, d, left
                x[v, 0], x[v, 1], x[v, 2] = ox, oy, oz
                if best_direction < 0:
                    step *= 0.5
                    continue
                for i in range(3):
                    x[v, i] += step * directions[best_direction, i]
                drift[v] += best_left
                quality = best
                moves += 1
                if quality >= target:
                    break
        if moves == before:
            break
    return moves


@numba.njit(cache=True, error_model="numpy")
def may_move(x, new, nodes, cells, size, star_offset, star, least):
    """Whether nodes, one after the other, may go to new places, where they then are in ``x``.

    The smallest altitude around a node may not fall below ``least``, or not fall where it is below.
    Those that may not stay. ``x`` is unchanged in the end.

    Args:
        x, new: Positions, shape (num_nodes, 3).
        nodes: Which to try.
        cells, size, star_offset, star: As in :func:`relocate`.
        least: Altitude over size.
    """
    good = np.zeros(nodes.size, np.bool_)
    old = np.empty((nodes.size, 3))
    for k in range(nodes.size):
        v = nodes[k]
        before = _worst(x, cells, size, star_offset, star, v)
        old[k] = x[v]
        x[v] = new[v]
        after = _worst(x, cells, size, star_offset, star, v)
        good[k] = after >= min(before, least)
        if not good[k]:
            x[v] = old[k]
    for k in range(nodes.size):
        x[nodes[k]] = old[k]
    return good


@numba.njit(cache=True, error_model="numpy")
def _worst(x, cells, size, star_offset, star, v):
    """Smallest altitude over size of the cells around a node."""
    worst = np.inf
    for s in range(star_offset[v], star_offset[v + 1]):
        c = star[s]
        found = altitude(x, cells[c, 0], cells[c, 1], cells[c, 2], cells[c, 3]) / size[c]
        worst = min(worst, found)
    return worst


@numba.njit(cache=True, error_model="numpy")
def _directions(directions, x, facets, ring_offset, ring, v, on_surface):
    """Fill in unit vectors to try: those of a cube, or along the facets; their number."""
    if not on_surface:
        directions[: CUBE.shape[0]] = CUBE
        return CUBE.shape[0]
    count = 0
    for r in range(ring_offset[v], min(ring_offset[v + 1], ring_offset[v] + 10)):
        a, b, c = facets[ring[r], 0], facets[ring[r], 1], facets[ring[r], 2]
        if b == v:
            b, c = c, a
        elif c == v:
            b, c = a, b
        # Along the edges of the ring, which may be those of the body, and between them.
        for part in (0.0, 0.5):
            dx = (1 - part) * x[b, 0] + part * x[c, 0] - x[v, 0]
            dy = (1 - part) * x[b, 1] + part * x[c, 1] - x[v, 1]
            dz = (1 - part) * x[b, 2] + part * x[c, 2] - x[v, 2]
            norm = math.sqrt(dx * dx + dy * dy + dz * dz)
            for sign in (1.0, -1.0):
                directions[count, 0] = sign * dx / norm
                directions[count, 1] = sign * dy / norm
                directions[count, 2] = sign * dz / norm
                count += 1
    return count


@numba.njit(cache=True, error_model="numpy")
def _along_edge(directions, x, along, v):
    """Fill in unit vectors to the two neighbours along an edge; their number."""
    for k in range(2):
        length = 0.0
        for i in range(3):
            directions[k, i] = x[along[v, k], i] - x[v, i]
            length += directions[k, i] ** 2
        for i in range(3):
            directions[k, i] /= math.sqrt(length)
    return 2


@numba.njit(cache=True, error_model="numpy")
def _left(x, facets, ring_offset, ring, v, ox, oy, oz):
    """By how much a node that moved from o has left the facets, or these its old place."""
    nx, ny, nz = x[v, 0], x[v, 1], x[v, 2]
    now = _distance(x, facets, ring_offset, ring, v, ox, oy, oz)
    x[v, 0], x[v, 1], x[v, 2] = ox, oy, oz
    before = _distance(x, facets, ring_offset, ring, v, nx, ny, nz)
    x[v, 0], x[v, 1], x[v, 2] = nx, ny, nz
    return max(now, before)


@numba.njit(cache=True, error_model="numpy")
def _distance(x, facets, ring_offset, ring, v, px, py, pz):
    """Distance of a point to the facets around a node."""
    closest = np.inf
    for r in range(ring_offset[v], ring_offset[v + 1]):
        a, b, c = facets[ring[r], 0], facets[ring[r], 1], facets[ring[r], 2]
        wa, wb, wc, _ = closest_point(px, py, pz, x, a, b, c)
        dx = wa * x[a, 0] + wb * x[b, 0] + wc * x[c, 0] - px
        dy = wa * x[a, 1] + wb * x[b, 1] + wc * x[c, 1] - py
        dz = wa * x[a, 2] + wb * x[b, 2] + wc * x[c, 2] - pz
        closest = min(closest, dx * dx + dy * dy + dz * dz)
    return math.sqrt(closest)
