"""Grains that start inside each other: up to an edge deep an offset, deeper refused."""

import math
from types import SimpleNamespace

import numpy as np

from ...contact.laws import edge_of_area
from ...contact.separation import separate
from ...contact.start.overlap import DEEPEST_START
from ...explicit.simulation import Simulation
from ...geometry.bodies.shapes import sphere
from ...run.from_bodies import distribute
from ..case import case, compare
from ..overlap import MATERIAL, RADIUS, two_bodies
from .limits import bisect, message_of

#: Overlap over the element size.
DEPTHS = (0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9, 1.1, 1.4, 2.0, 3.0)
H = 0.3 * RADIUS


def start(comm, depth, kind="balls", part=None, speed=0.0):
    """Two bodies ``depth`` h deep in each other, drawn apart at a speed.

    Args:
        comm: MPI communicator of one rank.
        depth: Over the element size.
        kind: Of `verification.overlap`.
        part: Largest shift of a node that parts them first, over h; None: not at all.
        speed: Of each [m/s].

    Returns:
        Simulation, and what was moved apart.
    """
    bodies = two_bodies(kind, H, depth * H)
    mesh = distribute(comm, bodies)
    moved = None if part is None else separate(mesh, part)
    v = np.zeros_like(mesh.x)
    v[:, 0] = np.where(mesh.grains[mesh.grain_of_node] == 0, -speed, speed)
    return Simulation(mesh, [MATERIAL] * 2, friction=0.3, velocity=v), moved


def overlap_map(comm, depths=DEPTHS, kind="balls", steps=200):
    """One row for each depth: is it refused, what was found of it, and energy that came of it.

    ``released``: after steps at rest, over that of springs without offsets; ``gained``: after the
    bodies were drawn apart, over their kinetic energy; ``left``: depth after parting by 0.3 h.
    """
    rows, simulations = [], []
    for depth in depths:
        message = message_of(start, comm, depth, kind)
        row = SimpleNamespace(depth=depth, message=message, found=math.nan, released=math.nan,
                              gained=math.nan)  # fmt: skip
        if not message:
            s, _ = start(comm, depth, kind)
            row.found = s.contact.overlaps.deepest / H
            for _ in range(steps):
                s.step()
            e = s.energies()
            springs = H**2 / (4 * s.contact.points.layer.max()) * (depth * H) ** 2
            row.released = (e["kinetic"] + e["elastic"] + e["contact"]) / springs
            t, _ = start(comm, depth, kind, speed=20.0)
            first = t.energies()["kinetic"]
            while t.state.t < 1.5 * depth * H / 20.0:
                t.step()
            e = t.energies()
            row.gained = (e["kinetic"] + e["elastic"] + e["contact"]) / first - 1.0
            simulations += [s, t]
        message = message_of(start, comm, depth, kind, 0.3)
        row.parted = "" if message else start(comm, depth, kind, 0.3)[1].remaining_depth / H
        rows.append(row)
    return rows, simulations


def limit(comm, kind="balls", trials=9):
    """Depth over the mean facet edge at which the program refuses to start."""
    s, _ = start(comm, 0.05, kind)
    edge = s.contact.edge / H
    return bisect(lambda d: bool(message_of(start, comm, d, kind)), 0.2, 3.0, trials) / edge


def limit_theory(comm, kind="balls"):
    """The same by geometry: the depth at which the first point is an edge deep.

    Points of contact are middles of facets and sharp vertices, and have the edges that go with
    their areas. The bodies are convex: a point in one is as deep as its nearest plane, which is
    found over all of them.
    """
    s, _ = start(comm, 0.05, kind)
    contact, points, own = s.contact, s.contact.points, s.contact.own
    x = s.mesh.x[own.nodes]
    place = np.einsum("pi,pij->pj", points.weight, x[points.corner])
    corner = x[own.facets]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]

    def refused(depth):
        moved = (depth - 0.05) * H  # the second body, into the first
        worst = 0.0
        for sign, grain in ((-1.0, 0), (1.0, 1)):
            other = own.grain_of_facet == grain
            p = np.flatnonzero(points.grain_of_point != grain)
            away = corner[other, 0] - (place[p] + [sign * moved, 0, 0])[:, None]
            planes = np.einsum("pfi,fi->pf", away, normal[other])
            nearest = planes.argmin(axis=1)
            area = np.minimum(points.facet_area[p], own.facet_area[other][nearest])
            worst = max(worst, (planes.min(axis=1) / edge_of_area(area, 1)).max())
        return worst > DEEPEST_START

    return bisect(refused, 0.2, 1.6, 20) * H / contact.edge


def swallowed(comm, part=0.25):
    """A small ball in the middle of a large one: what the program says."""
    large, small = sphere(RADIUS, H), sphere(part * RADIUS, part * H)
    mesh = distribute(comm, [large, small])
    return message_of(Simulation, mesh, [MATERIAL] * 2)


@case("stability-overlap", num_bodies=1)
def initial_overlap(comm, trials=7):
    """Overlaps up to a facet's edge give no energy; deeper ones, and grains in grains, are refused.

    Args:
        comm: MPI communicator.
        trials: Bisections.
    """
    results, simulations = {}, []
    for kind in ("balls", "blocks"):
        rows, more = overlap_map(comm, (0.3, 0.6), kind, steps=50)
        simulations += more
        for row in rows:
            name = f"{kind} {row.depth:g} h deep"
            results[f"{name}: energy released at rest"] = compare(row.released, 0.0, 0.0, 1.0)
            # Stresses of rigid flight are round-off of positions.
            results[f"{name}: energy gained"] = compare(row.gained, 0.0, 1e-10, 1.0)
        # Bisection between 0.2 and 3.
        results[f"{kind}: depth that is refused, over mean edge of facets"] = compare(
            limit(comm, kind, trials), limit_theory(comm, kind), 15 ** (0.5 / 2**trials) - 1 + 0.01
        )
    results["a ball in a ball is refused"] = compare(float(bool(swallowed(comm))), 1.0, 0.0)
    return results, simulations
