"""Are the contacts of grains resolved by the facets of their surfaces?

A contact of radius a on facets with edges h has π a² / (√3/4 h²) of them on each side. So N closed
points, one at the middle of each facet, stand for

    a/h = √(√3 N / (4 π s))

elements per contact radius, s the number of sides that have points: two between grains, one at a
wall. Where points are the nodes instead there are half as many, and a/h is √2 times that.
"""

from dataclasses import dataclass

import numpy as np

#: Elements per contact radius below which a contact is coarse. The force between two elastic balls
#: is off by 33 % with 0.75 elements, 19 % with 1, 6 % with 1.5 and 0.8 % with 2.5, of
#: `mufe verify hertz --set bodies=spheres --set a_over_R=0.02 --set elements_per_radius=1`.
COARSE = 1.0


@dataclass(frozen=True)
class Resolution:
    """How finely contacts are meshed, each with the weight of its normal force."""

    points: float  #: median number of closed points of a contact
    elements: float  #: median number of elements per contact radius
    coarse: float  #: share of the normal force in contacts with fewer than `least` points
    least: int  #: the number of points that COARSE elements per contact radius have


def elements_per_radius(num_points, sides=2, nodes=False):
    """Elements per contact radius of contacts with so many closed points.

    Args:
        num_points: On all sides, shape (num_contacts,).
        sides: Sides of a contact that have points: 2, or 1 at a wall.
        nodes: Whether points are nodes and not the middles of facets.
    """
    per_facet = 2.0 if nodes else 1.0
    return np.sqrt(np.sqrt(3.0) * per_facet * np.asarray(num_points) / (4.0 * np.pi * sides))


def points_of(elements, sides=2, nodes=False):
    """Closed points of a contact with so many elements per radius; arguments as above."""
    return 4.0 * np.pi * sides * elements**2 / (np.sqrt(3.0) * (2.0 if nodes else 1.0))


def contact_resolution(num_points, force, sides=2, nodes=False):
    """How finely contacts are meshed; None without a normal force.

    Args:
        num_points: Closed points of each contact, on all sides, shape (num_contacts,).
        force: Normal forces [N], shape (num_contacts,).
        sides, nodes: As of :func:`elements_per_radius`.

    Returns:
        :class:`Resolution`.
    """
    num_points, force = np.asarray(num_points, float), np.maximum(np.asarray(force), 0.0)
    if not force.sum() > 0:
        return None
    order = np.argsort(num_points)
    carried = np.cumsum(force[order]) / force.sum()
    median = float(num_points[order][np.searchsorted(carried, 0.5)])
    least = int(np.ceil(points_of(COARSE, sides, nodes)))
    coarse = float(force[num_points < least].sum() / force.sum())
    return Resolution(median, float(elements_per_radius(median, sides, nodes)), coarse, least)
