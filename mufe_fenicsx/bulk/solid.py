"""The bulk of the grains: mass, internal forces, energies and stable time step."""

import numpy as np
import ufl
from dolfinx import fem

from ..errors import InputError, shown
from ..kernels.build.compiled_forms import compiled_form
from ..kernels.build.native import SOURCES, load
from ..kernels.bulk.element_step import add_nodal_stiffness, element_time_step
from ..kernels.bulk.energy import add_normal_stresses, elastic_energy
from ..kernels.bulk.hardening import plastic_increment
from ..kernels.bulk.solid import AVERAGED, PLAIN, InternalForces
from ..kernels.contact.edge_compliance import add_edge_compliance, cells_around, largest_patch
from ..machine.ranks import on_first_rank
from ..materials.auto import Auto
from ..materials.rigid import Rigid
from ..state import ForceTerm
from .neo_hookean import NeoHookeanGrains

#: Elements by name: averaged nodal pressure, and plain linear tetrahedra.
ELEMENTS = {"averaged": AVERAGED, "p1": PLAIN}

#: An element whose time step falls to this part of the first smallest one has collapsed.
COLLAPSED = 0.02


def lumped_mass(mesh, density):
    """Nodal masses [kg] by row sums of the mass matrix, as a DOLFINx form. Collective.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        density: Densities of this rank's grains [kg/m³], shape (num_grains,).

    Returns:
        Masses of the nodes of version 0 of the mesh.
    """
    view = mesh.first_view
    rho = fem.Function(fem.functionspace(view.mesh, ("DG", 0)))
    rho.x.array[view.cell_order] = density[mesh.grain_of_cell]
    test = ufl.TestFunction(view.V)
    masses = compiled_form(rho * ufl.inner(ufl.as_vector((1.0, 1.0, 1.0)), test) * ufl.dx)
    return fem.assemble_vector(masses).array.reshape(-1, 3)[:, 0].copy()


def shared_mass(mesh, mass, volume):
    """Nodal masses [kg] where parts of a node share its mass as the volume around each. Local.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        mass: Of the nodes of version 0 [kg].
        volume: Of the cells in their reference places [m³], shape (num_cells,).

    Returns:
        Masses, shape (num_nodes,).
    """
    origin = mesh.origin
    if origin is None:
        return mass.copy()
    parted = np.bincount(origin)[origin] > 1
    rows = mesh.cells_of(np.unique(mesh.grain_of_node[parted]))
    nodes, of_corner = mesh.cells[rows].ravel(), np.repeat(volume[rows], 4)
    mine = parted[nodes]
    nodes, of_corner = nodes[mine], of_corner[mine]
    whole = np.bincount(origin[nodes], of_corner, mass.size)[origin[parted]]
    shared = mass[origin]
    shared[parted] *= np.bincount(nodes, of_corner, mesh.num_nodes)[parted] / whole
    return shared


class Solid(ForceTerm):
    """Elastic or elasto-plastic grains of one rank; rigid ones cost nothing here.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        materials: One material (with ``bulk_modulus``, ``shear_modulus``, ``rho``,
            ``wave_speed``, ``contact_modulus``, ``plastic_increment``, ``parameters()``) for
            each grain of this rank.
        element: One of :data:`ELEMENTS`.
        before: That of the mesh that this one has grown from; None: it has not grown.

    Raises:
        InputError: There is no such element, or there is no C compiler.
    """

    def __init__(self, mesh, materials, element="averaged", before=None):
        self.mesh = mesh
        if not isinstance(element, str) or element not in ELEMENTS:
            raise InputError(f"element = {shown(element)}, expected one of {', '.join(ELEMENTS)}")
        self.element = element
        self.materials = materials
        self.bulk = np.array([m.bulk_modulus for m in materials])
        self.shear = np.array([m.shear_modulus for m in materials])
        flows = [element != "p1" and np.isfinite(m.parameters()[0]) for m in materials]
        #: G of what keeps each element's own volume, shape (num_grains,).
        self.own = np.where(np.array(flows, dtype=bool), self.shear, 0.0)
        self.wave_speed = np.array([m.wave_speed for m in materials])
        self.parameters = _rows([m.parameters() for m in materials])
        self.largest_plastic_strain = np.array([m.largest_plastic_strain for m in materials])
        x = mesh.x
        self.volume0 = np.empty(mesh.num_cells)
        self.pressure = np.zeros(max(mesh.num_nodes, mesh.num_cells))
        _compile_once(mesh.comm)
        self.kernel = InternalForces(
            mesh.cells, self.volume0, mesh.cell_offset, mesh.nodes[mesh.node_offset[:-1]],
            np.diff(mesh.node_offset), self.bulk, self.shear, self.own, self.parameters,
            self.pressure, ELEMENTS[element], x,
        )  # fmt: skip
        #: Masses of the nodes of version 0 of the mesh [kg].
        self.first_mass = (
            lumped_mass(mesh, np.array([m.rho for m in materials]))
            if before is None
            else before.first_mass
        )
        self.mass = shared_mass(mesh, self.first_mass, self.volume0)
        self.inverted = -1  #: an element of this rank that turned inside out, or -1
        #: Grains that deform now or later, shape (num_deformable,).
        self.deformable = np.flatnonzero([not isinstance(m, Rigid) for m in materials])
        self.first_time_step = (
            self.element_time_step(x) if before is None else before.first_time_step
        )
        self.hyperelastic = NeoHookeanGrains(self, [m.hyperelastic for m in materials])
        self.set_deforming(np.flatnonzero([not isinstance(m, Rigid | Auto) for m in materials]))

    @property
    def contact_modulus(self):
        """E/(1 - nu²) of the grains [Pa], shape (num_grains,)."""
        return np.array([m.contact_modulus for m in self.materials])

    @property
    def tangential_ratio(self):
        """Tangential over normal stiffness of contacts of the grains (Mindlin), (num_grains,)."""
        return np.array([2 * (1 - m.nu) / (2 - m.nu) for m in self.materials])

    def state_dict(self):
        """Pressure of the nodes, or of the tetrahedra, as the element has it."""
        if self.element == "averaged":
            return {"nodes": {"pressure": self.pressure[: self.mesh.num_nodes]}}
        return {"cells": {"pressure": self.pressure[: self.mesh.num_cells]}}

    def load_state_dict(self, kept):
        """Take the pressure."""
        for values in kept.values():
            self.pressure[: len(values["pressure"])] = values["pressure"]

    def set_deforming(self, grains):
        """Say which grains deform; the others cost nothing, and keep their stress. Local.

        Args:
            grains: Local indices, increasing, shape (num_deforming,).
        """
        self.grains = grains  #: grains that deform, shape (num_deforming,)
        increments = [m.plastic_increment or plastic_increment for m in self.materials]
        self.laws = _laws(self.hyperelastic.others(grains), increments)

    def begin_forces(self, f, state, dt):
        """Subtract the internal forces; an element that turned inside out is :attr:`inverted`."""
        bad = self.add_internal_forces(f, state, dt)
        if bad >= 0:
            self.inverted = bad

    def add_internal_forces(self, f, state, dt, among=None):
        """Advance the stress of ``state`` by ``dt`` and subtract the internal forces from ``f``.

        Args:
            f, state, dt: As of :meth:`begin_forces`.
            among: Local grains, of which those that deform take part; None: all that deform.

        Returns:
            An inverted element, or -1. Local.
        """
        bad = -1
        laws, rubber = self.laws, self.hyperelastic.grains
        if among is not None:
            laws = [(law, grains[np.isin(grains, among)]) for law, grains in laws]
            rubber = rubber[np.isin(rubber, among)]
        for increment, grains in laws:
            found = self.kernel(
                f, state.deviator, state.plastic_strain, state.plastic_work, state.x, state.v,
                dt, grains, increment,
            )  # fmt: skip
            bad = max(bad, found)
        if rubber.size:
            bad = max(bad, self.hyperelastic.add_forces(f, state, rubber))
        return bad

    def add_stiffness(self, y, q, x):
        """Add the elastic tangent at positions ``x`` times ``q`` to ``y``. Local."""
        self.kernel.add_stiffness(y, q, x, self.deformable)

    def element_time_step(self, x):
        """Proven bound of the stable time step from single elements [s], inf without any. Local."""
        return self.worst_element(x)[0]

    def worst_element(self, x):
        """That bound [s] at positions ``x``, and the element that asks for it, or -1. Local."""
        m = self.mesh
        return element_time_step(x, m.cells, self.deformable, m.cell_offset, self.wave_speed)

    def nodal_stiffness(self, x):
        """What the elements resist each node with, moved alone [N/m], shape (num_nodes,). Local.

        The mean of three directions at the positions ``x``, (M + 2 G)/3 the modulus.
        """
        m, found = self.mesh, np.zeros(self.mesh.num_nodes)
        modulus = (self.bulk + 10.0 / 3.0 * self.shear) / 3.0
        add_nodal_stiffness(found, x, m.cells, self.deformable, m.cell_offset, modulus)
        return found

    def edge_compliance(self, ends, direction):
        """Relative compliance of the two ends of edges, elastic, as they are at the start. Local.

        Args:
            ends: Nodes, shape (num_edges, 2).
            direction: Unit vectors of the two opposite forces, shape (num_edges, 3).

        Returns:
            By how much the ends part along these under opposite unit forces [m/N], shape
            (num_edges,), as of kernels.contact.edge_compliance.add_edge_compliance; zero for rigid
            grains.
        """
        m = self.mesh
        compliance, averaged = np.zeros(len(ends)), self.element == "averaged"
        soft = np.isin(m.grain_of_node[ends[:, 0]], self.deformable)
        if not soft.any():
            return compliance
        some = ends[soft]
        rows = m.cells_of(np.unique(m.grain_of_node[some[:, 0]]))
        cells = m.cells[rows]
        volume = self.kernel.node_volume0 if averaged else self.volume0[rows]
        place, places = np.full(m.num_nodes, -1), np.full(volume.size, -1)
        free = np.empty(m.num_nodes, np.int64)
        offset, around = cells_around(cells, m.num_nodes)
        n, num = largest_patch(place, free, some, cells, offset, around, averaged)
        found, volumes = np.zeros(len(some)), np.empty(num, np.int64)
        add_edge_compliance(
            found, np.empty((3 * n, 3 * n)), np.empty((num, 3 * n)), free, place, places, volumes,
            some, direction[soft], m.x, cells, offset, around, m.grain_of_cell[rows], self.bulk,
            self.shear, volume, averaged,
        )  # fmt: skip
        compliance[soft] = found
        return compliance

    def elastic_energy(self, state):
        """Elastic energy of each grain [J], shape (num_grains,). Local."""
        m = self.mesh
        energy = np.zeros(m.num_grains)
        volume = np.empty(m.num_nodes)
        self.kernel.nodal_volumes(volume, state.x)
        elastic_energy(
            energy, state.deviator, state.x, m.cells, self.volume0, self.grains, m.cell_offset,
            m.nodes, m.node_offset, self.kernel.node_volume0, volume, self.bulk,
            self.hyperelastic.quadratic_shear, self.own, ELEMENTS[self.element],
        )  # fmt: skip
        self.hyperelastic.add_energy(energy, state.x)
        return energy

    def plastic_energy(self, state):
        """Plastic work of each grain's cells so far [J], shape (num_grains,). Local."""
        return np.add.reduceat(state.plastic_work, self.mesh.cell_offset[:-1])

    def shared_mean_stress(self, cells=slice(None)):
        """That of nodes, which ``cells`` share, or their own [Pa], shape (num_cells,). Local."""
        if self.element == "averaged":
            return self.pressure[self.mesh.cells[cells]].mean(axis=1)
        return self.pressure[: self.mesh.num_cells][cells].copy()

    def mean_stress(self, state, cells=slice(None)):
        """Mean Cauchy stress of ``cells`` [Pa], tension positive, shape (num_cells,). Local."""
        J, own = self._volume_ratio(state, cells), self.own[self.mesh.grain_of_cell[cells]]
        return self.shared_mean_stress(cells) + own * (1 - 1 / J) ** 3 / J

    def _volume_ratio(self, state, cells):
        x = state.x[self.mesh.cells[cells]]
        return np.linalg.det(x[:, 1:] - x[:, :1]) / (6 * self.volume0[cells])

    def deviator(self, state, cells=slice(None)):
        """Deviator of the Cauchy stress of ``cells`` [Pa], xx yy zz xy yz xz. Local.

        Shape (num_cells, 6).
        """
        return state.deviator[cells] / self._volume_ratio(state, cells)[:, None]

    def stress(self, state, cells=slice(None)):
        """Cauchy stress of ``cells`` [Pa], xx yy zz xy yz xz, shape (num_cells, 6). Local."""
        stress = self.deviator(state, cells)
        stress[:, :3] += self.mean_stress(state, cells)[:, None]
        return stress

    def normal_stresses(self, state, grains):
        """Σ σ V of the elements of some ``grains``, xx yy zz [J], shape (3,). Local."""
        total, m = np.zeros(3), self.mesh
        add_normal_stresses(
            total, state.deviator, self.pressure, ELEMENTS[self.element], state.x, m.cells,
            self.volume0, self.own, grains, m.cell_offset,
        )  # fmt: skip
        return total

    def failure(self, state, worst, inverted=-1):
        """What went wrong in an element of this rank, or None. Local.

        Returns:
            None, or a message and whether a shorter time step may be the answer.

        Args:
            state: The state of the grains.
            worst: As of :meth:`worst_element` at its positions.
            inverted: An element that turned inside out, or -1.
        """
        if inverted >= 0:
            return (
                f"{self._name(inverted)} lost its volume: load more slowly, use a coarser or "
                "better shaped mesh near it, or reduce solver.time_step_factor"
            ), True
        grains = np.flatnonzero(np.isfinite(self.largest_plastic_strain))
        for grain in grains:
            begin = self.mesh.cell_offset[grain]
            strain = state.plastic_strain[begin : self.mesh.cell_offset[grain + 1]]
            limit = self.largest_plastic_strain[grain]
            if strain.max() > limit:
                return (
                    f"{self._name(begin + strain.argmax())} reached a plastic strain of "
                    f"{strain.max():.3g}, beyond the table of yield stresses, which ends at "
                    f'{limit:g}: extend material.yield_stress, or set material.beyond = "flat"'
                ), False
        step, cell = worst
        if step < COLLAPSED * self.first_time_step:
            return (
                f"{self._name(cell)} collapsed: it allows {step / self.first_time_step:.2%} of the "
                "first time step; the grain deforms more than its mesh can: end the test earlier, "
                "use a coarser mesh there, or a harder material"
            ), True
        return None

    def _name(self, cell):
        label = self.mesh.labels[self.mesh.grains[self.mesh.grain_of_cell[cell]]]
        return f"an element of grain {label} (element {cell} of its rank)"


def _compile_once(comm):
    """Rank 0 has the kernel made where it is not; the others find it. Collective.

    Raises:
        InputError: There is no C compiler; on all ranks.
    """
    on_first_rank(comm, lambda: [load(name) for name in SOURCES])


def von_mises(deviator):
    """Von Mises stress [Pa] of deviators xx yy zz xy yz xz, shape (n, 6)."""
    normal, shear = deviator[:, :3], deviator[:, 3:]
    return np.sqrt(1.5 * (normal**2).sum(axis=1) + 3.0 * (shear**2).sum(axis=1))


def _rows(parameters):
    """Parameters of all grains side by side, shape (num_grains, m)."""
    rows = np.zeros((len(parameters), max((p.size for p in parameters), default=1)))
    for row, values in zip(rows, parameters, strict=True):
        row[: values.size] = values
    return rows


def _laws(grains, increments):
    """The laws of plastic flow, and those of the ``grains`` that each is for."""
    grains_of = {}
    for grain in grains:
        grains_of.setdefault(increments[grain], []).append(grain)
    return [(increment, np.array(grains)) for increment, grains in grains_of.items()]
