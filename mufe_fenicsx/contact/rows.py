"""Own surface nodes in the arrays of the mesh and in those of contact: from one to the other."""

from ..kernels.kick_drift import spans_of
from ..kernels.walls import gather_rows, gather_some, hand_rows, hand_some


class SurfaceRows:
    """Hands positions of surface nodes to contact, and its forces to the mesh. Local.

    Args:
        nodes: The nodes, increasing, int32, shape (num_surface_nodes,).
        first: First node of each grain.
    """

    def __init__(self, nodes, first):
        self.nodes = nodes
        #: Rows whose positions are known until the next search of contacts; None: all.
        self.moving = None
        #: Whether forces are still to be added to those of the mesh.
        self.holds = False
        self._spans = spans_of(nodes, first)
        self._none = self._spans[:0]  # the same array each time: its address is kept

    def place(self, positions, x):
        """Set ``positions`` [m], shape (num_surface_nodes, 3), to those of the mesh nodes."""
        if self.moving is None:
            gather_rows(positions, x, self.nodes)
        else:
            gather_some(positions, x, self.nodes, self.moving)

    def hand(self, f, forces):
        """Add ``forces`` [N], shape (num_surface_nodes, 3), to those of the mesh; then zero."""
        self.holds = False
        if self.moving is None:
            hand_rows(f, self.nodes, forces)
        else:
            hand_some(f, self.nodes, forces, self.moving)

    def give(self):
        """What :class:`~mufe_fenicsx.kernels.kick_drift.KickAndDrift` is to do instead.

        Returns:
            Ranges of nodes; none where no forces are held.
        """
        spans = self._spans if self.holds else self._none
        self.holds = False
        return spans
