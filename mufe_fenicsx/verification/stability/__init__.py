"""The stability map: each method driven to failure, the limit compared with theory.

The cases are those of `mufe verify`.
"""

from ..case import by_name
from . import (
    between_points,
    close_contacts,
    conforming,
    cracks,
    edge,
    friction,
    incompressible,
    inversion,
    newton,
    overlap,
    penalty,
    plastic,
    resting,
    sleeve,
    slivers,
    speed,
    time_step,
    touch,
    tunnelling,
    unequal,
)

STABILITY = by_name(
    time_step.time_step,
    penalty.penalty,
    between_points.between_points,
    close_contacts.close_contacts,
    edge.edge,
    conforming.conforming,
    friction.friction_limits,
    speed.loading_speed,
    speed.added_mass,
    slivers.slivers,
    overlap.initial_overlap,
    incompressible.incompressible,
    plastic.plastic_flow,
    inversion.inversion,
    touch.first_touch,
    tunnelling.fast_impact,
    unequal.unequal_size,
    resting.resting,
    sleeve.sleeve_limits,
    newton.newton_limits,
    cracks.cracks_limits,
)
