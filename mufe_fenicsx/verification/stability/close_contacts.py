"""Contacts so close to each other that they share a facet."""

import math
from functools import lru_cache

import numpy as np

from ...geometry.bodies.block import block
from ...geometry.bodies.half_ball import half_ball
from ...materials.elastic import Elastic
from ...theory import hertz
from ...theory.stability import apart_for, force_of_three
from ..case import case, compare
from ..pressed import AXIS, Body, Pressed
from .limits import NU, RHO, E

RADIUS = 1e-3
#: Contact radius of Hertz [m].
A = 0.02 * RADIUS
APPROACH = A**2 / RADIUS
SOFT = Elastic(E, NU, RHO)
#: The three tips, so hard that they yield to each other by the block alone.
HARDER = 100.0
HARD = Elastic(HARDER * E, NU, RHO)
#: Distance of the tips from each other, over the contact radius.
APART = 3.0
#: Elements per contact radius of the tips.
OF_TIPS = 1.5


def places(number):
    """Points that fill the square of edge 1 around the origin evenly, shape (number, 2)."""
    k = np.arange(number)[:, None]
    return (0.3 + k * [0.618034, 0.754878]) % 1.0 - 0.5


def corners():
    """Where the tips are [m], shape (3, 2)."""
    angle = 0.4 + 2 * np.pi * np.arange(3) / 3
    return APART * A / math.sqrt(3) * np.column_stack([np.cos(angle), np.sin(angle)])


@lru_cache(maxsize=4)
def tips(number):
    """A half ball with one tip, or with three of its radius a few contact radii apart."""
    h, s = A / OF_TIPS, APART * A
    reach = A + (s / math.sqrt(3) if number > 1 else 0.0)
    points, cells = half_ball(RADIUS, h, 0.25, (0.0, 0.0, 1.0), reach)
    if number > 1:
        # Highest of three parabolas, less that of the ball; it fades far from them.
        far = np.linalg.norm(points - [0, 0, RADIUS], axis=1) / (4 * s)
        higher = (points[:, :2] @ corners().T).max(axis=1) - s**2 / 6
        points[:, 2] += higher / RADIUS * np.exp(-(far**4))
    return points, cells


@lru_cache(maxsize=8)
def under(h):
    """The block under the tips, with edges ``h`` [m]."""
    length = 60 * A
    return block(length, 0.5 * length, h, 0.3, 1.5 * APART * A)


def pressed(comm, number, h, at):
    """One tip or three above the place ``at`` [m] of the block with edges ``h``."""

    def jog(points):
        return points - [*at, 0.0]

    body = Body(*under(h), 60 * A, SOFT, jog)
    return Pressed(comm, [body, Body(*tips(number), RADIUS, HARD)])


def share_of_interplay(comm, h, at):
    """How far each of three tips is moved by the other two, over the law of a half-space.

    Each tip is pressed alone at its place on the same mesh. There the force of three needs less
    approach; the rest is what the others do. By Boussinesq it is 2 P/(π E* s), with E* of both.

    Returns:
        That share; force of the three over that of theory; simulation.
    """
    three = pressed(comm, 3, h, at)
    three.press(APPROACH)
    force = three.reaction()
    alone = np.zeros(2)
    for corner in corners():
        one = pressed(comm, 1, h, at + corner)
        for k, part in enumerate((0.8, 1.0)):
            one.press(part * APPROACH)
            alone[k] += one.reaction()
    power = math.log(alone[1] / alone[0]) / math.log(1 / 0.8)
    needed = APPROACH * (force / alone[1]) ** (1 / power)
    modulus = hertz.effective_modulus((E, NU), (HARDER * E, NU))
    moved = 2 * force / 3 / (math.pi * modulus * APART * A)
    law = 3 * force_of_three(APART) * hertz.hertz_force(APPROACH, RADIUS, modulus)
    return (APPROACH - needed) / moved, force / law, three.simulation


def reach_of_point(comm, h):
    """Distance at which a half-space has the compliance of a loaded facet, over its edge.

    The mean of the facets next to the middle of the block.
    """
    s = Pressed(comm, [Body(*under(h), 60 * A, SOFT)]).simulation
    own, x, found = s.contact.own, s.mesh.x, []
    facets = own.nodes[own.facets]
    away = np.linalg.norm(x[facets].mean(axis=1), axis=1)
    for k in np.argsort(away)[:4]:
        load = np.zeros_like(x)
        load[facets[k]] = AXIS / 3
        yields = (s.response(load)[facets[k]] @ AXIS).mean()
        edge = math.sqrt(4 / math.sqrt(3) * own.facet_area[k])
        found.append((1 - NU**2) / (math.pi * E * yields * edge))
    return float(np.mean(found))


@case("stability-close-contacts", num_bodies=2)
def close_contacts(comm, num_places=5, nearest=0.4, farthest=0.6, error=0.05):
    """Three hard tips on one block, as close as its facets are wide.

    Each contact has layers of its own, but on one facet they share its nodes: others move a
    contact no more than it moves itself. The mesh then carries too much. What each tip carries
    alone on the same mesh is taken out.

    Args:
        comm: MPI communicator.
        num_places: On the mesh of the block, over which means are taken.
        nearest, farthest: Distances of the tips over the edges between which the limit is sought.
        error: Of the force, at the limit.
    """
    distance, shares, forces, simulations = np.array([nearest, farthest]), [], [], []
    for over_h in distance:
        h = APART * A / over_h
        rows = [share_of_interplay(comm, h, at * h) for at in places(num_places)]
        shares.append(np.mean([row[0] for row in rows]))
        forces.append(np.mean([row[1] for row in rows]))
        simulations.extend(row[2] for row in rows)
    reach = reach_of_point(comm, 2 * APART * A)
    limit = apart_for(error, APART, reach)
    # Of the others' motion, of which this is left at the limit.
    measured = float(np.interp(limit / reach, shares, distance))
    results = {
        # Places scatter by a tenth of the motion.
        "distance over h where interplay is missed": compare(measured, limit, 0.1),
        "share of the interplay at half of the edge": compare(
            float(np.interp(0.5, distance, shares)), min(0.5 / reach, 1.0), 0.1
        ),
    }
    for over_h, force in zip(distance, forces, strict=True):
        results[f"force at {over_h:g} h over that of a half-space"] = compare(force, 1.0, np.inf)
    return results, simulations
