"""Forces on opened facets, their energies, and the search of facets that are strained enough.

A facet has three points, one at each corner: with forces there two sides cannot move against each
other without one, and the points of a node stay joined pair by pair. Its frame turns with the mean
of both sides; areas are the first ones. The law of a point is in kernels/cracks/law.h.

A facet opens where its effective traction reaches its strength, of the mean stress of both cells by
their volume: √(t_n² + (t_t/β)²) where it is pulled, ⟨|t_t| - μ|t_n|⟩/β where it is pressed. What no
plane of a cell exceeds says which facets are looked at: a convex function of the stress that is
nowhere less.
"""

import ctypes

import numba
import numpy as np

from ..build.native import Pointers, address, load

#: What a point keeps, in the order of ``point_type`` in law.h.
OF_POINT = (
    "open", "start_n", "start_1", "start_2", "strength", "ultimate", "stiffness", "furthest",
    "anchor_1", "anchor_2", "pull_1", "pull_2", "held", "damper", "drag_x", "drag_y", "drag_z",
    "rubbed", "damped",
)  # fmt: skip
POINT = np.dtype([(name, float) for name in OF_POINT])
#: Energies of :meth:`CrackForces.energies`. The last is what springs held as points opened, which
#: nothing gave, as a negative number: less of it where points have softened, in whose energy it is.
ENERGIES = ("stored", "fracture", "friction", "damping", "opening")


@numba.njit(cache=True)
def least_beside(least, across, values):
    """Lower ``least`` of cells, shape (num_cells,), to the values of the facets beside, in place.

    Args:
        across: Cells on both sides of each facet, int32, shape (num_facets, 2).
        values: Of the facets, shape (num_facets,).
    """
    for f in range(values.size):
        for k in range(2):
            least[across[f, k]] = min(least[across[f, k]], values[f])


class CrackForces:
    """Opened facets; local. All arrays are changed where they are, and must stay there.

    Args:
        nodes: Of the corners on one side, then on the other in the same order, seen from outside
            of the first, int32, shape (num_facets, 6).
        area: First areas [m²], shape (num_facets,).
        friction: Coefficients μ of what is pressed, shape (num_facets,).
        points: Of type :data:`POINT`, shape (num_facets, 3).
        shear: β, shear over tensile strength.
    """

    def __init__(self, nodes, area, friction, points, shear):
        self.nodes, self._num, self._shear = nodes, len(nodes), shear
        self._found = np.zeros(len(ENERGIES))
        real = np.float64
        self._pointers = Pointers(
            (nodes, np.int32), (area, real), (friction, real), (points, POINT)
        )  # fmt: skip
        pointer, number, integer = ctypes.c_void_p, ctypes.c_double, ctypes.c_int64
        library = _library()
        self._add = library.mufe_add_cracks
        self._add.argtypes = [pointer, number, pointer, pointer, pointer, number, integer]
        self._add.restype = None
        self._energies = library.mufe_crack_energies
        self._energies.argtypes = [pointer, number, pointer, pointer, integer]
        self._energies.restype = None
        self._leave = library.mufe_leave_cracks
        self._leave.argtypes = [pointer, number, *[pointer] * 3, integer]
        self._leave.restype = number
        self._begin = library.mufe_begin_cracks
        self._begin.argtypes = [pointer, number, *[pointer] * 3, integer]
        self._begin.restype = None

    def add(self, f, x, v, dt):
        """Add the forces after a step ``dt`` [s]; with 0 nothing else changes.

        Args:
            f: Forces [N], shape (num_nodes, 3).
            x, v: Positions [m], and velocities that led there [m/s], of that shape.
        """
        self._add(
            self._pointers.table, self._shear, address(x), address(v), address(f), dt, self._num
        )

    def energies(self, x):
        """:data:`ENERGIES` since the facets opened [J], shape (5,)."""
        self._found[:] = 0.0
        self._energies(
            self._pointers.table, self._shear, address(x), address(self._found), self._num
        )
        return self._found.copy()

    def begin(self, which, traction, x):
        """Let points bear a traction from now on, as what they have in common moves at ``x``.

        Args:
            which: 3 facet + corner, int64, shape (n,).
            traction: That on the first side [Pa], shape (n, 3).
            x: As of :meth:`add`.
        """
        self._begin(
            self._pointers.table, self._shear, address(x), address(which, np.int64),
            address(traction), which.size,
        )  # fmt: skip

    def leave(self, which, x):
        """Let facets bear no more.

        Args:
            which: Of them, int64, shape (n,).
            x: As of :meth:`add`.

        Returns:
            Mean tractions on their first sides until now [Pa], shape (n, 3), and what their springs
            held, which is in none of :data:`ENERGIES` any more [J].
        """
        traction = np.zeros((which.size, 3))
        held = self._leave(
            self._pointers.table, self._shear, address(x), address(which, np.int64),
            address(traction), which.size,
        )  # fmt: skip
        return traction, held


class FacetSearch:
    """Facets between cells of which some may open; local. Arrays stay where they are.

    Now and then :meth:`watch` lists the facets that have come near their strength; others are not
    looked at.

    Args:
        cells: Nodes of the cells, int32, shape (num_cells, 4).
        volume: Their first volumes [m³], shape (num_cells,).
        weakest: Least strength of the closed facets of each cell [Pa], inf for none, (num_cells,).
        across: Cells on both sides of each facet, int32, shape (num_facets, 2).
        corner: Corners of the first one that are those of the facet, uint8, (num_facets, 3).
        strength: Of the facets [Pa], inf where one is open or never opens, (num_facets,).
        friction: Their μ, shape (num_facets,).
        softens: From which effective traction on they open at once [Pa], (num_facets,).
        near: Which facets of cells came near at the last :meth:`watch`, in bits, uint8, shape
            (num_cells,).
        shear: As of :class:`CrackForces`.
        averaged: Whether ``pressure`` is that of nodes.

    Attributes:
        num_listed: Facets that are looked at.
    """

    def __init__(
        self, cells, volume, weakest, across, corner, strength, friction, near, softens, shear,
        averaged,
    ):  # fmt: skip
        real, short, whole = np.float64, np.uint8, np.int64
        self._found, listed = np.empty((2, len(across)), whole)
        self._sizes, self._shear, self._averaged = (len(cells), len(across)), shear, averaged
        self._friction = friction.min(initial=np.inf)
        self._pointers = Pointers(
            (cells, np.int32), (volume, real), (weakest, real), (across, np.int32),
            (corner, short), (strength, real), (friction, real), (near, short), (listed, whole),
            (softens, real), (self._found, whole),
        )  # fmt: skip
        library, pointer, integer = _library(), ctypes.c_void_p, ctypes.c_int64
        self._find, self._list = library.mufe_find_strained, library.mufe_list_near
        again, number = library.mufe_list_again, ctypes.c_double
        self._find.argtypes = [*[pointer] * 4, number, integer, integer, pointer]
        self._now = np.zeros(1, whole)
        self._list.argtypes = [*[pointer] * 4, number, number, *[integer] * 3]
        again.argtypes = [pointer, integer]
        for function in (self._find, self._list, again):
            function.restype = integer
        self.num_listed = again(self._pointers.table, len(across))

    def watch(self, deviator, pressure, x):
        """List the facets near their strength; arguments as of a call."""
        self.num_listed = self._list(
            self._pointers.table, address(deviator), address(pressure), address(x), self._shear,
            self._friction, *self._sizes, self._averaged,
        )  # fmt: skip

    def __call__(self, deviator, pressure, x):
        """Listed facets that are strained enough to open, increasing, and how many do so at once.

        Args:
            deviator: Of the cells [Pa], xx yy zz xy yz xz, shape (num_cells, 6).
            pressure: Mean stress of nodes, or of cells [Pa], tension positive.
            x: Positions [m], shape (num_nodes, 3).
        """
        count = self._find(
            self._pointers.table, address(deviator), address(pressure), address(x), self._shear,
            self.num_listed, self._averaged, address(self._now, np.int64),
        )  # fmt: skip
        return self._found[:count].copy(), int(self._now[0])


def _library():
    return load("cracks")
