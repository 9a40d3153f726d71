"""Sums over nodes and elements for the energy balance."""

import math

import numba

from .solid import AVERAGED, PLAIN, cofactors


@numba.njit(cache=True)
def kinetic_energy(v, a, dt, damping, mass, runs):
    """Kinetic energy of central differences at whole steps [J].

    Sum of m/2 (v - a dt/2).(v + a dt/2): with the elastic energy at the same
    instant this is the sum that the scheme conserves exactly in a linear system. With damping c it
    is so where m/2 (v c dt/2)² is added and its power is a trapezium, c m v² at whole steps.

    Args:
        v: Velocities [m/s], shape (num_nodes, 3).
        a: Accelerations [m/s²], shape (num_nodes, 3).
        dt: Time step [s].
        damping: c [1/s].
        mass: Nodal masses [kg], shape (num_nodes,).
        runs: Ranges of nodes to sum over, first and end and their grain, shape (num_runs, 3).
    """
    total, half = 0.0, 0.5 * dt
    of_v = 1.0 + (half * damping) ** 2
    for r in range(runs.shape[0]):
        for n in range(runs[r, 0], runs[r, 1]):
            v2 = v[n, 0] * v[n, 0] + v[n, 1] * v[n, 1] + v[n, 2] * v[n, 2]
            a2 = a[n, 0] * a[n, 0] + a[n, 1] * a[n, 1] + a[n, 2] * a[n, 2]
            total += 0.5 * mass[n] * (of_v * v2 - half * half * a2)
    return total


@numba.njit(cache=True, inline="always")
def _volume_energy(J):
    """J ln J - J + 1, to rounding of J - 1: near J = 1 it is a small difference of large terms."""
    d = J - 1.0
    return J * math.log1p(d) - d


@numba.njit(cache=True, inline="always")
def _own_energy(e):
    """e⁴/4 + e⁵/5 + ...: -ln(1 - e) without its first three terms."""
    return -math.log1p(-e) - e * (1.0 + e * (0.5 + e / 3.0))


@numba.njit(cache=True, inline="always")
def _volume(x, cell):
    """Volume of a tetrahedron [m³]."""
    return cofactors(x, cell[0], cell[1], cell[2], cell[3])[9] / 6.0


@numba.njit(cache=True)
def elastic_energy(energy, deviator, x, cells, volume0, grains, cell_offset, nodes, node_offset,
                   node_volume0, volume, bulk, shear, own, element):  # fmt: skip
    """Elastic energy of each grain [J], in place.

    t:t/4G over the first volume, t = J s, and K (J ln J - J + 1), J as the ``element`` takes it;
    and G (e^4/4 + e^5/5 + ...), e = 1 - 1/J, of the J of each tetrahedron.

    Args:
        energy: Result, shape (num_grains,).
        deviator: Deviator of the Kirchhoff stress [Pa], shape (num_cells, 6).
        volume: Current volumes around nodes [m³], shape (num_nodes,).
        shear: G of t:t/4G [Pa], inf where the deviator stores energy in another way, (num_grains,).
        own: G of e^4 [Pa], shape (num_grains,).
        others: As in :func:`~mufe_fenicsx.kernels.bulk.solid.add_internal_forces`.
    """
    for g in grains:
        total = 0.0
        for e in range(cell_offset[g], cell_offset[g + 1]):
            volume_of_cell = _volume(x, cells[e])
            s = deviator[e]
            ss = s[0] ** 2 + s[1] ** 2 + s[2] ** 2 + 2.0 * (s[3] ** 2 + s[4] ** 2 + s[5] ** 2)
            total += volume0[e] * ss / (4.0 * shear[g])
            if own[g] > 0.0:
                total += volume0[e] * own[g] * _own_energy(1.0 - volume0[e] / volume_of_cell)
            if element == PLAIN:
                total += volume0[e] * bulk[g] * _volume_energy(volume_of_cell / volume0[e])
        if element == AVERAGED:
            for i in range(node_offset[g], node_offset[g + 1]):
                n = nodes[i]
                total += node_volume0[n] * bulk[g] * _volume_energy(volume[n] / node_volume0[n])
        energy[g] = total


@numba.njit(cache=True)
def add_normal_stresses(
    total, deviator, pressure, element, x, cells, volume0, own, grains, cell_offset
):
    """Add Σ σ V of the elements of some grains, xx yy zz [J], to ``total``, shape (3,), in place.

    Args:
        deviator: Deviator of the Kirchhoff stress [Pa], shape (num_cells, 6).
        pressure: Mean stress of nodes where ``AVERAGED``, else of elements [Pa].
        element, x, own: As in :func:`elastic_energy`.
        cells, volume0, grains, cell_offset: As in :func:`elastic_energy`. Mean stresses act on the
            first volumes, which are those of now but for the strain of volume.
    """
    for g in grains:
        for e in range(cell_offset[g], cell_offset[g + 1]):
            if element == AVERAGED:
                mean = 0.0
                for i in range(4):
                    mean += 0.25 * pressure[cells[e, i]]
            else:
                mean = pressure[e]
            if own[g] > 0.0:
                mean += own[g] * (1.0 - volume0[e] / _volume(x, cells[e])) ** 3
            for i in range(3):
                total[i] += volume0[e] * (deviator[e, i] + mean)
