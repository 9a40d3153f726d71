"""Another reference configuration: the surface is given, nodes inside follow without strain."""

import h5py  # noqa: F401  before dolfinx.fem.petsc, whose HDF5 has no compression
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem.petsc import apply_lifting, assemble_matrix, create_vector
from petsc4py import PETSc

from ...kernels.build.compiled_forms import compiled_form

#: Elements keep at least this part of their volume.
SMALLEST_VOLUME = 0.5
#: So many times the shift is halved around elements that would keep less.
MAX_HALVINGS = 8
#: Nodes as near to a cylinder lie on it [radius].
ON_CYLINDER = 1e-9


def volumes(mesh, x):
    """Volumes of the cells of this rank at positions ``x`` [m³], shape (num_cells,). Local."""
    edges = x[mesh.cells[:, 1:]] - x[mesh.cells[:, :1]]
    return np.linalg.det(edges) / 6


def extend(mesh, first, shift):
    """Positions after a shift of the surface has been continued into the grains. Collective.

    The extension is harmonic, so that elements keep their shape. Around elements that would
    lose more than :data:`SMALLEST_VOLUME` allows, the shift is halved, again and again; a
    grain for which that does not help stays as it is.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        first: Positions before [m], shape (num_nodes, 3).
        shift: Of the nodes on the surface [m], shape (num_nodes, 3).
    """
    surface = np.unique(mesh.facets)
    on_surface = np.zeros_like(shift)
    on_surface[surface] = shift[surface]
    inner = _harmonic(mesh, on_surface, surface)
    least = SMALLEST_VOLUME * volumes(mesh, first)
    scale = np.ones((mesh.num_nodes, 1))
    for _ in range(MAX_HALVINGS):
        moved = first + scale * inner
        squeezed = np.flatnonzero(volumes(mesh, moved) < least)
        if not mesh.comm.allreduce(squeezed.size):
            return moved
        scale[np.unique(mesh.cells[squeezed])] *= 0.5
    squeezed = volumes(mesh, first + scale * inner) < least
    hopeless = np.isin(mesh.grain_of_node, mesh.grain_of_cell[squeezed])
    scale[hopeless] = 0.0
    return first + scale * inner


def kept_in_cylinder(mesh, first, x):
    """Positions put back onto the cylinder that cut the grains, and within it. Local.

    A move along the chord of a round face leaves it by u²/2R. A wall takes only facets on it for
    parts of itself.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        first: Positions before they moved [m], shape (num_nodes, 3).
        x: Positions now.
    """
    if mesh.cylinder is None:
        return x
    axis, radius = mesh.cylinder[:2], mesh.cylinder[2]
    on = np.abs(np.linalg.norm(first[:, :2] - axis, axis=1) - radius) <= ON_CYLINDER * radius
    distance = np.linalg.norm(x[:, :2] - axis, axis=1)
    moved = (x != first).any(axis=1) & (on | (distance > radius))
    result = x.copy()
    result[moved, :2] = axis + (x[moved, :2] - axis) * (radius / distance[moved])[:, None]
    return result


def _harmonic(mesh, values, surface):
    """Extension of values at surface nodes into the grains, each component for itself."""
    W, component = mesh.V.sub(0).collapse()
    node = mesh.node_of_dof[np.asarray(component) // 3]
    of_node = np.empty(node.size, dtype=np.int32)
    of_node[node] = np.arange(node.size, dtype=np.int32)
    trial, test = ufl.TrialFunction(W), ufl.TestFunction(W)
    laplace = compiled_form(ufl.inner(ufl.grad(trial), ufl.grad(test)) * ufl.dx)
    boundary = fem.Function(W)
    condition = fem.dirichletbc(boundary, of_node[surface])
    matrix = assemble_matrix(laplace, bcs=[condition])
    matrix.assemble()
    solver = PETSc.KSP().create(mesh.comm)
    solver.setOperators(matrix)
    solver.setType(PETSc.KSP.Type.CG)
    solver.getPC().setType(PETSc.PC.Type.JACOBI)
    # So tightly that the reference is the same on any number of ranks.
    solver.setTolerances(rtol=1e-13)
    solver.setErrorIfNotConverged(True)
    right, solution = create_vector(W), create_vector(W)
    extended = np.empty_like(values)
    for i in range(3):
        boundary.x.array[:] = values[node, i]
        right.set(0.0)
        apply_lifting(right, [laplace], bcs=[[condition]])
        condition.set(right.array_w)
        solver.solve(right, solution)
        extended[node, i] = solution.array_r
    extended[surface] = values[surface]
    for used in (solver, matrix, right, solution):
        used.destroy()
    return extended


def set_reference(mesh, x):
    """Make ``x`` the reference configuration of the mesh and of its DOLFINx geometry."""
    mesh.x[:] = x
    geometry = mesh.mesh.geometry
    geometry.x[geometry.dofmaps[0]] = x[mesh.node_of_dof[mesh.V.dofmap.list]]
