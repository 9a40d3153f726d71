"""The stability map: each method driven to failure, the limit compared with theory.

The cases are those of `mufe verify`; ``demos/stability.py`` draws what they measure.
"""

from . import (
    friction,
    incompressible,
    inversion,
    newton,
    overlap,
    penalty,
    plastic,
    resting,
    slivers,
    speed,
    time_step,
    tunnelling,
    unequal,
)

STABILITY = {
    "stability-time-step": time_step.time_step,
    "stability-penalty": penalty.penalty,
    "stability-friction": friction.friction_limits,
    "stability-loading-speed": speed.loading_speed,
    "stability-mass": speed.added_mass,
    "stability-slivers": slivers.slivers,
    "stability-overlap": overlap.initial_overlap,
    "stability-incompressible": incompressible.incompressible,
    "stability-plastic": plastic.plastic_flow,
    "stability-inversion": inversion.inversion,
    "stability-impact": tunnelling.fast_impact,
    "stability-size": unequal.unequal_size,
    "stability-resting": resting.resting,
    "stability-newton": newton.newton_limits,
}
