"""Surfaces that overlap in the image are moved apart before the test, without strain."""

from dataclasses import asdict, dataclass

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem.petsc import apply_lifting, assemble_matrix, create_vector
from mpi4py import MPI
from petsc4py import PETSc

from .assemble import Contact
from .walls import Walls

#: An overlap below this many mean facet edges counts as none.
TOLERANCE = 1e-3
#: Elements keep at least this part of their volume.
SMALLEST_VOLUME = 0.5


@dataclass(frozen=True)
class Separation:
    """What the separation did, over all ranks."""

    overlap_nodes: int  #: nodes inside another grain before
    max_depth: float  #: deepest of them [m]
    remaining_nodes: int  #: nodes still deeper than the tolerance after
    remaining_depth: float  #: deepest of them [m]; it becomes the offset of that gap
    max_shift: float  #: largest shift of a node [m]
    volume_change: float  #: relative change of the volume of all grains [-]
    num_sweeps: int  #: searches it took

    def as_dict(self):
        return asdict(self)


def separate(mesh, max_shift, max_sweeps=15):
    """Move the nodes of ``mesh`` until no node lies inside another grain. Collective.

    A surface node at depth d moves by d/2 along the normal of the surface that it is
    behind; the other surface does the same. Interior nodes follow by a harmonic
    extension, so that elements keep their shape. The reference configuration,
    ``mesh.x`` and the geometry of the DOLFINx mesh, is changed in place.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        max_shift: Largest shift of a node, in mean facet edges.
        max_sweeps: Searches at most.

    Returns:
        :class:`Separation`.
    """
    comm = mesh.comm
    first = mesh.x.copy()
    x = mesh.x.copy()
    shift = np.zeros_like(x)
    found = None
    for sweep in range(max_sweeps + 1):
        nodes, depth, normal, edge = _overlaps(mesh, x)
        count = comm.allreduce(int((depth > TOLERANCE * edge).sum()))
        deepest = comm.allreduce(depth.max(initial=0.0), op=MPI.MAX)
        if found is None:
            found = (count, deepest)
        if count == 0 or sweep == max_sweeps:
            break
        # A node inside two grains moves out of both.
        np.add.at(shift, nodes, 0.5 * (depth + TOLERANCE * edge)[:, None] * normal)
        length = np.linalg.norm(shift, axis=1)
        shift *= np.minimum(1.0, max_shift * edge / np.maximum(length, 1e-300))[:, None]
        x = first + shift

    volume0 = _volumes(mesh, first)
    if found[0]:
        x = _extend(mesh, first, shift, volume0)
        _, depth, _, edge = _overlaps(mesh, x)
        count = comm.allreduce(int((depth > TOLERANCE * edge).sum()))
        deepest = comm.allreduce(depth.max(initial=0.0), op=MPI.MAX)
        _set_reference(mesh, x)
    moved = np.linalg.norm(x - first, axis=1).max(initial=0.0)
    before = comm.allreduce(volume0.sum())
    return Separation(
        overlap_nodes=found[0],
        max_depth=float(found[1]),
        remaining_nodes=count,
        remaining_depth=float(deepest),
        max_shift=float(comm.allreduce(moved, op=MPI.MAX)),
        volume_change=float(comm.allreduce(_volumes(mesh, x).sum()) / before - 1),
        num_sweeps=sweep,
    )


def _overlaps(mesh, x):
    """Mesh nodes inside another grain, their depths, normals, and the mean facet edge."""
    one = np.ones(mesh.num_grains)
    contact = Contact(mesh, x, one, one, 0.0, 1.0, Walls([]))
    contact.begin(x)
    contact.add_forces(np.zeros_like(x), x, adopt=True)
    pairs = contact.pairs
    inside = np.flatnonzero(pairs.offset < 0)
    contact.positions.destroy()
    contact.forces.destroy()
    nodes = contact.own.nodes[pairs.node[inside]]
    return nodes, -pairs.offset[inside], pairs.normal[inside], contact.edge


def _extend(mesh, first, shift, volume0):
    """Positions after the shift of the surface has been continued into the grains."""
    surface = np.unique(mesh.facets)
    on_surface = np.zeros_like(shift)
    on_surface[surface] = shift[surface]
    inner = _harmonic(mesh, on_surface, surface)
    scale = np.ones(mesh.num_grains)
    for _ in range(6):
        # The extension is linear, so that of a smaller shift is known.
        moved = first + inner * scale[mesh.grain_of_node][:, None]
        squeezed = np.unique(mesh.grain_of_cell[_volumes(mesh, moved) < SMALLEST_VOLUME * volume0])
        scale[squeezed] *= 0.5
        if not mesh.comm.allreduce(int(squeezed.size)):
            return moved
    # Grains that would still be squeezed stay as they are: their overlaps become offsets.
    scale[squeezed] = 0.0
    return first + inner * scale[mesh.grain_of_node][:, None]


def _harmonic(mesh, values, surface):
    """Extension of values at surface nodes into the grains, each component for itself."""
    W, component = mesh.V.sub(0).collapse()
    node = np.asarray(component) // 3
    of_node = np.empty(node.size, dtype=np.int32)
    of_node[node] = np.arange(node.size, dtype=np.int32)
    trial, test = ufl.TrialFunction(W), ufl.TestFunction(W)
    laplace = fem.form(ufl.inner(ufl.grad(trial), ufl.grad(test)) * ufl.dx)
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


def _volumes(mesh, x):
    edges = x[mesh.cells[:, 1:]] - x[mesh.cells[:, :1]]
    return np.linalg.det(edges) / 6


def _set_reference(mesh, x):
    """Make ``x`` the reference configuration of the mesh and of its DOLFINx geometry."""
    mesh.x[:] = x
    geometry = mesh.mesh.geometry
    geometry.x[geometry.dofmaps[0]] = x[mesh.V.dofmap.list]
