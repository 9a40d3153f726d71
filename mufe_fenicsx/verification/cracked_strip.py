"""A long strip with a crack along its middle, whose edges are pulled apart."""

import numpy as np

from ..bulk.cracks.cracks import Cracks
from ..bulk.cracks.facets import Facets
from ..contact.walls import Wall
from ..geometry.bodies.shapes import box
from ..materials.elastic import Elastic
from ..materials.fracture import Fracture
from ..run.from_bodies import build
from .case import case, compare

E, RHO, EDGE, STRENGTH = 100e9, 2650.0, 0.1e-3, 100e6
X, Z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
#: Over the strip's height: length of the first crack, and of the whole. Way that is a run [bricks]:
#: over 4 bricks what the crack takes is by chance 0.87 to 1 of its energy, over 16 it is the same.
NOTCH, LENGTH, RUNS = 0.6, 2.0, 16.0


@case("cracked-strip", num_bodies=1)
def cracked_strip(comm, height=40, zone=8.0, passes=160.0, damping=0.3, shear_ratio=2.0):
    """A crack in a strip runs when the energy of the strip ahead of it is that of its surface.

    The long edges of the strip are glued to platens. Far ahead of the crack it is strained alike,
    and far behind not at all: when the crack has gone on by da it has released G = E u²/H in each
    da of it, with H half of the height and u the way of each platen, whatever happens at the front
    (R. S. Rivlin, A. G. Thomas, J. Polym. Sci. 10, 1953, 291-318). No facet is told to open but
    those of the notch.

    Args:
        comm: MPI communicator.
        height: Bricks across the strip, even.
        zone: Cohesive zone E G/σ² in bricks: a third of the height would break the whole strip.
        passes: Time of the pull, in which waves cross the strip so many times. It goes on while
            the crack runs: a pull of half the time gives 2 to 4 % more.
        damping: Of all motion, in passes of a wave through the strip.
        shear_ratio: β.
    """
    material, energy = Elastic(E, 0.0, RHO), zone * EDGE * STRENGTH**2 / E
    half, length, wave = 0.5 * height * EDGE, LENGTH * height * EDGE, material.wave_speed
    crossing, wanted = 2.0 * half / wave, np.sqrt(energy * half / E)
    speed = 1.1 * wanted / (passes * crossing)
    size, bricks = (length, EDGE, 2.0 * half), (round(LENGTH * height), 1, height)
    walls = [
        Wall("low", -half * Z, Z, bonded=True, velocity=-speed * Z),
        Wall("high", half * Z, -Z, bonded=True, velocity=speed * Z),
    ]
    s = build(
        comm, [box(size, bricks, (0.0, 0.0, -half))], material, (0, 0, 0), (0, 0, 0), axes="",
        walls=walls, damping=damping / crossing,
        velocity=lambda x, _grain: speed / half * x[:, 2:] * Z,
    )  # fmt: skip
    notch = NOTCH * height * EDGE

    facets = Facets(s.mesh, s.solid.volume0)
    x = s.mesh.x[facets.nodes(s.mesh)[:, :3]]
    middle = (np.abs(x[:, :, 2]) < 0.1 * EDGE).all(axis=1)
    cut = middle & (x[:, :, 0].mean(axis=1) < notch)
    s.grow(facets.across[cut])
    cracks = Cracks(s.specimen, Fracture(STRENGTH, energy, shear_ratio))
    cracks.strength[cut] = np.inf
    s.add_term(cracks)
    ran = 0.0
    while s.state.t < 1.2 * passes * crossing and not ran >= RUNS * EDGE:
        s.step(everywhere=False)
        if s.state.num_steps % 20 == 0 and cracks.opened.size:
            failed = failed_area(cracks)
            ran = failed[middle[cracks.opened]].sum() / EDGE
    u = speed * s.state.t
    failed, on = failed_area(cracks), middle[cracks.opened]
    e = s.energies()
    results = {
        "energy released over that of the crack": compare(E * u**2 / half / energy, 1.0, 0.03),
        "way of the crack [bricks]": compare(ran / EDGE, RUNS, np.inf),
        "area that failed off the middle, over all": compare(
            failed[~on].sum() / failed.sum(), 0.0, 0.02, scale=1.0
        ),
        "work of the dashpot over that of fracture": compare(
            e["cracks_damping"] / e["cracks_fracture"], 0.0, 0.01, scale=1.0
        ),
        "energy residual over the work": compare(
            abs(e["residual"]) / (e["work"] + s.initial_kinetic), 0.0, 1e-3, scale=1.0
        ),
    }
    return results, [s]


def failed_area(cracks):
    """Failed area of each open facet [m²], shape (num_opened,)."""
    p = cracks.points
    soft = p["furthest"] - p["strength"] / np.maximum(p["stiffness"], 1.0)
    share = np.mean((p["open"] != 0.0) & (soft >= p["ultimate"]), axis=1)
    return share * cracks.facets.area[cracks.opened]
