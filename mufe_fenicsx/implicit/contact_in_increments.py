"""Contact as a force of increments: the pairs of one search, at all positions that are tried."""

from ..state import ForceTerm


class ContactInIncrements(ForceTerm):
    """Forces of the pairs that are known. Collective.

    Args:
        contact: :class:`~mufe_fenicsx.contact.contact.Contact`.
    """

    def __init__(self, contact):
        self._contact = contact

    def begin_forces(self, f, state, dt):
        """Send positions."""
        self._contact.ghosts.place(state.x)

    def add_forces(self, f, state, dt):
        """Add the forces at the positions that were sent."""
        self._contact.ghosts.receive()
        self._contact.evaluate(f)
