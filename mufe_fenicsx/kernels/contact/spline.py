"""Value and gradient of a cubic spline on a regular grid."""

import math

import numba


@numba.njit(cache=True, error_model="numpy")
def spline_value_and_gradient(value, gradient, coefficients, at):
    """Evaluate a tensor-product cubic B-spline and its exact gradient at points, in place.

    Points beyond the grid take the value of the closest point on it.

    Args:
        value: Shape (num_points,).
        gradient: By the index along each axis, shape (num_points, 3).
        coefficients: Of the B-splines (SciPy's ``spline_filter``), shape (n0, n1, n2).
        at: Indices of the points along the axes, shape (num_points, 3).
    """
    for p in range(at.shape[0]):
        i0, a0, a1, a2, a3, da0, da1, da2, da3 = _weights(at[p, 0], coefficients.shape[0])
        j0, b0, b1, b2, b3, db0, db1, db2, db3 = _weights(at[p, 1], coefficients.shape[1])
        k0, c0, c1, c2, c3, dc0, dc1, dc2, dc3 = _weights(at[p, 2], coefficients.shape[2])
        a, da = (a0, a1, a2, a3), (da0, da1, da2, da3)
        b, db = (b0, b1, b2, b3), (db0, db1, db2, db3)
        f = fx = fy = fz = 0.0
        for i in range(4):
            ii = min(max(i0 + i, 0), coefficients.shape[0] - 1)
            g = gy = gz = 0.0
            for j in range(4):
                jj = min(max(j0 + j, 0), coefficients.shape[1] - 1)
                v0 = coefficients[ii, jj, min(max(k0, 0), coefficients.shape[2] - 1)]
                v1 = coefficients[ii, jj, min(max(k0 + 1, 0), coefficients.shape[2] - 1)]
                v2 = coefficients[ii, jj, min(max(k0 + 2, 0), coefficients.shape[2] - 1)]
                v3 = coefficients[ii, jj, min(max(k0 + 3, 0), coefficients.shape[2] - 1)]
                row = c0 * v0 + c1 * v1 + c2 * v2 + c3 * v3
                g += b[j] * row
                gy += db[j] * row
                gz += b[j] * (dc0 * v0 + dc1 * v1 + dc2 * v2 + dc3 * v3)
            f += a[i] * g
            fx += da[i] * g
            fy += a[i] * gy
            fz += a[i] * gz
        value[p] = f
        gradient[p, 0], gradient[p, 1], gradient[p, 2] = fx, fy, fz


@numba.njit(cache=True, error_model="numpy")
def _weights(x, n):
    """First of the four B-splines that reach a point, their values and slopes."""
    inside = min(max(x, 0.0), n - 1.0)
    i = min(math.floor(inside), n - 2)
    t = inside - i
    s = 1.0 - t
    return (
        i - 1,
        s * s * s / 6.0,
        (4.0 - 6.0 * t * t + 3.0 * t * t * t) / 6.0,
        (4.0 - 6.0 * s * s + 3.0 * s * s * s) / 6.0,
        t * t * t / 6.0,
        -0.5 * s * s,
        (-4.0 * t + 3.0 * t * t) / 2.0,
        (4.0 * s - 3.0 * s * s) / 2.0,
        0.5 * t * t,
    )
