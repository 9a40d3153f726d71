"""Rigid tools pressed on an elastic half-space: Sneddon's cone and Hertz's ball."""

import numpy as np

from ..bulk.tools import Tool
from ..geometry.bodies.half_ball import half_ball
from ..geometry.bodies.half_space import half_space
from ..materials.elastic import Elastic
from ..run.from_bodies import distribute, simulate, sum_over_nodes
from ..theory import hertz
from ..theory.indentation import cone_force, point_force_displacement
from .case import case, compare

E, RHO, RADIUS = 100e9, 2650.0, 1e-4
#: Of the force; means over the second half of the way.
FORCE = 0.02
#: Sides of the cone: sectors are within 5e-4 of their cone.
SIDES = 96


@case("tool-indentation", num_bodies=2)
def tool_indentation(
    comm, elements_per_radius=4.0, nu=0.3, slope=0.02, a_over_R=0.02, far=30.0, growth=0.25
):
    """A cone and a ball, given as tools, pressed on an elastic half-space without friction.

    The half-space is half a ball of ``far`` contact radii. Its curved side moves as that of a
    half-space under a point force of the size that theory asks for, so that its size matters in
    the second order only. The tools go down in static increments.

    Args:
        comm: MPI communicator.
        elements_per_radius: Contact radius at the end over the length of edges there.
        nu: Poisson's ratio.
        slope: Of the cone; theory is that of small ones.
        a_over_R: Contact radius over that of the ball; theory is that of small ones.
        far: Radius of the half ball over the contact radius.
        growth: Increase of the size of elements with the distance.
    """
    modulus, results, simulations = hertz.effective_modulus((E, nu)), {}, []
    block = half_space(far * RADIUS, RADIUS / elements_per_radius, growth, RADIUS)
    ball_radius = RADIUS / a_over_R
    tools = {
        "cone": (
            cone(3 * RADIUS, slope),
            0.5 * np.pi * slope * RADIUS,
            lambda depth: cone_force(depth, slope, modulus),
        ),
        "ball": (
            ball(ball_radius),
            RADIUS**2 / ball_radius,
            lambda depth: hertz.hertz_force(depth, ball_radius, modulus),
        ),
    }
    for name, (body, depth, theory) in tools.items():
        test, lines = press(comm, block, Tool(name, *body), depth, theory, nu)
        simulations.append(test)
        results.update({f"{name}: {key}": line for key, line in lines.items()})
    return results, simulations


def press(comm, block, tool, depth, theory, nu, num_increments=10):
    """Press a tool, whose tip is at the origin, into the half-space below it. Collective.

    Args:
        comm: MPI communicator.
        block: Nodes and tetrahedra of the half-space.
        tool: :class:`~mufe_fenicsx.bulk.tools.Tool`.
        depth: To go [m].
        theory: Force by the depth.
        nu: Poisson's ratio.
        num_increments: In all.

    Returns:
        The simulation, and lines of a case.
    """
    tool = Tool(tool.name, tool.points, tool.cells, velocity=(0.0, 0.0, -depth))
    mesh = distribute(comm, [block], tools=[tool])
    own = np.flatnonzero(~mesh.is_tool[mesh.grain_of_node])
    radius = np.linalg.norm(block[0], axis=1).max()
    far = own[np.linalg.norm(mesh.x[own], axis=1) > (1 - 1e-6) * radius]
    materials = [Elastic(E, nu, RHO)] * int(np.sum(~mesh.is_tool))
    test = simulate(
        mesh, materials, [], 1.0 / num_increments, friction=0.0, tools=[tool],
        held=[(far, axis) for axis in np.eye(3)],
    )  # fmt: skip
    ratios, before = [], 0.0
    for k in range(num_increments):
        force = theory((k + 1) / num_increments * depth)
        test.prescribed[far] = point_force_displacement(mesh.x[far], force - before, E, nu)
        before = force
        test.step()
        pushed = test.tools.forces()[0, 2]
        if 2 * (k + 1) > num_increments:
            ratios.append(pushed / force)
    on_far = np.zeros_like(mesh.x)
    on_far[far] = test.specimen.f[far]
    return test, {
        "force": compare(float(np.mean(ratios)), 1.0, FORCE),
        "force, worst": compare(ratios[np.argmax(np.abs(np.array(ratios) - 1))], 1.0, 2 * FORCE),
        "held side over tool": compare(sum_over_nodes(test, on_far)[2] / pushed, -1.0, 5e-3),
    }


def cone(radius, slope):
    """A cone of that radius [m], its tip down at the origin: nodes and tetrahedra."""
    angle = 2 * np.pi * np.arange(SIDES) / SIDES
    # Sectors of the same mean slope as the cone.
    out = radius / np.sqrt(np.sinc(2 / SIDES))
    ring = np.column_stack(
        [out * np.cos(angle), out * np.sin(angle), np.full(SIDES, radius * slope)]
    )
    points = np.vstack([np.zeros(3), [0.0, 0.0, radius * slope], ring])
    first = 2 + np.arange(SIDES)
    cells = np.column_stack([np.zeros(SIDES, int), first, np.roll(first, -1), np.ones(SIDES, int)])
    return points, cells


def ball(radius):
    """Half a ball whose pole is at the origin: nodes and tetrahedra."""
    points, cells = half_ball(radius, RADIUS / 8, 0.3, contact_radius=1.5 * RADIUS)
    return points + radius * np.array([0.0, 0.0, 1.0]), cells
