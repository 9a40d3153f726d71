"""Products with the tangent, that of the grains by differences of their forces, as a PETSc matrix.

    K d = C d - p (f(q + ε d) - f(q))/ε

(D. A. Knoll, D. E. Keyes, J. Comput. Phys. 193, 2004, 357-397). One product costs one evaluation
of the forces f of the grains and holds all that they hold: yielding, large rotations, any law. ε
moves no node further than a length that is far above rounding, and far below that over which they
turn. C has what else there is, contact foremost: its forces jump where a point leaves a sharp edge,
which a difference must not pass over.
"""

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc


class Products:
    """The context of a PETSc matrix of type "python". Collective.

    Args:
        system: :class:`~mufe_fenicsx.near_system.NearSystem`, whose ``on_top`` is C.
        forces: f, a function of displacements, shape (num_nodes, 3); None where there are none.
        project: Takes the held part out of nodal vectors in place.
        way: Largest motion of a node in a difference [m].
        part: p, of the grains' forces in the residual.

    Attributes:
        matrix: The matrix.
    """

    def __init__(self, system, forces, project, way, part=1.0):
        self._system, self._forces, self._project = system, forces, project
        self._way, self._part = way, part
        self._at, self._f = None, None
        n = system.vector().getSizes()
        self.matrix = PETSc.Mat().createPython((n, n), self, comm=system.comm)
        self.matrix.setBlockSize(3)
        self.matrix.setUp()

    def take(self, q, forces):
        """Products are those at ``q``, where the grains' forces are ``forces``. Local."""
        self._at, self._f = q.copy(), forces.copy()

    def mult(self, matrix, x, y):
        """y = K x."""
        self._system.on_top.mult(x, y)
        d = x.array_r.reshape(-1, 3)
        largest = self._system.comm.allreduce(float(np.abs(d).max(initial=0.0)), op=MPI.MAX)
        if largest == 0.0:
            return
        epsilon = self._way / largest
        f = self._forces(self._at + epsilon * d)
        if f is None:
            y.set(np.nan)
            return
        y.array[:] -= self._project((f - self._f) * (self._part / epsilon)).ravel()
