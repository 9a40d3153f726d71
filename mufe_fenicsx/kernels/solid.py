"""Stress update and internal forces of linear tetrahedra, grain by grain.

The Cauchy stress is split into a deviator s, integrated in time, and a mean
stress p = K ln J, which is a function of the current volume alone.

What is integrated is that of the Kirchhoff stress, t = J s, J of the element: its rate t' = 2 G
dev D in the frame that turns with the element makes t:t/4G, over the first volume, the exact
store of its power, so that no path of strains gains or loses energy, and the tangent is
symmetric (R. Hill, J. Mech. Phys. Solids 7, 1959, 209-225). The same rate of s itself lets a
vibrating, turning grain with stresses locked in gain energy exponentially.

Deviator: strain increment and spin at the midpoint of the step (T. J. R.
Hughes, J. Winget, Int. J. Numer. Methods Eng. 15, 1980, 1862-1867), so that a
rigid rotation of any size strains nothing; then a radial return (M. L. Wilkins,
Methods Comput. Phys. 3, 1964) as far as the plastic law says, by default that of von Mises
with a hardening table (kernels.hardening); :func:`with_law` makes the same with another one.

Mean stress, where ``averaged``: J of a node is the current over the first
volume of the elements around it, and an element takes the mean of its four
nodes (J. Bonet, A. J. Burton, Commun. Numer. Methods Eng. 14, 1998, 437-449).
These forces derive from the energy sum_a V_a K (J_a ln J_a - J_a + 1).

In a composite tetrahedron J is that of its ``PARTS`` linear ones together, which stand one
after the other (Y. Guo, M. Ortiz, T. Belytschko, E. A. Repetto, Int. J. Numer. Methods Eng. 47,
2000, 287-316; P. Thoutireddy, J. F. Molinari, E. A. Repetto, M. Ortiz, 53, 2002, 1337-1351):
the energy is sum V K (J ln J - J + 1) over the composites. Plain ones have a J each.

Constraints where the volume is kept, in a large mesh of V vertices, about 6 V tetrahedra and
7 V edges: plain 6 V against 3 V unknowns, which locks; averaged V against 3 V; composite 6 V
against 3 (V + 7 V) = 24 V. Inside a ball held at its surface, 240 to 1500 composites have no
spurious pressure and an inf-sup constant of 0.05 to 0.07 that does not fall as the mesh is
refined. It is small since those around one edge alone are not held: composites show more of a
checkerboard than averaged tetrahedra, and far less than plain ones.

Grains are the outer loop: the data of one grain stay in the cache from the
pass over volumes to the pass over stresses.
"""

import functools
import math
import types

import numba
import numpy as np

from .hardening import plastic_increment

# Reassociation and contraction only: NaN and infinity keep their meaning.
FAST = {"contract", "reassoc", "arcp", "nsz"}

# Unsigned indices spare the test for negative ones at each access.
U = numba.uintp

# Elements that are worked on together, so that the compiler can use vector instructions.
# Their numbers stand in rows of an array: 0-8 edges of node a to b, c, d (later forces),
# 9-17 their velocities, 18-23 deviator t, 24-32 cofactors, 33 volume, 34 mean stress,
# 35 square of the trial von Mises stress (later J).
LANES = 16

#: Over what J is taken: a linear tetrahedron, the nodes, or a composite tetrahedron.
PLAIN, AVERAGED, COMPOSITE = 0, 1, 2
#: Linear tetrahedra in a composite one; composites are not cut by batches of ``LANES``.
PARTS = 8


@numba.njit(cache=True, fastmath=FAST, error_model="numpy", inline="always")
def _cofactors(x, a, b, c, d):
    """Six times volume times the gradients of nodes b, c, d; and six times the volume."""
    e1x, e1y, e1z = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    e2x, e2y, e2z = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
    e3x, e3y, e3z = x[d, 0] - x[a, 0], x[d, 1] - x[a, 1], x[d, 2] - x[a, 2]
    c1x, c1y, c1z = e2y * e3z - e2z * e3y, e2z * e3x - e2x * e3z, e2x * e3y - e2y * e3x
    c2x, c2y, c2z = e3y * e1z - e3z * e1y, e3z * e1x - e3x * e1z, e3x * e1y - e3y * e1x
    c3x, c3y, c3z = e1y * e2z - e1z * e2y, e1z * e2x - e1x * e2z, e1x * e2y - e1y * e2x
    det = e1x * c1x + e1y * c1y + e1z * c1z
    return c1x, c1y, c1z, c2x, c2y, c2z, c3x, c3y, c3z, det


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def nodal_volumes(volume, x, cells):
    """Add a quarter of each element's volume [m³] to its nodes, in place.

    Args:
        volume: Volumes around nodes, shape (num_nodes,).
        x: Positions [m], shape (num_nodes, 3).
        cells: Nodes of the elements, shape (num_cells, 4).
    """
    for e in range(cells.shape[0]):
        a, b, c, d = U(cells[e, 0]), U(cells[e, 1]), U(cells[e, 2]), U(cells[e, 3])
        det = _cofactors(x, a, b, c, d)[9]
        quarter = det / 24.0
        volume[a] += quarter
        volume[b] += quarter
        volume[c] += quarter
        volume[d] += quarter


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def _trial_stress(w, dt, G):
    """Elastic trial stress of a batch of elements; see the rows of ``w`` at ``LANES``."""
    for i in range(LANES):
        e1x, e1y, e1z = w[i], w[1 * LANES + i], w[2 * LANES + i]
        e2x, e2y, e2z = w[3 * LANES + i], w[4 * LANES + i], w[5 * LANES + i]
        e3x, e3y, e3z = w[6 * LANES + i], w[7 * LANES + i], w[8 * LANES + i]
        d1x, d1y, d1z = dt * w[9 * LANES + i], dt * w[10 * LANES + i], dt * w[11 * LANES + i]
        d2x, d2y, d2z = dt * w[12 * LANES + i], dt * w[13 * LANES + i], dt * w[14 * LANES + i]
        d3x, d3y, d3z = dt * w[15 * LANES + i], dt * w[16 * LANES + i], dt * w[17 * LANES + i]

        m1x, m1y, m1z = e1x - 0.5 * d1x, e1y - 0.5 * d1y, e1z - 0.5 * d1z
        m2x, m2y, m2z = e2x - 0.5 * d2x, e2y - 0.5 * d2y, e2z - 0.5 * d2z
        m3x, m3y, m3z = e3x - 0.5 * d3x, e3y - 0.5 * d3y, e3z - 0.5 * d3z
        g1x, g1y, g1z = m2y * m3z - m2z * m3y, m2z * m3x - m2x * m3z, m2x * m3y - m2y * m3x
        g2x, g2y, g2z = m3y * m1z - m3z * m1y, m3z * m1x - m3x * m1z, m3x * m1y - m3y * m1x
        g3x, g3y, g3z = m1y * m2z - m1z * m2y, m1z * m2x - m1x * m2z, m1x * m2y - m1y * m2x
        inv = 1.0 / (m1x * g1x + m1y * g1y + m1z * g1z)

        # Gradient of the displacement increment at the midpoint.
        lxx = inv * (d1x * g1x + d2x * g2x + d3x * g3x)
        lxy = inv * (d1x * g1y + d2x * g2y + d3x * g3y)
        lxz = inv * (d1x * g1z + d2x * g2z + d3x * g3z)
        lyx = inv * (d1y * g1x + d2y * g2x + d3y * g3x)
        lyy = inv * (d1y * g1y + d2y * g2y + d3y * g3y)
        lyz = inv * (d1y * g1z + d2y * g2z + d3y * g3z)
        lzx = inv * (d1z * g1x + d2z * g2x + d3z * g3x)
        lzy = inv * (d1z * g1y + d2z * g2y + d3z * g3y)
        lzz = inv * (d1z * g1z + d2z * g2z + d3z * g3z)
        third = (lxx + lyy + lzz) / 3.0

        # Rotation R = I + 2/(1 + q.q) (Q + Q Q), q half the axial vector of the spin.
        qx, qy, qz = 0.25 * (lzy - lyz), 0.25 * (lxz - lzx), 0.25 * (lyx - lxy)
        t = 2.0 / (1.0 + qx * qx + qy * qy + qz * qz)
        rxx = 1.0 - t * (qy * qy + qz * qz)
        ryy = 1.0 - t * (qx * qx + qz * qz)
        rzz = 1.0 - t * (qx * qx + qy * qy)
        rxy, ryx = t * (qx * qy - qz), t * (qx * qy + qz)
        rxz, rzx = t * (qx * qz + qy), t * (qx * qz - qy)
        ryz, rzy = t * (qy * qz - qx), t * (qy * qz + qx)

        # The increment belongs to the middle of the step: half of it turns along.
        hxx, hyy, hzz = G * (lxx - third), G * (lyy - third), G * (lzz - third)
        hxy, hyz, hxz = 0.5 * G * (lxy + lyx), 0.5 * G * (lyz + lzy), 0.5 * G * (lxz + lzx)
        sxx, syy, szz = w[18 * LANES + i] + hxx, w[19 * LANES + i] + hyy, w[20 * LANES + i] + hzz
        sxy, syz, sxz = w[21 * LANES + i] + hxy, w[22 * LANES + i] + hyz, w[23 * LANES + i] + hxz
        ax = rxx * sxx + rxy * sxy + rxz * sxz
        ay = rxx * sxy + rxy * syy + rxz * syz
        az = rxx * sxz + rxy * syz + rxz * szz
        bx = ryx * sxx + ryy * sxy + ryz * sxz
        by = ryx * sxy + ryy * syy + ryz * syz
        bz = ryx * sxz + ryy * syz + ryz * szz
        cx = rzx * sxx + rzy * sxy + rzz * sxz
        cy = rzx * sxy + rzy * syy + rzz * syz
        cz = rzx * sxz + rzy * syz + rzz * szz
        sxx = ax * rxx + ay * rxy + az * rxz + hxx
        syy = bx * ryx + by * ryy + bz * ryz + hyy
        szz = cx * rzx + cy * rzy + cz * rzz + hzz
        sxy = ax * ryx + ay * ryy + az * ryz + hxy
        syz = bx * rzx + by * rzy + bz * rzz + hyz
        sxz = ax * rzx + ay * rzy + az * rzz + hxz

        w[18 * LANES + i], w[19 * LANES + i], w[20 * LANES + i] = sxx, syy, szz
        w[21 * LANES + i], w[22 * LANES + i], w[23 * LANES + i] = sxy, syz, sxz
        w[35 * LANES + i] = 1.5 * (sxx * sxx + syy * syy + szz * szz) + 3.0 * (
            sxy * sxy + syz * syz + sxz * sxz
        )

        # Cofactors of the end of the step: gradients times six volumes.
        h1x, h1y, h1z = e2y * e3z - e2z * e3y, e2z * e3x - e2x * e3z, e2x * e3y - e2y * e3x
        h2x, h2y, h2z = e3y * e1z - e3z * e1y, e3z * e1x - e3x * e1z, e3x * e1y - e3y * e1x
        h3x, h3y, h3z = e1y * e2z - e1z * e2y, e1z * e2x - e1x * e2z, e1x * e2y - e1y * e2x
        w[24 * LANES + i], w[25 * LANES + i], w[26 * LANES + i] = h1x, h1y, h1z
        w[27 * LANES + i], w[28 * LANES + i], w[29 * LANES + i] = h2x, h2y, h2z
        w[30 * LANES + i], w[31 * LANES + i], w[32 * LANES + i] = h3x, h3y, h3z
        w[33 * LANES + i] = (e1x * h1x + e1y * h1y + e1z * h1z) / 6.0


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def _element_forces(w):
    """Forces of a batch of elements on their nodes b, c, d, into rows 0 to 8 of ``w``."""
    sixth = 1.0 / 6.0
    for i in range(LANES):
        p = sixth * w[34 * LANES + i]
        part = sixth / w[35 * LANES + i]
        txx = part * w[18 * LANES + i] + p
        tyy = part * w[19 * LANES + i] + p
        tzz = part * w[20 * LANES + i] + p
        txy, tyz, txz = (
            part * w[21 * LANES + i],
            part * w[22 * LANES + i],
            part * w[23 * LANES + i],
        )
        h1x, h1y, h1z = w[24 * LANES + i], w[25 * LANES + i], w[26 * LANES + i]
        h2x, h2y, h2z = w[27 * LANES + i], w[28 * LANES + i], w[29 * LANES + i]
        h3x, h3y, h3z = w[30 * LANES + i], w[31 * LANES + i], w[32 * LANES + i]
        w[i] = txx * h1x + txy * h1y + txz * h1z
        w[1 * LANES + i] = txy * h1x + tyy * h1y + tyz * h1z
        w[2 * LANES + i] = txz * h1x + tyz * h1y + tzz * h1z
        w[3 * LANES + i] = txx * h2x + txy * h2y + txz * h2z
        w[4 * LANES + i] = txy * h2x + tyy * h2y + tyz * h2z
        w[5 * LANES + i] = txz * h2x + tyz * h2y + tzz * h2z
        w[6 * LANES + i] = txx * h3x + txy * h3y + txz * h3z
        w[7 * LANES + i] = txy * h3x + tyy * h3y + tyz * h3z
        w[8 * LANES + i] = txz * h3x + tyz * h3y + tzz * h3z


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def add_internal_forces(
    f,
    deviator,
    plastic_strain,
    plastic_work,
    pressure,
    x,
    v,
    dt,
    cells,
    volume0,
    cell_offset,
    nodes,
    node_offset,
    node_volume0,
    bulk,
    shear,
    grains,
    parameters,
    element,
):
    """Advance the stress by one step and subtract the internal forces from ``f``, in place.

    Args:
        f: Nodal forces [N], shape (num_nodes, 3).
        deviator: Deviator t of the Kirchhoff stress [Pa], xx yy zz xy yz xz, shape (num_cells, 6).
        plastic_strain: Equivalent plastic strain, shape (num_cells,).
        plastic_work: Plastic work so far [J], shape (num_cells,).
        pressure: Mean stress of nodes (of elements unless ``AVERAGED``) [Pa],
            tension positive, shape (max(num_nodes, num_cells),); written.
        x: Positions at the end of the step [m], shape (num_nodes, 3).
        v: Velocities that led there [m/s], shape (num_nodes, 3).
        dt: Length of that step [s].
        cells: Nodes of the elements, those of a grain together, shape (num_cells, 4).
        volume0: First volumes of the elements [m³], shape (num_cells,).
        cell_offset: First element of each grain, shape (num_grains + 1,).
        nodes: Nodes, those of a grain together, shape (num_nodes,).
        node_offset: First entry of each grain in ``nodes``, shape (num_grains + 1,).
        node_volume0: First volumes around the nodes [m³], shape (num_nodes,).
        bulk, shear: Moduli of the grains [Pa], shape (num_grains,).
        grains: Grains to work on, shape (n,).
        parameters: Of the plastic law of all grains, shape (num_grains, m); the first is the least
            von Mises stress of t at which the material can yield [Pa].
        element: ``PLAIN``, ``AVERAGED`` or ``COMPOSITE``.

    Returns:
        The first element whose volume is not positive, or -1.
    """
    bad = -1
    w = np.empty(36 * LANES)
    for g in grains:
        K, G = bulk[g], shear[g]
        law = parameters[g]
        begin, end = cell_offset[g], cell_offset[g + 1]
        first_yield2 = law[0] * law[0]

        if element == AVERAGED:
            for i in range(node_offset[g], node_offset[g + 1]):
                pressure[nodes[i]] = 0.0
            nodal_volumes(pressure, x, cells[begin:end])
            for i in range(node_offset[g], node_offset[g + 1]):
                n = nodes[i]
                pressure[n] = K * math.log(pressure[n] / node_volume0[n])

        for start in range(begin, end, LANES):
            count = min(LANES, end - start)
            for i in range(LANES):
                e = U(start + min(i, count - 1))
                a, b, c, d = U(cells[e, 0]), U(cells[e, 1]), U(cells[e, 2]), U(cells[e, 3])
                for k in range(3):
                    w[k * LANES + i] = x[b, k] - x[a, k]
                    w[(3 + k) * LANES + i] = x[c, k] - x[a, k]
                    w[(6 + k) * LANES + i] = x[d, k] - x[a, k]
                    w[(9 + k) * LANES + i] = v[b, k] - v[a, k]
                    w[(12 + k) * LANES + i] = v[c, k] - v[a, k]
                    w[(15 + k) * LANES + i] = v[d, k] - v[a, k]
                for k in range(6):
                    w[(18 + k) * LANES + i] = deviator[e, k]
                if element == AVERAGED:
                    w[34 * LANES + i] = 0.25 * (
                        pressure[a] + pressure[b] + pressure[c] + pressure[d]
                    )
            _trial_stress(w, dt, G)

            if element == COMPOSITE:
                for first in range(0, count, PARTS):
                    now = before = 0.0
                    for i in range(first, first + PARTS):
                        now += w[33 * LANES + i]
                        before += volume0[U(start + i)]
                    mean = K * math.log(now / before)
                    for i in range(first, first + PARTS):
                        pressure[U(start + i)] = w[34 * LANES + i] = mean
            for i in range(count):
                e = U(start + i)
                if not w[33 * LANES + i] > 0.0:
                    bad = start + i
                if element == PLAIN:
                    pressure[e] = w[34 * LANES + i] = K * math.log(w[33 * LANES + i] / volume0[e])
                if w[35 * LANES + i] > first_yield2:
                    alpha, q = plastic_strain[e], math.sqrt(w[35 * LANES + i])
                    dp = plastic_increment(q, w[34 * LANES + i], alpha, dt, G, law)
                    if dp > 0.0:
                        scale = 1.0 - 3.0 * G * dp / q
                        # Half of the start's stress and half of the end's: the rule by which
                        # the nodal forces do their work.
                        before = 0.0
                        for k in range(3):
                            before += 1.5 * deviator[e, k] * w[(18 + k) * LANES + i]
                            before += 3.0 * deviator[e, 3 + k] * w[(21 + k) * LANES + i]
                        for k in range(18, 24):
                            w[k * LANES + i] *= scale
                        plastic_strain[e] = alpha + dp
                        plastic_work[e] += 0.5 * (q * scale + before / q) * dp * volume0[e]
                for k in range(6):
                    deviator[e, k] = w[(18 + k) * LANES + i]
                w[35 * LANES + i] = w[33 * LANES + i] / volume0[e]

            _element_forces(w)
            for i in range(count):
                e = U(start + i)
                a, b, c, d = U(cells[e, 0]), U(cells[e, 1]), U(cells[e, 2]), U(cells[e, 3])
                for k in range(3):
                    f[a, k] += w[k * LANES + i] + w[(3 + k) * LANES + i] + w[(6 + k) * LANES + i]
                    f[b, k] -= w[k * LANES + i]
                    f[c, k] -= w[(3 + k) * LANES + i]
                    f[d, k] -= w[(6 + k) * LANES + i]
    return bad


@functools.cache
def with_law(increment):
    """:func:`add_internal_forces` with another plastic law; compiled at its first call.

    Args:
        increment: Compiled by numba; as :func:`.hardening.plastic_increment` it takes the trial
            von Mises stress, the mean stress (tension positive) [Pa], the plastic strain so far,
            the time step [s], the shear modulus [Pa] and the material's parameters, and returns
            the increment dp >= 0 of the plastic strain. Flow keeps the volume and points
            along the deviator: the stress goes back to q - 3 G dp.
    """
    names = {**globals(), "plastic_increment": increment}
    function = types.FunctionType(add_internal_forces.py_func.__code__, names)
    return numba.njit(fastmath=FAST, error_model="numpy")(function)
