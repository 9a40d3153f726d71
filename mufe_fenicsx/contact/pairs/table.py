"""Pairs of points with grains or with walls, and of edges: the rows that kernels work on."""

import numpy as np

from ...kernels.build.pair_rows import DENT
from ...kernels.contact.transfer import copy_rows
from ...state import Stateful


class RowTable(Stateful):
    """A row of each pair. Local.

    Each field of the rows is an attribute, a view of shape (num_pairs,) or (num_pairs, n).

    Args:
        row: :class:`~mufe_fenicsx.kernels.build.pair_rows.Row` of the pairs.
        number: How many.
        bound: Of all relative motion so far [m].
    """

    STATE = {"here": ("next_check", "state")}

    def __init__(self, row, number, bound):
        self.row = row
        self.next_check = np.full(number, bound)
        self.state = row.rows(number)
        self._name_fields()
        self.gap[:] = np.inf
        self.forces = None  #: of the kernels, once they are wanted

    def _name_fields(self):
        for field in self.row.fields:
            setattr(self, field.name, self.row.view(self.state, field.name))

    @property
    def kept(self):
        """Names of what a checkpoint keeps of each pair."""
        return ("next_check", *self.row.kept)

    def counts(self, which=True):
        """Numbers of closed pairs, and of those with an offset, of those flagged, shape (2,)."""
        closed = self.closed & which
        return np.array([closed.sum(), (closed & (self.offset != 0.0)).sum()])

    def num_at_largest(self, which=True, recess=0.0):
        """Number of closed pairs at their largest force, with a ``recess`` of contact [m]."""
        depth = self.offset - self.gap - recess
        return (self.closed & which & (depth > self.largest_depth)).sum()


class PairTable(RowTable):
    """A row of each pair of a point, and another one where a body can yield. Local.

    Args:
        row, bound: As of :class:`RowTable`.
        node: Their points, int32, shape (num_pairs,).
        motion_bounds: :class:`~.motion_bounds.MotionBounds` of the pairs.
        yields: Whether some body of all ranks can yield.
    """

    STATE = {"here": (*RowTable.STATE["here"], "dents", "bounds")}

    def __init__(self, row, node, motion_bounds, bound, yields):
        super().__init__(row, node.size, bound)
        self.node, self.motion_bounds, self.yields = node, motion_bounds, yields
        self.dents = DENT.rows(node.size if yields else 0)
        self._name_dents()

    def _name_dents(self):
        for field in DENT.fields if self.yields else ():
            setattr(self, field.name, DENT.view(self.dents, field.name))
        if not self.yields:
            self.dent = self.slope_left = np.zeros(self.node.size)

    def go_on(self, rows, node):
        """Become the pairs ``rows`` of now, with other numbers of points, to be found again. Local.

        Args:
            rows: Shape (num,).
            node: Their points, shape (num,).
        """
        if not np.array_equal(rows, np.arange(self.node.size)):
            self.next_check, self.state = self.next_check[rows], self.state[rows]
            self.motion_bounds.of = self.motion_bounds.of[rows]
            if self.yields:
                self.dents = self.dents[rows]
            self._name_fields()
        self.node = node.astype(np.int32)
        self._name_dents()

    @property
    def kept(self):
        """Names of what a checkpoint keeps of each pair."""
        return (*super().kept, *(DENT.kept if self.yields else ()))

    @property
    def bounds(self):
        """Of relative motion, of each pair of bodies [m]."""
        return self.motion_bounds.bounds

    def take_rows(self, new, old, source):
        """The pairs ``new`` go on as ``source`` of an ``old`` table; the ledger has their work."""
        copy_rows(self.state, new, old.state, source)
        if self.yields:
            copy_rows(self.dents, new, old.dents, source)
        self.work[new] = 0.0

    def name_dents(self, strengths, points, partner=None):
        """Say in the rows of dents whose they are. Local.

        Args:
            strengths: :class:`~mufe_fenicsx.contact.stiffness.strength.Strengths`.
            points: :class:`~mufe_fenicsx.contact.surface.points.Points`.
            partner: The other grain of each pair; None: walls, which do not yield.
        """
        if not self.yields:
            return
        tables = strengths.offsets(points.grain_of_point[self.node], partner)
        self.own[:], self.other[:] = tables.T
        self.cell[:], self.point[:] = points.cell[self.node], self.node
        self.partner[:] = -1 if partner is None else partner
