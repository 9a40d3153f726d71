"""Where in a grain yield begins: under a contact, at its edge, or away from any."""

from dataclasses import dataclass

import numpy as np

from mufe_fenicsx.geometry.measure import boundary_triangles
from mufe_fenicsx.geometry.pieces import piece_of_cell


@dataclass(frozen=True)
class YieldPlace:
    """The cell of a grain with the largest plastic strain, and the contacts around it."""

    cell: int  #: its number among the given ones
    position: np.ndarray  #: its centroid [m], shape (3,)
    depth: float  #: from the surface of the grain [m]
    under_contact: bool  #: whether the closest place of the surface is pressed
    edge_distance: float  #: from that place to the closest edge of contact [m]; nan without one
    contact_radius: float  #: of the circle with the area of that contact's facets [m]; nan


def yield_place(points, cells, plastic_strain, contact_pressure):
    """Place of the largest plastic strain of one grain in the first state where it has yielded.

    A facet counts as pressed where all three of its nodes are, contacts are pressed facets that
    share nodes, and their edges are the edges of one pressed facet only: known to the
    size of a facet. Between smooth bodies yield begins inside, at 0.48 of the contact's radius
    under its middle (K. L. Johnson, Contact Mechanics, 1985, ch. 6.1); at the edge where much
    friction acts or the body has a sharp edge there.

    Args:
        points: Present positions of the nodes [m], shape (num_nodes, 3).
        cells: Nodes of the grain's tetrahedra, shape (num_cells, 4).
        plastic_strain: Equivalent plastic strain of these cells [-], shape (num_cells,).
        contact_pressure: At the nodes [Pa], shape (num_nodes,).

    Returns:
        :class:`YieldPlace`, or None where there is no plastic strain.
    """
    cell = int(np.argmax(plastic_strain))
    if not plastic_strain[cell] > 0:
        return None
    at = points[cells[cell]].mean(axis=0)
    facets = boundary_triangles(cells)
    closest = closest_on_triangles(at, points[facets])
    distance = np.linalg.norm(closest - at, axis=1)
    nearest = int(np.argmin(distance))
    pressed = (contact_pressure[facets] > 0).all(axis=1)
    edge_distance = radius = np.nan
    if pressed.any():
        patch = facets[pressed]
        edges = np.concatenate([patch[:, [0, 1]], patch[:, [1, 2]], patch[:, [2, 0]]])
        edges, count = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
        rim = edges[count == 1]
        if rim.size:
            away = distance_to_segments(closest[nearest], points[rim[:, 0]], points[rim[:, 1]])
            edge_distance = float(away.min())
            part = piece_of_cell(patch)
            own = part[(patch == rim[np.argmin(away), 0]).any(axis=1)][0]
            corners = points[patch[part == own]]
            cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            radius = float(np.sqrt(np.linalg.norm(cross, axis=1).sum() / (2 * np.pi)))
    return YieldPlace(
        cell=cell,
        position=at,
        depth=float(distance[nearest]),
        under_contact=bool(pressed[nearest]),
        edge_distance=edge_distance,
        contact_radius=radius,
    )


def distance_to_segments(at, start, end):
    """Distances of one place from line segments [m], shape (num_segments,)."""
    along = end - start
    length2 = np.einsum("si,si->s", along, along)
    s = np.clip(np.einsum("si,si->s", at - start, along) / length2, 0, 1)
    return np.linalg.norm(start + s[:, None] * along - at, axis=1)


def closest_on_triangles(at, corners):
    """The point of each triangle that is closest to one place [m], shape (num_triangles, 3).

    The foot of the perpendicular where it lies inside, else the closest point of the edges.

    Args:
        at: Shape (3,).
        corners: Shape (num_triangles, 3, 3).
    """
    a, b, c = corners.transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    foot = at - np.einsum("ti,ti->t", at - a, normal)[:, None] * normal
    best, inside = foot.copy(), np.ones(len(corners), dtype=bool)
    least = np.full(len(corners), np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        along = end - start
        inside &= np.einsum("ti,ti->t", np.cross(along, foot - start), normal) >= 0
        s = np.einsum("ti,ti->t", at - start, along) / np.einsum("ti,ti->t", along, along)
        here = start + np.clip(s, 0, 1)[:, None] * along
        distance = np.linalg.norm(here - at, axis=1)
        nearer = distance < least
        best[nearer], least[nearer] = here[nearer], distance[nearer]
    best[inside] = foot[inside]
    return best
