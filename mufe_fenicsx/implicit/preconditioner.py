"""The linear system of products: a matrix near the tangent, in two levels.

Linear elasticity of plain tetrahedra stays as it is; contacts, the drag and a regularisation are
put on top of a copy. The preconditioner adds incomplete factors of this matrix on each
rank and its coarse space (:mod:`.coarse_space`), as a multigrid of PETSc with two levels.
"""

import numpy as np
from petsc4py import PETSc

from ..kernels.build.blocks import add_blocks
from .coarse_space import CoarseSpace
from .linear_system import LinearSystem


class ElasticPreconditioner(LinearSystem):
    """As :class:`~.linear_system.LinearSystem`, around one part that does not change. Collective.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        tangent: :class:`~.near_tangent.NearTangent`.
        held: :class:`~.held_nodes.HeldNodes`.
        prefix, options: As there.
        factor: The tangent's part of elasticity.

    Attributes:
        on_top: What contact, drag and regularisation add, a PETSc matrix.
    """

    def __init__(self, mesh, tangent, held, prefix, options=None, factor=1.0):
        super().__init__(mesh, tangent.offset, tangent.columns, prefix, "products", options)
        self._held, self._tangent = held, tangent
        self._elastic = tangent.blocks
        self._elastic *= factor
        held.project_blocks(tangent, self._elastic)
        self._base, self._more = None, np.empty(0, dtype=np.int64)
        self._coarse, self.on_top = None, None

    def prepare(self, ksp):
        """Give a solver of PETSc its coarse space, where its options ask for two levels."""
        preconditioner = ksp.getPC()
        if preconditioner.getType() == "mg":
            pattern = self._tangent.offset, self._tangent.columns
            self._coarse = CoarseSpace(self.mesh, self._held.project, *pattern, self._elastic)
            preconditioner.setMGInterpolation(1, self._coarse.prolongation)
            self._coarse_solver = preconditioner.getMGCoarseSolve()

    def put(self, diagonal, rows, columns, blocks):
        """Make ``on_top``, the part that changes from iteration to iteration. Collective.

        Args:
            diagonal: Of the nodes [N/m], shape (num_nodes,).
            rows, columns, blocks: Of contact, as in :meth:`~.linear_system.LinearSystem.set`.
        """
        self._touching, place = np.unique(rows * self.size + columns, return_inverse=True)
        self._stiffness, self._diagonal = np.zeros((self._touching.size, 3, 3)), self.vector()
        add_blocks(self._stiffness, place, blocks)
        self._diagonal.array[:] = np.repeat(diagonal, 3)
        row, column = np.divmod(np.arange(9), 3)
        rows, columns = (3 * k[:, None] for k in np.divmod(self._touching, self.size))
        each = 3 * self.first + np.arange(diagonal.size * 3)
        self.on_top = self._new_matrix("aij")
        self.on_top.setPreallocationCOO(
            np.concatenate([(rows + row).ravel(), each]).astype(PETSc.IntType),
            np.concatenate([(columns + column).ravel(), each]).astype(PETSc.IntType),
        )
        self.on_top.setValuesCOO(
            np.concatenate([self._stiffness.ravel(), self._diagonal.array_r]),
            PETSc.InsertMode.INSERT_VALUES,
        )

    def renew(self):
        """Make the matrix elasticity and ``on_top``. Collective."""
        new = np.setdiff1d(self._touching, self._more, assume_unique=True)
        if self.comm.allreduce(int(self._base is None or new.size > 0)):
            self._more = np.union1d(self._more, new)
            self._make_base()
        self._base.copy(self.matrix, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        self._add(self.matrix, self._touching, self._stiffness)
        self.matrix.setDiagonal(self._diagonal, PETSc.InsertMode.ADD_VALUES)
        if self._coarse:
            self._coarse_solver.setOperators(self._coarse.with_more(self.on_top))

    def forget(self):
        """Begin a new pattern at the next call of :meth:`renew`. Collective."""
        self._base, self._more = None, self._more[:0]

    def _make_base(self):
        """Elasticity, and zeros where contacts have been since the pattern was begun."""
        more = np.divmod(self._more, self.size)
        rows = np.concatenate([self._own[0], more[0]]).astype(PETSc.IntType)
        columns = np.concatenate([self._own[1], more[1]]).astype(PETSc.IntType)
        # Rows of this rank; those that others add are few.
        last = self.first + self.mesh.num_nodes
        mine = (rows >= self.first) & (rows < last)
        inside = mine & (columns >= self.first) & (columns < last)
        counts = [
            np.bincount(rows[which] - self.first, minlength=self.mesh.num_nodes)
            for which in (inside, mine & ~inside)
        ]
        base = self._new_matrix("baij")
        base.setPreallocationNNZ([c.astype(PETSc.IntType) for c in counts])
        base.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, False)
        own = self._own[0].size
        base.setValuesBlockedRCV(
            rows[:own, None], columns[:own, None], self._elastic.reshape(-1, 9),
            PETSc.InsertMode.ADD_VALUES,
        )  # fmt: skip
        self._add(base, self._more, np.zeros((self._more.size, 3, 3)))
        self._base = base if self._type == "baij" else base.convert(self._type)
        # The one before may be in use.
        self._before, self.matrix = self.matrix, self._base.duplicate()
        if self._type != "baij":
            self.matrix.setNearNullSpace(self._rigid_motions())

    def _add(self, matrix, keys, values):
        rows, columns = (k.astype(PETSc.IntType)[:, None] for k in np.divmod(keys, self.size))
        matrix.setValuesBlockedRCV(
            rows, columns, values.reshape(-1, 9), PETSc.InsertMode.ADD_VALUES
        )
        matrix.assemble()
