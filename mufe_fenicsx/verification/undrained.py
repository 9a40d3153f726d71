"""An elastic cylinder between smooth walls that keep its volume: its effective stress path."""

import math

import numpy as np

from ..contact.walls import Wall
from ..container import CYLINDER, Bounds
from ..geometry.bodies.shapes import cylinder
from ..loading.stages import StagedLoading
from ..materials.elastic import Elastic
from ..run.from_bodies import build
from ..scene.stages import Axis, Loading, Stage, named
from .case import case, compare

E, RHO, SIZE, PRESSURE = 1e9, 2650.0, 1e-3, 1e6


@case("undrained-elastic", num_bodies=1)
def undrained_elastic(comm, elements=6.0, nu=0.2, strain=2e-3, speed=0.02):
    """An elastic cylinder under 1 MPa, sheared at constant volume and back.

    An isotropic elastic body that keeps its volume keeps its mean stress: Δp' = 0, whatever the
    deviator. Half of what the vertical stress rises by, the side stress falls by, so that a fluid
    at a constant total side stress has

        u = q/3,  Δσz' = εz/((1 + ν)/E + c),

    c the strain of both contact layers along an axis over the stress, in series.

    Args:
        comm: MPI communicator.
        elements: Edges along the radius.
        nu: Poisson's ratio.
        strain: Along the axis.
        speed: At which the height changes [m/s].

    Source: A. W. Skempton, Géotechnique 4, 1954, 143-147: A = 1/3 and B = 1 of an elastic body.
    """
    points, cells = cylinder(0.5 * SIZE, SIZE, 0.5 * SIZE / elements)
    radius = np.linalg.norm(points[:, :2], axis=1).max()
    bounds = Bounds(points.min(axis=0), points.max(axis=0), np.zeros(2), radius)
    walls = [Wall(s.name, s.point, s.normal, radius=s.radius) for s in CYLINDER.surfaces(bounds)]
    material = Elastic(E, nu, RHO)
    sim = build(comm, [(points, cells)], material, bounds.low, bounds.high, "", walls=walls)
    program = named(
        [
            Stage("start", zero=True, rz=Axis(stress=PRESSURE)),
            Stage("shut", z=Axis(strain=strain), undrained=True),
            Stage("back", z=Axis(strain=0.0), undrained=True),
        ]
    )
    settings = Loading(speed=speed, ramp=1e-4, tolerance=1e-3)
    loading, ends = StagedLoading(sim, settings, program), {}
    while not loading.finished:
        loading.before_step()
        sim.step()
        stress = loading.apparatus.gauges.axis_stress(sim.wall_forces())
        pressure = loading.apparatus.gauges.pore_pressure(stress)
        volume = float(CYLINDER.volume(loading.apparatus.gauges.lengths))
        ends[loading.stage] = stress, pressure, volume
    side, vertical = ends["start"][0]
    mean = (2.0 * side + vertical) / 3.0
    (side1, vertical1), pressure, volume = ends["shut"]
    q, mean1 = vertical1 - side1, (2.0 * side1 + vertical1) / 3.0
    layers = sim.contact.points
    soft = 2.0 * float(np.average(layers.layer, weights=layers.area)) / SIZE
    rise = strain / ((1.0 + nu) / E + soft)
    back = float(ends["back"][0][1] - ends["back"][0][0])
    return {
        "change of the mean effective stress over q": compare((mean1 - mean) / q, 0.0, 0.01, 1.0),
        "pore pressure over q": compare(pressure / q, 1.0 / 3.0, 0.02),
        "rise of the vertical effective stress": compare(vertical1 - vertical, rise, 0.02),
        "volume": compare(volume / ends["start"][2], 1.0, 1e-8),
        "q that is left after the way back": compare(back / q, 0.0, 0.02, 1.0),
        "part of the strain that contact layers take": compare(soft * rise / strain, 0.0, math.inf),
    }, [sim]
