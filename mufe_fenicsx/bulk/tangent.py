"""Tangent of the grains' internal forces, from DOLFINx forms.

The forces are those of the time steps, kernels.bulk.solid: deviator t of the Kirchhoff stress by a
midpoint increment with rotation and radial return, mean stress p = K ln J of nodes or elements.
Written in the reference configuration, for one increment from u0 to u,

    r(u; v) = ∫ (t + (J p + G e³) I) F⁻ᵀ : grad v dX,    F = I + grad u,  J = det F,
    L = grad(u - u0) (I + grad (u0 + u)/2)⁻¹,   h = G dev sym L,   Q = skew L / 2,
    R = I + 2/(1 + |q|²) (Q + Q Q),             t_trial = R (t0 + h) Rᵀ + h,
    t = (1 - 3 G dp/m) t_trial,                 m = √(3/2 t_trial : t_trial),

q the axial vector of Q; e = 1 - 1/J is of grains that can flow, but for plain elements. UFL
differentiates this, which gives the consistent tangent (J. C. Simo, R. L. Taylor, Comput. Methods
Appl. Mech. Eng. 48, 1985, 101-118) with all derivatives of the rotation. dp is a line in m and p
through the increment that the law gave, with the law's slopes.

A neo-Hookean grain has t = G J^(-2/3) dev F Fᵀ instead (kernels.bulk.neo_hooke).

The mean stress adds G D Bᵀ: Bᵀ, a form too, is the derivative of the volumes that J belongs to, D
that of p by them, and G that of the forces by p (equal to B where flow does not depend on p).
Averaged over nodes it joins neighbours of neighbours; all of that is inside a grain, and a rank.
"""

from typing import NamedTuple

import h5py  # noqa: F401  before dolfinx.fem.petsc, whose HDF5 has no compression
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem.petsc import assemble_matrix, create_matrix
from dolfinx.la import BlockMode

from ..kernels.build.blocks import add_products, find_slots, joined_pattern
from ..kernels.build.compiled_forms import compiled_form
from ..kernels.bulk.hardening import plastic_increment
from ..kernels.bulk.law_slopes import law_slopes, law_slopes_of
from .solid import von_mises

#: Keeps the derivative of the von Mises stress finite where there is no stress, over shear modulus.
TINY = 1e-14


class _Increment(NamedTuple):
    """What the law gave over an increment, as functions of DOLFINx."""

    stress: fem.Function  #: deviator at its start [Pa], xx yy zz xy yz xz
    shear: fem.Function  #: modulus [Pa]
    own: fem.Function  #: G of e³ [Pa]
    increment: fem.Function  #: of the plastic strain
    trial: fem.Function  #: von Mises stress without flow [Pa]
    by_trial: fem.Function  #: derivative of the increment by that [1/Pa]
    by_mean: fem.Function  #: and by the mean stress [1/Pa]
    mean: fem.Function  #: mean stress [Pa]
    mean_of_law: fem.Function  #: that which the law was given [Pa]
    neo_hookean: fem.Function | None  #: 1 in such grains, else 0; None: there are none


class SolidTangent:
    """Derivative of this rank's internal forces by its displacements. Collective when made.

    Args:
        solid: :class:`~mufe_fenicsx.bulk.solid.Solid`, all of whose grains deform.

    Attributes:
        offset, columns: Compressed rows of 3 × 3 blocks, a row for each node of the mesh.
        diagonal: Place of each node's own block, shape (num_nodes,).
        residual: The form r(u; v): forces on nodes [N] with the opposite sign.
    """

    def __init__(self, solid):
        self.solid, self.mesh = solid, solid.mesh
        mesh = self.mesh
        # Displacements now and at the start of the increment [m].
        self._u, self._u0 = u, u0 = fem.Function(mesh.V), fem.Function(mesh.V)
        cells = fem.functionspace(mesh.mesh, ("DG", 0))
        self._averaged = solid.element == "averaged"
        volumes = fem.functionspace(mesh.mesh, ("Lagrange", 1)) if self._averaged else cells
        stress = fem.Function(fem.functionspace(mesh.mesh, ("DG", 0, (6,))))
        spaces = [cells] * 6 + [volumes] * 2
        rubber = None
        if mesh.comm.allreduce(solid.hyperelastic.grains.size):
            is_rubber = np.isin(mesh.grain_of_cell, solid.hyperelastic.grains)
            rubber = mesh.cell_function(is_rubber.astype(float))
        self._law = _Increment(stress, *(fem.Function(space) for space in spaces), rubber)
        for function, modulus in ((self._law.shear, solid.shear), (self._law.own, solid.own)):
            function.x.array[mesh.cell_order] = modulus[mesh.grain_of_cell]
        test, step = ufl.TestFunction(mesh.V), ufl.TrialFunction(mesh.V)
        weight = ufl.TestFunction(volumes)

        def forces(v):
            return _internal_work(v, u, u0, self._law) * ufl.dx

        J = ufl.det(ufl.Identity(3) + ufl.grad(u))
        self.residual = compiled_form(forces(test))
        self._forms = [
            compiled_form(ufl.derivative(forces(test), u, step)),
            compiled_form(ufl.derivative(J * weight * ufl.dx, u, step)),
        ]
        # Where flow does not depend on the mean stress, G is B.
        self._coupled = any(law is not plastic_increment for law, _ in solid.laws)
        if self._coupled:
            self._forms.append(compiled_form(ufl.derivative(forces(step), self._law.mean, weight)))
        # DOLFINx's own matrices cannot have blocks that are not square.
        self._bulk = fem.create_matrix(self._forms[0], BlockMode.compact)
        self._by_volume, *self._by_mean = (create_matrix(form) for form in self._forms[1:])
        self._make_pattern(volumes)

    def _make_pattern(self, volumes):
        """Where the blocks of all terms go."""
        mesh, of_dof = self.mesh, self.mesh.node_of_dof
        bulk = self._bulk
        _values_of(self._by_volume, self._forms[1])  # entries appear as they are set
        indptr, columns = _local_rows(self._by_volume)[:2]
        # Rows of volumes: nodes or cells.
        num_rows = indptr.size - 1
        row = np.empty(num_rows, dtype=np.int64)
        if self._averaged:
            row[volumes.dofmap.list] = of_dof[mesh.V.dofmap.list]
        else:
            row[mesh.cell_order] = np.arange(num_rows)
        self._row_of_volume = row
        entry_row = np.repeat(row, np.diff(indptr))
        columns = 3 * of_dof[columns // 3].astype(np.int64) + columns % 3
        key, entry = np.unique(entry_row * mesh.num_nodes + columns // 3, return_inverse=True)
        self._entry = 3 * entry + columns % 3
        self._node = (key % mesh.num_nodes).astype(np.int32)
        self._first = np.searchsorted(key // mesh.num_nodes, np.arange(num_rows + 1))
        rows = np.repeat(of_dof.astype(np.int64), np.diff(bulk.indptr))
        columns, by_row = of_dof[bulk.indices], np.argsort(rows, kind="stable")
        offset = np.searchsorted(rows[by_row], np.arange(mesh.num_nodes + 1))
        self.offset, self.columns = joined_pattern(
            self._first, self._node, offset, columns[by_row], mesh.num_nodes
        )
        self._bulk_slots = find_slots(self.offset, self.columns, rows, columns)
        nodes = np.arange(mesh.num_nodes)
        self.diagonal = find_slots(self.offset, self.columns, nodes, nodes.astype(np.int32))

    def take(self, state, u0, deviator0, strain0, dt):
        """Follow the increment that the forces were last evaluated for. Local.

        Args:
            state: :class:`~mufe_fenicsx.state.State` after it.
            u0, deviator0, strain0: Its displacements, deviator and plastic strain before.
            dt: Length of the increment [s].
        """
        mesh, solid, of = self.mesh, self.solid, self._law
        for function, values in ((self._u, state.u), (self._u0, u0)):
            function.x.array[:] = values[mesh.node_of_dof].ravel()
        of.stress.x.array.reshape(-1, 6)[mesh.cell_order] = deviator0
        increment = state.plastic_strain - strain0
        shear = solid.shear[mesh.grain_of_cell]
        trial = von_mises(state.deviator) + 3.0 * shear * increment
        mean = solid.shared_mean_stress()
        by_trial, by_mean = np.zeros(mesh.num_cells), np.zeros(mesh.num_cells)
        for law, grains in solid.laws:
            slopes = law_slopes if law is plastic_increment else law_slopes_of(law)
            slopes(
                by_trial, by_mean, trial, mean, strain0, increment, dt, grains, mesh.cell_offset,
                solid.shear, solid.parameters,
            )  # fmt: skip
        for function, values in (
            (of.increment, increment), (of.trial, trial), (of.by_trial, by_trial),
            (of.by_mean, by_mean),
        ):  # fmt: skip
            function.x.array[mesh.cell_order] = values
        of.mean.x.array[:] = solid.pressure[self._row_of_volume]
        of.mean_of_law.x.array[:] = of.mean.x.array

    def assemble(self, x):
        """The tangent at the positions ``x`` [m], blocks of shape (num_blocks, 3, 3). Local."""
        self._bulk.set_value(0.0)
        fem.assemble_matrix(self._bulk, self._forms[0])
        bulk = self._bulk.data
        b = g = self._grouped(_values_of(self._by_volume, self._forms[1]))
        if self._coupled:
            g = self._grouped(_values_of(self._by_mean[0], self._forms[2]))
        blocks = np.zeros((self.columns.size, 3, 3))
        blocks[self._bulk_slots] = bulk.reshape(-1, 3, 3)
        add_products(blocks, self._first, self._node, g, b, self._slope(x), self.offset,
                     self.columns)  # fmt: skip
        return blocks

    def _grouped(self, values):
        """Sums of rows that share a volume, shape (num_entries, 3)."""
        return np.bincount(self._entry, values, 3 * self._node.size).reshape(-1, 3)

    def _slope(self, x):
        """Derivative of the mean stress by its volume [Pa/m³], shape (num_volumes,)."""
        mesh, solid = self.mesh, self.solid
        if self._averaged:
            volume = np.empty(mesh.num_nodes)
            solid.kernel.nodal_volumes(volume, x)
            return solid.bulk[mesh.grain_of_node] / volume
        corners = x[mesh.cells]
        volume = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
        return solid.bulk[mesh.grain_of_cell] / volume


def _local_rows(matrix):
    """Compressed rows of this rank and their values."""
    return matrix.getDiagonalBlock().getValuesCSR()


def _values_of(matrix, form):
    matrix.zeroEntries()
    assemble_matrix(matrix, form)
    matrix.assemble()
    return _local_rows(matrix)[2]


def _internal_work(v, u, u0, of):
    """(t + (J p + G e³) I) F⁻ᵀ : grad v, with the names of the module's docstring.

    Args:
        v, u, u0: Test function, displacement now and at the start of the increment.
        of: :class:`_Increment`.
    """
    one, grad, s, shear = ufl.Identity(3), ufl.grad, of.stress, of.shear
    F = one + grad(u)
    L = grad(u - u0) * ufl.inv(one + 0.5 * grad(u0 + u))
    h, Q = shear * ufl.dev(ufl.sym(L)), 0.5 * ufl.skew(L)
    R = one + 2.0 / (1.0 + 0.5 * ufl.inner(Q, Q)) * (Q + Q * Q)
    t0 = ufl.as_matrix([[s[0], s[3], s[5]], [s[3], s[1], s[4]], [s[5], s[4], s[2]]])
    t_trial = R * (t0 + h) * R.T + h
    m = ufl.sqrt(1.5 * ufl.inner(t_trial, t_trial) + (TINY * shear) ** 2)
    dp = of.increment + of.by_trial * (m - of.trial) + of.by_mean * (of.mean - of.mean_of_law)
    t = (1.0 - 3.0 * shear * dp / m) * t_trial
    if of.neo_hookean is not None:
        of_stretch = shear * ufl.det(F) ** (-2.0 / 3.0) * ufl.dev(F * F.T)
        t = (1.0 - of.neo_hookean) * t + of.neo_hookean * of_stretch
    J = ufl.det(F)
    mean = J * of.mean + of.own * (1.0 - 1.0 / J) ** 3
    return ufl.inner((t + mean * one) * ufl.inv(F).T, grad(v))
