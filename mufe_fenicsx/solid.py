"""The bulk of the grains: mass, internal forces, energies and stable time step."""

import numpy as np
import ufl
from dolfinx import fem

from .errors import SolverError
from .kernels.energy import elastic_energy
from .kernels.solid import add_internal_forces, nodal_volumes
from .kernels.stiffness import add_elastic_stiffness, element_time_step
from .materials.rigid import Rigid


def lumped_mass(mesh, density):
    """Nodal masses [kg] by row sums of the mass matrix, as a DOLFINx form. Collective.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        density: Densities of this rank's grains [kg/m³], shape (num_grains,).

    Returns:
        Masses, shape (num_nodes,).
    """
    rho = mesh.cell_function(density[mesh.grain_of_cell])
    test = ufl.TestFunction(mesh.V)
    form = fem.form(rho * ufl.inner(ufl.as_vector((1.0, 1.0, 1.0)), test) * ufl.dx)
    return fem.assemble_vector(form).array.reshape(-1, 3)[:, 0].copy()


class Solid:
    """Elastic or elasto-plastic grains of one rank; rigid ones cost nothing here.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        materials: One material (with ``bulk_modulus``, ``shear_modulus``, ``rho``,
            ``wave_speed``, ``contact_modulus``, ``table()``) for each grain of this rank.
        averaged: Averaged nodal pressure (True) or plain linear tetrahedra.
    """

    def __init__(self, mesh, materials, averaged=True):
        self.mesh = mesh
        self.averaged = averaged
        self.bulk = np.array([m.bulk_modulus for m in materials])
        self.shear = np.array([m.shear_modulus for m in materials])
        self.wave_speed = np.array([m.wave_speed for m in materials])
        self.contact_modulus = np.array([m.contact_modulus for m in materials])
        self.tangential_ratio = np.array([2 * (1 - m.nu) / (2 - m.nu) for m in materials])
        self.table_strain, self.table_stress = _hardening_tables(materials)
        #: The grains that deform, shape (num_deformable,).
        self.grains = np.flatnonzero([not isinstance(m, Rigid) for m in materials])
        self.mass = lumped_mass(mesh, np.array([m.rho for m in materials]))

        x = mesh.x
        edges = x[mesh.cells[:, 1:]] - x[mesh.cells[:, :1]]
        self.volume0 = np.linalg.det(edges) / 6
        self.node_volume0 = np.zeros(mesh.num_nodes)
        nodal_volumes(self.node_volume0, x, mesh.cells)
        self.pressure = np.zeros(max(mesh.num_nodes, mesh.num_cells))
        self._scratch = np.zeros(mesh.num_nodes)

    def add_internal_forces(self, f, state, dt):
        """Advance the stress of ``state`` by ``dt`` and subtract the internal forces from ``f``.

        Returns:
            The first inverted element, or -1. Local.
        """
        m = self.mesh
        return add_internal_forces(
            f,
            state.deviator,
            state.plastic_strain,
            state.plastic_work,
            self.pressure,
            state.x,
            state.v,
            dt,
            m.cells,
            self.volume0,
            self.grains,
            m.cell_offset,
            m.nodes,
            m.node_offset,
            self.node_volume0,
            self.bulk,
            self.shear,
            self.table_strain,
            self.table_stress,
            self.averaged,
        )

    def add_stiffness(self, y, q, x):
        """Add the elastic tangent at positions ``x`` times ``q`` to ``y``. Local."""
        m = self.mesh
        add_elastic_stiffness(
            y,
            self._scratch,
            q,
            x,
            m.cells,
            self.volume0,
            self.grains,
            m.cell_offset,
            m.nodes,
            m.node_offset,
            self.node_volume0,
            self.bulk,
            self.shear,
            self.averaged,
        )

    def element_time_step(self, x):
        """Proven bound of the stable time step from single elements [s], inf without any. Local."""
        m = self.mesh
        return element_time_step(x, m.cells, self.grains, m.cell_offset, self.wave_speed)[0]

    def elastic_energy(self, state):
        """Elastic energy of each grain [J], shape (num_grains,). Local."""
        m = self.mesh
        energy = np.zeros(m.num_grains)
        volume = np.zeros(m.num_nodes)
        nodal_volumes(volume, state.x, m.cells)
        elastic_energy(
            energy,
            state.deviator,
            state.x,
            m.cells,
            self.volume0,
            self.grains,
            m.cell_offset,
            m.nodes,
            m.node_offset,
            self.node_volume0,
            volume,
            self.bulk,
            self.shear,
            self.averaged,
        )
        return energy

    def plastic_energy(self, state):
        """Plastic work of each grain so far [J], shape (num_grains,). Local."""
        return np.add.reduceat(state.plastic_work, self.mesh.cell_offset[:-1])

    def mean_stress(self):
        """Mean Cauchy stress of the elements [Pa], tension positive, shape (num_cells,). Local."""
        if self.averaged:
            return self.pressure[self.mesh.cells].mean(axis=1)
        return self.pressure[: self.mesh.num_cells].copy()

    def stress(self, state):
        """Cauchy stress [Pa], xx yy zz xy yz xz, shape (num_cells, 6). Local."""
        stress = state.deviator.copy()
        stress[:, :3] += self.mean_stress()[:, None]
        return stress

    def inverted(self, cell):
        """The error to raise for an element that turned inside out."""
        label = self.mesh.labels[self.mesh.grains[self.mesh.grain_of_cell[cell]]]
        return SolverError(
            f"an element of grain {label} lost its volume (element {cell} of its rank): load more "
            "slowly, use a coarser or better shaped mesh near it, or reduce solver.time_step_factor"
        )


def von_mises(deviator):
    """Von Mises stress [Pa] of deviators xx yy zz xy yz xz, shape (n, 6)."""
    normal, shear = deviator[:, :3], deviator[:, 3:]
    return np.sqrt(1.5 * (normal**2).sum(axis=1) + 3.0 * (shear**2).sum(axis=1))


def _hardening_tables(materials):
    """Tables of all grains side by side, the last point repeated where one is shorter."""
    tables = [m.table() for m in materials]
    length = max((strain.size for strain, _ in tables), default=1)
    strains, stresses = np.zeros((len(tables), length)), np.zeros((len(tables), length))
    for g, (strain, stress) in enumerate(tables):
        strains[g, : strain.size], stresses[g, : stress.size] = strain, stress
        strains[g, strain.size :] = strain[-1] + np.arange(1, length - strain.size + 1)
        stresses[g, stress.size :] = stress[-1]
    return strains, stresses
