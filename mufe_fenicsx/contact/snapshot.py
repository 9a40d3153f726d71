"""What contact remembers, in names that know no ranks, and contact made again from it.

Tables are dicts of arrays with one row a thing and a column ``grain``, the global index of the
grain whose rank keeps it. A surface node is named by its number among those of its grain; a
facet by the numbers of its three nodes; a point of contact by its facet and its place in it,
or as -1 - n where it is the node n. The order of rows is that of the rank that wrote them, so
that sums over them give the same bits on the same number of ranks.
"""

import numpy as np

from ..errors import InputError
from .pairs.facet_pairs import Pairs
from .pairs.wall_pairs import WallPairs
from .search import connect, exchange
from .stiffness.layers import DENTS

#: Bits of the number of a surface node in the name of a facet.
BITS = 21
#: Rows that are looked up at a time where contact is made again.
BLOCK = 1 << 17


class Rows:
    """Rows of an array, taken where they are wanted: a checkpoint has no room for them all.

    Args:
        values: The array.
        order: Which of its rows.
        times: How often each, shape as ``order``; None: once.
    """

    def __init__(self, values, order, times=None):
        self.values, self.order, self.times = values, order, times

    @property
    def dtype(self):
        """Type of the values."""
        return self.values.dtype

    @property
    def shape(self):
        """Shape of the column."""
        number = len(self.order) if self.times is None else int(self.times.sum())
        return (number, *self.values.shape[1:])

    @property
    def nbytes(self):
        """Size [bytes]."""
        return self.shape[0] * self.values[:1].nbytes

    def blocks(self, number):
        """The column in turn, ``number`` of the rows that were taken at a time."""
        for begin in range(0, len(self.order), number):
            some = slice(begin, begin + number)
            rows = self.values[self.order[some]]
            yield rows if self.times is None else np.repeat(rows, self.times[some], axis=0)


class Names:
    """Names of what contact on this rank knows. Collective.

    Args:
        contact: :class:`~mufe_fenicsx.contact.contact.Contact`; what is on its way in its vector
            of forces is lost.
        mesh: Its :class:`~mufe_fenicsx.mesh.GrainMesh`.
    """

    def __init__(self, contact, mesh):
        own, points, ghosts = contact.own, contact.points, contact.ghosts
        row = np.full(mesh.num_nodes, -1, dtype=np.int64)
        row[own.nodes] = np.arange(own.nodes.size)
        #: own surface nodes grain after grain, in each by their names
        self.order = row[mesh.named_nodes]
        self.order = self.order[self.order >= 0]
        self.grains = mesh.grains
        grain = mesh.grain_of_node[own.nodes[self.order]]
        first = np.searchsorted(grain, np.arange(mesh.num_grains))
        number = np.empty(own.nodes.size, dtype=np.int64)
        number[self.order] = np.arange(own.nodes.size) - first[grain]
        if number.max(initial=0) >= 1 << BITS:
            raise InputError(
                f"surface nodes of one grain = {number.max() + 1}, expected at most {1 << BITS} "
                "where checkpoints are written"
            )
        names = ghosts.scratch_vector()
        names.own[:, 0] = number
        names.forward()
        #: of surface nodes, those of other ranks included
        self.node = names.array[ghosts.num_before :, 0].astype(np.int64)
        names.array[:] = 0.0
        self.facet = joined(self.node[contact.surface.facets])
        self.facet_grain = contact.surface.grain_of_facet
        self.point_grain = points.grain_of_point
        n, of_facets = len(points.rule), points.num_in_facets
        at_node = points.corner[of_facets:, 0]
        self.point = np.append(np.repeat(joined(number[own.facets]), n), -1 - number[at_node])
        self.part = np.append(np.arange(of_facets) % max(n, 1), 0 * at_node).astype(np.int8)

    def points(self, rows):
        """Columns that name the points of contact ``rows``."""
        return {
            "grain": self.point_grain[rows],
            "point": self.point[rows],
            "part": self.part[rows],
        }

    def rows_of_points(self, table):
        """Own points of contact that a table names, all of which have to be there."""
        known = (self.point_grain, self.point, self.part)
        return find_rows(known, (table["grain"], table["point"], table["part"]), "point")


def look_up(known, wanted):
    """For each wanted tuple the row of the known ones, and whether it is there; integers.

    By bisection, `BLOCK` of the wanted ones at a time: there can be many more of them than known
    ones, and a checkpoint's tables fill the memory already.
    """
    order = np.lexsort(known[::-1])
    ordered = [column[order] for column in known]
    rows = np.zeros(wanted[0].size, dtype=np.int64)
    there = np.zeros(rows.size, dtype=bool)
    for begin in range(0, rows.size, BLOCK) if order.size else ():
        some = slice(begin, begin + BLOCK)
        place, there[some] = _bisect(ordered, [column[some] for column in wanted])
        rows[some] = order[place]
    return rows, there


def find_rows(known, wanted, what):
    """Rows as of :func:`look_up`.

    Raises:
        InputError: One is not known.
    """
    rows, there = look_up(known, wanted)
    missing = there.size - np.count_nonzero(there)
    if missing:
        raise InputError(
            f"a {what} of contact in the checkpoint, one of {missing}, is not part of these "
            "grains, expected the grains that it was written with"
        )
    return rows


def _bisect(ordered, wanted):
    """Places of the first tuples that are not less than the wanted ones, and whether they match."""
    low = np.zeros(wanted[0].size, dtype=np.int64)
    num = ordered[0].size
    high = np.full(low.size, num)
    for _ in range(num.bit_length()):
        middle = (low + high) // 2
        less = _compare(ordered, np.minimum(middle, num - 1), wanted)[0] & (middle < high)
        low, high = np.where(less, middle + 1, low), np.where(less, high, middle)
    place = np.minimum(low, num - 1)
    return place, _compare(ordered, place, wanted)[1] & (low < num)


def _compare(ordered, place, wanted):
    """Whether tuples at places are less than the wanted ones, and whether they are the same."""
    less, same = np.zeros(place.size, dtype=bool), np.ones(place.size, dtype=bool)
    for column, other in zip(ordered, wanted, strict=True):
        value = column[place]
        less |= same & (value < other)
        same &= value == other
    return less, same


def contact_tables(contact, mesh):
    """All that contact remembers, as tables, columns arrays or :class:`Rows`. Collective."""
    names, p, w = Names(contact, mesh), contact.pairs, contact.walls.pairs
    edges, e = contact.edges.edges, contact.edges.pairs
    order, own, ghosts, done = names.order, contact.own, contact.ghosts, contact.dissipation
    closest = np.where(p.closest >= 0, p.closest - p.first[:-1], -1)
    count = np.diff(p.first)
    moving = np.zeros(own.nodes.size, dtype=bool)
    moving[slice(None) if ghosts.moving is None else ghosts.moving] = True
    ends = names.node[edges.ends]
    everything = slice(None)
    return {
        "surface": {
            "grain": own.grain_of_node[order],
            "searched": Rows(contact.searched, order),
            "previous": Rows(ghosts.positions.own, order),
            "slip": Rows(contact.edges.slip, order),
            "moving": moving[order],
        },
        "facets": {
            "grain": own.grain_of_facet,
            "facet": names.facet[: len(own.facets)],
            "layer": contact.layers.of_facet,
        },
        "points": {
            **names.points(everything),
            "layer": contact.points.layer,
            "slip": done.slip_of_dropped,
            **{name: getattr(contact.layers, name) for name in DENTS},
        },
        "pairs": {
            **names.points(p.node),
            "partner": p.grain,
            "count": count,
            "closest": closest,
            **p.motion_bounds.of_pairs(),
            **{name: getattr(p, name) for name in p.kept},
        },
        "candidates": {
            "grain": Rows(names.point_grain, p.node, count),
            "facet": Rows(names.facet, p.candidate),
            "next_check": p.candidate_next_check,
        },
        "wall_pairs": {
            **names.points(w.node),
            "wall": w.wall,
            **w.motion_bounds.of_pairs(),
            **{name: getattr(w, name) for name in w.kept},
        },
        "edge_pairs": {
            "grain": e.grain,
            "partner": e.partner,
            "first": ends[e.first],
            "second": ends[e.second],
            **{name: getattr(e, name) for name in e.kept},
        },
        "accounts": {"grain": done.grain, "partner": done.partner, "work": done.work},
    }


def wrong_number(tables, num_grains, num_walls):
    """The line for a column that arrays are indexed with and that is out of range, or None. Local.

    Args:
        tables: Of :func:`contact_tables`, read from a file.
        num_grains, num_walls: Of the test; tools and a sleeve are grains.
    """
    count, num_candidates = tables["pairs"]["count"], len(tables["candidates"]["grain"])
    bounds = {(name, "grain"): (0, num_grains) for name in tables} | {
        ("pairs", "partner"): (0, num_grains),
        ("pairs", "count"): (0, num_candidates + 1),
        ("pairs", "closest"): (-1, count),
        ("wall_pairs", "wall"): (0, num_walls),
        ("edge_pairs", "partner"): (0, num_grains),
        ("points", "met"): (-1, num_grains),
        ("accounts", "partner"): (0, num_grains + num_walls),
    }
    for (table, column), (least, end) in bounds.items():
        values = tables[table][column]
        if values.dtype.kind not in "iu":
            return f"{column} of {table} has type {values.dtype}, expected whole numbers"
        wrong = np.flatnonzero((values < least) | (values >= np.maximum(end, least + 1)))
        if wrong.size:
            most = np.broadcast_to(end, values.shape)[wrong[0]] - 1
            return f"{column} of {table} = {values[wrong[0]]}, expected {least} to {most}"
    if count.sum() != num_candidates:
        return f"count of pairs = {count.sum()}, expected that of candidates, {num_candidates}"
    return None


def restore_contact(contact, mesh, tables, everything_moves):
    """Make contact what it was. Collective.

    Args:
        contact: :class:`~mufe_fenicsx.contact.contact.Contact` of the same grains, its ``motion``
            that of then.
        mesh: Its :class:`~mufe_fenicsx.mesh.GrainMesh`.
        tables: Of :func:`contact_tables`, with the rows of this rank's grains; emptied.
        everything_moves: Whether all surface nodes were followed then, on this rank.

    Raises:
        InputError: The tables are not those of these grains; on one rank or more.
    """
    own, walls, ghosts, done = contact.own, contact.walls, contact.ghosts, contact.dissipation
    names = Names(contact, mesh)
    surface, order = tables.pop("surface"), names.order
    searched, previous = np.empty((2, own.nodes.size, 3))
    searched[order], previous[order] = surface["searched"], surface["previous"]
    contact.edges.slip[order] = surface["slip"]
    known = (own.grain_of_facet, names.facet[: len(own.facets)])
    facets = tables.pop("facets")
    rows = find_rows(known, (facets["grain"], facets["facet"]), "facet")
    contact.layers.of_facet[rows] = facets["layer"]
    points = tables.pop("points")
    rows = names.rows_of_points(points)
    contact.points.layer[rows], done.slip_of_dropped[rows] = points["layer"], points["slip"]
    for name in DENTS:
        getattr(contact.layers, name)[rows] = points[name]
    del facets, points, known, rows, names
    accounts = tables.pop("accounts")
    by_pair = np.lexsort((accounts["partner"], accounts["grain"]))
    for name in ("grain", "partner", "work"):
        setattr(done, name, accounts[name][by_pair])

    exchange(contact, searched, contact.motion.reach, contact.motion.overlap)
    names = Names(contact, mesh)
    contact.edges.list_edges(own.nodes.size, contact.surface)
    contact.pairs = pairs = _pairs(contact, names, tables.pop("pairs"), tables.pop("candidates"))
    known = np.flatnonzero(pairs.known)
    facet = pairs.candidate[pairs.closest[known]]
    pairs.vertices[known], pairs.sharp[known] = ghosts.facets[facet], contact.edges.beside[facet]
    pairs.bulge[known] = contact.surface.bulge_of_facet[facet]
    walls.pairs = _wall_pairs(contact, names, tables.pop("wall_pairs"))
    _set_edge_pairs(contact, names, tables.pop("edge_pairs"))

    moving = np.empty(own.nodes.size, dtype=bool)
    moving[order] = surface["moving"]
    ghosts.moving = None if everything_moves else np.flatnonzero(moving)
    ghosts.positions.own[:] = previous
    connect(contact)
    ghosts.send()
    ghosts.receive()
    ghosts.place_points()
    contact.motion.measure_from(previous)
    contact.bind()  # which fills in what pairs have of their points: their energy asks for it


def _pairs(contact, names, table, candidates):
    node = names.rows_of_points(table).astype(np.int32)
    first = np.concatenate([[0], np.cumsum(table["count"])])
    body, surface = table["partner"].astype(np.int32), contact.surface
    if (surface.body_of_facet != surface.grain_of_facet).any():
        # That of the closest facet: where a body has parted since others may be of another one.
        one = first[:-1] + np.maximum(table["closest"], 0)
        wanted = table["partner"], candidates["facet"][one]
        known = names.facet_grain, names.facet
        body = surface.body_of_facet[find_rows(known, wanted, "facet")]
    order = np.lexsort((body, node))
    count = table["count"][order]
    new_first = np.concatenate([[0], np.cumsum(count)]).astype(np.int64)
    # Where each candidate stands in the table.
    place = np.repeat(first[:-1][order] - new_first[:-1], count) + np.arange(new_first[-1])
    partner = table["partner"][order]
    wanted = np.repeat(partner, count), candidates.pop("facet")[place]
    facet = find_rows((names.facet_grain, names.facet), wanted, "facet")
    facet = facet.astype(np.int32)
    pairs = Pairs(
        node[order], body[order], new_first, facet, contact.points,
        contact.dissipation.num_grains, contact.motion.bound, contact.layers.strengths.any,
        contact.first_tool,
    )  # fmt: skip
    pairs.motion_bounds.take((name, table.pop(name)[order]) for name in pairs.motion_bounds.KEPT)
    pairs.candidate_next_check[:] = candidates.pop("next_check")[place]
    closest = table["closest"][order]
    pairs.closest[:] = np.where(closest >= 0, new_first[:-1] + closest, -1)
    for name in pairs.kept:
        getattr(pairs, name)[:] = table.pop(name)[order]
    return pairs


def _wall_pairs(contact, names, table):
    node = names.rows_of_points(table).astype(np.int32)
    order = np.lexsort((table["wall"], node))
    pairs = WallPairs(
        node[order], table["wall"][order], contact.points, contact.motion.bound,
        contact.layers.strengths.any,
    )  # fmt: skip
    pairs.motion_bounds.take((name, table.pop(name)[order]) for name in pairs.motion_bounds.KEPT)
    for name in pairs.kept:
        getattr(pairs, name)[:] = table.pop(name)[order]
    pairs.stiffness[:] = contact.points.area[pairs.node] / contact.points.layer[pairs.node]
    return pairs


def _set_edge_pairs(contact, names, table):
    edges = contact.edges.edges
    ends = names.node[edges.ends]
    # The direction of an edge may depend on the number of ranks.
    grain = np.concatenate([edges.grain, edges.grain])
    known = (grain, *np.vstack([ends, ends[:, ::-1]]).T)
    first, second = (
        find_rows(known, (table[grain], *table[edge].T), "edge")
        for grain, edge in (("grain", "first"), ("partner", "second"))
    )
    num = max(edges.grain.size, 1)
    first_edge, second_edge = (edge.astype(np.int32) % num for edge in (first, second))
    # Of two edges of a grain the one listed first comes first.
    swap = (table["grain"] == table["partner"]) & (first_edge > second_edge)
    ends = np.where(swap, second_edge, first_edge), np.where(swap, first_edge, second_edge)
    contact.edges.set_pairs(*ends, contact.motion.bound)
    pairs = contact.edges.pairs
    for name in pairs.kept:
        getattr(pairs, name)[:] = table[name]
    for name in ("place", "stick_point"):
        getattr(pairs, name)[swap] = table[name][swap, ::-1]
    for name in ("normal", "shear"):
        getattr(pairs, name)[swap] *= -1.0
    first, second = np.where(swap, second, first), np.where(swap, first, second)
    for column, edge in enumerate((first, second)):
        turned = edge >= num
        for name in ("place", "stick_point"):
            values = getattr(pairs, name)
            values[turned, column] = 1.0 - values[turned, column]


def joined(numbers):
    """One number from three of at most ``BITS`` bits, of shape (n, 3)."""
    a, b, c = numbers.astype(np.int64).T
    return (a << (2 * BITS)) | (b << BITS) | c
