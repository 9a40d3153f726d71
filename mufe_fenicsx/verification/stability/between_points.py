"""Contacts so small that they lie between the points at which contact acts."""

import numpy as np

from ...materials.elastic import Elastic
from ..case import case, compare
from ..plastic_ball import AXIS, RADIUS, press_ball
from .limits import NU, RHO, E

#: Points of facets by their name in scenes.
KINDS = {"facets": "one point a facet", "facets4": "four points a facet"}


def first_contact(comm, kind, h):
    """A plane pressed onto a ball over one of its nodes.

    Returns:
        Radius of Hertz's contact [m] at which a point first carries; the distance of the nearest
        point from the axis [m]; simulation.
    """
    most = 0.6 * h
    course = press_ball(
        comm, Elastic(E, NU, RHO), most**2 / RADIUS, most, 0.6, periods=3.0, records=600,
        added_mass=0.0, phase=(0.0, 0.0), points=kind,
    )  # fmt: skip
    s = course.simulation
    carries = course.approach[course.force > 0]
    points, x = s.contact.points, s.mesh.x[s.contact.own.nodes]
    place = np.einsum("pk,pki->pi", points.weight, x[points.corner])
    near = place[place @ AXIS > 0.5 * RADIUS]
    distance = np.linalg.norm(near - np.outer(near @ AXIS, AXIS), axis=1).min()
    return np.sqrt(RADIUS * carries[0]) if carries.size else np.nan, distance, s


@case("stability-between-points", num_bodies=1)
def between_points(comm, h_over_R=0.03):
    """A contact around a node meets no point before its depth is the gap of the nearest one.

    At the distance x from the axis the gap of a ball and a plane is x²/2R, and Hertz's contact is
    a²/R deep, so that points meet the plane from a = x/√2 on. Centroids are h/√3 away: a contact of
    less than 0.41 elements per radius may carry nothing. With four points a facet half of that is
    enough.

    Args:
        comm: MPI communicator.
        h_over_R: Length of edges over the radius of the ball.
    """
    results, simulations = {}, []
    for kind, name in KINDS.items():
        h = h_over_R * RADIUS
        radius, distance, s = first_contact(comm, kind, h)
        # The gap is right to 2 % of h²/2R where facets around a node are not alike, and 600 records
        # tell it to a tenth of that.
        predicted = distance / np.sqrt(2) / h
        results[f"{name}: a/h where the first point carries"] = compare(
            radius / h, predicted, 0.5 * 0.01 / predicted**2
        )
        simulations.append(s)
    return results, simulations
