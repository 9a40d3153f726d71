"""Springs of contact: what many pull with."""

import numba


@numba.njit(cache=True)
def add_springs(y, q, nodes, share, normal, kn, kt):
    """Add the forces that springs resist the displacements ``q`` with to ``y``, in place.

    Args:
        y: Forces [N], shape (num_nodes, 3).
        q: Displacements [m], shape (num_nodes, 3).
        nodes, share: Nodes of each spring and their parts in its elongation, both of shape
            (num_springs, num).
        normal: Unit normals, shape (num_springs, 3).
        kn, kt: Stiffness along the normal and across it [N/m], shape (num_springs,).
    """
    for p in range(kn.size):
        dx = dy = dz = 0.0
        for m in range(nodes.shape[1]):
            n = nodes[p, m]
            dx += share[p, m] * q[n, 0]
            dy += share[p, m] * q[n, 1]
            dz += share[p, m] * q[n, 2]
        along = normal[p, 0] * dx + normal[p, 1] * dy + normal[p, 2] * dz
        along *= kn[p] - kt[p]
        fx = kt[p] * dx + along * normal[p, 0]
        fy = kt[p] * dy + along * normal[p, 1]
        fz = kt[p] * dz + along * normal[p, 2]
        for m in range(nodes.shape[1]):
            n = nodes[p, m]
            y[n, 0] += share[p, m] * fx
            y[n, 1] += share[p, m] * fy
            y[n, 2] += share[p, m] * fz
