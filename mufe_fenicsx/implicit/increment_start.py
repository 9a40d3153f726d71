"""The state at the start of an increment, to come back to."""

from ..state import copied


class IncrementStart:
    """A copy of all that an increment changes but contacts (contact.mark). Local.

    Args:
        specimen: :class:`~mufe_fenicsx.specimen.Specimen`.

    Attributes:
        state: Arrays of the state by name.
        force: Sum of all forces on the nodes [N], shape (num_nodes, 3).
    """

    def __init__(self, specimen):
        self._kept = [
            (part, copied(_without_bounds(part.state_dict())))
            for name, part in specimen.parts.items()
            if name not in specimen.contact.parts
        ]  # fmt: skip
        of = {id(part): kept for part, kept in self._kept}
        kept = of[id(specimen.state)]
        self.state = kept["nodes"] | kept["cells"]
        self.force = of[id(specimen)]["nodes"]["f"]

    def restore(self):
        """Make the specimen what it was; its walls have been turned back."""
        for part, kept in self._kept:
            part.load_state_dict(kept)


def _without_bounds(kept):
    """All but what a search widens, which an increment that is tried again may have done."""
    return {place: values for place, values in kept.items() if place != "largest"}
