"""The state of all contacts kept, to evaluate them again from there."""

from ..state import copied


class ContactMark:
    """What the contacts were when it was made. Local.

    Args:
        contact: :class:`~mufe_fenicsx.contact.contact.Contact`.
    """

    def __init__(self, contact):
        contact.bind()  # which completes the rows of pairs
        self.contact = contact
        self.num_searches = contact.num_searches
        parts = contact.pairs, contact.edges.pairs, contact.walls.pairs, *contact.parts.values()
        self._kept = [(part, copied(part.state_dict())) for part in parts]
        self._pairs, self._edges, self._walls = (kept["here"] for _, kept in self._kept[:3])

    def restore(self):
        """Make the contacts what they were; a search since then must not have been.

        Raises:
            RuntimeError: There was one.
        """
        if self.contact.num_searches != self.num_searches:
            raise RuntimeError("contacts were searched anew, expected the pairs of the mark")
        for part, kept in self._kept:
            part.load_state_dict(kept)

    def before(self, name):
        """``closed`` or ``slip`` then: of pairs with facets, of edges and with walls."""
        of_pairs, of_walls = self.of_points(name)
        return of_pairs, self.contact.edges.pairs.of_mark(self._edges, name), of_walls

    def of_points(self, name):
        """An array of pairs with facets and of those with walls then, which may be changed."""
        pairs, walls = self.contact.pairs, self.contact.walls.pairs
        return pairs.of_mark(self._pairs, name), walls.of_mark(self._walls, name)
