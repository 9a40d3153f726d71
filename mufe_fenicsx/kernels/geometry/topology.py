"""Facets and bodies of tetrahedra: what a mesh has to be, its surface, and nodes that part."""

from itertools import pairwise

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from .pieces import first_of_pieces

#: The four facets of a tetrahedron, seen from outside where it is positively oriented.
FACETS = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])


def cell_defect(cells, num_nodes):
    """What keeps tetrahedra from being cells of one mesh, in words; empty if they are. Local.

    Args:
        cells: Nodes of the tetrahedra, shape (num_cells, 4).
        num_nodes: How many nodes there are.
    """
    return _joints(np.asarray(cells), num_nodes)[0]


def body_defect(cells, num_nodes):
    """What keeps tetrahedra from being one body, in words; empty if they are one.

    In a body cells hang together by facets, also around each node, every facet has one cell or
    two, and the facets of the surface around each of its nodes make one ring. Where one of these
    fails two parts are joined as by a ball or a hinge, or cells lie in each other. Local.

    Args:
        cells: Nodes of the tetrahedra, shape (num_cells, 4).
        num_nodes: How many nodes there are.
    """
    cells = np.asarray(cells)
    defect, facets, key, (first, second) = _joints(cells, num_nodes)
    if defect:
        return defect
    num_parts = _num_parts(len(cells), first // 4, second // 4)
    if num_parts > 1:
        return (
            f"{num_parts} parts that have only nodes or edges in common, expected cells that hang "
            "together by facets"
        )
    # Corner i of a facet is one node: the corners of both cells there belong together.
    cells = cells - cells.min()
    joined = [_cell_corners(cells, facet // 4, key[facet]) for facet in (first, second)]
    if _num_parts(cells.size, *joined) > _num_used(cells):
        return "parts that only touch at a node or an edge, expected them to hang together there"
    single = np.ones(len(facets), dtype=bool)
    single[first] = single[second] = False
    return surface_pinch(facets[single])


def inner_facets(cells):
    """Facets of two cells: their nodes, shape (n, 3), and rows of both cells, (n, 2). Local."""
    facets = cells[:, FACETS].reshape(-1, 3)
    order, same = _sorted_rows(np.sort(facets, axis=1))
    first, second = order[:-1][same], order[1:][same]
    return facets[first], np.stack([first, second], axis=1) // 4


def boundary_sides(cells, cell_offset):
    """Numbers of the sides of cells that no other cell of their grain shares, increasing. Local.

    Side 4 c + i is across from corner i of cell c. They are found grain by grain from the cells:
    the facets of the DOLFINx topology would stay in memory, 80 bytes a cell, and nothing else needs
    them.
    """
    found = [np.empty(0, dtype=np.int64)]
    for first, end in pairwise(cell_offset):
        key = np.sort(cells[first:end][:, FACETS].reshape(-1, 3), axis=1)
        order = np.lexsort(key.T)
        key = key[order]
        same = (key[1:] == key[:-1]).all(axis=1)
        single = np.ones(len(key), dtype=bool)
        single[1:] &= ~same
        single[:-1] &= ~same
        found.append(4 * first + np.sort(order[single]))
    return np.concatenate(found)


def nodes_of_sides(cells, sides):
    """Nodes of sides of cells, seen from outside, shape (num_sides, 3). Local."""
    return np.take_along_axis(cells[sides // 4], FACETS[sides % 4], axis=1)


def rows_of(known, wanted):
    """Row of each wanted number among known, increasing ones, -1 where there is none. Local."""
    row = np.minimum(np.searchsorted(known, wanted), max(known.size - 1, 0))
    return np.where(known[row] == wanted, row, -1) if known.size else np.full(wanted.size, -1)


def part_nodes(cells, rows, opened, now, name_of_cell):
    """Give parts of nodes of their own where facets between cells opened. Local.

    Two cells stay joined at a node where a path of cells around it joins them, through facets that
    are not open.

    Args:
        cells: Nodes of the tetrahedra, shape (num_cells, 4).
        rows: Those of them beside which nodes can part: of the bodies that facets open in.
        opened: Pairs of cells whose facets opened so far, shape (n, 2).
        now: Those of them that opened now, shape (m, 2).
        name_of_cell: Numbers of the cells, of which the least of a part says which comes first,
            shape (num_cells,).

    Returns:
        Cells with the node num + k of part k, num one more than the largest node; and the old nodes
        of these parts, increasing, shape (num_parts,).
    """
    num = int(cells.max(initial=-1)) + 1
    one, other = cells[now].transpose(1, 0, 2)
    touched = np.zeros(num, dtype=bool)
    touched[one[(one[:, :, None] == other[:, None, :]).any(axis=2)]] = True
    around = rows[touched[cells[rows]].any(axis=1)]
    if not around.size:
        return cells, np.empty(0, dtype=np.int64)
    near = cells[around]
    facets = near[:, FACETS].reshape(-1, 3)
    by_node = np.argsort(facets, axis=1)
    corner = (4 * np.arange(len(near))[:, None, None] + FACETS).reshape(-1, 3)
    corner = np.take_along_axis(corner, by_node, axis=1)
    order, same = _sorted_rows(np.take_along_axis(facets, by_node, axis=1))
    first, second = order[:-1][same], order[1:][same]
    joined = ~np.isin(
        _pair_key(np.stack([around[first // 4], around[second // 4]], axis=1), len(cells)),
        _pair_key(opened, len(cells)),
    )
    ends = [corner[facet[joined]].ravel() for facet in (first, second)]
    graph = coo_array((np.ones(ends[0].size, bool), ends), (near.size, near.size))
    part = connected_components(graph, directed=False)[1]
    # The first corner of each part, those of a node one after another, the first cells first.
    mine = np.flatnonzero(touched[near.ravel()])
    node, name = near.ravel()[mine], name_of_cell[around[mine // 4]]
    mine = mine[np.lexsort((name, node))]
    _, begin = np.unique(part[mine], return_index=True)
    begin = mine[np.sort(begin)]
    node = near.ravel()[begin]
    further = begin[1:][node[1:] == node[:-1]]
    number = np.full(near.size, -1)
    number[part[further]] = num + np.arange(further.size)
    new = number[part].reshape(-1, 4)
    result = cells.copy()
    result[around] = np.where((new >= 0) & touched[near], new, near)
    return result, near.ravel()[further]


def _pair_key(pairs, num):
    """One number of each pair of numbers below ``num``, in either order."""
    low, high = np.sort(np.asarray(pairs, dtype=np.int64), axis=1).T
    return low * num + high


def num_folds(cells):
    """Facets whose two cells lie on the same side of them: there the mesh is folded. Local.

    Args:
        cells: Positively oriented tetrahedra that have no `cell_defect`, shape (num_cells, 4).
    """
    cells = np.asarray(cells)
    _, facets, _, (first, second) = _joints(cells, cells.max() + 1)
    # Of two neighbours' views of a facet, one is an even permutation of the other's reverse.
    one, other = facets[first], facets[second]
    place = (one[:, None, :] == other[:, :, None]).argmax(axis=2)
    even = (place[:, 1] - place[:, 0]) % 3 == 1
    return int(np.count_nonzero(even))


def _joints(cells, num_nodes):
    """A defect in words; all facets, as they are and sorted; and pairs of those that are one."""
    none = np.zeros(0, dtype=np.int64)
    nothing = (none.reshape(0, 3), none.reshape(0, 3), (none, none))
    if cells.ndim != 2 or cells.shape[1:] != (4,) or len(cells) == 0:
        return f"cells of shape {cells.shape}, expected (n, 4) with n > 0", *nothing
    if cells.min() < 0 or cells.max() >= num_nodes:
        wrong = cells.min() if cells.min() < 0 else cells.max()
        return f"a cell with node {wrong}, expected nodes from 0 to {num_nodes - 1}", *nothing
    cells = cells - cells.min()  # so that numbers are as small as those of one grain alone
    corners = np.sort(cells, axis=1)
    if (corners[:, 1:] == corners[:, :-1]).any():
        return "a cell that has one node twice, expected four nodes", *nothing
    _, same = _sorted_rows(corners)
    if same.any():
        return (
            f"{np.count_nonzero(same)} cells that are there twice, expected each once",
            *nothing,
        )
    facets = cells[:, FACETS].reshape(-1, 3)
    key = np.sort(facets, axis=1)
    order, same = _sorted_rows(key)
    if (same[1:] & same[:-1]).any():
        return "a facet of more than two cells, expected one or two", *nothing
    return "", facets, key, (order[:-1][same], order[1:][same])


def surface_pinch(triangles):
    """Where a closed surface touches itself, in words; empty if it does nowhere.

    Args:
        triangles: Shape (num_triangles, 3); each edge belongs to an even number of them.
    """
    order, same = _sorted_rows(_edges(triangles))
    if not same[::2].all():
        return "a surface with an open edge, expected a closed one"
    if same[1::2].any():
        return "a surface that touches itself along an edge, expected two facets at each edge"
    corners = _rings(triangles, order[::2], order[1::2])
    more = _num_parts(triangles.size, *corners) - _num_used(triangles)
    if more:
        return f"a surface that touches itself at {more} nodes, expected one ring of facets at each"
    return ""


def cut_at_pinches(points, triangles):
    """A surface whose nodes have one fan of triangles each: others get nodes of their own. Local.

    Args:
        points: Shape (n, 3).
        triangles: Shape (m, 3). Edges with other than two triangles part fans.

    Returns:
        points and triangles, and how many nodes were added.
    """
    order, same = _sorted_rows(_edges(triangles))
    first = np.append(True, ~same)
    count = np.diff(np.append(np.flatnonzero(first), len(order)))
    pairs = np.flatnonzero(first)[count == 2]
    corners = _rings(triangles, order[pairs], order[pairs + 1])
    graph = coo_array((np.ones(len(corners[0])), corners), shape=(triangles.size,) * 2)
    _, fan = connected_components(graph, directed=False)
    found, at, number = np.unique(fan, return_index=True, return_inverse=True)
    node = triangles.ravel()[at]
    # The first fan of a node keeps it.
    _, keeps = np.unique(node, return_index=True)
    new = np.full(len(found), -1)
    new[keeps] = node[keeps]
    others = np.flatnonzero(new < 0)
    new[others] = len(points) + np.arange(len(others))
    return (
        np.concatenate([points, points[node[others]]]),
        new[number].reshape(-1, 3),
        len(others),
    )


def _edges(triangles):
    """Nodes of edges, the lower one first; number 3 t + i: from corner i of triangle t onwards."""
    ends = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2)
    return np.sort(ends, axis=2).reshape(-1, 2)


def _rings(triangles, one, other):
    """Corners 3 t + i that belong together, since their triangles share an edge: two arrays."""
    ends = []
    for edge in (one, other):
        triangle, i = edge // 3, edge % 3
        corner = np.column_stack([3 * triangle + i, 3 * triangle + (i + 1) % 3])
        swap = triangles.ravel()[corner[:, 0]] > triangles.ravel()[corner[:, 1]]
        corner[swap] = corner[swap][:, ::-1]
        ends.append(corner.ravel())
    return ends


def number_pieces(cells, before, grain_of_cell, rows, holding):
    """Numbers of the pieces that the cells of grains hang together in. Local.

    Cells hang together by nodes, and by what holds them beside. Of a piece that parts, the part of
    most cells keeps the number, of as many the one of the first cell; the others get the next
    numbers of their grain, by their first cells.

    Args:
        cells: Nodes of the tetrahedra, shape (num_cells, 4).
        before: Numbers before, shape (num_cells,).
        grain_of_cell: Their grains, shape (num_cells,).
        rows: Cells of the grains that can be in pieces, grain after grain, in each in an order that
            knows no ranks.
        holding: Pairs of cells, shape (n, 2).

    Returns:
        Numbers now, int32, shape (num_cells,).
    """
    if not rows.size:
        return before
    part = first_of_pieces(cells, rows, holding, int(cells.max()) + 1)
    first, part, count = np.unique(part, return_inverse=True, return_counts=True)
    grain, of = grain_of_cell[rows[first]], before[rows[first]]
    order = np.lexsort((first, -count, of, grain))
    same = (grain[order[1:]] == grain[order[:-1]]) & (of[order[1:]] == of[order[:-1]])
    number, new = of.copy(), order[1:][same]
    new = new[np.argsort(first[new])]  # grain after grain
    begin = np.searchsorted(grain[new], grain[new])
    most = np.zeros(grain.max() + 1, dtype=np.int32)
    np.maximum.at(most, grain, of)
    number[new] = most[grain[new]] + 1 + np.arange(new.size) - begin
    now = before.copy()
    now[rows] = number[part]
    return now


def _sorted_rows(rows):
    """Order of rows of node numbers, and whether each but the first equals the one before."""
    base = np.int64(rows.max(initial=0)) + 1
    if float(base) ** rows.shape[1] < 2.0**63:
        keys = [np.zeros(len(rows), dtype=np.int64)]
        for column in rows.T:
            keys[0] = keys[0] * base + column
    else:
        keys = list(rows.T)
    order = np.lexsort(keys)
    same = np.ones(max(len(rows) - 1, 0), dtype=bool)
    for key in keys:
        same &= key[order[1:]] == key[order[:-1]]
    return order, same


def _cell_corners(cells, cell, nodes):
    """Numbers 4 c + i of the corners of cells that are given nodes, one after the other."""
    place = (cells[cell][:, None, :] == nodes[:, :, None]).argmax(axis=2)
    return (4 * cell[:, None] + place).ravel()


def _num_used(nodes):
    return np.count_nonzero(np.bincount(nodes.ravel()))


def _num_parts(size, one, other):
    """Parts of a graph of so many nodes with edges from ``one`` to ``other``."""
    graph = coo_array((np.ones(len(one), dtype=np.int8), (one, other)), shape=(size, size))
    return connected_components(graph, directed=False)[0]
