"""Stress update and internal forces of linear tetrahedra, grain by grain.

The Cauchy stress is split into a deviator s, integrated in time, and a mean
stress p = K ln J, which is a function of the current volume alone.

What is integrated is that of the Kirchhoff stress, t = J s, J of the element: its rate t' = 2 G
dev D in the frame that turns with the element makes t:t/4G, over the first volume, the exact
store of its power, so that no path of strains gains or loses energy, and the tangent is
symmetric (R. Hill, J. Mech. Phys. Solids 7, 1959, 209-225). The same rate of s itself lets a
vibrating, turning grain with stresses locked in gain energy exponentially.

Deviator: strain increment and spin at the midpoint of the step (T. J. R.
Hughes, J. Winget, Int. J. Numer. Methods Eng. 15, 1980, 1862-1867), so that a
rigid rotation of any size strains nothing (spins below 1e-4 turn the stress by the series of the
rotation to its second order); then a radial return (M. L. Wilkins,
Methods Comput. Phys. 3, 1964) as far as the plastic law says, by default that of von Mises
with a hardening table (kernels.bulk.hardening), or another one that the caller gives.

In rubber the deviator follows from the stretch instead (kernels.bulk.neo_hooke). The gradient of
the displacement is then that since the first places, on these; all else is the same loop.

Mean stress, where ``averaged``: J of a node is the current over the first
volume of the elements around it, and an element takes the mean of its four
nodes (J. Bonet, A. J. Burton, Commun. Numer. Methods Eng. 14, 1998, 437-449).
These forces derive from the energy sum_a V_a K (J_a ln J_a - J_a + 1).

A mean does not see how an element shares its volume with its neighbours. The deviator resists that,
but where it flows an element can shrink to nothing while the volumes at its nodes stay. So elements
that have a mean, of materials that can flow, carry the mean stress G e^3/J of their own e = 1 - 1/J
besides, from the energy sum V G (e^4/4 + e^5/5 + ...). It is nothing at small strains, where a
stiffness like that of M. A. Puso, J. Solberg (Int. J. Numer. Methods Eng. 67, 2006, 841-867) would
lock, and without bound towards J = 0. What the flow stress Y can do to an element ends at about
e = (Y/G)^(1/3).

Plain elements have a J each. Constraints where the volume is kept, in a large mesh of V vertices
and about 6 V tetrahedra: plain 6 V against 3 V unknowns, which locks; averaged V against 3 V.

Grains are the outer loop: the data of one grain stay in the cache from the pass over volumes to
the pass over stresses. The loop over elements is in C (tets.c), for its loads and stores of whole
vectors, which numba cannot be made to use; products of the tangent likewise (tets_stiffness.c).
"""

import ctypes
import functools

import numba
import numpy as np

from ..build.native import Addresses, Pointers, address, load
from ..build.rows import aligned
from .hardening import plastic_increment

# Reassociation and contraction only: NaN and infinity keep their meaning.
FAST = {"contract", "reassoc", "arcp", "nsz"}

# Unsigned indices spare the test for negative ones at each access.
U = numba.uintp

#: Over what J is taken: a tetrahedron, or the nodes.
PLAIN, AVERAGED = 0, 1


@numba.njit(cache=True, fastmath=FAST, error_model="numpy", inline="always")
def cofactors(x, a, b, c, d):
    """Six times volume times the gradients of nodes b, c, d; and six times the volume."""
    e1x, e1y, e1z = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    e2x, e2y, e2z = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
    e3x, e3y, e3z = x[d, 0] - x[a, 0], x[d, 1] - x[a, 1], x[d, 2] - x[a, 2]
    c1x, c1y, c1z = e2y * e3z - e2z * e3y, e2z * e3x - e2x * e3z, e2x * e3y - e2y * e3x
    c2x, c2y, c2z = e3y * e1z - e3z * e1y, e3z * e1x - e3x * e1z, e3x * e1y - e3y * e1x
    c3x, c3y, c3z = e1y * e2z - e1z * e2y, e1z * e2x - e1x * e2z, e1x * e2y - e1y * e2x
    det = e1x * c1x + e1y * c1y + e1z * c1z
    return c1x, c1y, c1z, c2x, c2y, c2z, c3x, c3y, c3z, det


#: Doubles of scratch that tets.c needs for each node of the largest grain, and besides.
SCRATCH, BESIDES = 13, 32


class InternalForces:
    """Advances the stress by one step and subtracts the internal forces; local.

    Args:
        cells: Nodes of the elements, those of a grain together, int32, shape (num_cells, 4).
        volume0: Written: first volumes of the elements [m³], shape (num_cells,).
        cell_offset: First element of each grain, int64, shape (num_grains + 1,).
        first_node, num_nodes: First node of each grain, whose nodes are numbered in a row, and
            their number, shape (num_grains,).
        bulk, shear: Moduli of the grains [Pa], shape (num_grains,).
        own: The G of (1 - 1/J)^3, 0 of grains without it [Pa], shape (num_grains,).
        parameters: Of the plastic law of all grains, shape (num_grains, m); the first is the least
            von Mises stress of t at which the material can yield [Pa].
        pressure: Written at each call: mean stress of nodes (of elements unless ``AVERAGED``)
            [Pa], tension positive, shape (max(num_nodes, num_cells),).
        element: ``PLAIN`` or ``AVERAGED``.
        x: First positions [m], shape (num_nodes, 3), kept.

    Attributes:
        node_volume0: First volumes around the nodes [m³], shape (num_nodes,).
    """

    def __init__(self, cells, volume0, cell_offset, first_node, num_nodes, bulk, shear, own,
                 parameters, pressure, element, x):  # fmt: skip
        real, whole = np.float64, np.int64
        self.node_volume0 = np.empty(x.shape[0])
        largest = int(num_nodes.max(initial=0))
        arrays = [
            np.ascontiguousarray(array, dtype)
            for array, dtype in (
                (cells, np.int32), (volume0, real), (cell_offset, whole), (first_node, whole),
                (num_nodes, whole), (self.node_volume0, real), (bulk, real), (shear, real),
                (own, real), (parameters, real), (np.empty(2 * parameters.shape[1] + 2), real),
                (aligned(SCRATCH * largest + BESIDES), real), (pressure, real),
            )
        ]  # fmt: skip
        for name, array, at in (("volume0", volume0, 1), ("pressure", pressure, -1)):
            if arrays[at] is not array:
                raise ValueError(f"{name}: {array.dtype}, expected contiguous float64")
        self._pointers = Pointers(*((array, array.dtype) for array in arrays))
        self._model = self._pointers.table
        self._row, self._element = parameters.shape[1], element
        self._first = np.ascontiguousarray(x, real)
        self._at_first = address(self._first)
        self._addresses = Addresses(*[real] * 6, whole)
        library, pointer, integer = load("tets"), ctypes.c_void_p, ctypes.c_int64
        self._volumes, self._num_grains = library.mufe_nodal_volumes, first_node.size
        self._volumes.argtypes = [pointer, pointer, pointer, integer]
        self._volumes.restype = None
        of_elements = library.mufe_volumes
        of_elements.argtypes, of_elements.restype = self._volumes.argtypes, None
        of_elements(self._model, address(volume0), self._at_first, self._num_grains)
        self.nodal_volumes(self.node_volume0, x)
        self._stiffness = load("tets_stiffness").mufe_add_stiffness
        self._stiffness.argtypes = [*[pointer] * 5, integer, integer]
        self._stiffness.restype = None
        self._call = library.mufe_add_internal_forces
        self._call.argtypes = [*[pointer] * 8, ctypes.c_double, *[integer] * 3, *[pointer] * 2]
        self._call.restype = integer

    def nodal_volumes(self, volume, x):
        """Volumes around all nodes [m³] at positions ``x``, into ``volume``, shape (num_nodes,).

        Summed up as in each step, so that those of a grain at rest are its first ones.
        """
        self._volumes(self._model, address(volume), address(x), self._num_grains)

    def add_stiffness(self, y, q, x, grains):
        """Add K q of some grains to ``y``, in place: the elastic tangent at the positions ``x``.

        The stress that is there already (geometric stiffness) is left out: it is of
        the order stress/E beside the elastic terms.

        Args:
            y: Forces [N], shape (num_nodes, 3).
            q: Displacements [m], shape (num_nodes, 3).
            x: Positions [m], shape (num_nodes, 3).
            grains: Grains to work on, int64, shape (n,).
        """
        self._stiffness(
            self._model, address(y), address(q), address(x), address(grains, np.int64),
            grains.size, self._element,
        )  # fmt: skip

    def __call__(self, f, deviator, strain, work, x, v, dt, grains, increment=plastic_increment,
                 stretch=False):  # fmt: skip
        """One step of some grains, in place.

        Args:
            f: Nodal forces [N], shape (num_nodes, 3).
            deviator: Deviator t of the Kirchhoff stress [Pa], xx yy zz xy yz xz, shape
                (num_cells, 6).
            strain: Equivalent plastic strain, shape (num_cells,).
            work: Plastic work so far [J], shape (num_cells,).
            x: Positions at the end of the step [m], shape (num_nodes, 3).
            v: Velocities that led there [m/s], shape (num_nodes, 3).
            dt: Length of that step [s].
            grains: Grains to work on, int64, shape (n,).
            increment: Their law of plastic flow, compiled by numba: as
                :func:`.hardening.plastic_increment` it takes the trial von Mises stress, the mean
                stress (tension positive) [Pa], the plastic strain so far, the time step [s], the
                shear modulus [Pa] and the material's parameters, and returns the increment dp >= 0
                of the plastic strain. Flow keeps the volume and points along the deviator: the
                stress goes back to q - 3 G dp.
            stretch: Whether their deviator follows from the stretch at ``x``, as in rubber; it
                depends on nothing else, and none flows.

        Returns:
            The last element whose volume is not positive, or -1.
        """
        law = None if increment is plastic_increment else _c_function(increment, self._row)
        return self._call(
            self._model, *self._addresses(f, deviator, strain, work, x, v, grains), dt,
            grains.size, self._row, self._element,
            law and law.address, self._at_first if stretch else None,
        )  # fmt: skip


@functools.cache
def _c_function(increment, num_parameters):
    """A plastic law for C."""
    real = numba.float64

    @numba.cfunc(real(real, real, real, real, real, numba.types.CPointer(real)))
    def law(q, mean, alpha, dt, shear, parameters):
        return increment(q, mean, alpha, dt, shear, numba.carray(parameters, num_parameters))

    return law
