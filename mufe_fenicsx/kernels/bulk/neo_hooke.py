"""Neo-Hookean tetrahedra: energy of the deformation since the reference places.

The energy over the first volume is that of an isotropic solid whose deviator follows the stretch,

    W = G/2 (J^(-2/3) tr b - 3) + K (J ln J - J + 1),    F = ∂x/∂X,  b = F Fᵀ,  J = det F

(R. W. Ogden, Non-Linear Elastic Deformations, 1984, section 7.2). The deviator of the Kirchhoff
stress is t = G J^(-2/3) dev b, with J of the element. The mean stress is K ln J as in
kernels.bulk.solid, with J of a node or an element. Nothing is integrated in time. Stress and forces
are those of kernels.bulk.solid, in tets.c.
"""

import numba

from .solid import cofactors


@numba.njit(cache=True)
def add_neo_hookean_energy(energy, x, x0, cells, volume0, grains, cell_offset, shear):
    """Add the energy of the deviator of some grains [J] to ``energy``, (num_grains,), in place.

    Args:
        x, x0: Positions and first positions [m], shape (num_nodes, 3).
        cells, volume0, cell_offset, shear: As of kernels.bulk.solid.InternalForces.
        grains: The grains, shape (n,).
    """
    for g in grains:
        for e in range(cell_offset[g], cell_offset[g + 1]):
            a, b, c, d = cells[e, 0], cells[e, 1], cells[e, 2], cells[e, 3]
            h = cofactors(x0, a, b, c, d)
            J = cofactors(x, a, b, c, d)[9] / (6.0 * volume0[e])
            trace = 0.0
            for i in range(3):
                u, v, w = x[b, i] - x[a, i], x[c, i] - x[a, i], x[d, i] - x[a, i]
                for k in range(3):
                    F = (u * h[k] + v * h[3 + k] + w * h[6 + k]) / h[9]
                    trace += F * F
            energy[g] += 0.5 * shear[g] * volume0[e] * (J ** (-2.0 / 3.0) * trace - 3.0)
