"""Elastic tangent of the tetrahedra: its action on a vector, and bounds of its spectrum."""

import math

import numba

from .solid import AVERAGED, COMPOSITE, FAST, PARTS, U, _cofactors


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def add_elastic_stiffness(
    y,
    nodal,
    q,
    x,
    cells,
    volume0,
    grains,
    cell_offset,
    nodes,
    node_offset,
    node_volume0,
    bulk,
    shear,
    element,
):
    """Add K q to ``y``, in place: elastic tangent at the positions ``x``.

    The stress that is there already (geometric stiffness) is left out: it is of
    the order stress/E beside the elastic terms.

    Args:
        y: Result [N], shape (num_nodes, 3).
        nodal: Scratch, shape (num_nodes,).
        q: Displacements [m], shape (num_nodes, 3).
        others: As in :func:`~mufe_fenicsx.kernels.solid.add_internal_forces`.
    """
    for g in grains:
        K, G = bulk[g], shear[g]
        begin, end = cell_offset[g], cell_offset[g + 1]
        together = 0.0
        if element == AVERAGED:
            for i in range(node_offset[g], node_offset[g + 1]):
                nodal[nodes[i]] = 0.0
            for e in range(begin, end):
                a, b, c, d = U(cells[e, 0]), U(cells[e, 1]), U(cells[e, 2]), U(cells[e, 3])
                h = _cofactors(x, a, b, c, d)
                dv = 0.0
                for i in range(3):
                    dv += h[i] * (q[b, i] - q[a, i])
                    dv += h[3 + i] * (q[c, i] - q[a, i])
                    dv += h[6 + i] * (q[d, i] - q[a, i])
                dv /= 24.0
                nodal[a] += dv
                nodal[b] += dv
                nodal[c] += dv
                nodal[d] += dv
            for i in range(node_offset[g], node_offset[g + 1]):
                n = nodes[i]
                nodal[n] *= K / node_volume0[n]

        for e in range(begin, end):
            a, b, c, d = U(cells[e, 0]), U(cells[e, 1]), U(cells[e, 2]), U(cells[e, 3])
            if element == COMPOSITE and (e - begin) % PARTS == 0:
                together = K * _volume_strain(q, x, cells[e : e + PARTS], volume0[e : e + PARTS])
            h1x, h1y, h1z, h2x, h2y, h2z, h3x, h3y, h3z, det = _cofactors(x, a, b, c, d)
            d1x, d1y, d1z = q[b, 0] - q[a, 0], q[b, 1] - q[a, 1], q[b, 2] - q[a, 2]
            d2x, d2y, d2z = q[c, 0] - q[a, 0], q[c, 1] - q[a, 1], q[c, 2] - q[a, 2]
            d3x, d3y, d3z = q[d, 0] - q[a, 0], q[d, 1] - q[a, 1], q[d, 2] - q[a, 2]
            G2 = 2.0 * G / det
            exx = d1x * h1x + d2x * h2x + d3x * h3x
            eyy = d1y * h1y + d2y * h2y + d3y * h3y
            ezz = d1z * h1z + d2z * h2z + d3z * h3z
            exy = 0.5 * (d1x * h1y + d2x * h2y + d3x * h3y + d1y * h1x + d2y * h2x + d3y * h3x)
            eyz = 0.5 * (d1y * h1z + d2y * h2z + d3y * h3z + d1z * h1y + d2z * h2y + d3z * h3y)
            exz = 0.5 * (d1x * h1z + d2x * h2z + d3x * h3z + d1z * h1x + d2z * h2x + d3z * h3x)
            trace = exx + eyy + ezz
            if element == AVERAGED:
                p = 0.25 * (nodal[a] + nodal[b] + nodal[c] + nodal[d])
            elif element == COMPOSITE:
                p = together
            else:
                p = K * trace / (6.0 * volume0[e])
            mean = trace / 3.0
            txx = (G2 * (exx - mean) + p) / 6.0
            tyy = (G2 * (eyy - mean) + p) / 6.0
            tzz = (G2 * (ezz - mean) + p) / 6.0
            txy, tyz, txz = G2 * exy / 6.0, G2 * eyz / 6.0, G2 * exz / 6.0
            f1x = txx * h1x + txy * h1y + txz * h1z
            f1y = txy * h1x + tyy * h1y + tyz * h1z
            f1z = txz * h1x + tyz * h1y + tzz * h1z
            f2x = txx * h2x + txy * h2y + txz * h2z
            f2y = txy * h2x + tyy * h2y + tyz * h2z
            f2z = txz * h2x + tyz * h2y + tzz * h2z
            f3x = txx * h3x + txy * h3y + txz * h3z
            f3y = txy * h3x + tyy * h3y + tyz * h3z
            f3z = txz * h3x + tyz * h3y + tzz * h3z
            y[a, 0] -= f1x + f2x + f3x
            y[a, 1] -= f1y + f2y + f3y
            y[a, 2] -= f1z + f2z + f3z
            y[b, 0] += f1x
            y[b, 1] += f1y
            y[b, 2] += f1z
            y[c, 0] += f2x
            y[c, 1] += f2y
            y[c, 2] += f2z
            y[d, 0] += f3x
            y[d, 1] += f3y
            y[d, 2] += f3z


@numba.njit(cache=True, fastmath=FAST, error_model="numpy", inline="always")
def _volume_strain(q, x, cells, volume0):
    """Change of volume of some elements together by displacements ``q``, over their first one."""
    change = volume = 0.0
    for e in range(cells.shape[0]):
        a, b, c, d = U(cells[e, 0]), U(cells[e, 1]), U(cells[e, 2]), U(cells[e, 3])
        h = _cofactors(x, a, b, c, d)
        for i in range(3):
            change += h[i] * (q[b, i] - q[a, i])
            change += h[3 + i] * (q[c, i] - q[a, i])
            change += h[6 + i] * (q[d, i] - q[a, i])
        volume += volume0[e]
    return change / (6.0 * volume)


@numba.njit(cache=True)
def element_time_step(x, cells, grains, cell_offset, wave_speed):
    """Smallest proven time step of the elements [s] and its element.

    With a quarter of the mass at each node, the highest frequency of one linear
    tetrahedron obeys omega <= 2 c sqrt(sum_a |grad N_a|^2), and |grad N_a| is one
    over the altitude at a; the assembled system lies below the worst element
    (B. M. Irons, S. Ahmad, Techniques of Finite Elements, 1980). The step is 2/omega.
    A mean of J over several elements only takes energy away, so that this holds for it too.

    Args:
        x: Positions [m], shape (num_nodes, 3).
        cells: Nodes of the elements, shape (num_cells, 4).
        grains: The grains that deform, shape (num_deformable,).
        cell_offset: First element of each grain, shape (num_grains + 1,).
        wave_speed: Speed of compression waves of the grains [m/s], shape (num_grains,).
    """
    best, worst = math.inf, -1
    for g in grains:
        for e in range(cell_offset[g], cell_offset[g + 1]):
            h = _cofactors(x, cells[e, 0], cells[e, 1], cells[e, 2], cells[e, 3])
            s0, s1, s2 = h[0] + h[3] + h[6], h[1] + h[4] + h[7], h[2] + h[5] + h[8]
            total = s0 * s0 + s1 * s1 + s2 * s2
            for i in range(9):
                total += h[i] * h[i]
            dt = abs(h[9]) / (wave_speed[g] * math.sqrt(total))
            if dt < best:
                best, worst = dt, e
    return best, worst
