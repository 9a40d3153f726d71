"""Mass, centre, inertia and principal axes of bodies of tetrahedra or of points."""

import numpy as np


def mass_properties(x, cells, cell_offset, rho):
    """Mass, centre and inertia of bodies of tetrahedra, exact for the mesh.

    Over a tetrahedron of volume V with corners x_a, s their sum, the integral of x xᵀ is
    V/20 (sum_a x_a x_aᵀ + s sᵀ). Masses lumped at the nodes would make the inertia too large.

    Args:
        x: Positions of the nodes [m], shape (num_nodes, 3).
        cells: Nodes of the tetrahedra, body after body, shape (num_cells, 4).
        cell_offset: First tetrahedron of each body, shape (num_bodies + 1,).
        rho: Densities [kg/m³], shape (num_bodies,).

    Returns:
        Masses [kg], shape (num_bodies,); centres [m], shape (num_bodies, 3); inertia
        about the centres [kg m²], shape (num_bodies, 3, 3).
    """
    num = rho.size
    mass, centre, inertia = np.empty(num), np.empty((num, 3)), np.empty((num, 3, 3))
    for b in range(num):
        corners = x[cells[cell_offset[b] : cell_offset[b + 1]]]
        origin = corners.reshape(-1, 3).mean(axis=0)
        corners = corners - origin
        volume = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
        total = corners.sum(axis=1)
        mean = volume @ total / (4 * volume.sum())
        second = np.einsum("c,cai,caj->ij", volume, corners, corners)
        second = (second + np.einsum("c,ci,cj->ij", volume, total, total)) / 20
        second -= volume.sum() * np.outer(mean, mean)
        mass[b] = rho[b] * volume.sum()
        centre[b] = origin + mean
        inertia[b] = rho[b] * (np.trace(second) * np.eye(3) - second)
    return mass, centre, inertia


def point_properties(x, mass):
    """Mass, centre and inertia of one body of point masses, shaped as by `mass_properties`.

    Args:
        x: Positions [m], shape (n, 3).
        mass: Masses [kg], shape (n,).
    """
    centre = mass @ x / mass.sum()
    r = x - centre
    second = np.einsum("n,ni,nj->ij", mass, r, r)
    inertia = np.trace(second) * np.eye(3) - second
    return np.array([mass.sum()]), centre[None], inertia[None]


def quaternion_of(axes):
    """Unit quaternion, scalar first, of a rotation matrix, shape (4,).

    The eigenvector of the largest eigenvalue: I. Y. Bar-Itzhack, J. Guid. Control Dyn. 23,
    2000, 1085-1087.
    """
    m = axes
    K = np.array(
        [
            [np.trace(m), m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]],
            [0, m[0, 0] - m[1, 1] - m[2, 2], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0]],
            [0, 0, m[1, 1] - m[0, 0] - m[2, 2], m[1, 2] + m[2, 1]],
            [0, 0, 0, m[2, 2] - m[0, 0] - m[1, 1]],
        ]
    )
    return np.linalg.eigh(K, UPLO="U")[1][:, -1]
