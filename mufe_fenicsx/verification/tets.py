"""Pairs of tetrahedra that face each other with every pair of features."""

import math

import numpy as np

from .tet_depth import penetration_depth

#: Name, feature of the lower and of the upper tetrahedron, angle between them [degrees].
PAIRS = (
    ("vertex-vertex", "V", "V", 25.0),
    ("vertex-edge", "V", "E", 10.0),
    ("vertex-face", "V", "F", 10.0),
    ("edge-vertex", "E", "V", 40.0),
    ("edge-edge 90", "E", "E", 90.0),
    ("edge-edge 60", "E", "E", 60.0),
    ("edge-edge 30", "E", "E", 30.0),
    ("edge-edge 10", "E", "E", 10.0),
    ("edge-edge 4", "E", "E", 4.0),
    ("edge-edge 2", "E", "E", 2.0),
    ("edge-edge 1", "E", "E", 1.0),
    ("edge-edge 0.5", "E", "E", 0.5),
    ("edge-edge 0", "E", "E", 0.0),
    ("edge-face", "E", "F", 90.0),
    ("face-vertex", "F", "V", 70.0),
    ("face-edge", "F", "E", 90.0),
    ("face-face 0", "F", "F", 0.0),
    ("face-face 25", "F", "F", 25.0),
    ("face-face 60", "F", "F", 60.0),
)


def feature_up(kind):
    """A regular tetrahedron of edge 1, a vertex V, edge E or face F of it on top.

    The feature is centred at the origin and all else below; positively oriented.
    """
    r, height = 1 / math.sqrt(3), math.sqrt(2 / 3)
    turn = np.radians([90, 210, 330])
    triangle = np.column_stack([r * np.cos(turn), r * np.sin(turn), np.zeros(3)])
    if kind == "F":
        x = np.vstack([triangle, [[0, 0, -height]]])
    elif kind == "V":
        x = np.vstack([triangle - [0, 0, height], [[0, 0, 0]]])
    else:
        deep = -math.sqrt(0.5)
        x = np.array([[-0.5, 0, 0], [0.5, 0, 0], [0, -0.5, deep], [0, 0.5, deep]])
    if np.linalg.det(x[1:] - x[0]) < 0:
        x[[0, 1]] = x[[1, 0]]
    return x


def rotation(axis, angle):
    """Rotation matrix about an axis by an angle [rad]."""
    axis = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    K = np.cross(np.eye(3), -axis)
    return np.eye(3) + math.sin(angle) * K + (1 - math.cos(angle)) * K @ K


def tet_pairs(num_random, tilt=0.03, seed=1):
    """Tetrahedra of edge 1 that touch, one above the other.

    Each of ``PAIRS``, the same with the upper one tilted by ``tilt`` [rad] and shifted
    a little, then pairs of any orientation that touch off centre.

    Returns:
        Names; lower and upper tetrahedra, shape (n, 4, 3) each.
    """
    rng = np.random.default_rng(seed)
    flip = np.diag([1.0, -1.0, -1.0])
    names, lower, upper = [], [], []
    for tilted in (False, True):
        for name, one, other, angle in PAIRS:
            b = feature_up(other) @ flip @ rotation([0, 0, 1], math.radians(angle)).T
            if tilted:
                b = b @ rotation(rng.standard_normal(3), tilt).T
                b += [*0.05 * rng.standard_normal(2), 0.0]
            names.append(name + " tilted" * tilted)
            lower.append(feature_up(one))
            upper.append(b)
    centred = feature_up("E") - feature_up("E").mean(axis=0)
    for k in range(num_random):
        turns = [rotation(rng.standard_normal(3), rng.uniform(0, math.pi)) for _ in range(2)]
        names.append(f"random {k}")
        lower.append(centred @ turns[0].T)
        upper.append(centred @ turns[1].T + [*rng.uniform(-0.25, 0.25, 2), 0.0])
    lower, upper = np.array(lower), np.array(upper)
    return names, lower, upper + _height_of_contact(lower, upper)[:, None, None] * [0.0, 0.0, 1.0]


def _height_of_contact(lower, upper):
    """How far the upper ones have to go up until they are free, by bisection."""
    low, high = np.full(len(lower), -0.5), np.full(len(lower), 3.0)
    for _ in range(50):
        mid = 0.5 * (low + high)
        apart = penetration_depth(lower, upper + mid[:, None, None] * [0.0, 0.0, 1.0]) < 0
        low, high = np.where(apart, low, mid), np.where(apart, mid, high)
    return high
