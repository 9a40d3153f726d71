"""Particle impacts that codes of discrete elements are checked by: those elastic bodies can do.

Of the eight tests, 1, 2, 4 and 5 are elastic (4 with a restitution of 0.98) and are here; 3 and
6 to 8 have a damper in the contact, which an elastic body has not. Tests 5 to 8 differ from
each other in how the contact moves, by translation or by spin, which is a number of
:func:`~mufe_fenicsx.verification.oblique_impact.rebound`.

Source: Y. C. Chung, J. Y. Ooi, Benchmark tests for verifying discrete element modelling codes at
particle impact level, Granular Matter 13, 2011, 643-656; values as repeated in the
examples of YADE and PySPH.
"""

import math
from dataclasses import dataclass

from ..materials.elastic import Elastic


@dataclass(frozen=True)
class ParticleImpact:
    """One test with one material; a plane is rigid, of two balls each has ``speed``."""

    test: int  #: number in the source
    material: Elastic
    radius: float  #: [m]
    partner: str  #: "plane" or "ball"
    speed: float  #: normal speed, or all of it where angles are given [m/s]
    friction: float = 0.0
    angles: tuple = ()  #: of incidence, from the normal [°]
    tangential: tuple = ()  #: speeds along the surface [m/s]


ANGLES = (5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 50.0, 60.0, 70.0, 80.0, 85.0)
TANGENTIAL = (0.1, 0.3, 0.5, 1.0, 5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 50.0, 70.0)

PARTICLE_IMPACTS = {
    "1 glass": ParticleImpact(1, Elastic(48e9, 0.2, 2800.0), 0.01, "ball", 10.0, 0.35),
    "1 limestone": ParticleImpact(1, Elastic(20e9, 0.25, 2500.0), 0.01, "ball", 10.0, 0.35),
    "2 aluminium alloy": ParticleImpact(2, Elastic(70e9, 0.3, 2699.0), 0.1, "plane", 0.2),
    "2 magnesium alloy": ParticleImpact(2, Elastic(40e9, 0.35, 1800.0), 0.1, "plane", 0.2),
    "4 aluminium oxide": ParticleImpact(
        4, Elastic(380e9, 0.23, 4000.0), 0.0025, "plane", 3.9, 0.092, angles=ANGLES
    ),
    "4 aluminium alloy": ParticleImpact(
        4, Elastic(70e9, 0.33, 2700.0), 0.0025, "plane", 3.9, 0.092, angles=ANGLES
    ),
    "5 steel": ParticleImpact(
        5, Elastic(208e9, 0.3, 7850.0), 1e-5, "plane", 5.0, 0.3, tangential=TANGENTIAL
    ),
    "5 polyethylene": ParticleImpact(
        5, Elastic(1e9, 0.4, 1400.0), 1e-5, "plane", 5.0, 0.3, tangential=TANGENTIAL
    ),
}


def angles_of_incidence(impact):
    """ψ₁ = κ v/(μ V) of each impact of a :class:`ParticleImpact` with friction."""
    kappa = 2 * (1 - impact.material.nu) / (2 - impact.material.nu)
    ratios = [math.tan(math.radians(angle)) for angle in impact.angles]
    ratios += [v / impact.speed for v in impact.tangential]
    return [kappa * ratio / impact.friction for ratio in ratios]
