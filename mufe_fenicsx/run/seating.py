"""The stage by which an oedometer test seats its sample."""

from ..loading.measures import PlatenMeasures
from ..loading.oedometer import LARGEST_SEATING, SEATING
from ..loading.stages import StagedLoading
from ..scene.stages import Axis, Loading, Stage

#: Of the seating stress, over it: a sample that yields comes to it ever more slowly, and where
#: strain begins changes by as little.
TOLERANCE = 0.1


def seating_of(simulation, oedometer):
    """The top platen takes the sample to the seating stress and holds it until all is at rest.

    Args:
        simulation: :class:`~mufe_fenicsx.explicit.simulation.Simulation`, or increments.
        oedometer: :class:`~mufe_fenicsx.scene.Oedometer`.

    Returns:
        :class:`~mufe_fenicsx.loading.stages.StagedLoading`; None of increments.
    """
    if simulation.increments:
        return None
    speed = oedometer.seating_speed
    settings = Loading(speed, oedometer.ramp, TOLERANCE, LARGEST_SEATING)
    platen = Axis(stress=oedometer.seating_stress, speed=speed, walls="max")
    program = [Stage(name=SEATING, z=platen, zero=True)]
    return StagedLoading(simulation, settings, program, None, PlatenMeasures(simulation))
