"""The search of contact: which points, edges and walls are near each other, on all ranks."""

import numpy as np

from ..kernels.build.rows import gather_rows
from .pairs.facet_pairs import search_pairs
from .results.edge_contacts import new_slip
from .start.overlap import depths_to_search
from .surface.active_nodes import nodes_of_pairs
from .surface.exchange import exchange_surface
from .surface.surface import in_closed_cracks


def find_pairs(contact, x, ahead, skin):
    """Make the pairs of contact those within ``ahead`` [m] at least. Collective.

    They take over what the pairs before remember.

    Args:
        contact: :class:`~mufe_fenicsx.contact.contact.Contact`.
        x: Positions of the nodes [m], shape (num_nodes, 3).
        ahead, skin: As of its ``search``.
    """
    own, motion, walls, edges = contact.own, contact.motion, contact.walls, contact.edges
    motion.skin = skin * contact.edge
    contact.ghosts.moving = None
    gathered = np.empty((own.nodes.size, 3))
    gather_rows(gathered, x, own.nodes)
    # Edges may be far deeper than points: closed ones are kept, and other ranks send theirs.
    of_points, of_edges = 1.1 * contact.deepest()
    reach, beyond = max(motion.skin, ahead) + of_points, max(of_edges - of_points, 0.0)
    old, old_walls, old_edges = contact.pairs, walls.pairs, edges.pairs
    wait, num_grains = 0.0, contact.dissipation.num_grains
    if contact.surface is not None:
        put_away(contact)
    if old is not None:
        # Whether a node meets its own grain hangs on more than their distance.
        if not contact.self_contact:
            wait = min(motion.left, motion.longest)
        overlaps = np.zeros(num_grains)
    else:
        overlaps = depths_to_search(
            contact.comm, own, num_grains, contact.first_tool, contact.edge
        )  # fmt: skip
    exchange(contact, gathered, reach, max(overlaps.max(initial=0.0), beyond))
    _search_facets(contact, reach + overlaps[contact.surface.grain_of_facet], wait)
    _search_edges_and_walls(contact, gathered, reach, overlaps.max(initial=0.0))
    if old is not None:
        contact.dissipation.change(old, contact.pairs, old_walls, walls.pairs, old_edges)
    motion.searched_at = motion.bound
    connect(contact)


def put_away(contact):
    """Keep of all pairs what the next search finds them again by. Collective."""
    edges = contact.edges
    # The kernels keep positions and forces of before.
    contact.walls.pairs.forces = edges.pairs.forces = None
    edges.slip += new_slip(contact)
    edges.put_away()
    contact.pairs.drop_candidates(contact.surface.global_facet)


def exchange(contact, positions, reach, overlap=0.0):
    """Fetch what other ranks have near this one's surface. Collective.

    Args:
        contact: :class:`~mufe_fenicsx.contact.contact.Contact`.
        positions: Of own surface nodes [m], shape (num_nodes, 3).
        reach: Distance of smooth surfaces [m].
        overlap: Largest depth that is looked for beyond it [m].
    """
    layers, contact.searched = contact.layers, positions
    contact.surface, ghosts = exchange_surface(
        contact.comm, contact.own, layers, positions, reach + overlap + layers.rise,
        contact.dissipation.num_grains, in_closed_cracks(contact.own, positions),
    )  # fmt: skip
    contact.own = contact.surface.part_of(contact.own)
    contact.ghosts.renew(contact.surface, ghosts, positions)
    num_walls = len(contact.walls.walls)
    contact.motion.renew(reach, overlap, contact.surface.neighbours, num_walls, positions)


def connect(contact):
    """Steps exchange, place and move on what the pairs of now ask for. Collective."""
    pairs, of_walls, ghosts = contact.pairs, contact.walls.pairs, contact.ghosts
    contact.motion.follow(pairs.motion_bounds, of_walls.motion_bounds)
    # The others are needed again at the next search only.
    ghosts.list_near(pairs.node, of_walls.node)
    neighbours = contact.surface.neighbours
    ghosts.connect(neighbours, nodes_of_pairs(contact) if neighbours else ())
    any_pair = any(of.size for of in (pairs.node, of_walls.node, contact.edges.pairs.first))
    contact.any_pair = any_pair or ghosts.any_force


def _search_facets(contact, reach, wait):
    """Find pairs of points and facets, within ``reach`` of each smooth one [m]. Local.

    What is beyond the reach of the last search cannot be met for a motion ``wait`` [m].
    """
    old, points, surface = contact.pairs, contact.points, contact.surface
    contact.pairs = search_pairs(
        contact.ghosts.positions.array, points, contact.ghosts.facets, surface,
        reach + contact.layers.highest, contact.motion.bound,
        contact.layers.strengths.any, contact.self_contact, contact.first_tool,
        contact.dissipation.num_grains,
    )  # fmt: skip
    if old is not None:
        contact.pairs.transfer(old, surface.global_facet, wait)


def _search_edges_and_walls(contact, nodes, reach, overlap):
    """Find pairs of edges, and of points with walls, within ``reach`` [m]. Collective.

    Args:
        contact: :class:`~mufe_fenicsx.contact.contact.Contact`.
        nodes: Positions of own surface nodes [m], shape (num_nodes, 3).
        reach: Largest gap [m].
        overlap: Largest depth of the start that is looked for beyond it [m].
    """
    ghosts, motion, points, walls = contact.ghosts, contact.motion, contact.points, contact.walls
    x, of_walls = ghosts.positions.array, reach + contact.layers.rise
    of_nodes, of_points = x[ghosts.num_before :], x[: points.num_points]
    contact.edges.search(of_nodes, len(nodes), contact.surface, reach + overlap, motion.bound)
    walls.search(of_points, points, of_walls, motion.bound, contact.layers.strengths.any)
    walls.near.enclose(contact.comm, walls, of_points, of_walls)
