"""The stage that ends the seating of an oedometer test."""

import functools

from ..loading.measures import PlatenMeasures
from ..loading.oedometer import LARGEST_SEATING, SEATING
from ..loading.stages import StagedLoading
from ..scene.stages import Axis, Loading, Stage

#: Of the seating stress, over it: a sample that yields comes to it ever more slowly, and where
#: strain begins changes by as little.
TOLERANCE = 0.1


def hold_of(simulation, oedometer):
    """What makes the stage in which the top platen holds the seating stress until all is at rest.

    Args:
        simulation: :class:`~mufe_fenicsx.explicit.simulation.Simulation`, or increments.
        oedometer: :class:`~mufe_fenicsx.scene.Oedometer`.

    Returns:
        A function without arguments that gives a
        :class:`~mufe_fenicsx.loading.stages.StagedLoading`, collective; None where the test does
        not ask for it.
    """
    if not oedometer.seating_at_rest:
        return None
    speed = oedometer.seating_speed
    settings = Loading(speed, oedometer.ramp, TOLERANCE, LARGEST_SEATING)
    platen = Axis(stress=oedometer.seating_stress, speed=speed, walls="max")
    program = [Stage(name=SEATING, z=platen, zero=True)]
    measures = PlatenMeasures(simulation)
    return functools.partial(StagedLoading, simulation, settings, program, None, measures)
