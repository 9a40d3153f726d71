"""What a fluid does to a surface: pressure that follows it, its volume, and drag."""

import numba


@numba.njit(cache=True, inline="always")
def _normal(x, a, b, c, i):
    """Component i of twice the area vector of the facet a, b, c."""
    j, m = (i + 1) % 3, (i + 2) % 3
    normal = (x[b, j] - x[a, j]) * (x[c, m] - x[a, m])
    return normal - (x[b, m] - x[a, m]) * (x[c, j] - x[a, j])


@numba.njit(cache=True)
def add_pressure(f, x, facets, pressure):
    """Add -p A/3 to the nodes of each facet, A its present area vector, in place.

    Args:
        f: Forces [N], shape (num_nodes, 3).
        x: Positions [m], shape (num_nodes, 3).
        facets: Nodes, in the order that makes A point outwards, shape (num_facets, 3).
        pressure: p [Pa].
    """
    for k in range(len(facets)):
        a, b, c = facets[k, 0], facets[k, 1], facets[k, 2]
        for i in range(3):
            share = pressure * _normal(x, a, b, c, i) / 6.0
            f[a, i] -= share
            f[b, i] -= share
            f[c, i] -= share


@numba.njit(cache=True)
def swept_rate(x, v, facets):
    """Rate of the volume that facets sweep outwards [m³/s], at velocities ``v`` [m/s] of all nodes.

    Other arguments as of :func:`add_pressure`, to whose forces it is conjugate.
    """
    rate = 0.0
    for k in range(len(facets)):
        a, b, c = facets[k, 0], facets[k, 1], facets[k, 2]
        for i in range(3):
            j, m = (i + 1) % 3, (i + 2) % 3
            area = (x[b, j] - x[a, j]) * (x[c, m] - x[a, m])
            area -= (x[b, m] - x[a, m]) * (x[c, j] - x[a, j])
            rate += area * (v[a, i] + v[b, i] + v[c, i]) / 6.0
    return rate


@numba.njit(cache=True)
def enclosed_volume(x, facets, origin):
    """Volume between facets and a place [m³]; of a closed surface what it encloses.

    Args:
        x, facets: As of :func:`add_pressure`.
        origin: The place [m], shape (3,).
    """
    volume = 0.0
    for k in range(len(facets)):
        a, b, c = facets[k, 0], facets[k, 1], facets[k, 2]
        for i in range(3):
            volume += (x[a, i] - origin[i]) * _normal(x, a, b, c, i) / 6.0
    return volume


@numba.njit(cache=True)
def volume_beside(x, facets):
    """Volume between facets and the z axis, whatever is above and below [m³].

    Half the flux of (x, y, 0), whose divergence is 2 and which passes no horizontal plane: of
    the mantle of a body between two of these it is the volume of the body.

    Args:
        x, facets: As of :func:`add_pressure`.
    """
    volume = 0.0
    for k in range(len(facets)):
        a, b, c = facets[k, 0], facets[k, 1], facets[k, 2]
        for i in range(2):
            volume += (x[a, i] + x[b, i] + x[c, i]) * _normal(x, a, b, c, i) / 12.0
    return volume


@numba.njit(cache=True)
def subtract_drag(f, v, nodes, rate):
    """Subtract the drag, ``rate`` times velocity, of some nodes from ``f``, in place.

    Args:
        f: Forces [N], shape (num_nodes, 3).
        v: Velocities [m/s], shape (num_nodes, 3).
        nodes: The nodes, shape (n,).
        rate: Force over velocity of each [kg/s], shape (n,).

    Returns:
        Power that the drag takes [W].
    """
    power = 0.0
    for k in range(nodes.size):
        n = nodes[k]
        for i in range(3):
            f[n, i] -= rate[k] * v[n, i]
            power += rate[k] * v[n, i] * v[n, i]
    return power
