"""The state of all contacts kept, to evaluate them again from there."""

import numpy as np

from ..kernels.pairs import column
from .snapshot import EDGES_KEPT, WALLS_KEPT

#: Arrays that an evaluation changes, of pairs with facets, besides their rows.
OF_PAIRS = ("due", "candidate_due", "closest")
#: Numbers of the contact operator itself.
NUMBERS = ("dissipated", "switched", "num_adopted", "deepest", "clock")


class ContactMark:
    """What the contacts were when it was made. Local.

    Args:
        contact: :class:`~mufe_fenicsx.contact.contact.Contact`.
    """

    def __init__(self, contact):
        contact.bind()  # which completes the rows of pairs
        self.contact = contact
        self.num_searches = contact.num_searches
        self._kept = [(array, array.copy()) for array in _arrays(contact)]
        self._numbers = {name: getattr(contact, name) for name in NUMBERS}

    def restore(self):
        """Make the contacts what they were; a search since then must not have been.

        Raises:
            RuntimeError: There was one.
        """
        contact = self.contact
        if contact.num_searches != self.num_searches:
            raise RuntimeError("contacts were searched anew, expected the pairs of the mark")
        for array, kept in self._kept:
            np.copyto(array, kept)
        for name, value in self._numbers.items():
            setattr(contact, name, value)

    def before(self, name):
        """``closed`` or ``slip`` then: of pairs with facets, of edges and with walls."""
        of_edges = self._kept[-len(EDGES_KEPT) - len(WALLS_KEPT) :][EDGES_KEPT.index(name)][1]
        of_walls = self._kept[-len(WALLS_KEPT) :][WALLS_KEPT.index(name)][1]
        return self._of_pairs(name), of_edges, of_walls

    def of_points(self, name):
        """An array of pairs with facets and of those with walls then, which may be changed."""
        return self._of_pairs(name), self._kept[-len(WALLS_KEPT) :][WALLS_KEPT.index(name)][1]

    def _of_pairs(self, name):
        if name in OF_PAIRS:
            return self._kept[OF_PAIRS.index(name)][1]
        return column(self._kept[len(OF_PAIRS)][1], name)


def _arrays(contact):
    pairs, edges, walls = contact.pairs, contact.edges.pairs, contact.walls.pairs
    return (
        [getattr(pairs, name) for name in OF_PAIRS]
        + [pairs.state, pairs.clocks.readings, walls.clocks.readings]
        + [getattr(edges, name) for name in EDGES_KEPT]
        + [getattr(walls, name) for name in WALLS_KEPT]
    )
