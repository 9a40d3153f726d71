"""Grains that stay rigid until the load on them could make them yield."""

from dataclasses import dataclass

from ..units import setting
from .j2 import J2


@dataclass(frozen=True)
class Auto(J2):
    """J2, but rigid as long as the contact forces on the grain are small.

    A grain of equal volume's radius R under two opposite forces F carries a nominal stress
    F/(pi R²). It deforms once that exceeds ``margin`` times the first yield stress Y, and from
    then on. Until then it is taken to be rigid with the same contact layer as later, so that no
    force jumps then. What is left out is the approach of the bulk: elastic
    (3 pi m Y/(4 E*))^(2/3) R by Hertz's law, m the margin, and m R/6 where the contact flows at
    3 Y (K. L. Johnson, Contact Mechanics, 1985, sections 4.2 and 6.3).

    Below yield the kernel does the work of an elastic grain, no more: there is no third stage.

    Raises:
        InputError: as `J2`; or the margin is not in ]0, 1].
    """

    margin: float = setting(
        1e-3, "-", "nominal over yield stress at which the grain begins to deform", gt=0, le=1
    )
