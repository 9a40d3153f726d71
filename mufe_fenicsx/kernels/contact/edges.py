"""Contact of sharp edges that cross: forces and energy."""

import ctypes

import numpy as np

from ..build.native import Pointers, address, load
from ..build.pair_rows import EDGE_PAIR
from .pairs import energy_of_rows


class EdgeForces:
    """Finds the crossings of all pairs and adds the forces of the closed ones; local.

    A closed pair with gap g (less its offset) carries the normal force -k g at the
    closest points p of the one and q of the other edge, p - q = g n: the gradient of
    k g²/2, with net force and net moment zero. Friction is the force of a spring between
    two stick points, points of the edges that start as p and q and that Coulomb's limit drags
    along. What separates them beside g n is a vector d = ds u - dt v of the edges u and
    v; friction T = -k_t d acts at the stick points, and its couple g n x T is borne by forces
    ± h n at the ends of the edges, h u + h' v = g T. That is the gradient of k_t d²/2.

    Where k falls along an edge, so does the energy of both springs: it pushes the crossing there by
    a force along the edges, Q, with a couple like that of friction. Both are parts of the gradient.

    The normal force follows from where the edges are now: a pair carries where they cross between
    their ends, with the stiffness of that place. It begins at a gap that was open, or where another
    one leaves an edge that goes on. Edges that come in from the side, inside each other already,
    are those of bodies that touch elsewhere: they carry from the depth on at which they came. What
    springs lose where a crossing fades out or leaves its edges is counted. Anchors pass on to
    the crossing that takes over.

    All arrays are changed where they are, and must stay there. What a pair keeps is declared in
    kernels.build.pair_rows.

    Args:
        pairs: :class:`~mufe_fenicsx.contact.pairs.edge_pairs.EdgePairs`.
        edges: Their edges: ``ends`` and ``beyond``, as in kernels.contact.edge_search; ``area``
            that stands for one [m²] and compliance ``layer`` c h/E* [m/Pa], shape (num_edges,);
            ``share``, part of the stiffness that acts at their ends, (num_edges, 2);
            ``compliance``, relative one of these [m/N], (num_edges,).
        friction: Static and kinetic coefficients, shape (n, 2), as of :class:`~.pairs.PairForces`.
        x: Positions [m], shape (num_nodes, 3).
        f: Forces on these nodes [N].

    Raises:
        ValueError: An array is of another type, or not contiguous.
    """

    def __init__(self, pairs, edges, friction, x, f):
        real, short = np.float64, np.int32
        num = self._num_pairs = pairs.next_check.size
        self._found = np.zeros(4)
        self._found_at = address(self._found)
        self._pointers = Pointers(
            (pairs.state, real), (pairs.next_check, real), (np.empty(2 * num + 1, short), short),
            (x, real), (f, real), (friction, real), *arrays_of(edges),
        )  # fmt: skip
        pointer, number, integer = ctypes.c_void_p, ctypes.c_double, ctypes.c_int64
        library = load("edges")
        self._add = library.mufe_add_edge_forces
        self._add.argtypes = [pointer, pointer, number, integer, integer]
        self._add.restype = None
        self._find = library.mufe_find_springs
        self._find.argtypes = [pointer, pointer, pointer, number, number, integer]
        self._find.restype = integer
        self._look = library.mufe_areas_and_pushes
        self._look.argtypes = [pointer, pointer, pointer, pointer, integer]
        self._look.restype = None

    def __call__(self, bound, accept):
        """Add the forces at the positions ``x`` to ``f``.

        Args:
            bound: Of all relative motion so far [m].
            accept: True to accept every overlap (start of a test).

        Returns:
            Energy dissipated [J]; energy that springs lost where crossings changed [J]; number of
            accepted pairs; largest accepted depth [m].
        """
        self._add(self._pointers.table, self._found_at, bound, self._num_pairs, accept)
        dissipated, switched, accepted, deepest = self._found.tolist()
        return dissipated, switched, int(accepted), deepest

    def springs(self, margin, bound):
        """Pairs that are closed or can close by a motion of ``margin`` [m], and their stiffness.

        Crossings that come between edges and facets by such a motion count too, an upper bound.

        Returns:
            Pairs, shape (n,); stiffness [N/m], shape (n,).
        """
        on, k = np.empty(self._num_pairs, np.int64), np.empty(self._num_pairs)
        outputs = address(on, np.int64), address(k)
        n = self._find(self._pointers.table, *outputs, margin, bound, self._num_pairs)
        return on[:n], k[:n]

    def areas_and_pushes(self, on):
        """Areas that the closed crossings ``on`` stand for, and their forces along edges.

        Returns:
            Areas [m²], shape (n,); q, r and Q: the force Q = q u + r v [N] on the first edge u, its
            opposite on the second edge v, shape (n, 5).
        """
        on = np.ascontiguousarray(on, np.int64)
        area, pushes = np.empty(on.size), np.empty((on.size, 5))
        outputs = address(area), address(pushes)
        self._look(self._pointers.table, *outputs, address(on, np.int64), on.size)
        return area, pushes


def arrays_of(edges):
    """Arrays of edges and their types, as in edge_springs.h."""
    real, short = np.float64, np.int32
    return (
        (edges.ends, short), (edges.beyond, short), (edges.area, real), (edges.layer, real),
        (edges.share, real), (edges.compliance, real),
    )  # fmt: skip


def edge_energy(state, closed):
    """:func:`~.pairs.pair_energy` of crossing edges."""
    return energy_of_rows("edges", EDGE_PAIR, state, closed)
