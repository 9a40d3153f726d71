"""Static increments: the drag that holds free grains, and a point that locks by friction."""

import math
from types import SimpleNamespace

import numpy as np

from ...contact.walls import Wall
from ...errors import SolverError
from ...geometry.bodies.shapes import box
from ...implicit.simulation import ImplicitSimulation
from ...materials.elastic import Elastic
from ...run.from_bodies import distribute
from ...theory.stability import drag_error, self_locking_friction
from ..case import case, compare
from .limits import RHO, SIZE, E, bisect

STABILISATION = (1e-8, 1e-6, 1e-4, 1e-2, 0.1, 0.3, 1.0)
FRICTION = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.2, 1.6, 2.0)
#: Poisson's ratio of the strut, and how far the face opposite to its tip leans [rad]: nearly
#: incompressible, it gives way along that face far more than across.
STRUT_NU, LEAN = 0.45, -0.3


def pressed_with_drag(comm, stabilisation, increments=4, strain=1e-4, free=False, divisions=2):
    """A cube between smooth platens in static increments.

    Args:
        comm: MPI communicator of one rank.
        stabilisation: Of the drag.
        increments: Number, all of the same length.
        strain: Of the cube with its layers.
        free: A second cube that nothing touches.
        divisions: Bricks along an edge.

    Returns:
        Difference of the platens' forces over their mean, theory of it, largest displacement of
        the free cube over the platen's, simulation.
    """
    material, up = Elastic(E, 0.0, RHO), np.eye(3)[2]
    bodies = [box((SIZE,) * 3, (divisions,) * 3)]
    if free:
        bodies.append(box((0.5 * SIZE,) * 3, (divisions,) * 3, (2 * SIZE, 0, 0.25 * SIZE)))
    mesh = distribute(comm, bodies)
    walls = [
        Wall("base", np.zeros(3), up),
        Wall("platen", SIZE * up, -up, velocity=-strain * SIZE * up),
    ]
    step = 1.0 / increments
    s = ImplicitSimulation(
        mesh, [material] * mesh.num_grains, walls, first_step=step, largest_step=step,
        stabilisation=stabilisation,
    )  # fmt: skip
    for _ in range(increments):
        s.step()
    bottom, top = s.wall_forces()
    mean = 0.5 * (top + bottom)
    stiff = mean / (strain * SIZE**2)  # of cube and layers together
    drift = 0.0
    if free:
        other = mesh.grains[mesh.grain_of_node] == 1
        drift = float(np.abs(s.state.u[other]).max() / (strain * SIZE))
    return SimpleNamespace(
        stabilisation=stabilisation, error=abs(top - bottom) / mean,
        theory=drag_error(stabilisation, material.contact_modulus, stiff, increments),
        drift=drift, iterations=[row[2] for row in s.report], simulation=s,
    )  # fmt: skip


def drag_map(comm, values=STABILISATION):
    """:func:`pressed_with_drag` for several drags."""
    rows = [pressed_with_drag(comm, value) for value in values]
    return rows, [row.simulation for row in rows]


class Strut:
    """A tetrahedron held at three nodes whose tip presses on a plane that is drawn along x.

    Its face leans, so that the tip gives way aslant: drawn along -x it is dragged into the plane
    and locks, the other way it slips.
    """

    def __init__(self, comm, friction, along):
        around = 2 * math.pi / 3 * np.arange(3)
        face = np.stack([np.cos(around), np.sin(around), -math.tan(LEAN) * np.cos(around)], axis=1)
        points = SIZE * np.vstack([np.zeros(3), 0.4 * face + [0.0, 0.0, 1.0]])
        cells = np.array([[0, 1, 2, 3]])
        if np.linalg.det(points[1:] - points[0]) < 0:
            cells = cells[:, [0, 1, 3, 2]]
        self.depth = 3e-6 * SIZE
        mesh = distribute(comm, [(points, cells)])
        order = [int(np.linalg.norm(mesh.x - p, axis=1).argmin()) for p in points]
        self.tip, self.t = order[0], np.array([along, 0.0, 0.0])
        held = [(np.array(order[1:]), e) for e in np.eye(3)]
        self.s = ImplicitSimulation(
            mesh, [Elastic(E, STRUT_NU, RHO)], [Wall("plane", np.zeros(3), np.eye(3)[2], friction)],
            first_step=1.0, largest_step=1.0, points="nodes", element="p1", held=held,
        )  # fmt: skip
        own = int(np.flatnonzero(self.s.contact.own.nodes == self.tip)[0])
        contact = self.s.contact
        self.k = float(contact.points.area[own] / contact.points.layer[own])
        self.k_t = self.k * float(contact.layers.ratio[own])
        K = np.zeros((3, 3))
        for i in range(3):
            q, y = np.zeros_like(mesh.x), np.zeros_like(mesh.x)
            q[self.tip, i] = 1.0
            self.s.solid.add_stiffness(y, q, mesh.x)
            K[:, i] = y[self.tip]
        self.stiffness, self.friction = K, friction

    @property
    def critical(self):
        """Coefficient at which it locks, by theory."""
        return float(self_locking_friction(self.stiffness, self.k, np.eye(3)[2], self.t))

    def slipping_force(self):
        """Normal force while it slips, over that without friction; inf or negative beyond."""
        C, n = np.linalg.inv(self.stiffness), np.eye(3)[2]
        lift = 1.0 / self.k + n @ C @ n
        return lift / (lift + self.friction * (n @ C @ self.t))

    def draw(self, way=60.0, increments=12):
        """Press, then draw the plane by ``way`` depths.

        Returns:
            Normal force over that without friction, friction over normal force, whether it slips
            at the end, iterations; inf and nan where no equilibrium is found.
        """
        s, n = self.s, np.eye(3)[2]
        C = np.linalg.inv(self.stiffness)
        free = self.depth / (1.0 / self.k + n @ C @ n)
        s.walls.velocity[0] = self.depth * n
        s.step()
        s.walls.velocity[0] = way / increments * self.depth * self.t
        forces, message = [], ""
        try:
            for _ in range(increments):
                s.step()
                forces.append(-s.walls.force[0].copy())
        except SolverError as error:
            message = str(error)
        normal = forces[-1][2] if forces else math.nan
        drag = forces[-1] @ self.t if forces else math.nan
        sliding = bool(s.contact.walls.pairs.sliding.any())
        return SimpleNamespace(
            friction=self.friction, normal=normal / free, ratio=drag / normal, sliding=sliding,
            iterations=sum(row[2] for row in s.report), message=message,
            theory=self.slipping_force(), simulation=s,
        )  # fmt: skip


def locking(comm, along=-1.0, trials=9):
    """Coefficient of friction at which the strut does not slip any more: measured."""

    def locked(value):
        found = Strut(comm, value, along).draw(way=300.0, increments=10)
        return not found.sliding or bool(found.message)

    return bisect(locked, 0.05, 3.0, trials)


@case("stability-newton", num_bodies=1)
def newton_limits(comm, trials=8):
    """Static increments: the error of the drag, and the friction at which a strut locks.

    Args:
        comm: MPI communicator.
        trials: Bisections.
    """
    rows, simulations = drag_map(comm, (1e-4, 1e-2, 0.1))
    results = {}
    for row in rows:
        # The cube moves by half of the platen's way in the mean, but for its edges.
        results[f"drag {row.stabilisation:g}: difference of the platens' forces"] = compare(
            row.error, row.theory, 0.05
        )
    strut = Strut(comm, 0.3, -1.0)
    # Bisection, and 300 depths of way in which slip has to begin.
    results["strut: friction at which it locks"] = compare(
        locking(comm, trials=trials), strut.critical, 0.01 + 4.1 * 2.0**-trials
    )
    for value in (0.3 * strut.critical, 0.8 * strut.critical):
        found = Strut(comm, value, -1.0).draw(way=100.0)
        # Linear elasticity, strains of 1e-3 at most.
        results[f"strut, μ = {value:.3g}: normal force as it slips"] = compare(
            found.normal, found.theory, 0.02
        )
    return results, [*simulations, strut.s]
