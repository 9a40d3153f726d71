"""What friction did so far, kept when pairs of points and of edges come and go."""

import numpy as np

from ...kernels.contact.transfer import transfer_pairs
from ...state import Stateful


class Dissipation(Stateful):
    """Friction work of each grain pair and slip of each point on this rank, over all searches.

    Pairs of points and crossings count their own work from search to search only; a search
    closes these accounts, so that nothing is lost with the pairs that it drops. Work is what
    friction dissipated.

    Args:
        grain_of_point: Global grain of each point of contact of this rank, shape (num_points,).
        num_grains: Grains on all ranks; a wall is the partner ``num_grains`` + its number.
        dents: :class:`~.dents.Dents`, which keep what they dissipate themselves.
    """

    STATE = {"sum": ("total", "switched")}

    def __init__(self, grain_of_point, num_grains, dents):
        self.total = 0.0  #: by friction on this rank so far [J]
        #: Energy that springs lost so far where pairs passed to other facets and edges [J]: less
        #: than none where a point came under an edge; on this rank.
        self.switched = 0.0
        self.num_grains = int(num_grains)
        self.grain = np.empty(0, dtype=np.int64)  #: grain of each account
        self.partner = np.empty(0, dtype=np.int64)  #: the other grain, or the wall
        self.work = np.empty(0)  #: friction work of their points and crossings so far [J]
        self.dents = dents
        self._grain_of_point = grain_of_point
        #: slip of each point by pairs that were dropped [m]
        self.slip_of_dropped = np.zeros(grain_of_point.size)

    def add(self, friction, switched):
        """Add what friction dissipated, and springs lost, in a step [J]. Local."""
        self.total += friction
        self.switched += switched

    def totals(self, pairs, walls, crossings):
        """Work of all accounts with what pairs with grains, with walls and of edges did since.

        Returns:
            Grain, partner and work [J] of each account, shape (num_accounts,).
        """
        grain, partner, work = [self.grain], [self.partner], [self.work]
        mine = self._grain_of_point
        for p, own, other in (
            (pairs, mine[pairs.node], pairs.grain),
            (walls, mine[walls.node], walls.wall + self.num_grains),
            (crossings, crossings.grain, crossings.partner),
        ):
            some = np.flatnonzero(p.work)
            grain.append(own[some])
            partner.append(other[some])
            work.append(p.work[some])
        (grain, partner), (work,) = sum_by_pair(
            np.concatenate(grain), np.concatenate(partner), np.concatenate(work)
        )
        return grain, partner, work

    def close(self, *pairs):
        """Take the work of pairs, arguments as of :meth:`totals`, into the accounts. Local."""
        self.grain, self.partner, self.work = self.totals(*pairs)
        for p in pairs:
            p.work[:] = 0.0

    def change(self, old, new, old_walls, new_walls, old_crossings):
        """Close the accounts of the old pairs, and keep the slip of those that are dropped."""
        self.close(old, old_walls, old_crossings)
        for a, b, of in ((old, new, "body"), (old_walls, new_walls, "wall")):
            dropped = transfer_pairs(b.node, getattr(b, of), a.node, getattr(a, of)) < 0
            np.add.at(self.slip_of_dropped, a.node[dropped], a.slip[dropped])

    def slip(self, pairs, walls):
        """Slip of each point of contact so far [m], shape (num_points,)."""
        total = self.slip_of_dropped.copy()
        for p in (pairs, walls):
            np.add.at(total, p.node, p.slip)
        return total


def sum_by_pair(grain, partner, *values):
    """Sums of values that belong to the same pair.

    Args:
        grain, partner: Two numbers a pair, shape (num,).
        values: Arrays of shape (num,) or (num, k).

    Returns:
        (grain, partner) of the distinct pairs, in increasing order, and the list of sums.
    """
    base = int(partner.max(initial=0)) + 1
    key, place = np.unique(grain.astype(np.int64) * base + partner, return_inverse=True)
    sums = []
    for value in values:
        total = np.zeros((key.size, *value.shape[1:]))
        np.add.at(total, place, value)
        sums.append(total)
    return (key // base, key % base), sums
