"""Products with the tangent, that of the grains by differences of their forces, as a PETSc matrix.

    K d = C d - p (f(q + E d) - f(q))/E

(D. A. Knoll, D. E. Keyes, J. Comput. Phys. 193, 2004, 357-397). One product costs one evaluation
of the forces f of the grains and holds all that they hold: yielding, large rotations, any law. E
has one number for each grain, whose forces are its own affair: where nothing holds one, it goes
far, and beside it the others' motion would drown in rounding. No node is moved further than a
length far above rounding, and far below that over which forces turn. C has what else there is,
contact foremost: its forces jump where a point leaves a sharp edge, which a difference must not
pass over.
"""

import weakref

import numpy as np
from petsc4py import PETSc

#: Motions below this are none.
LEAST = 1e-200


class _Context:
    """Of the matrix: it has no hold on the products, which have the matrix.

    What PETSc's objects refer to, Python's collector of cycles does not see.
    """

    def __init__(self, products):
        self._mult = weakref.WeakMethod(products.mult)

    def mult(self, matrix, x, y):
        """y = K x."""
        self._mult()(matrix, x, y)


class Products:
    """Products as a PETSc matrix of type "python". Collective.

    Args:
        system: :class:`~mufe_fenicsx.implicit.preconditioner.ElasticPreconditioner`, with C as its
            ``on_top``.
        forces: f, a function of displacements, shape (num_nodes, 3); None where there are none.
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        project: Takes the held part out of nodal vectors in place.
        way: Largest motion of a node in a difference [m].
        part: p, of the grains' forces in the residual.

    Attributes:
        matrix: The matrix.
    """

    def __init__(self, system, forces, mesh, project, way, part=1.0):
        self._system, self._forces, self._project = system, forces, project
        self._mesh, self._way, self._part = mesh, way, part
        self._at, self._f = None, None
        n = system.vector().getSizes()
        self.matrix = PETSc.Mat().createPython((n, n), _Context(self), comm=system.comm)
        self.matrix.setBlockSize(3)
        self.matrix.setUp()

    def take(self, q, forces):
        """Products are those at ``q``, where the grains' forces are ``forces``. Local."""
        self._at, self._f = q.copy(), forces.copy()

    def mult(self, matrix, x, y):
        """y = K x."""
        self._system.on_top.mult(x, y)
        d = x.array_r.reshape(-1, 3)
        mesh = self._mesh
        of_nodes = np.abs(d).max(axis=1)[mesh.nodes]
        largest = np.maximum.reduceat(of_nodes, mesh.node_offset[:-1])
        epsilon = np.where(largest > 0.0, self._way / np.maximum(largest, LEAST), 1.0)
        epsilon = epsilon[mesh.grain_of_node][:, None]
        f = self._forces(self._at + epsilon * d)
        if f is None:
            y.set(np.nan)
            return
        y.array[:] -= self._project((f - self._f) * (self._part / epsilon)).ravel()
