"""Grains that break: paths that follow facets, in tension and under pressure, dust, no dashpot."""

import numpy as np

from ...analysis.breakage import diameter
from ...bulk.cracks.cracks import Cracks
from ...contact.walls import Wall
from ...geometry.bodies.shapes import box
from ...materials.elastic import Elastic
from ...materials.fracture import Fracture
from ...run.from_bodies import build
from ...theory.cohesion import compression_on_plane, compressive_strength, tension_on_plane
from ..case import at_least, case, compare
from ..damaged_block import block_in_motion, course_of_energies

E, RHO, EDGE, STRENGTH = 60e9, 2500.0, 0.1e-3, 60e6
#: Bricks across and along a bar, part of it in the middle that may break, cohesive zone in bricks.
ACROSS, ALONG, WEAK, ZONE = 4, 16, 0.4, 6.0
#: Steps from one look at the force to the next.
EVERY = 10


def bar(slope):
    """A bar along z of bricks whose layers across are tilted about y in its middle."""
    width, length = ACROSS * EDGE, ALONG * EDGE
    points, cells = box(
        (width, width, length), (ACROSS, ACROSS, ALONG), (-0.5 * width, 0.0, -0.5 * length)
    )
    tilted = np.clip((0.5 * length - np.abs(points[:, 2])) / (0.5 * (1 - WEAK) * length), 0, 1)
    points[:, 2] += slope * points[:, 0] * tilted
    return points, cells


def strength_of_bar(comm, slope, pull, friction=0.0, shear_ratio=2.0, speed=0.05):
    """Largest mean stress of a bar that is pulled or pressed over σ, and the simulation.

    Args:
        comm: MPI communicator of one rank.
        slope: Of the layers of bricks.
        pull: 1.0, or -1.0: it is pressed.
        friction, shear_ratio: μ, β.
        speed: Of its ends from each other, over c σ/E times the stress over σ.
    """
    material, up, half = Elastic(E, 0.0, RHO), np.eye(3)[2], 0.5 * ALONG * EDGE
    c = material.wave_speed
    v = speed * c * STRENGTH / E * pull
    walls = [
        Wall("low", -half * up, up, velocity=-v * up, bonded=True),
        Wall("high", half * up, -up, velocity=v * up, bonded=True),
    ]
    s = build(
        comm, [bar(slope)], material, (0, 0, 0), (0, 0, 0), axes="", walls=walls,
        damping=0.5 * c / half, velocity=lambda x, _grain: v / half * x[:, 2:] * up,
    )  # fmt: skip
    law = Fracture(STRENGTH, ZONE * EDGE * STRENGTH**2 / E, shear_ratio, friction)
    cracks = Cracks(s.specimen, law)
    places = np.abs(s.mesh.x[cracks.facets.nodes(s.mesh)[:, :3], 2])
    cracks.strength[(places > WEAK * half).any(axis=1)] *= 10.0
    s.add_term(cracks)
    most, area = 0.0, (ACROSS * EDGE) ** 2
    while True:
        s.step(everywhere=False)
        if s.state.num_steps % EVERY:
            continue
        now = abs(s.wall_forces().mean()) / area / STRENGTH
        most = max(most, now)
        if now < 0.7 * most and s.mesh.version:
            return most, s


def burst(comm, cubes=2, rate=2e6, dust=0):
    """Sizes of the pieces of a block that flies apart over an edge of its bricks; simulation."""
    s = build(
        comm, [box((cubes * EDGE,) * 3, (cubes,) * 3)], Elastic(E, 0.2, RHO), (0, 0, 0), (0, 0, 0),
        axes="", velocity=lambda x, _grain: rate * (x - 0.5 * cubes * EDGE),
    )  # fmt: skip
    s.add_term(Cracks(s.specimen, Fracture(STRENGTH, 3.0 * EDGE * STRENGTH**2 / E, dust=dust)))
    while s.state.t < 20.0 / rate and (s.mesh.num_pieces < s.mesh.num_cells).all():
        s.step(everywhere=False)
    piece = s.mesh.piece_of_cell
    return diameter(np.bincount(piece, s.solid.volume0)) / EDGE, s


@case("stability-cracks", num_bodies=1)
def cracks_limits(
    comm, tilt=30.0, friction=0.6, shear_ratio=2.0, cubes=2, rate=2e6, dust=0, steps=6000
):
    """How paths along facets, dust and a lack of the dashpot fail.

    A bar whose layers of bricks are tilted breaks along them, not straight across. A pressed bar
    whose facets are turned by 45° at best slips there, at more than Mohr and Coulomb's plane asks
    for; where tan 45° is not above μ it never does. No piece is less than a tetrahedron. Without
    the dashpot damaged facets that close again and again gain energy.

    Args:
        comm: MPI communicator.
        tilt: Of the layers [degrees].
        friction, shear_ratio: μ, β.
        cubes: Bricks along the edges of the block that flies apart.
        rate: Of its strain [1/s].
        dust: Tetrahedra of its pieces that go on as rigid bodies.
        steps: Of damaged blocks.
    """
    straight, *simulations = strength_of_bar(comm, 0.0, 1.0, 0.0, shear_ratio)
    angle = np.radians(tilt)
    tilted, s = strength_of_bar(comm, np.tan(angle), 1.0, 0.0, shear_ratio)
    pressed, p = strength_of_bar(comm, 0.0, -1.0, friction, shear_ratio, speed=0.3)
    sizes, b = burst(comm, cubes, rate, dust)
    weakest = compressive_strength(shear_ratio, friction)
    slips = compression_on_plane(np.pi / 4, shear_ratio, friction) / weakest
    results = {
        "tension over σ": compare(straight, 1.0, 0.05),
        "tension of tilted layers over that": compare(
            tilted / straight, tension_on_plane(angle, shear_ratio), 0.02
        ),
        # As above, with ends that move six times as fast.
        "compression over Mohr and Coulomb's": compare(pressed / weakest, slips, 0.08),
        "least piece over an edge": compare(sizes.min(), np.cbrt(1.0 / np.pi), 1e-3),
        "energy from nowhere as all is dust, over that of the start": compare(
            abs(b.energies()["residual"]) / b.initial_kinetic, 0.0, np.inf
        ),
    }
    for name, damping in (("", 0.07), (" without a dashpot", 0.0)):
        block, _ = block_in_motion(comm, 2, 1.0, (0.5, 0.95), 0.9, damping)
        energies = course_of_energies(block, steps)
        simulations.append(block)
        grown = max(energies[-1] / energies[0] - 1.0, 0.0)
        results[f"growth of energy{name}"] = (
            compare(grown, 0.0, 1e-6, 1.0) if damping else at_least(grown, 0.01)
        )
    return results, [*simulations, s, p, b]
