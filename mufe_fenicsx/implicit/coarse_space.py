"""Rigid motions of pieces of grains, the coarse space of a preconditioner.

Incomplete factors carry what happens at one end of a grain over an element or two, so that
their iterations grow with the number of elements across. A second level, on which pieces of a grain
move like rigid bodies, takes what is smooth over a piece: aggregation without smoothing (R. Nabben,
C. Vuik, SIAM J. Numer. Anal. 42, 2004, 1631-1647, and references there), in which motions of
whole grains are contained.
"""

import numpy as np
from petsc4py import PETSc

from ..kernels.bulk.coarse import galerkin

#: Nodes of a piece: a Hertz contact of 24 000 nodes took 15 or 16 iterations with 128, 512 and 1024
#: of them, 18 with 2048, and 27 without pieces (a record).
NODES_OF_PIECE = 512
#: Added to the diagonal over its largest entry: a piece all of whose nodes are held has no motion.
LEAST = 1e-12


class CoarseSpace:
    """The prolongation P from motions of pieces to those of nodes, and P^T K P. Collective.

    Nodes of a grain have numbers by their place (mesh.py), so that runs of them are pieces.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        project: Takes the held part out of nodal vectors, shape (num_nodes, 3), in place.
        offset, columns, blocks: The part of K that stays, between nodes of this rank alone, in
            compressed rows of 3 × 3 blocks.

    Attributes:
        prolongation: P, a matrix of 3 num_nodes rows and 6 columns a piece of this rank.
    """

    def __init__(self, mesh, project, offset, columns, blocks):
        nodes, first = _pieces(mesh)
        piece = np.empty(mesh.num_nodes, dtype=np.int64)
        piece[nodes] = np.repeat(np.arange(first.size - 1), np.diff(first))
        modes = _rigid_motions(mesh.x, piece, first.size - 1)
        for k in range(6):
            modes[:, :, k] = project(modes[:, :, k].copy())
        n, size = mesh.num_nodes, 6 * (first.size - 1)
        begin = mesh.comm.exscan(size) or 0
        motion = (begin + 6 * piece)[:, None, None] + np.zeros((3, 1), dtype=int) + np.arange(6)
        self.prolongation = PETSc.Mat().createAIJ(
            ((3 * n, PETSc.DECIDE), (size, PETSc.DECIDE)), comm=mesh.comm,
            csr=(_whole(np.arange(0, 18 * n + 1, 6)), _whole(motion.ravel()), modes.ravel()),
        )  # fmt: skip
        end, others, products = galerkin(offset, columns, blocks, nodes, first, piece, modes)
        row = np.repeat(np.arange(first.size - 1), np.diff(end))
        rows, others = (begin + 6 * k[:, None] + np.arange(6) for k in (row, others))
        self._stays = PETSc.Mat().create(mesh.comm)
        self._stays.setSizes(((size, PETSc.DECIDE), (size, PETSc.DECIDE)))
        self._stays.setType("aij")
        rows, columns = np.repeat(rows, 6, axis=1).ravel(), np.tile(others, 6).ravel()
        self._stays.setPreallocationCOO(_whole(rows), _whole(columns))
        self._stays.setValuesCOO(products.ravel(), PETSc.InsertMode.INSERT_VALUES)

    def with_more(self, more):
        """P^T K P where a PETSc matrix is added to K. Collective."""
        result = more.ptap(self.prolongation)
        result.axpy(1.0, self._stays, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
        result.shift(LEAST * result.getDiagonal().max()[1])
        return result


def _whole(array):
    return array.astype(PETSc.IntType)


def _pieces(mesh):
    """Nodes of each piece of this rank, in compressed form."""
    parts = []
    for begin, end in zip(mesh.node_offset[:-1], mesh.node_offset[1:], strict=True):
        parts += np.array_split(
            mesh.nodes[begin:end], max(round((end - begin) / NODES_OF_PIECE), 1)
        )
    first = np.cumsum([0] + [len(part) for part in parts])
    return np.concatenate([*parts, np.empty(0, dtype=int)]).astype(np.int64), first


def _rigid_motions(x, piece, num_pieces):
    """Three translations and three rotations of the piece of each node, shape (num_nodes, 3, 6)."""
    count = np.bincount(piece, minlength=num_pieces)
    middle = np.stack([np.bincount(piece, x[:, i], num_pieces) for i in range(3)], axis=1)
    arm = x - (middle / count[:, None])[piece]
    arm /= np.sqrt(np.bincount(piece, (arm**2).sum(axis=1), num_pieces) / count)[piece, None]
    modes = np.zeros((len(x), 3, 6))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        modes[:, i, i] = 1.0
        modes[:, k, 3 + i], modes[:, j, 3 + i] = arm[:, j], -arm[:, k]
    return modes
