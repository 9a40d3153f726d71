"""Bodies that start inside each other: nothing of that becomes energy."""

import numpy as np

from ..contact.separation import separate
from ..contact.start.reference import volumes
from ..explicit.simulation import Simulation
from ..geometry.bodies.shapes import box, sphere
from ..materials.elastic import Elastic
from ..run.from_bodies import build
from .case import case, compare

MATERIAL = Elastic(100e9, 0.15, 2650.0)
RADIUS = 1e-3
#: Depths over the largest.
FRACTIONS = (0.0, 1 / 3, 2 / 3, 1.0)
#: What is done about overlaps: the largest shift of a node over h, or nothing.
TREATMENTS = {"parted": 0.3, "parted in part": 0.03, "offset": None}
KINDS = ("balls", "blocks", "corner in a ball")


@case("overlap", num_bodies=2 * len(KINDS) * len(FRACTIONS))
def overlap(
    comm,
    depth=0.3,
    element_size=0.3,
    speed=50.0,
    friction=0.3,
    steps=100,
    time_step_factor=0.1,
):
    """Bodies that start up to 0.3 h deep in each other: no energy comes of it, none is lost.

    Ball and ball, block and block, the corner of a block in a ball, at four depths; parted
    without strain, parted in part so that offsets keep the rest, or left to offsets. At rest they
    stay at rest; drawn apart they gain nothing; pressed together they return what they
    received.

    Args:
        comm: MPI communicator.
        depth: Largest overlap, over the element size h.
        element_size: h over the radius of the balls.
        speed: With which the bodies leave or meet each other [m/s].
        friction: Coefficient of friction.
        steps: Steps at rest.
        time_step_factor: Time step over the limit of stability where bodies meet. All nodes of
            two flat faces meet at once, somewhere within a step; the error of that falls with
            the step and with the speed, with overlap or without.
    """
    h = element_size * RADIUS
    bodies, away = _pairs(h, depth * h)
    results, simulations = {}, []
    for name, max_shift in TREATMENTS.items():
        mesh = build(comm, bodies, MATERIAL, np.zeros(3), np.zeros(3), axes="").mesh
        if max_shift is not None:
            results |= _part(mesh, max_shift, name, h, depth * h)
        direction = away[mesh.grains[mesh.grain_of_node]]

        def start(velocity, factor=0.6, mesh=mesh, direction=direction):
            s = Simulation(
                mesh, [MATERIAL] * mesh.num_grains, friction=friction,
                velocity=velocity * direction, time_step_factor=factor,
            )  # fmt: skip
            simulations.append(s)
            return s, s.energies()["kinetic"]

        s, _ = start(0.0)
        for _ in range(int(steps)):
            s.step()
        e = s.energies()
        released = e["kinetic"] + e["elastic"] + e["contact"]
        # No spring is under load, so no force acts: not even round-off.
        results[f"{name}: energy at rest over that of springs without offset"] = compare(
            released / _energy_of_springs(s, h, depth * h), 0.0, 0.0, scale=1.0
        )

        s, kinetic = start(speed)
        while s.state.t < h / speed:
            s.step()
        e = s.energies()
        total = e["kinetic"] + e["elastic"] + e["contact"] + e["friction"]
        # Stresses of rigid flight are round-off of positions.
        results[f"{name}: energy after they were drawn apart over that before"] = compare(
            total / kinetic, 1.0, 1e-12
        )

        s, kinetic = start(-speed, time_step_factor)
        touched = 0
        while s.state.t < 3e-6:
            s.step()
            if s.state.num_steps % 50 == 0:
                e = s.energies()
                touched = max(touched, s.num_contacts)
        # The target of the method for the balance of energies.
        results[f"{name}: energy gained when pressed together"] = compare(
            s.energies()["residual"] / kinetic, 0.0, 1e-3, scale=1.0
        )
        least = len(bodies) // 2
        results[f"{name}: contacts when pressed together, at least"] = compare(
            touched, max(touched, least), 0.0
        )
    return results, simulations


def _part(mesh, max_shift, name, h, depth):
    """Part the surfaces; the volume that this took. Collective."""
    before = volumes(mesh, mesh.x)
    separate(mesh, max_shift)
    lost = np.zeros(mesh.labels.size)
    np.add.at(lost, mesh.grains[mesh.grain_of_cell], before - volumes(mesh, mesh.x))
    lost = mesh.comm.allreduce(lost).reshape(len(KINDS), len(FRACTIONS), 2).sum(axis=2)
    # The overlap is no larger than its depth times its section in the middle; nodes
    # stand for their surroundings, up to half an element beyond.
    rim = 0.5 * h
    section = {
        "balls": np.pi * (np.sqrt(RADIUS * depth) + rim) ** 2,
        "blocks": 4 * (RADIUS + rim) ** 2,
        "corner in a ball": np.pi * (np.sqrt(2) * depth + rim) ** 2,
    }
    return {
        f"{name}: volume lost over depth times section, {kind}, at most 1": compare(
            lost[k, -1] / (depth * section[kind]), 0.0, 1.0, scale=1.0
        )
        for k, kind in enumerate(KINDS)
    }


def _energy_of_springs(s, h, depth):
    """Energy that the springs of a contact of h² without offset would hold [J]. Collective."""
    layer = max(s.comm.allgather(s.contact.points.layer.max()))
    return 0.5 * h**2 / (2 * layer) * depth**2


def _pairs(h, depth):
    """All bodies, and the directions in which they leave each other, shape (num_bodies, 3)."""
    turn = _rotation([3.0, 1.0, 2.0], 1.1)
    bodies, away = [], []
    for i, kind in enumerate(KINDS):
        for k, fraction in enumerate(FRACTIONS):
            place = np.array([0.0, 5.0 * i, 5.0 * k]) * RADIUS
            for sign, (points, cells) in zip(
                (-1, 1), two_bodies(kind, h, fraction * depth), strict=True
            ):
                bodies.append(((points + place) @ turn.T, cells))
                away.append(sign * turn[:, 0])
    return bodies, np.array(away)


def two_bodies(kind, h, d):
    """Two bodies that meet at the origin along x, the second one ``d`` [m] deep in the first."""
    n = max(round(RADIUS / h), 2)
    if kind == "blocks":
        # The first stands out all around: no edge meets an edge.
        side, other = 2.6 * RADIUS, 2.0 * RADIUS
        first = box((RADIUS, side, side), (n, 2 * n, 2 * n), (-RADIUS, -side / 2, -side / 2))
        n = 2 * n + 1
        return first, box((RADIUS, other, other), (n // 2, n, n), (-d, -other / 2, -other / 2))
    points, cells = sphere(RADIUS, h)
    first = points @ _rotation([1.0, 2.0, -1.0], 0.7).T - [RADIUS, 0, 0], cells
    if kind == "balls":
        return first, (points + np.array([RADIUS - d, 0, 0]), cells)
    points, cells = box((RADIUS, RADIUS, RADIUS), (n, n, n))
    to_x = _rotation(np.cross([1, 1, 1], [1, 0, 0]), np.arccos(1 / np.sqrt(3)))  # its diagonal
    return first, (points @ to_x.T - [d, 0, 0], cells)


def _rotation(axis, angle):
    """Rotation matrix about ``axis`` by ``angle`` [rad]."""
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
