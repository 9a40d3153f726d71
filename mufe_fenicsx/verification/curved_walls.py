"""Bodies in rigid cylinders and spheres: Hertz in a socket, a confined cylinder."""

import math
from dataclasses import dataclass

import numpy as np

from ..contact.walls import Wall
from ..geometry.bodies.half_ball import half_ball
from ..geometry.bodies.shapes import cylinder
from ..materials.elastic import Elastic
from ..run.from_bodies import build
from ..theory import elasticity, hertz
from .case import case, compare

E, RHO, RADIUS = 100e9, 2650.0, 1e-3
UP = np.array([0.0, 0.0, 1.0])
AXIS = np.array([1.0, 0.0, 0.0])
#: 1 % because a ball is no half-space, which the base of a half of one adds to; 1 % for the mesh.
FORCE = 0.02


@dataclass(frozen=True)
class Hollow:
    """A rigid wall that is touched from inside: its axis, zero for a sphere, and its radius."""

    axis: np.ndarray
    over_radius: float  #: its radius over that of the ball

    def curvatures(self):
        """A <= B of the gap A x² + B y² to the ball [1/m]."""
        less = 0.5 / RADIUS - 0.5 / (self.over_radius * RADIUS)
        return less, (0.5 / RADIUS if self.axis.any() else less)


@case("curved-walls", num_bodies=1)
def curved_walls(comm, elements_per_radius=3.0, a_over_R=0.02, nu=0.22, over_radius=2.0):
    """A ball pressed from inside on a rigid sphere and on a rigid cylinder, against Hertz.

    With a ball of radius R₁ in a hollow of radius R₂ the gap has the curvatures 1/R₁ - 1/R₂ along
    and, in a cylinder, 1/R₁ across. Half a ball is glued to a platen and moves in static
    increments. The load then turns back, and the sample is drawn around by friction in neither.

    Args:
        comm: MPI communicator.
        elements_per_radius: Contact radius over the length of edges there.
        a_over_R: Contact radius over that of the ball; a ball is a half-space for small ones.
        nu: Poisson's ratio.
        over_radius: R₂/R₁. Near 1 the contact is no longer small against the ball.
    """
    results, simulations = {}, []
    for name, axis in (("sphere", np.zeros(3)), ("cylinder", AXIS)):
        hollow = Hollow(axis, over_radius)
        test, lines = press_in(comm, hollow, elements_per_radius, a_over_R, nu)
        simulations.append(test)
        results.update({f"ball in a {name}: {key}": line for key, line in lines.items()})
    return results, simulations


def press_in(comm, hollow, elements_per_radius, a_over_R, nu, num_increments=10):
    """Press half a ball into a hollow. Collective.

    Returns:
        The simulation, and lines of a case: the mean of the force over Hertz's in the second
        half of the way, and the residual of the energy over the work.
    """
    A, B = hollow.curvatures()
    modulus, a = hertz.effective_modulus((E, nu)), a_over_R * RADIUS
    unit = hertz.elliptic_contact(RADIUS, A, B, modulus)
    approach = RADIUS * (a / math.sqrt(unit[1] * unit[2])) ** 2
    points, cells = half_ball(RADIUS, a / elements_per_radius, 0.25, UP, 1.3 * a)
    # The ball, whose facets stand out of it and cut into it, has a little room at the start.
    room = (a / elements_per_radius) ** 2 / RADIUS
    points = points - (RADIUS + room) * UP
    low = points.min(axis=0)
    radius = hollow.over_radius * RADIUS
    walls = [
        Wall("platen", low, UP, velocity=(approach + room) * UP, bonded=True),
        Wall("hollow", -radius * UP, hollow.axis, radius=radius),
    ]
    test = build(
        comm, [(points, cells)], Elastic(E, nu, RHO), low, -low, "",
        walls=walls, increment=1.0 / num_increments, friction=0.0,
    )  # fmt: skip
    ratios = []
    for k in range(num_increments):
        test.step()
        delta = test.walls.point[0, 2] - low[2] - room
        if 2 * (k + 1) > num_increments:
            theory = hertz.elliptic_contact(delta, A, B, modulus)[0]
            ratios.append(test.wall_forces()[1] / theory)
    energies = test.energies()
    return test, {
        "force": compare(float(np.mean(ratios)), 1.0, FORCE),
        "platen over hollow": compare(-test.wall_forces()[0] / test.wall_forces()[1], -1.0, 5e-4),
        "energy": compare(energies["residual"] / energies["work"], 0.0, 1e-2, 1.0),
    }


@case("confined-cylinder", num_bodies=1)
def confined_cylinder(comm, elements=8.0, nu=0.25, strain=1e-3):
    """An elastic cylinder in a smooth rigid ring: pressed along its axis, and by the ring.

    Along the axis its stiffness is the constrained modulus. A ring that shrinks by the part e of
    its radius in plane strain has the pressure K e, K = E/((1 + ν)(1 - 2ν)). The contact layer, of
    compliance c, is a spring in series, which leaves the part 1/(1 + K c/R) of it.

    Args:
        comm: MPI communicator.
        elements: Edges along the radius.
        nu: Poisson's ratio.
        strain: Along the axis, or of the radius.
    """
    height, material = 2 * RADIUS, Elastic(E, nu, RHO)
    body = cylinder(RADIUS, height, RADIUS / elements)
    end, side = math.pi * RADIUS**2, 2 * math.pi * RADIUS * height
    K, M = E / ((1 + nu) * (1 - 2 * nu)), elasticity.oedometric_modulus(E, nu)

    def forces(ends, ring):
        walls = [
            Wall("bottom", np.zeros(3), UP, **ends),
            Wall("top", height * UP, -UP, **ends),
            Wall("ring", np.zeros(3), UP, radius=RADIUS, growth_rate=-ring * RADIUS),
        ]
        low, high = body[0].min(axis=0), body[0].max(axis=0)
        test = build(comm, [body], material, low, high, "", walls=walls, increment=1.0)
        if not ring:  # glued ends, which would not move sideways anyhow
            test.walls.velocity[1] = -strain * height * UP
        test.step()
        return test, test.wall_forces(), test.energies()

    along, pressed, _ = forces({"bonded": True}, 0.0)
    across, shrunk, energies = forces({"mirror": True}, strain)
    points = across.contact.points
    layer = float(np.average(points.layer, weights=points.area))
    left = 1 / (1 + K * layer / RADIUS)
    return {
        "constrained modulus": compare(pressed[1] / end / strain, M, 0.01),
        "pressure of the ring that shrinks": compare(shrunk[2] / side / strain, K * left, 0.01),
        "part that the contact layer leaves": compare(left, 1.0, math.inf),
        "energy": compare(energies["residual"] / energies["work"], 0.0, 1e-3, 1.0),
    }, [along, across]
