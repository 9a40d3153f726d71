"""How much less a mesh gives way between two nodes of an edge than its nodes themselves do."""

import math

import numba
import numpy as np

from ..bulk.stiffness import gradients


@numba.njit(cache=True)
def cells_around(cells, num_nodes):
    """Tetrahedra around each node, as compressed rows.

    Args:
        cells: Nodes of the tetrahedra, shape (num_cells, 4).
        num_nodes: Number of nodes.

    Returns:
        First entry of each node, shape (num_nodes + 1,); tetrahedra, shape (4 num_cells,).
    """
    offset = np.zeros(num_nodes + 1, np.int64)
    for c in range(cells.shape[0]):
        for a in range(4):
            offset[cells[c, a] + 1] += 1
    for n in range(num_nodes):
        offset[n + 1] += offset[n]
    fill, found = offset[:-1].copy(), np.empty(4 * cells.shape[0], np.int32)
    for c in range(cells.shape[0]):
        for a in range(4):
            found[fill[cells[c, a]]] = c
            fill[cells[c, a]] += 1
    return offset, found


#: Part of a diagonal of the stiffness that is left where nothing holds a node any more.
FREE = 1e-9


@numba.njit(cache=True)
def _free_nodes(free, place, a, b, cells, offset, around, neighbours):
    """Nodes of all tetrahedra around a and b, these two last, and their places; their number."""
    count = 0
    for end in (a, b):
        for m in range(offset[end], offset[end + 1] if neighbours else 0):
            for k in range(4):
                n = cells[around[m], k]
                if n != a and n != b and place[n] < 0:
                    place[n] = count
                    free[count] = n
                    count += 1
    for end in (a, b):
        place[end] = count
        free[count] = end
        count += 1
    return count


@numba.njit(cache=True)
def _num_held(free, place, count, cells, offset, around):
    """How many nodes that are not free the tetrahedra around the free ones have."""
    held = 0
    for i in range(count):
        for m in range(offset[free[i]], offset[free[i] + 1]):
            for k in range(4):
                n = cells[around[m], k]
                if place[n] == -1:
                    place[n] = -2
                    free[count + held] = n
                    held += 1
    for i in range(count, count + held):
        place[free[i]] = -1
    return held


@numba.njit(cache=True)
def largest_patch(place, free, ends, cells, offset, around, averaged):
    """Most nodes that are free around an edge, and most volumes that they take part in.

    Args:
        place: -1 for each node, and again afterwards, shape (num_nodes,).
        free: Room for as many nodes as a patch has, shape (num_nodes,).
        ends, cells, offset, around, averaged: As of :func:`add_edge_compliance`.
    """
    most, most_volumes = 0, 0
    for e in range(ends.shape[0]):
        count = _free_nodes(free, place, ends[e, 0], ends[e, 1], cells, offset, around, True)
        num_cells = 0
        for i in range(count):
            place[free[i]] = -1
            num_cells += offset[free[i] + 1] - offset[free[i]]
        most = max(most, count)
        most_volumes = max(most_volumes, 4 * num_cells if averaged else num_cells)
    return most, most_volumes


@numba.njit(cache=True, error_model="numpy")
def _assemble(
    K, B, free, count, place, place_of_volume, volumes, x, cells, offset, around, grain_of_cell,
    bulk, shear, volume, averaged, g, e, at,
):  # fmt: skip
    """The lower half of the stiffness of ``count`` free nodes, all others held, in place.

    Arguments as of :func:`add_edge_compliance`; ``g``, ``e`` and ``at`` are room for a tetrahedron.
    Places of the nodes are forgotten.
    """
    size, num_volumes = 3 * count, 0
    # Loops, as in rows.resized: slices on the left of "=" take long to compile.
    for i in range(size):
        for j in range(i + 1):
            K[i, j] = 0.0
    for i in range(count):
        for entry in range(offset[free[i]], offset[free[i] + 1]):
            c = around[entry]
            first = True  # each tetrahedron with the first of its free nodes
            for k in range(4):
                at[k] = place[cells[c, k]]
                first = first and not 0 <= at[k] < i
            if not first:
                continue
            six = gradients(g, e, x, cells, c)
            # Deviator: V G (b ⊗ a + a·b I - 2/3 a ⊗ b), gradients g over six volumes.
            G = shear[grain_of_cell[c]] / (6.0 * six)
            for p in range(4):
                for s in range(4):
                    if at[p] < 0 or at[s] < 0 or at[s] > at[p]:
                        continue
                    dot = g[p, 0] * g[s, 0] + g[p, 1] * g[s, 1] + g[p, 2] * g[s, 2]
                    for k in range(3):
                        for m in range(3):
                            K[3 * at[p] + k, 3 * at[s] + m] += G * (
                                g[s, k] * g[p, m] - 2.0 / 3.0 * g[p, k] * g[s, m]
                            )
                        K[3 * at[p] + k, 3 * at[s] + k] += G * dot
            # Mean stress: derivatives of the volumes that the tetrahedron is part of.
            for v in range(4 if averaged else 1):
                number = cells[c, v] if averaged else c
                if place_of_volume[number] < 0:
                    place_of_volume[number] = num_volumes
                    volumes[num_volumes] = number
                    for j in range(size):
                        B[num_volumes, j] = 0.0
                    num_volumes += 1
                part = 1.0 / 24.0 if averaged else 1.0 / 6.0
                for p in range(4):
                    if at[p] >= 0:
                        for k in range(3):
                            B[place_of_volume[number], 3 * at[p] + k] += part * g[p, k]
    modulus = bulk[grain_of_cell[around[offset[free[0]]]]]
    for v in range(num_volumes):
        place_of_volume[volumes[v]] = -1
        row, factor = B[v], modulus / volume[volumes[v]]
        for i in range(size):
            if row[i] != 0.0:
                for j in range(i + 1):
                    K[i, j] += factor * row[i] * row[j]
    for i in range(count):
        place[free[i]] = -1


@numba.njit(cache=True, error_model="numpy")
def add_edge_compliance(
    compliance, K, B, free, place, place_of_volume, volumes, ends, direction, x, cells, offset,
    around, grain_of_cell, bulk, shear, volume, averaged,
):  # fmt: skip
    """Add the relative compliance of the ends of edges, in place.

        D = (e1 - e2)ᵀ K⁻¹ (e1 - e2)

    with unit forces e1 and e2 on the two ends along a direction. K is the elastic stiffness of the
    tetrahedra around both ends and around their neighbours; the nodes beyond are held. Where these
    are fewer than the free ones, as in a grain of few elements, all nodes but the two are held; and
    where the two can turn then, as in a tetrahedron alone, nothing is added.

    Args:
        compliance: D [m/N], shape (num_edges,).
        K: Room for the stiffness, shape (3 n, 3 n), n as of :func:`largest_patch`.
        B: Room for derivatives of volumes, shape (m, 3 n), m as of :func:`largest_patch`.
        free: Room for the nodes, shape (n,).
        place, place_of_volume: -1 for each node and volume, and again afterwards.
        volumes: Room for the volumes, shape (m,).
        ends: Nodes, shape (num_edges, 2).
        direction: Unit vectors, shape (num_edges, 3).
        x: Reference positions [m], shape (num_nodes, 3).
        cells: Nodes of the tetrahedra, shape (num_cells, 4).
        offset, around: As of :func:`cells_around`.
        grain_of_cell: Shape (num_cells,).
        bulk, shear: Moduli of the grains [Pa], shape (num_grains,).
        volume: That mean stresses belong to [m³]: of nodes if ``averaged``, else of tetrahedra,
            shape (num_volumes,).
        averaged: Whether a tetrahedron takes the mean of its four nodes.
    """
    g, e, at, f = np.empty((4, 3)), np.empty((3, 3)), np.empty(4, np.int64), np.empty(6)
    for n_edge in range(ends.shape[0]):
        a, b = ends[n_edge, 0], ends[n_edge, 1]
        for neighbours in (True, False):
            count = _free_nodes(free, place, a, b, cells, offset, around, neighbours)
            if neighbours and _num_held(free, place, count, cells, offset, around) < count:
                for i in range(count):
                    place[free[i]] = -1
                continue
            _assemble(
                K, B, free, count, place, place_of_volume, volumes, x, cells, offset, around,
                grain_of_cell, bulk, shear, volume, averaged, g, e, at,
            )  # fmt: skip
            for k in range(3):
                f[k], f[3 + k] = direction[n_edge, k], -direction[n_edge, k]
            compliance[n_edge] += _relative_compliance(K, 3 * count, f)
            break


@numba.njit(cache=True, fastmath={"contract", "reassoc"}, error_model="numpy")
def _relative_compliance(K, size, f):
    """fᵀ K⁻¹ f of forces ``f`` (6,) on the last two nodes; K and ``f`` become L of K = L Lᵀ and y.

    It is |y|² with L y = f; 0 where the nodes can move without any force.
    """
    for i in range(size):
        diagonal = K[i, i]
        for j in range(i + 1):
            rest = K[i, j]
            for m in range(j):
                rest -= K[i, m] * K[j, m]
            if i == j and rest < FREE * diagonal:
                return 0.0
            K[i, j] = math.sqrt(rest) if i == j else rest / K[j, j]
    total, first = 0.0, size - 6
    for i in range(6):
        for m in range(i):
            f[i] -= K[first + i, first + m] * f[m]
        f[i] /= K[first + i, first + i]
        total += f[i] * f[i]
    return total
