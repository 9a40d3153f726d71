"""Elastic bodies sheared by walls: a tube between platens that turn, a cube in a box that tilts."""

import math

import numpy as np

from ..contact.walls import Wall
from ..container import BOX, HOLLOW_CYLINDER, Bounds
from ..geometry.bodies.shapes import box
from ..geometry.bodies.tube import tube
from ..loading.shearing import SimpleShear, Torsion
from ..materials.elastic import Elastic
from ..run.from_bodies import build
from ..scene.shearing import Shear, Turn
from ..scene.stages import Stage
from .case import case, compare

E, RHO, SIZE = 100e9, 2650.0, 1e-3
#: Walls beside a tube are so far from it, over its radius.
AWAY = 0.02


@case("tube-in-torsion", num_bodies=1)
def tube_in_torsion(comm, layers=8, inner_over_outer=0.6, angle=1e-4, nu=0.2):
    """An elastic tube glued to platens, of which one turns, in one static increment: T = G J φ/H.

    J is ∫ρ² dA of the section of the mesh, which warps by nothing. Linear tetrahedra are too stiff
    by an error of second order in their size, so that two meshes give the limit.

    Args:
        comm: MPI communicator.
        layers: Of bricks of six tetrahedra along the height; half of them in the coarser mesh.
        inner_over_outer: Radius of the hole over that of the tube.
        angle: φ [rad].
        nu: Poisson's ratio.
    """
    material, found, tests = Elastic(E, nu, RHO), [], []
    for n in (layers // 2, layers):
        body = tube(SIZE, inner_over_outer * SIZE, SIZE, (6 * n, max(n // 2, 1), n))
        bounds = Bounds(*_corners(body), np.zeros(2), SIZE * (1 + AWAY),
                        inner_over_outer * SIZE * (1 - AWAY))  # fmt: skip
        test = _between(comm, HOLLOW_CYLINDER, bounds, body, material, ("z_min", "z_max"))
        torsion = Torsion(test, HOLLOW_CYLINDER, 1.0)
        torsion.begin(Stage(turn=Turn(angle=angle)))
        torsion.move(1.0, 1.0, np.zeros(4))
        test.step()
        row = dict(zip(torsion.columns, torsion.row(), strict=True))
        exact = material.shear_modulus * _polar_moment(body) * angle / SIZE
        found.append(row["torque"] / exact)
        tests.append(test)
    volume = float(HOLLOW_CYLINDER.volume(HOLLOW_CYLINDER.lengths_within(bounds)))
    work = volume * row["shear_tz"] * row["gamma_tz"] / (row["torque"] * angle)
    energies = tests[-1].energies()
    stored = energies["elastic"] / (0.5 * row["torque"] * angle)
    return {
        "torque over G J φ/H": compare(found[-1], 1.0, 0.16 * (4 / layers) ** 2),
        "limit of both meshes": compare((4 * found[-1] - found[0]) / 3, 1.0, 0.01),
        "V τ γ over T φ": compare(work, 1.0, 1e-9),
        "elastic energy over T φ/2": compare(stored, 1.0, 1e-3),
    }, tests


@case("sheared-box", num_bodies=1)
def sheared_box(comm, divisions=8, gamma=1e-4, nu=0.2, compliance=0.02):
    """An elastic cube between rough walls that move as a sheared solid, static: τ = G γ.

    Six smooth walls press it. Then those across x and z are rough: the top moves along x, two walls
    tilt with it. Contact acts in points within facets, through a layer, and leaves edges free,
    an error of first order in the size of facets. Smooth walls beside cannot carry the shear
    stress that goes with τ: then the sample turns where it can, and τ is less.

    Args:
        comm: MPI communicator.
        divisions: Bricks of six tetrahedra along an edge; half of them in the coarser mesh.
        gamma: γ.
        nu: Poisson's ratio.
        compliance: Of the contact layer.
    """
    material, tests = Elastic(E, nu, RHO), []
    G, bounds = material.shear_modulus, Bounds(np.zeros(3), np.full(3, SIZE), np.zeros(2), 0.0)

    def sheared(n, rough):
        body = box((SIZE,) * 3, (n,) * 3)
        test = _between(comm, BOX, bounds, body, material, (), compliance=compliance)
        test.walls.set_speeds(np.full(6, 2 * gamma * SIZE / test.dt))
        test.step()
        test.walls.friction[rough] = test.walls.friction_kinetic[rough] = 1e3
        shear = SimpleShear(test, BOX, 1.0)
        shear.begin(Stage(shear=Shear(xz=gamma)))
        test.walls.set_speeds(np.zeros(6))
        shear.move(1.0, 1.0, np.zeros(6))
        test.step()
        force, _ = test.walls.loads(comm)
        tests.append(test)
        row = dict(zip(shear.columns, shear.row(), strict=True))
        return row, 0.5 * (force[0, 2] - force[1, 2]) / SIZE**2

    along, platens = [0, 1, 4, 5], [4, 5]
    coarse, _ = sheared(divisions // 2, along)
    fine, beside = sheared(divisions, along)
    smooth, _ = sheared(divisions // 2, platens)
    first, last = (row["shear_xz"] / (G * gamma) for row in (coarse, fine))
    return {
        "shear stress over G γ": compare(last, 1.0, 0.5 / divisions),
        "limit of both meshes": compare(2 * last - first, 1.0, 0.02),
        "shear stress of the walls that tilt over that of the platens": compare(
            beside / fine["shear_xz"], 1.0, 0.01
        ),
        "γ": compare(fine["gamma_xz"], gamma, 1e-9),
        "shear stress over G γ, smooth walls beside": compare(
            smooth["shear_xz"] / (G * gamma), 1.0, math.inf
        ),
    }, tests


def _between(comm, container, bounds, body, material, bonded, **options):
    """A body in a container, in static increments."""
    walls = [
        Wall(s.name, s.point, s.normal, radius=s.radius, bonded=s.name in bonded)
        for s in container.surfaces(bounds)
    ]
    return build(
        comm, [body], material, bounds.low, bounds.high, "", walls=walls, increment=1.0, **options
    )


def _corners(body):
    return body[0].min(axis=0), body[0].max(axis=0)


def _polar_moment(body):
    """∫ρ² dA of the mean section of a body of tetrahedra whose height is ``SIZE`` [m⁴]."""
    x = body[0][body[1]]
    volume = np.linalg.det(x[:, 1:] - x[:, :1]) / 6
    across = x[:, :, :2]
    # Of ρ², squares of linear functions: (Σ xi² + (Σ xi)²)/20 over the four nodes.
    square = ((across**2).sum(axis=(1, 2)) + (across.sum(axis=1) ** 2).sum(axis=1)) / 20
    return float(volume @ square) / SIZE
