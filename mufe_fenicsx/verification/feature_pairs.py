"""Tetrahedra that meet with every pair of features: vertex, edge, face."""

import math

import numpy as np
from mpi4py import MPI

from ..materials.elastic import Elastic
from ..mesh import create_grain_mesh
from ..simulation import Simulation
from .case import case, compare
from .tet_depth import penetration_depth

E, NU, RHO, EDGE = 100e9, 0.15, 2650.0, 1e-3

#: Positively oriented.
CELL = np.array([[0, 1, 2, 3]])

#: Name, features of the lower and of the upper tetrahedron, angle between them [degrees].
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
    """A regular tetrahedron of edge 1 with a feature centred at the origin, the rest below."""
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


def arrange(gap, tilt, num_random, seed=1):
    """Pairs of tetrahedra of edge 1, ``gap`` apart along the third axis.

    Each named pair, the same with the upper one tilted by ``tilt`` [rad] and shifted a
    little, then pairs of any orientation that meet off centre.

    Returns:
        Names; lower and upper tetrahedra, shape (n, 4, 3) each.
    """
    rng = np.random.default_rng(seed)
    names, lower, upper = [], [], []

    def add(name, a, b):
        # Lower them on each other until they are ``gap`` apart along the direction of travel.
        low, high = -0.5, 3.0
        for _ in range(40):
            mid = 0.5 * (low + high)
            apart = penetration_depth(a[None], (b + [0, 0, mid])[None])[0] < 0
            low, high = (low, mid) if apart else (mid, high)
        names.append(name)
        lower.append(a)
        upper.append(b + [0, 0, high + gap])

    flip = np.diag([1.0, -1.0, -1.0])
    for tilted in (False, True):
        for name, one, other, angle in PAIRS:
            b = feature_up(other) @ flip @ rotation([0, 0, 1], math.radians(angle)).T
            if tilted:
                b = b @ rotation(rng.standard_normal(3), tilt).T
                b += [*0.05 * rng.standard_normal(2), 0.0]
            add(name + (" tilted" if tilted else ""), feature_up(one), b)
    centred = feature_up("E") - feature_up("E").mean(axis=0)
    for k in range(num_random):
        turns = [rotation(rng.standard_normal(3), rng.uniform(0, math.pi)) for _ in range(2)]
        offset = [*rng.uniform(-0.25, 0.25, 2), 0.0]
        add(f"random {k}", centred @ turns[0].T, centred @ turns[1].T + offset)
    return names, np.array(lower), np.array(upper)


def simulate(comm, lower, upper, speed, friction, turn, **options):
    """All pairs side by side in one simulation, both of a pair on different ranks. Collective.

    Args:
        comm: MPI communicator.
        lower, upper: Tetrahedra of edge 1, shape (n, 4, 3).
        speed: Of the upper one towards the lower one, which is at rest [m/s].
        friction: Coefficient of friction.
        turn: Rotation of everything.
        options: Of :class:`~mufe_fenicsx.simulation.Simulation`.
    """
    n = len(lower)
    side = math.ceil(n ** (1 / 3))
    site = 5.0 * np.stack(np.unravel_index(np.arange(n), (side,) * 3), axis=1)
    tets = np.stack([lower + site[:, None], upper + site[:, None]], axis=1).reshape(-1, 4, 3)
    tets = EDGE * tets @ turn.T
    grain = np.arange(2 * n)
    rank_of_grain = ((grain // 2 + grain % 2) % comm.size).astype(np.int32)
    mine = np.flatnonzero(rank_of_grain == comm.rank)
    mesh = create_grain_mesh(
        comm,
        tets[mine].reshape(-1, 3),
        np.arange(4 * mine.size).reshape(-1, 4),
        mine,
        grain + 1,
        rank_of_grain,
    )
    velocity = np.zeros_like(mesh.x)
    velocity[mesh.grains[mesh.grain_of_node] % 2 == 1] = -speed * turn[:, 2]
    material = [Elastic(E, NU, RHO)] * mesh.num_grains
    return Simulation(mesh, material, friction=friction, velocity=velocity, **options)
