"""What is measured of an axisymmetric contact: its edge, its pressure, the stress below it."""

import math

import numpy as np

from .law import von_mises2

#: Nodes, of both ends of edges and their middles, on the radius of a contact that is measured.
FEWEST = 4


def edge(state):
    """Radius of the contact over R, nan below a few nodes.

    Beyond the edge of a smooth contact the gap grows with the power 3/2 of the distance: its
    power 2/3 at the first two open nodes is drawn on to 0, not beyond the last closed node.
    """
    closed = np.flatnonzero(state.gap < 1e-9 * state.delta)
    if closed.size < FEWEST:
        return math.nan
    last = closed[-1]
    root = np.cbrt(state.gap[last + 1 : last + 3]) ** 2
    near, far = state.radius[last + 1 : last + 3]
    a = near - (far - near) * root[0] / (root[1] - root[0])
    return float(np.clip(a, state.radius[last], near))


def radius_of_moment(state):
    """Radius over R of the half-ellipsoid of pressure with the same second moment.

    For p = p0 √(1 - r²/a²) the mean of r² weighted by p is 2a²/5. Forces of nodes give it as
    exactly as quadratic functions can.
    """
    return math.sqrt(2.5 * (state.push * state.radius**2).sum() / state.force)


def centre_pressure(state, a):
    """Pressure over E where the axis meets the plane, from the stress within 0.35 a."""
    r, depth = (state.places / a).T
    near = np.hypot(r, depth) < 0.35
    r, z = r[near] ** 2, depth[near]
    terms = np.column_stack([np.ones_like(r), z, z**2, z**3, r, r * z, r * z**2, r**2])
    axial = state.t[near, 1] / state.J[near] + state.pressure[near]
    return -float(np.linalg.lstsq(terms, axial, rcond=None)[0][0])


def largest_on_axis(state, a):
    """Largest von Mises stress on the axis over E, and its depth below the plane over a.

    Of the function, even in r, that fits best the stress near the axis and the largest one.
    """
    r, depth = (state.places / a).T
    q = np.sqrt(von_mises2(state.t.T)) / state.J
    near = (r < 0.2) & (depth > 0.1) & (depth < 1.0)
    z, r = depth[near] - 0.5, r[near] ** 2
    powers = [z**k for k in range(6)]
    terms = np.column_stack([*powers, r, r * z, r * z**2])
    found = np.linalg.lstsq(terms, q[near], rcond=None)[0]
    z = np.linspace(-0.35, 0.45, 1601)
    values = np.polynomial.polynomial.polyval(z, found[:6])
    top = values.argmax()
    return float(values[top]), float(z[top] + 0.5)
