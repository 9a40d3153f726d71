"""Neo-Hookean tetrahedra: forces and energy from the deformation since the reference places.

The energy over the first volume is that of an isotropic solid whose deviator follows the stretch,

    W = G/2 (J^(-2/3) tr b - 3) + K (J ln J - J + 1),    F = ∂x/∂X,  b = F Fᵀ,  J = det F

(R. W. Ogden, Non-Linear Elastic Deformations, 1984, section 7.2). The deviator of the Kirchhoff
stress is t = G J^(-2/3) dev b, with J of the element. The mean stress is K ln J as in
kernels.solid, with J of a node, an element or a composite. Nothing is integrated in time.
"""

import math

import numba
import numpy as np

from .solid import AVERAGED, COMPOSITE, FAST, PARTS, cofactors


def reference_gradients(x, cells):
    """Gradients of nodes b, c, d in the reference places [1/m], shape (num_cells, 9).

    Args:
        x: Reference positions [m], shape (num_nodes, 3).
        cells: Nodes a, b, c, d of the elements, shape (num_cells, 4).
    """
    edges = x[cells[:, 1:]] - x[cells[:, :1]]
    return np.ascontiguousarray(np.linalg.inv(edges).transpose(0, 2, 1).reshape(-1, 9))


@numba.njit(cache=True, fastmath=FAST, error_model="numpy", inline="always")
def _gradient(x, cell, h):
    """Deformation gradient, nine numbers, row by row; ``h`` as of :func:`reference_gradients`."""
    a, b, c, d = cell[0], cell[1], cell[2], cell[3]
    ux, uy, uz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    vx, vy, vz = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
    wx, wy, wz = x[d, 0] - x[a, 0], x[d, 1] - x[a, 1], x[d, 2] - x[a, 2]
    return (
        ux * h[0] + vx * h[3] + wx * h[6],
        ux * h[1] + vx * h[4] + wx * h[7],
        ux * h[2] + vx * h[5] + wx * h[8],
        uy * h[0] + vy * h[3] + wy * h[6],
        uy * h[1] + vy * h[4] + wy * h[7],
        uy * h[2] + vy * h[5] + wy * h[8],
        uz * h[0] + vz * h[3] + wz * h[6],
        uz * h[1] + vz * h[4] + wz * h[7],
        uz * h[2] + vz * h[5] + wz * h[8],
    )


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def _set_pressure(pressure, x, cells, volume0, begin, end, nodes, node_volume0, around, bulk,
                  element):  # fmt: skip
    """Mean stress K ln J of the nodes of one grain, or of its elements or composites, in place."""
    if element == AVERAGED:
        for n in nodes:
            around[n] = 0.0
        for e in range(begin, end):
            c = cells[e]
            quarter = cofactors(x, c[0], c[1], c[2], c[3])[9] / 24.0
            for i in range(4):
                around[c[i]] += quarter
        for n in nodes:
            pressure[n] = bulk * math.log(around[n] / node_volume0[n])
        return
    family = PARTS if element == COMPOSITE else 1
    for first in range(begin, end, family):
        now = before = 0.0
        for e in range(first, first + family):
            c = cells[e]
            now += cofactors(x, c[0], c[1], c[2], c[3])[9] / 6.0
            before += volume0[e]
        for e in range(first, first + family):
            pressure[e] = bulk * math.log(now / before)


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def subtract_neo_hookean(f, deviator, pressure, around, x, cells, volume0, gradients, first,
                         grains, cell_offset, nodes, node_offset, node_volume0, bulk, shear,
                         element):  # fmt: skip
    """Subtract the internal forces of some grains from ``f``, and write their stress, in place.

    Args:
        f: Nodal forces [N], shape (num_nodes, 3).
        deviator: Deviator t of the Kirchhoff stress [Pa], xx yy zz xy yz xz, (num_cells, 6).
        pressure: Mean stress of nodes (of elements unless ``AVERAGED``) [Pa], tension positive.
        around: Scratch for the volumes around nodes, shape (num_nodes,).
        x: Positions [m], shape (num_nodes, 3).
        cells, volume0, cell_offset, bulk, shear: As of kernels.solid.InternalForces.
        gradients: Of :func:`reference_gradients`, of the elements of ``grains`` alone.
        first: Row of the first element of each of the grains in them, shape (n,).
        grains: The grains, shape (n,).
        nodes, node_offset: Nodes grain after grain, and the first of each grain.
        node_volume0: First volumes around nodes [m³], shape (num_nodes,).
        element: ``PLAIN``, ``AVERAGED`` or ``COMPOSITE``.

    Returns:
        The last element whose volume is not positive, or -1.
    """
    bad = -1
    for k in range(len(grains)):
        g = grains[k]
        begin, end = cell_offset[g], cell_offset[g + 1]
        own = nodes[node_offset[g] : node_offset[g + 1]]
        _set_pressure(
            pressure, x, cells, volume0, begin, end, own, node_volume0, around, bulk[g], element
        )
        for e in range(begin, end):
            cell = cells[e]
            a, b, c, d = cell[0], cell[1], cell[2], cell[3]
            F = _gradient(x, cell, gradients[first[k] + e - begin])
            h = cofactors(x, a, b, c, d)
            volume = h[9] / 6.0
            if not volume > 0.0:
                bad = e
            factor = shear[g] * math.exp(-2.0 / 3.0 * math.log(volume / volume0[e]))
            xx = factor * (F[0] * F[0] + F[1] * F[1] + F[2] * F[2])
            yy = factor * (F[3] * F[3] + F[4] * F[4] + F[5] * F[5])
            zz = factor * (F[6] * F[6] + F[7] * F[7] + F[8] * F[8])
            xy = factor * (F[0] * F[3] + F[1] * F[4] + F[2] * F[5])
            yz = factor * (F[3] * F[6] + F[4] * F[7] + F[5] * F[8])
            xz = factor * (F[0] * F[6] + F[1] * F[7] + F[2] * F[8])
            third = (xx + yy + zz) / 3.0
            xx, yy, zz = xx - third, yy - third, zz - third
            t = deviator[e]
            t[0], t[1], t[2], t[3], t[4], t[5] = xx, yy, zz, xy, yz, xz
            if element == AVERAGED:
                mean = 0.25 * (pressure[a] + pressure[b] + pressure[c] + pressure[d])
            else:
                mean = pressure[e]
            # Kirchhoff stress times the present gradients, over the first volume.
            share, p = volume0[e] / h[9], mean / 6.0
            xx, yy, zz = share * xx + p, share * yy + p, share * zz + p
            xy, yz, xz = share * xy, share * yz, share * xz
            for i in range(3):
                hx, hy, hz = h[3 * i], h[3 * i + 1], h[3 * i + 2]
                fx = xx * hx + xy * hy + xz * hz
                fy = xy * hx + yy * hy + yz * hz
                fz = xz * hx + yz * hy + zz * hz
                n = cell[i + 1]
                f[n, 0] -= fx
                f[n, 1] -= fy
                f[n, 2] -= fz
                f[a, 0] += fx
                f[a, 1] += fy
                f[a, 2] += fz
    return bad


@numba.njit(cache=True)
def add_neo_hookean_energy(energy, x, cells, volume0, gradients, first, grains, cell_offset, shear):
    """Add the energy of the deviator of some grains [J] to ``energy``, (num_grains,), in place.

    Other arguments as of :func:`subtract_neo_hookean`.
    """
    for k in range(len(grains)):
        g = grains[k]
        for e in range(cell_offset[g], cell_offset[g + 1]):
            cell = cells[e]
            F = _gradient(x, cell, gradients[first[k] + e - cell_offset[g]])
            J = cofactors(x, cell[0], cell[1], cell[2], cell[3])[9] / (6.0 * volume0[e])
            trace = 0.0
            for i in range(9):
                trace += F[i] * F[i]
            energy[g] += 0.5 * shear[g] * volume0[e] * (J ** (-2.0 / 3.0) * trace - 3.0)
