"""Surface of this rank's grains: nodes, facets, areas, neighbours."""

import math
from dataclasses import dataclass

import numpy as np

from ...kernels.contact.edge_search import sharp_edges
from ...kernels.geometry.rings import neighbours, rings
from ...kernels.geometry.topology import rows_of

#: Convex edges are sharp whose facets' normals differ by more than this angle [rad]. Where two
#: edges of length h cross at their middles, a vertex is inside the other body from the depth
#: (h/2) tan(angle/2) on, of the blunter edge: at 20° nodes and facets miss 0.09 h at most, on
#: a smooth surface (angle = 0.6 h/R) 0.15 h²/R, as much as its facets cut off.
SHARP_EDGE = math.radians(20.0)
#: A crack is closed while its faces lie on each other up to this part of an edge.
CLOSED = 0.1


@dataclass(frozen=True)
class OwnSurface:
    """Surface of the grains of this rank in the reference configuration.

    Facets refer to surface nodes, numbered from 0 in the order of ``nodes``.
    """

    nodes: np.ndarray  #: mesh nodes on the surface, shape (num_nodes,)
    facets: np.ndarray  #: surface nodes of facets, outward, int32, shape (num_facets, 3)
    grain_of_node: np.ndarray  #: global index of the grain, int32, shape (num_nodes,)
    grain_of_facet: np.ndarray  #: global index of the grain, int32, shape (num_facets,)
    #: Bodies, int32: grain + number of all grains * piece; where none is in pieces, the grains.
    body_of_node: np.ndarray
    body_of_facet: np.ndarray
    side: np.ndarray  #: of a cell that each facet is, as of the mesh, increasing, (num_facets,)
    area: np.ndarray  #: nodal areas [m²], shape (num_nodes,)
    facet_area: np.ndarray  #: areas of the facets [m²], shape (num_facets,)
    facet_edge: np.ndarray  #: mean edges of the facets [m], shape (num_facets,)
    neighbour: np.ndarray  #: as returned by :func:`neighbours`
    ring_offset: np.ndarray  #: as returned by :func:`rings`
    ring: np.ndarray
    local_grain_of_facet: np.ndarray  #: local index of the grain, shape (num_facets,)
    cell_of_facet: np.ndarray  #: of the mesh, beneath the facet, int32, shape (num_facets,)
    whole_area: np.ndarray  #: nodal areas with those beyond mirrors [m²], shape (num_nodes,)
    mirror: np.ndarray  #: wall that an edge without a neighbour lies on, -1 for none
    mirror_normal: np.ndarray  #: unit normals of all walls, shape (num_walls, 3)
    sharp_edge: np.ndarray  #: whether the edges 0-1, 1-2, 2-0 are sharp, shape (num_facets, 3)
    cracks: np.ndarray  #: facets on both sides of cracks that have not gone through, (num, 2)


def own_surface(mesh, x, on_mirror=None, mirror_normal=None, some=None):
    """Surface of a :class:`~mufe_fenicsx.mesh.GrainMesh` at positions ``x``. Local.

    Args:
        mesh: The mesh.
        x: [m], shape (num_nodes, 3).
        on_mirror: Which of its nodes lie on which mirror, shape (num_nodes, num_walls): facets that
            lie on one are left out; None: no mirrors.
        mirror_normal: Unit normals of the walls, shape (num_walls, 3).
        some: Of which local grains alone, shape (num_grains,); None: of all.
    """
    if on_mirror is None:
        on_mirror, mirror_normal = np.zeros((len(x), 0), dtype=bool), np.zeros((0, 3))
    outside = slice(None) if some is None else np.flatnonzero(some[mesh.grain_of_facet])
    if on_mirror.any():
        on = on_mirror[mesh.facets[outside]].all(axis=1).any(axis=1)
        outside = np.arange(len(mesh.facets))[outside][~on]
    of_mesh, local_grain = mesh.facets[outside], mesh.grain_of_facet[outside]
    on_surface = np.zeros(mesh.num_nodes, dtype=bool)
    on_surface[of_mesh] = True
    nodes = np.flatnonzero(on_surface)
    facets = (np.cumsum(on_surface, dtype=np.int32) - np.int32(1))[of_mesh]
    a, b, c = (x[of_mesh[:, i]] for i in range(3))
    facet_area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    area = np.bincount(facets.ravel(), np.repeat(facet_area / 3, 3), nodes.size)
    edges = sum(np.linalg.norm(end - begin, axis=1) for begin, end in ((a, b), (b, c), (c, a)))
    ring_offset, ring = rings(facets, nodes.size)
    across = neighbours(facets, ring_offset, ring)
    grain_of_node = mesh.grains[mesh.grain_of_node[nodes]].astype(np.int32)
    grain_of_facet = mesh.grains[local_grain].astype(np.int32)
    bodies = grain_of_node, grain_of_facet
    if mesh.piece_of_cell is not None:
        bodies = tuple(grain.copy() for grain in bodies)
        bodies[1][:] += mesh.labels.size * mesh.piece_of_cell[mesh.cell_of_facet[outside]]
        bodies[0][facets] = bodies[1][:, None]
    side = mesh.side_of_facet[outside]
    return OwnSurface(
        nodes=nodes.astype(np.int32),
        facets=facets,
        grain_of_node=grain_of_node,
        grain_of_facet=grain_of_facet,
        body_of_node=bodies[0],
        body_of_facet=bodies[1],
        side=side,
        area=area,
        facet_area=facet_area,
        facet_edge=edges / 3.0,
        neighbour=across,
        ring_offset=ring_offset,
        ring=ring,
        local_grain_of_facet=local_grain,
        cell_of_facet=mesh.cell_of_facet[outside],
        # Each of k mirrors at right angles doubles what is around a node.
        whole_area=area * 2.0 ** on_mirror[nodes].sum(axis=1),
        mirror=_mirrors_at_edges(on_mirror[of_mesh], across),
        mirror_normal=mirror_normal,
        sharp_edge=sharp_edges(x[nodes], facets, across, math.cos(SHARP_EDGE)),
        cracks=faces_of_cracks(mesh, side, bodies[1]),
    )


def _mirrors_at_edges(on, across):
    """Field ``mirror`` of :class:`OwnSurface`, from ``on_mirror`` at the corners of facets."""
    if not on.any():  # without room for as many numbers
        return np.broadcast_to(np.int32(-1), across.shape)
    both = on & np.roll(on, -1, axis=1)  # both ends of the edges 0-1, 1-2, 2-0
    wall = np.where(both.any(axis=2) & (across < 0), both.argmax(axis=2), -1)
    return wall.astype(np.int32)


def faces_of_cracks(mesh, side, body):
    """Facets on both sides of cracks that have not gone through, shape (num, 2). Local.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        side, body: Fields ``side`` and ``body_of_facet`` of :class:`OwnSurface`.
    """
    rows = rows_of(side, mesh.sides_between(mesh.all_opened[:, :2]).ravel()).reshape(-1, 2)
    known = rows[(rows >= 0).all(axis=1)]
    return known[body[known[:, 0]] == body[known[:, 1]]]


def in_closed_cracks(own, x):
    """Facets of cracks that nothing can touch: the body goes on beyond them. Local.

    To a point that is a little inside the body beside a closed crack, the crack's face would be the
    closest, and the point outside of it.

    Args:
        own: :class:`OwnSurface`.
        x: Positions of its nodes [m], shape (num_nodes, 3).

    Returns:
        Their rows.
    """
    cracks = own.cracks
    first, second = x[own.facets[cracks]].mean(axis=2).transpose(1, 0, 2)
    apart = np.linalg.norm(second - first, axis=1)
    return cracks[apart < CLOSED * own.facet_edge[cracks[:, 0]]].ravel()
