"""Products with the tangent by differences of the residual, as a PETSc matrix.

    K d ≈ (r(q + ε d) - r(q))/ε + μ D d

(D. A. Knoll, D. E. Keyes, J. Comput. Phys. 193, 2004, 357-397). One product costs one evaluation
of the forces and holds all that they hold: yielding, slip, large rotations, any law. ε moves no
node further than a length that is far above rounding, and far below that over which forces turn.
"""

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc


class Products:
    """The context of a PETSc matrix of type "python". Collective.

    Args:
        newton: :class:`~.newton.Newton`, whose residual it is.
        way: Largest motion of a node in a difference [m].
        stiffness: D, of each node [N/m], shape (num_nodes,).

    Attributes:
        matrix: The matrix.
    """

    def __init__(self, newton, way, stiffness):
        self._newton, self._way, self._stiffness = newton, way, stiffness
        self._comm = newton.system.comm
        self._at, self._r, self._added = None, None, 0.0
        n = newton.x.getSizes()
        self.matrix = PETSc.Mat().createPython((n, n), self, comm=self._comm)
        self.matrix.setBlockSize(3)
        self.matrix.setUp()

    def take(self, q, residual, regularisation):
        """Products are those at ``q``, flat, where the residual is ``residual``, flat. Local."""
        self._at, self._r = q.reshape(-1, 3).copy(), residual.reshape(-1, 3).copy()
        self._added = regularisation

    def mult(self, matrix, x, y):
        """y = K x."""
        d = x.array_r.reshape(-1, 3)
        largest = self._comm.allreduce(float(np.abs(d).max(initial=0.0)), op=MPI.MAX)
        if largest == 0.0:
            y.set(0.0)
            return
        epsilon = self._way / largest
        r = self._newton.away(self._at + epsilon * d)
        if r is None:
            y.set(np.nan)
            return
        product = (r - self._r) / epsilon
        if self._added:
            product += self._added * self._stiffness[:, None] * d
        y.array[:] = product.ravel()
