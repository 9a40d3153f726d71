"""Creases: edges of a triangle surface between two of its faces, triangles of different tags.

The plane faces that the border of the image cuts have a tag each, the rest of the surface 0.
"""

import numpy as np


def sides(triangles):
    """The three sides of each triangle as one number each, equal for the same two nodes.

    Returns:
        Numbers, shape (m, 3), and by what to divide them: their quotient and remainder are the
        nodes, the lower one first.
    """
    n = int(triangles.max(initial=0)) + 1
    start, end = triangles.astype(np.int64), np.roll(triangles, -1, axis=1).astype(np.int64)
    return np.minimum(start, end) * n + np.maximum(start, end), n


def crease_edges(triangles, tags):
    """Edges whose two triangles have different tags, start < end, shape (k, 2)."""
    number, n = sides(triangles)
    order = np.argsort(number, axis=None, kind="stable")
    number, tag = number.ravel()[order], tags[order // 3]
    pair = (number[1:] == number[:-1]) & (tag[1:] != tag[:-1])
    return np.column_stack(np.divmod(number[1:][pair], n))


class Creases:
    """Which nodes of a surface lie on creases, and which where creases meet.

    Args:
        triangles, tags: The surface, shapes (m, 3) and (m,).
        num_nodes: Its nodes.
    """

    def __init__(self, triangles, tags, num_nodes):
        self.edges = crease_edges(triangles, tags)
        degree = np.bincount(self.edges.ravel(), minlength=num_nodes)
        #: 0 on a face, 1 on a crease, 2 where creases meet or end.
        self.rank = np.where(degree == 0, 0, np.where(degree == 2, 1, 2))
        self._next = None

    def neighbours(self):
        """The two neighbours along their crease of nodes on one, shape (num_nodes, 2); else -1."""
        found = np.full((len(self.rank), 2), -1)
        ends = np.concatenate([self.edges, self.edges[:, ::-1]])
        ends = ends[self.rank[ends[:, 0]] == 1]
        ends = ends[np.argsort(ends[:, 0], kind="stable")]
        found[ends[::2, 0]] = np.column_stack([ends[::2, 1], ends[1::2, 1]])
        return found

    def weight(self, a, b):
        """Where the edge from a to b may shrink to: part of a in that place; None if it may not."""
        first, second = self.rank[a], self.rank[b]
        if first == second == 0:
            return 0.5
        if 0 in (first, second):
            return 1.0 if first > second else 0.0
        if self._next is None:
            self._next = {}
            for i, j in self.edges.tolist():
                self._next.setdefault(i, set()).add(j)
                self._next.setdefault(j, set()).add(i)
        if b not in self._next[a] or self._next[a] & self._next[b] or first == second == 2:
            return None
        return 0.5 if first == second else 1.0 if first > second else 0.0


def crease_chains(triangles, tags):
    """Chains of nodes along creases, each from one end or meeting to the next.

    A ring without such a node begins and ends with one of its own.
    """
    around = {}
    for a, b in crease_edges(triangles, tags).tolist():
        around.setdefault(a, []).append(b)
        around.setdefault(b, []).append(a)
    ends = {v for v, others in around.items() if len(others) != 2}
    chains = []
    for first in [*ends, *around]:
        while around[first]:
            chain = [first]
            while True:
                following = around[chain[-1]].pop()
                around[following].remove(chain[-1])
                chain.append(following)
                if following == first or following in ends:
                    break
            chains.append(np.array(chain))
    return chains
