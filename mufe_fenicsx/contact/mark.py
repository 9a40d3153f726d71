"""The state of all contacts kept, to evaluate them again from there."""

from ..state import copied


class ContactMark:
    """What the contacts were when it was made. Local.

    Args:
        contact: :class:`~mufe_fenicsx.contact.contact.Contact`.

    Attributes:
        pairs, edges, walls: Arrays of pairs with facets, of edges and with walls then, by their
            names.
    """

    def __init__(self, contact):
        contact.bind()  # which completes the rows of pairs
        self.contact = contact
        self.num_searches = contact.num_searches
        parts = contact.pairs, contact.edges.pairs, contact.walls.pairs, *contact.parts.values()
        self._kept = [(part, copied(part.state_dict())) for part in parts]
        self.pairs, self.edges, self.walls = (kept["here"] for _, kept in self._kept[:3])

    def restore(self):
        """Make the contacts what they were; a search since then must not have been.

        Raises:
            RuntimeError: There was one.
        """
        if self.contact.num_searches != self.num_searches:
            raise RuntimeError("contacts were searched anew, expected the pairs of the mark")
        for part, kept in self._kept:
            part.load_state_dict(kept)
