"""A PETSc matrix of 3 × 3 blocks whose pattern follows the contacts, and its solver."""

from contextlib import contextmanager

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from ..errors import SolverError
from ..kernels.build.blocks import add_blocks
from ..solvers.petsc_options import check_command_line

#: Unknowns of the largest grain up to which the direct solver is the default: grains hang together
#: by few nodes, so that the factors are about those of the single grains.
LARGEST_DIRECT = 6_000

#: Options of PETSc by the name of a solver, all of which a user may change.
SOLVERS = {
    "direct": {"ksp_type": "preonly", "pc_type": "lu", "pc_factor_mat_solver_type": "mumps"},
    # Products by differences; a matrix that is near the tangent, in two levels (near_system).
    "products": {
        "ksp_type": "gmres",
        "ksp_gmres_restart": 100,
        "ksp_rtol": 1e-3,
        "ksp_max_it": 500,
        "mat_type": "baij",
        "pc_type": "mg",
        "pc_mg_levels": 2,
        "pc_mg_type": "additive",
        "mg_levels_ksp_type": "preonly",
        "mg_levels_pc_type": "bjacobi",
        "mg_levels_sub_pc_type": "ilu",
    },
}


def solver_by_size(mesh):
    """The solver that is the default for a mesh, one of ``SOLVERS``. Collective."""
    own = 3 * int(np.diff(mesh.node_offset).max(initial=0))
    largest = mesh.comm.allreduce(own, op=MPI.MAX)
    return "direct" if largest <= LARGEST_DIRECT else "products"


class LinearSystem:
    """K q = r with one row of blocks for each node of the mesh. Collective.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        offset, columns: Pattern of this rank's own part, local nodes in compressed rows.
        prefix: Of the options of PETSc.
        solver: One of ``SOLVERS``.
        options: Further options of PETSc, without the prefix: dict.

    Raises:
        InputError: The command line of PETSc has an option that is not allowed.
    """

    def __init__(self, mesh, offset, columns, prefix, solver, options=None):
        self.mesh, self.comm = mesh, mesh.comm
        self.first, self.size = mesh.first_node, mesh.comm.allreduce(mesh.num_nodes)
        rows = np.repeat(np.arange(mesh.num_nodes), np.diff(offset))
        self._own = (self.first + rows, self.first + columns.astype(np.int64))
        self._keys = np.empty(0, dtype=np.int64)
        self._values = None
        database = PETSc.Options(prefix)
        check_command_line(database.getAll(), prefix)
        # The command line comes before the scene, and the scene before the defaults.
        chosen = {**SOLVERS[solver], **(options or {})}
        self._options = {name: v for name, v in chosen.items() if not database.hasName(name)}
        self._prefix = prefix
        self._before = None
        kind = database.getString("mat_type", str(chosen.get("mat_type", "aij")))
        self._type = "baij" if kind.endswith("baij") else "aij"
        self.matrix = self._new_matrix(self._type)

    def prepare(self, ksp):
        """Complete a solver of PETSc whose options have been read: nothing to do here."""

    @contextmanager
    def options(self):
        """The options of this solver are those of PETSc within; solvers read them as they go.

        Raises:
            SolverError: PETSc cannot do what they say.
        """
        database = PETSc.Options(self._prefix)
        for name, value in self._options.items():
            database[name] = value
        try:
            yield
        except PETSc.Error as error:
            raise SolverError(
                f"PETSc stopped ({_cause(error)}): with other options of implicit.petsc or another "
                "implicit.linear_solver it may go on"
            ) from error
        finally:
            for name in self._options:
                database.delValue(name)

    def set(self, own, rows, columns, blocks):
        """Make the matrix that of these blocks. Collective.

        Its pattern holds all pairs of nodes that have been in contact since it was made, and is
        made again when another one comes.

        Args:
            own: Blocks of the pattern of this rank's own part, (num_own_blocks, 3, 3).
            rows, columns: Nodes of further blocks, numbers over all ranks, shape (n,).
            blocks: Their values, shape (n, 3, 3); they add up.
        """
        keys = rows * self.size + columns
        if self.comm.allreduce(int(self._values is None or not _contained(keys, self._keys))):
            self._make(np.union1d(self._keys, keys))
        self._values[: own.size] = own.ravel()
        more = self._values[own.size :].reshape(-1, 3, 3)
        more[:] = 0.0
        add_blocks(more, np.searchsorted(self._keys, keys), blocks)
        self.matrix.setValuesCOO(self._values, PETSc.InsertMode.INSERT_VALUES)

    def forget(self):
        """Begin a new pattern at the next call of :meth:`set`. Collective."""
        self._keys, self._values = self._keys[:0], None

    def _make(self, keys):
        self._keys = keys
        rows = np.concatenate([self._own[0], keys // self.size])
        columns = np.concatenate([self._own[1], keys % self.size])
        row, column = np.divmod(np.arange(9), 3)
        rows = (3 * rows[:, None] + row).astype(PETSc.IntType).ravel()
        columns = (3 * columns[:, None] + column).astype(PETSc.IntType).ravel()
        # A matrix on several ranks cannot be given another pattern. The one before may be in use.
        self._before, self.matrix = self.matrix, self._new_matrix(self._type)
        self.matrix.setPreallocationCOO(rows, columns)
        self._values = np.empty(rows.size)
        self.matrix.setNearNullSpace(self._rigid_motions())

    def _rigid_motions(self):
        places = PETSc.Vec().createWithArray(self.mesh.x.ravel().copy(), bsize=3, comm=self.comm)
        return PETSc.NullSpace().createRigidBody(places)

    def _new_matrix(self, kind):
        n = 3 * self.mesh.num_nodes
        matrix = PETSc.Mat().create(self.comm)
        matrix.setSizes(((n, PETSc.DECIDE), (n, PETSc.DECIDE)))
        matrix.setType(kind)
        matrix.setBlockSize(3)
        return matrix

    def vector(self):
        """A vector of nodal values."""
        size = (3 * self.mesh.num_nodes, PETSc.DECIDE)
        return PETSc.Vec().createMPI(size, bsize=3, comm=self.comm)


def _cause(error):
    """What an error of PETSc says last, without where in its sources that was."""
    lines = [line.split("] ", 1)[-1] for line in str(error).splitlines()]
    return next((line for line in reversed(lines) if " at /" not in line), lines[0])


def _contained(keys, known):
    """Whether all ``keys`` are among the sorted ``known``."""
    if not keys.size:
        return True
    if not known.size:
        return False
    place = np.minimum(np.searchsorted(known, keys), known.size - 1)
    return bool((known[place] == keys).all())
