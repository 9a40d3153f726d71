"""Voxels inside of tetrahedra."""

import math

import numba


@numba.njit(cache=True, error_model="numpy")
def label_cells(labels, x, cells, label):
    """Give the voxels with their middles in a cell its label, in place; later cells win.

    Args:
        labels: Shape (nz, ny, nx).
        x: Nodes (x, y, z) from the corner of the image [voxels], shape (num_nodes, 3).
        cells: Tetrahedra, shape (num_cells, 4).
        label: Of each cell, shape (num_cells,).
    """
    nz, ny, nx = labels.shape
    for c in range(cells.shape[0]):
        a, b, d, e = cells[c, 0], cells[c, 1], cells[c, 2], cells[c, 3]
        ux, uy, uz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
        vx, vy, vz = x[d, 0] - x[a, 0], x[d, 1] - x[a, 1], x[d, 2] - x[a, 2]
        wx, wy, wz = x[e, 0] - x[a, 0], x[e, 1] - x[a, 1], x[e, 2] - x[a, 2]
        # Rows of the inverse are vectors across pairs of edges, over the volume.
        px, py, pz = vy * wz - vz * wy, vz * wx - vx * wz, vx * wy - vy * wx
        qx, qy, qz = wy * uz - wz * uy, wz * ux - wx * uz, wx * uy - wy * ux
        rx, ry, rz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        volume = ux * px + uy * py + uz * pz
        if volume == 0.0:
            continue
        lx = max(0, math.ceil(min(x[a, 0], x[b, 0], x[d, 0], x[e, 0]) - 0.5))
        ly = max(0, math.ceil(min(x[a, 1], x[b, 1], x[d, 1], x[e, 1]) - 0.5))
        lz = max(0, math.ceil(min(x[a, 2], x[b, 2], x[d, 2], x[e, 2]) - 0.5))
        hx = min(nx - 1, math.floor(max(x[a, 0], x[b, 0], x[d, 0], x[e, 0]) - 0.5))
        hy = min(ny - 1, math.floor(max(x[a, 1], x[b, 1], x[d, 1], x[e, 1]) - 0.5))
        hz = min(nz - 1, math.floor(max(x[a, 2], x[b, 2], x[d, 2], x[e, 2]) - 0.5))
        for k in range(lz, hz + 1):
            for j in range(ly, hy + 1):
                for i in range(lx, hx + 1):
                    sx, sy, sz = i + 0.5 - x[a, 0], j + 0.5 - x[a, 1], k + 0.5 - x[a, 2]
                    s = (px * sx + py * sy + pz * sz) / volume
                    t = (qx * sx + qy * sy + qz * sz) / volume
                    u = (rx * sx + ry * sy + rz * sz) / volume
                    if s >= 0.0 and t >= 0.0 and u >= 0.0 and s + t + u <= 1.0:
                        labels[k, j, i] = label[c]
