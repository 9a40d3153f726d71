"""Bodies with flat bases pressed on each other or on a plane, at rest, and what is measured.

The contact lies at the origin, its normal is :data:`AXIS`, an odd direction; nothing is aligned
with the axes of space, no node with the contact point, no mesh with the other.
"""

import math
from dataclasses import dataclass

import numpy as np

from ..contact.walls import Wall
from ..mesh import create_grain_mesh, partition_grains
from .slow_press import Increments, TimeSteps


def turn(vector):
    """Rotation matrix of a rotation vector [rad] (Rodrigues)."""
    angle = np.linalg.norm(vector)
    if angle == 0.0:
        return np.eye(3)
    x, y, z = np.asarray(vector) / angle
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * K + (1 - math.cos(angle)) * K @ K


#: From the axes of a set-up, z along the normal of the contact, to those of space.
FRAME = turn([0.71, -0.43, 0.55])
AXIS = FRAME[:, 2]


@dataclass
class Body:
    """A body in its own axes: its base in z = 0, its pole at (0, 0, height).

    Sliding in itself by ``jog`` must leave its surface as it is, near the pole.
    """

    points: np.ndarray  #: [m], shape (num_nodes, 3)
    cells: np.ndarray  #: shape (num_cells, 4)
    height: float  #: from base to pole [m]
    material: object
    jog: object = None  #: function of points: the mesh slid along its surface
    spin: float = 0.0  #: rotation about the normal of the contact [rad]
    #: Function of points: pairs (nodes, unit vector along x or y) that do not move along it, beside
    #: the base along z; None: three directions at two nodes of the base.
    held: object = None

    def __post_init__(self):
        points = np.asarray(self.points, dtype=float)
        on_base = np.abs(points[:, 2]) < 1e-9 * self.height
        middle = np.argmin((points[on_base] ** 2).sum(axis=1))
        far = np.argmax(np.abs(points[on_base, 0]))
        placed = points if self.jog is None else self.jog(points)
        self.placed = placed @ turn([0, 0, self.spin]).T - [0, 0, self.height]
        self.base = np.flatnonzero(on_base)
        middle, far = self.base[middle], self.base[far]
        x, y, _ = np.eye(3)
        self.holds = self.held(points) if self.held else [(middle, x), (middle, y), (far, y)]


class Pressed:
    """One body pressed on a rigid plane, or two on each other. Collective.

    The displacement of each base along the normal is prescribed and even; bases slide
    freely otherwise, but for what keeps a body from moving as a whole (:attr:`Body.held`). By
    symmetry a half ball so held is half of a ball between two planes.

    Args:
        comm: At most as many ranks as bodies.
        bodies: One or two :class:`Body`.
        integrator: "static" increments; or the same state by "explicit", damped time steps.
        options: Of :class:`~mufe_fenicsx.explicit.simulation.Simulation`, and of
            :class:`~mufe_fenicsx.implicit.simulation.ImplicitSimulation` for increments.
    """

    def __init__(self, comm, bodies, integrator="static", **options):
        self.comm = comm
        # The second body stands on its pole: half a turn about x.
        flips = [np.eye(3), np.diag([1.0, -1.0, -1.0])]
        places = [b.placed @ (FRAME @ f).T for b, f in zip(bodies, flips, strict=False)]
        walls = [Wall("plane", np.zeros(3), -AXIS)] if len(bodies) == 1 else []
        rank_of_body = partition_grains(
            [len(b.cells) for b in bodies], [p.mean(axis=0) for p in places], comm.size
        )
        mine = np.flatnonzero(rank_of_body == comm.rank)
        first = np.cumsum([0] + [len(places[k]) for k in mine])
        mesh = create_grain_mesh(
            comm,
            np.concatenate([places[k] for k in mine]),
            np.concatenate([bodies[k].cells + i for k, i in zip(mine, first, strict=False)]),
            np.repeat(mine, [len(bodies[k].cells) for k in mine]),
            np.arange(1, len(bodies) + 1),
            rank_of_body,
        )
        materials = [bodies[k].material for k in mesh.grains]
        held, self.bases = [], {}
        for k in mine:
            on = np.flatnonzero(mesh.grains[mesh.grain_of_node] == k)
            body, side = bodies[k], FRAME @ turn([0, 0, bodies[k].spin])
            base = _nearest(mesh.x, on, places[k][body.base])
            held.append((base, AXIS))
            for nodes, direction in body.holds:
                at = _nearest(mesh.x, on, places[k][np.atleast_1d(nodes)])
                held.append((at, side @ direction))
            self.bases[int(k)] = base
        self.pressing = len(bodies) - 1
        # Nodes of the body that is moved; the other one, or the plane, stays.
        self.moved = mesh.grains[mesh.grain_of_node] == self.pressing
        make = Increments if integrator == "static" else TimeSteps
        height = max(body.height for body in bodies)
        #: :class:`~.slow_press.Increments` or :class:`~.slow_press.TimeSteps`.
        self.loading = make(mesh, materials, walls, held, height, **options)
        self.simulation = self.loading.simulation
        self.delta = 0.0

    def press(self, delta):
        """Bring the bases to the approach ``delta`` [m] and the bodies to rest. Collective."""
        # A single body moves up to the plane, a second one down to the first.
        sign = 1.0 if self.pressing == 0 else -1.0
        base = self.bases.get(self.pressing, np.empty(0, dtype=int))
        self.loading.move(base, sign * (delta - self.delta) * AXIS)
        self.delta = delta

    def contact(self):
        """What acts at the points of the contact, of all ranks. Collective.

        Returns:
            Positions in the plane of the contact [m], shape (n, 2); normal forces [N]
            and areas [m²], shape (n,), of all points within the skin of the contact, zero force
            where it is open; and the second moments of their facets over their areas [m²],
            shape (n,). Both sides carry points: each counts with its share.
        """
        contact, walls = self.simulation.contact, self.simulation.walls.pairs
        pairs, points = contact.pairs, contact.points
        contact.ghosts.place_points()
        force, area = np.zeros(points.num_points), points.area.copy()
        on = np.flatnonzero(walls.closed)
        np.add.at(force, walls.node[on], walls.normal_force[on])
        if self.pressing:
            area *= 0.5  # of the open ones, on both sides
            on = np.flatnonzero(pairs.closed)
            np.add.at(force, pairs.node[on], pairs.normal_force[on])
            area[pairs.node[on]] = contact.areas(on)
        near = np.union1d(pairs.node, walls.node)
        plane = contact.ghosts.positions.array[near] @ FRAME[:, :2]
        # Second moment of an evenly loaded triangle about its centroid, along any axis.
        spread = points.facet_area[near] / (6 * math.sqrt(3))
        parts = self.comm.allgather((plane, force[near], area[near], spread))
        return tuple(np.concatenate(values) for values in zip(*parts, strict=True))

    def reaction(self):
        """Force on the base of the pressing body [N]. Collective."""
        sign = -1.0 if self.pressing == 0 else 1.0
        base = self.bases.get(self.pressing, np.empty(0, dtype=int))
        return sign * self.loading.reaction(base, AXIS)


def _nearest(x, nodes, places):
    """Those of ``nodes`` at the given places, for a mesh in another order."""
    from scipy.spatial import cKDTree

    return nodes[cKDTree(x[nodes]).query(places)[1]]


def measure(plane, force, area, spread, semi_axes):
    """Contact's force, size and pressure from its points.

    The size is that of the half-ellipsoid of pressure with the same second moments: for
    p = p0 √(1 - x²/a² - y²/b²) the mean of x² weighted by p is a²/5. Unlike the number
    of closed nodes it does not jump as the edge passes a node.

    Args:
        plane, force, area, spread: From :meth:`Pressed.contact`.
        semi_axes: a >= b of the theory [m], for the fit of the pressure.

    Returns:
        A dict: force [N]; a, b [m] from second moments; area_radius [m] of the nodal areas
        that carry force; p0 [Pa] of the half-ellipsoid that fits best within 0.7 of the
        ellipse; spread: of the pressure about the theory's shape, root mean square
        over that of the pressure.
    """
    total = force.sum()
    middle = force @ plane / total
    r = plane - middle
    # The traction of a point acts on its whole facet.
    inside = (force @ spread) * np.eye(2)
    moments, axes = np.linalg.eigh(((r * force[:, None]).T @ r + inside) / total)
    b, a = np.sqrt(5 * moments)
    s2 = ((r @ axes[:, ::-1] / semi_axes) ** 2).sum(axis=1)
    pressure, shape = force / area, np.sqrt(np.maximum(1 - s2, 0.0))
    inner = s2 < 0.7**2
    p0 = (force * shape)[inner].sum() / (area * shape**2)[inner].sum()
    off = (area * (pressure - p0 * shape) ** 2).sum() / (area * (p0 * shape) ** 2).sum()
    return {
        "force": total,
        "a": a,
        "b": b,
        "area_radius": math.sqrt(area[force > 0].sum() / math.pi),
        "p0": p0,
        "spread": math.sqrt(off),
    }
