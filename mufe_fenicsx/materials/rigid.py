"""Grains that do not deform: their surfaces give way in contact, nothing else does."""

import math
from dataclasses import dataclass

import numpy as np

from ..units import setting
from .elastic import IsotropicSolid


@dataclass(frozen=True)
class Rigid(IsotropicSolid):
    """Six degrees of freedom; E and nu are those of the contact alone.

    The bulk does not yield to a contact, so the layer on the surface stands for all of
    it: an elastic foundation p = E* g/(kappa R) (K. L. Johnson, Contact Mechanics, 1985,
    section 4.3), R the radius of the ball of equal volume, whatever the mesh. Pressed on
    a plane or on its like, a ball answers with F = pi R δ² E*/(kappa R), and Hertz with
    4/3 E* sqrt(R) δ^1.5: their ratio is 3 pi/4 (a/R)/kappa, a = sqrt(R δ) the radius of
    Hertz's contact. They agree where a/R = ``contact_radius`` with kappa = 3 pi/4 of it;
    lighter contacts are softer than Hertz's in proportion to a, heavier ones stiffer.

    Raises:
        InputError: as `IsotropicSolid`; or contact_radius is not a number in ]0, 1[.
    """

    contact_radius: float = setting(
        0.1, "-", "contact radius a/R at which the force is Hertz's", gt=0, lt=1
    )

    def layer(self, radius: float) -> float:
        """Compliance kappa R/E* of the layer [m/Pa] of a grain of that ``radius`` [m]."""
        return 0.75 * math.pi * self.contact_radius * radius / self.contact_modulus

    def parameters(self) -> np.ndarray:
        """As of an elastic grain: it never yields."""
        return np.array([np.inf, 1.0, 0.0, np.inf])


#: Layer of a tool over its radius over E*: none, beside those of the grains that it meets.
LAYER_OF_TOOL = 1e-7


@dataclass(frozen=True)
class ToolSolid(Rigid):
    """Material of a tool: in contact with it grains alone give way, as with a wall.

    E and nu are those of the stiffest grain, which the scales of a computation follow.
    """

    #: whether the velocity along and the turning about x, y and z are told
    told: tuple[bool, ...] = (True,) * 6
    #: what it turns about [m], shape (3,); None: its centre of mass
    point: tuple[float, ...] | None = None

    def layer(self, radius: float) -> float:
        """Compliance of the layer [m/Pa] of a tool of that ``radius`` [m], next to nothing."""
        return LAYER_OF_TOOL * radius / self.contact_modulus
