"""A free bar in which two waves of tension meet and break it."""

import numpy as np

from ..bulk.cracks.cracks import Cracks
from ..geometry.bodies.shapes import box
from ..materials.elastic import Elastic
from ..materials.fracture import Fracture
from ..run.from_bodies import build
from .case import case, compare

E, RHO, EDGE = 100e9, 2650.0, 0.1e-3
STRENGTH = 100e6


@case("bar-in-tension", num_bodies=1)
def bar_in_tension(comm, divisions=80, width=2, zone=6.0, pull=1.25, ramp=0.4, stronger=1.1):
    """Two waves of tension meet in the middle of a bar, and break it there.

    The outer parts of a free bar without Poisson's effect move apart. Each wave is too weak to
    break it; together they bear more than the strength of the middle plane, which is a little
    weaker than the rest. The crack unloads the bar before another one opens.

    Args:
        comm: MPI communicator.
        divisions: Bricks along the bar.
        width: Bricks across.
        zone: Length of the cohesive zone, E G/σ², in bricks.
        pull: Stress of both waves together over the strength.
        ramp: Length in which a wave rises, over that of the bar.
        stronger: Strength of the rest over that of the middle plane.
    """
    material, energy = Elastic(E, 0.0, RHO), zone * EDGE * STRENGTH**2 / E
    length, side = divisions * EDGE, width * EDGE
    speed = pull * STRENGTH / (RHO * material.wave_speed)

    def velocity(x, _grain):
        z = (x[:, 2] - 0.5 * length) / length
        rise = np.clip(np.abs(z) / ramp, 0.0, 1.0)
        rise = 0.5 - 0.5 * np.cos(np.pi * rise)
        return (speed * np.sign(z) * rise)[:, None] * [0.0, 0.0, 1.0]

    s = build(
        comm, [box((side, side, length), (width, width, divisions))], material, (0, 0, 0),
        (0, 0, 0), axes="", velocity=velocity,
    )  # fmt: skip
    cracks = Cracks(s.specimen, Fracture(STRENGTH, energy))
    nodes = s.mesh.x[cracks.facets.nodes(s.mesh)[:, :3], 2]
    cracks.strength[(np.abs(nodes - 0.5 * length) > 0.1 * EDGE).any(axis=1)] *= stronger
    s.add_term(cracks)
    start, whole = s.solid.mass @ np.abs(s.state.v), s.energies()
    first, dt = s.solid.mass @ s.state.v, s.dt
    while s.state.t < 0.8 * length / material.wave_speed:
        s.step(everywhere=False)
    e, kept = s.energies(), cracks.points
    drift = np.linalg.norm(s.solid.mass @ s.state.v - first)
    on = kept["open"] != 0.0
    area = np.broadcast_to(cracks.facets.area[cracks.opened][:, None] / 3.0, on.shape)
    failed = on & (kept["furthest"] - kept["strength"] / kept["stiffness"] >= kept["ultimate"])
    reached = np.average(kept["strength"][failed], weights=area[failed]) if failed.any() else 0.0
    results = {
        "strength reached over stated": compare(reached / STRENGTH, 1.0, 0.02),
        "area that failed over that of the bar": compare(area[failed].sum() / side**2, 1.0, 0.01),
        "fracture work over G A": compare(e["cracks_fracture"] / (energy * side**2), 1.0, 0.05),
        "work of the dashpot over it": compare(
            e["cracks_damping"] / e["cracks_fracture"], 0.0, 0.01, scale=1.0
        ),
        "momentum": compare(drift / start.sum(), 0.0, 1e-12, scale=1.0),
        "energy residual": compare(abs(e["residual"]) / whole["kinetic"], 0.0, 1e-3, scale=1.0),
        "time step over that without cracks": compare(s.dt / dt, 1.0, np.inf),
    }
    return results, [s]
