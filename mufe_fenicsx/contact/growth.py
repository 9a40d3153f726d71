"""What contact remembers, on the surface of a mesh that has grown.

Growth numbers surface nodes anew and adds facets. Sides of cells that were facets before still are:
by their corners facets, vertices and edges get their new names. Facets that opened remember
nothing. A vertex at the front of a crack is sharp until this goes on: what it remembers is lost
where it carries no contact any more.
"""

import numpy as np

from .snapshot import Names, as_arrays, contact_tables, joined, look_up, restore_contact


def carry_contact(old, old_mesh, new, mesh, x):
    """Make the contact of a grown mesh remember what that of the mesh before does. Collective.

    Args:
        old, old_mesh: :class:`~mufe_fenicsx.contact.contact.Contact` and mesh before.
        new, mesh: Those of after; the ``motion`` of the former is that of before.
        x: Present positions of the nodes of ``mesh`` [m], shape (num_nodes, 3).
    """
    tables = as_arrays(contact_tables(old, old_mesh))
    names, new_names = Names(old, old_mesh), Names(new, mesh)
    own, facets = new.own, old.own.facets
    kept = np.searchsorted(new.own.side, old.own.side)
    of_ranks = mesh.comm.allgather(
        (old.own.grain_of_facet, names.node[facets], new_names.node[own.facets[kept]])
    )
    grain, *corners = (np.concatenate(part) for part in zip(*of_ranks, strict=True))
    changed = np.isin(grain, grain[(corners[0] != corners[1]).any(axis=1)])
    grain, before, now = (of[changed] for of in (grain, *corners))
    order = np.lexsort((joined(before), grain))  # which no ranks know
    rename = _Renaming(grain[order], before[order], now[order])

    everything_moves = old.ghosts.moving is None
    tables["surface"] = _surface(old, old_mesh, new, mesh, new_names.order, x)
    table = tables["facets"]
    table["facet"] = rename.facets(table["grain"], table["facet"])
    partner = np.repeat(tables["pairs"]["partner"], tables["pairs"]["count"])
    table = tables["candidates"]
    table["facet"] = rename.facets(partner, table["facet"])
    for name in ("points", "pairs", "wall_pairs"):
        table = tables[name]
        table["point"] = rename.points(table["grain"], table["point"])
        known = new_names.find_points(table)[1]
        tables[name] = _some(table, known)
        if name == "pairs":
            tables["candidates"] = _some(tables["candidates"], np.repeat(known, table["count"]))
    table = tables["edge_pairs"]
    table["first"] = rename.edges(table["grain"], table["first"])
    table["second"] = rename.edges(table["partner"], table["second"])
    restore_contact(new, mesh, tables, everything_moves, grown=True)


def beside(contact, nodes):
    """Which pairs of this rank, closed or near, have to do with some nodes. Collective.

    Args:
        contact: :class:`~mufe_fenicsx.contact.contact.Contact`.
        nodes: Whether each node of this rank is one of them, shape (num_nodes,).

    Returns:
        Flags of pairs of points with bodies, with walls, and of edges, each of shape (num_pairs,).
    """
    p, points, edges = contact.pairs, contact.points, contact.edges
    flags = contact.ghosts.scratch_vector()
    flags.own[:, 0] = nodes[contact.own.nodes]
    flags.forward()
    flagged = flags.array[contact.ghosts.num_before :, 0] > 0.0
    flags.array[:] = 0.0
    near = flagged[contact.surface.facets].any(axis=1)[p.candidate]
    at_point = flagged[points.corner].any(axis=1)
    at_edge = flagged[edges.edges.ends].any(axis=1)
    of_pairs = at_point[p.node]
    if of_pairs.size:
        of_pairs |= np.logical_or.reduceat(near, p.first[:-1])
    ends = at_edge[edges.pairs.first] | at_edge[edges.pairs.second]
    return of_pairs, at_point[contact.walls.pairs.node], ends


def _some(table, rows):
    return {name: values[rows] for name, values in table.items()}


def _surface(old, old_mesh, new, mesh, order, x):
    """Rows of own surface nodes. Those that were inside begin where they are."""
    row = np.full(old_mesh.num_nodes, -1)
    row[old.own.nodes] = np.arange(old.own.nodes.size)
    row = row[mesh.source.nodes[new.own.nodes[order]]]
    inside, here = row < 0, x[new.own.nodes[order]]
    moving = np.zeros(old.own.nodes.size, dtype=bool)
    moving[slice(None) if old.ghosts.moving is None else old.ghosts.moving] = True
    return {
        "grain": new.own.grain_of_node[order],
        "searched": np.where(inside[:, None], here, old.searched[row]),
        "previous": np.where(inside[:, None], here, old.ghosts.positions.own[row]),
        "slip": np.where(inside, 0.0, old.edges.slip[row]),
        "moving": inside | moving[row],
    }


class _Renaming:
    """Names of before to names of now, of grains of all ranks; most keep theirs.

    Args:
        grain: Of facets whose corners have other numbers now, shape (n,).
        before, now: Numbers of their corners among the surface nodes of the grain, shape (n, 3).
    """

    def __init__(self, grain, before, now):
        self._facets = _Dictionary((grain, joined(before)), joined(now))
        self._vertices = _Dictionary((np.repeat(grain, 3), before.ravel()), now.ravel())
        self._edges = _Dictionary((np.tile(grain, 6), *_edges(before).T), _edges(now))

    def facets(self, grain, facet):
        """Names of facets of grains, shape (num,)."""
        return self._facets((grain, facet), facet)

    def points(self, grain, point):
        """Names of points of contact: facets, or vertices as -1 - n, shape (num,)."""
        vertex = -1 - self._vertices((grain, -1 - point), -1 - point)
        return np.where(point < 0, vertex, self.facets(grain, point))

    def edges(self, grain, ends):
        """Numbers of the ends of edges, shape (num, 2)."""
        return self._edges((grain, *ends.T), ends)


def _edges(facets):
    """Ends of the edges of facets, shape (6 n, 2): in both directions."""
    a, b, c = facets.T
    ends = (a, b), (b, c), (c, a), (b, a), (c, b), (a, c)
    return np.concatenate([np.stack(of, axis=1) for of in ends])


class _Dictionary:
    """Values by tuples of integers; of tuples that are there twice the first one."""

    def __init__(self, keys, values):
        _, first = np.unique(np.stack(keys, axis=1), axis=0, return_index=True)
        self._keys, self._values = tuple(key[first] for key in keys), values[first]

    def __call__(self, keys, others):
        """Values of keys, and of those that are not known ``others``."""
        rows, known = look_up(self._keys, keys)
        found = others.copy()
        found[known] = self._values[rows[known]]
        return found
