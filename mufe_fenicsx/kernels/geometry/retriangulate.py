"""Edges of a complex of facets split, collapsed and flipped; the faces keep what they part.

Several faces may meet along a line, and several lines in a node. A facet has two sides (labels) and
bits that say on which faces of the image it lies; the feature of a node or an edge is all
that the facets around it have of these: two on a face, three or more on a line. A facet that
is gone has the corners -1. ``ring`` holds the facets around each node, ``count`` their number.
"""

import math

import numba
import numpy as np

#: Facets around a node at most, and along an edge.
MOST, MOST_AT_EDGE = 64, 16


@numba.njit(cache=True, error_model="numpy")
def fill_rings(ring, count, facets):
    """Facets around each node, in place; False if a node has more than `MOST`."""
    for f in range(facets.shape[0]):
        for i in range(3):
            n = facets[f, i]
            if count[n] == MOST:
                return False
            ring[n, count[n]] = f
            count[n] += 1
    return True


@numba.njit(cache=True, error_model="numpy")
def split(x, facets, sides, bits, ring, count, pairs, num_nodes, num_facets, longest):
    """Halve edges longer than ``longest`` that are the longest of all facets around them.

    Args:
        x: Nodes, with room for more behind the first ``num_nodes``, shape (n, 3).
        facets, sides, bits: With room for more behind the first ``num_facets``, shapes (m, 3),
            (m, 2), (m,).
        ring, count: Shapes (n, MOST), (n,).
        pairs: Edges to try in turn, shape (num_edges, 2).
        num_nodes, num_facets: So far.
        longest: Length.

    Returns:
        num_nodes, num_facets.
    """
    at = np.empty(MOST_AT_EDGE, np.int64)
    for p in range(pairs.shape[0]):
        a, b = pairs[p, 0], pairs[p, 1]
        m = _facets_at(at, facets, ring, count, a, b)
        length = _distance(x, a, b)
        if m < 2 or length <= longest:
            continue
        if num_nodes + 1 > x.shape[0] or num_facets + m > facets.shape[0]:
            break
        good = True
        for k in range(m):
            c = _third(facets, at[k], a, b)
            good &= count[c] < MOST
            good &= length >= 0.999 * max(_distance(x, a, c), _distance(x, b, c))
        if not good:
            continue
        n = num_nodes
        num_nodes += 1
        for i in range(3):
            x[n, i] = 0.5 * (x[a, i] + x[b, i])
        count[n] = 0
        for k in range(m):
            f, g = at[k], num_facets
            c = _third(facets, f, a, b)
            num_facets += 1
            for i in range(3):
                facets[g, i] = n if facets[f, i] == a else facets[f, i]
                facets[f, i] = n if facets[f, i] == b else facets[f, i]
            sides[g, 0], sides[g, 1], bits[g] = sides[f, 0], sides[f, 1], bits[f]
            _replace(ring, count, b, f, g)
            ring[c, count[c]] = g
            count[c] += 1
            ring[n, count[n]], ring[n, count[n] + 1] = f, g
            count[n] += 2
    return num_nodes, num_facets


@numba.njit(cache=True, error_model="numpy")
def collapse(x, facets, sides, bits, ring, count, pairs, shortest, longest, least):
    """Shrink short edges, and edges of flat facets where that makes these less flat.

    A node goes only along what it lies on; the end that lies on more keeps its place. The
    facets around may turn by 60 degrees at most, and no two bodies or faces become one.

    Args:
        x, facets, sides, bits, ring, count, pairs: As in :func:`split`.
        shortest: Edges below this length shrink.
        longest: No edge may grow beyond it.
        least: Facets with an altitude below it are flat.
    """
    at = np.empty(MOST_AT_EDGE, np.int64)
    for p in range(pairs.shape[0]):
        a, b = pairs[p, 0], pairs[p, 1]
        m = _facets_at(at, facets, ring, count, a, b)
        if m < 2 or count[a] + count[b] - m > MOST:
            continue
        length = _distance(x, a, b)
        flattest = np.inf
        for k in range(m):
            flattest = min(flattest, _altitude(x, facets[at[k]]))
        if length > shortest and flattest > least:
            continue
        of_edge = _feature(facets, sides, bits, at, m)
        a_goes = of_edge == _feature(facets, sides, bits, ring[a], count[a])
        b_goes = of_edge == _feature(facets, sides, bits, ring[b], count[b])
        if of_edge > 2:
            a_goes = a_goes and _on_one_line(facets, sides, bits, ring, count, a, of_edge)
            b_goes = b_goes and _on_one_line(facets, sides, bits, ring, count, b, of_edge)
        if not (a_goes or b_goes):
            continue
        if not _may_join(facets, sides, bits, ring, count, a, b, at, m):
            continue
        for way in range(3):
            if way == 0:
                part = 0.5 if a_goes and b_goes else (0.0 if b_goes else 1.0)
            elif not (a_goes and b_goes):
                break
            else:
                part = way - 1.0
            px = (1 - part) * x[a, 0] + part * x[b, 0]
            py = (1 - part) * x[a, 1] + part * x[b, 1]
            pz = (1 - part) * x[a, 2] + part * x[b, 2]
            before, after, turn, edge = _judge(x, facets, ring, count, a, b, px, py, pz)
            limit = longest * (1.2 if length < 0.5 * shortest else 1.0)
            if turn < 0.5 or edge > limit or after < min(before, 0.6 * least):
                continue
            if length > shortest and after < 1.2 * before:
                continue
            _join(x, facets, ring, count, a, b, at, m, px, py, pz)
            break


@numba.njit(cache=True, error_model="numpy")
def flip(x, facets, sides, bits, ring, count, pairs):
    """Flip edges inside faces where the flatter of their facets becomes less flat; their number.

    Facets with two edges on the line around a face, whose corners all come to lie on it, count
    as flatter than they are.
    """
    at, flips = np.empty(MOST_AT_EDGE, np.int64), 0
    new = np.empty((2, 3), np.int64)
    for p in range(pairs.shape[0]):
        a, b = pairs[p, 0], pairs[p, 1]
        m = _facets_at(at, facets, ring, count, a, b)
        if m != 2:
            continue
        f, g = at[0], at[1]
        if sides[f, 0] != sides[g, 0] or sides[f, 1] != sides[g, 1] or bits[f] != bits[g]:
            continue
        # f is a, b, c in this order.
        for i in range(3):
            if facets[f, i] == b and facets[f, (i + 1) % 3] == a:
                a, b = b, a
                break
        c, d = _third(facets, f, a, b), _third(facets, g, a, b)
        if c == d or count[c] == MOST or count[d] == MOST or count[a] < 4 or count[b] < 4:
            continue
        if _adjacent(facets, ring, count, c, d):
            continue
        new[0, 0], new[0, 1], new[0, 2] = a, d, c
        new[1, 0], new[1, 1], new[1, 2] = d, b, c
        nf, ng = _normal(x, facets[f]), _normal(x, facets[g])
        n0, n1 = _normal(x, new[0]), _normal(x, new[1])
        if min(_dot(n0, n1), _dot(nf, n0), _dot(nf, n1), _dot(ng, n0), _dot(ng, n1)) < 0.75:
            continue
        ac = _on_line(facets, sides, bits, ring, count, a, c)
        bc = _on_line(facets, sides, bits, ring, count, b, c)
        ad = _on_line(facets, sides, bits, ring, count, a, d)
        bd = _on_line(facets, sides, bits, ring, count, b, d)
        old_f = _shape(x, facets[f]) * (0.4 if ac and bc else 1.0)
        old_g = _shape(x, facets[g]) * (0.4 if ad and bd else 1.0)
        new_0 = _shape(x, new[0]) * (0.4 if ac and ad else 1.0)
        new_1 = _shape(x, new[1]) * (0.4 if bc and bd else 1.0)
        if min(new_0, new_1) < 1.05 * min(old_f, old_g):
            continue
        facets[f], facets[g] = new[0], new[1]
        _remove(ring, count, b, f)
        _remove(ring, count, a, g)
        ring[c, count[c]], ring[d, count[d]] = g, f
        count[c] += 1
        count[d] += 1
        flips += 1
    return flips


@numba.njit(cache=True, error_model="numpy")
def _facets_at(at, facets, ring, count, a, b):
    """Fill in the facets along an edge; their number, 0 if they are too many."""
    m = 0
    for k in range(count[a]):
        f = ring[a, k]
        if facets[f, 0] == b or facets[f, 1] == b or facets[f, 2] == b:
            if m == MOST_AT_EDGE:
                return 0
            at[m] = f
            m += 1
    return m


@numba.njit(cache=True, error_model="numpy")
def _adjacent(facets, ring, count, a, b):
    for k in range(count[a]):
        f = ring[a, k]
        if facets[f, 0] == b or facets[f, 1] == b or facets[f, 2] == b:
            return True
    return False


@numba.njit(cache=True, error_model="numpy")
def _third(facets, f, a, b):
    for i in range(3):
        if facets[f, i] != a and facets[f, i] != b:
            return facets[f, i]
    return -1


@numba.njit(cache=True, error_model="numpy")
def _feature(facets, sides, bits, around, number):
    """How many labels and faces of the image these facets have; the void beyond it is none."""
    found = np.empty(2 * MOST, np.int64)
    n, on = 0, 0
    for k in range(number):
        f = around[k]
        on |= bits[f]
        for s in range(2):
            label = sides[f, s]
            if label == 0 and bits[f] != 0:
                continue
            known = False
            for i in range(n):
                known |= found[i] == label
            if not known:
                found[n] = label
                n += 1
    return n + (on & 1) + (on >> 1 & 1) + (on >> 2 & 1)


@numba.njit(cache=True, error_model="numpy")
def _on_line(facets, sides, bits, ring, count, a, b):
    """Whether an edge lies where faces end."""
    at = np.empty(MOST_AT_EDGE, np.int64)
    m = _facets_at(at, facets, ring, count, a, b)
    return m != 2 or _feature(facets, sides, bits, at, m) > 2


@numba.njit(cache=True, error_model="numpy")
def _on_one_line(facets, sides, bits, ring, count, a, feature):
    """Whether just two edges around a node lie on all that it lies on."""
    at = np.empty(MOST_AT_EDGE, np.int64)
    seen = np.empty(2 * MOST, np.int64)
    n, lines = 0, 0
    for k in range(count[a]):
        for i in range(3):
            b = facets[ring[a, k], i]
            if b == a:
                continue
            known = False
            for j in range(n):
                known |= seen[j] == b
            if known:
                continue
            seen[n] = b
            n += 1
            m = _facets_at(at, facets, ring, count, a, b)
            lines += _feature(facets, sides, bits, at, m) == feature
    return lines == 2


@numba.njit(cache=True, error_model="numpy")
def _may_join(facets, sides, bits, ring, count, a, b, at, m):
    """Whether a and b have in common just what the facets along their edge have (link condition).

    Nor may a face lose the last facet between two of the lines around it, nor a body be
    left with two facets around a node.
    """
    for k in range(m):
        c = _third(facets, at[k], a, b)
        if count[c] <= 4:
            return False
        for j in range(k):
            if _third(facets, at[j], a, b) == c:
                return False
        if _on_line(facets, sides, bits, ring, count, a, c) and _on_line(
            facets, sides, bits, ring, count, b, c
        ):
            return False
    for k in range(count[a]):
        f = ring[a, k]
        if facets[f, 0] == b or facets[f, 1] == b or facets[f, 2] == b:
            continue
        for i in range(3):
            c = facets[f, i]
            if c == a or not _adjacent(facets, ring, count, b, c):
                continue
            opposite = False
            for j in range(m):
                opposite |= _third(facets, at[j], a, b) == c
            if not opposite:
                return False
            # The facets a, c, d and b, c, d would come to lie on each other.
            d = _third(facets, f, a, c)
            for j in range(count[b]):
                g = ring[b, j]
                one = facets[g, 0] == c or facets[g, 1] == c or facets[g, 2] == c
                two = facets[g, 0] == d or facets[g, 1] == d or facets[g, 2] == d
                if one and two:
                    return False
    return True


@numba.njit(cache=True, error_model="numpy")
def _judge(x, facets, ring, count, a, b, px, py, pz):
    """What changes around a and b where both go to a place.

    Returns:
        Smallest altitude before and after, the least cosine by which a facet turns, and the
        longest edge after.
    """
    before, after, turn, edge = np.inf, np.inf, 1.0, 0.0
    moved = np.empty((3, 3))
    order = np.arange(3)
    for end in range(2):
        v = a if end == 0 else b
        for k in range(count[v]):
            t = facets[ring[v, k]]
            old = _altitude(x, t)
            before = min(before, old)
            if (t[0] == a or t[1] == a or t[2] == a) and (t[0] == b or t[1] == b or t[2] == b):
                continue
            for i in range(3):
                for j in range(3):
                    moved[i, j] = x[t[i], j]
                if t[i] == v:
                    moved[i, 0], moved[i, 1], moved[i, 2] = px, py, pz
            new = _altitude(moved, order)
            after = min(after, new)
            for i in range(3):
                if t[i] == v:
                    edge = max(edge, _distance(moved, i, (i + 1) % 3))
                    edge = max(edge, _distance(moved, i, (i + 2) % 3))
            turn = min(turn, _dot(_normal(x, t), _normal(moved, order)))
    return before, after, turn, edge


@numba.njit(cache=True, error_model="numpy")
def _join(x, facets, ring, count, a, b, at, m, px, py, pz):
    """Put b into a, which goes to a place."""
    x[a, 0], x[a, 1], x[a, 2] = px, py, pz
    for k in range(m):
        f = at[k]
        for i in range(3):
            n = facets[f, i]
            if n != b:
                _remove(ring, count, n, f)
    for k in range(count[b]):
        f = ring[b, k]
        gone = False
        for j in range(m):
            gone |= at[j] == f
        if gone:
            continue
        for i in range(3):
            if facets[f, i] == b:
                facets[f, i] = a
        ring[a, count[a]] = f
        count[a] += 1
    count[b] = 0
    for k in range(m):
        for i in range(3):
            facets[at[k], i] = -1


@numba.njit(cache=True, error_model="numpy")
def _remove(ring, count, n, f):
    for k in range(count[n]):
        if ring[n, k] == f:
            count[n] -= 1
            ring[n, k] = ring[n, count[n]]
            return


@numba.njit(cache=True, error_model="numpy")
def _replace(ring, count, n, f, g):
    for k in range(count[n]):
        if ring[n, k] == f:
            ring[n, k] = g
            return


@numba.njit(cache=True, error_model="numpy")
def _distance(x, a, b):
    dx, dy, dz = x[a, 0] - x[b, 0], x[a, 1] - x[b, 1], x[a, 2] - x[b, 2]
    return math.sqrt(dx * dx + dy * dy + dz * dz)


@numba.njit(cache=True, error_model="numpy")
def _area2(x, t):
    """Twice the area vector of a triangle."""
    a, b, c = t[0], t[1], t[2]
    ux, uy, uz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    vx, vy, vz = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


@numba.njit(cache=True, error_model="numpy")
def _normal(x, t):
    nx, ny, nz = _area2(x, t)
    norm = max(math.sqrt(nx * nx + ny * ny + nz * nz), 1e-300)
    return nx / norm, ny / norm, nz / norm


@numba.njit(cache=True, error_model="numpy")
def _dot(u, v):
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


@numba.njit(cache=True, error_model="numpy")
def _altitude(x, t):
    """Smallest altitude of a triangle."""
    nx, ny, nz = _area2(x, t)
    longest = max(_distance(x, t[0], t[1]), _distance(x, t[1], t[2]), _distance(x, t[2], t[0]))
    return math.sqrt(nx * nx + ny * ny + nz * nz) / max(longest, 1e-300)


@numba.njit(cache=True, error_model="numpy")
def _shape(x, t):
    """Area over the mean square of the edges, 1 for an equilateral triangle."""
    nx, ny, nz = _area2(x, t)
    a, b, c = _distance(x, t[0], t[1]), _distance(x, t[1], t[2]), _distance(x, t[2], t[0])
    squares = a * a + b * b + c * c
    return 2 * math.sqrt(3.0) * math.sqrt(nx * nx + ny * ny + nz * nz) / max(squares, 1e-300)
