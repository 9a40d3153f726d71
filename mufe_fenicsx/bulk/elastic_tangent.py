"""A tangent that is cheap to have: linear elasticity of plain tetrahedra.

It stands in for :class:`~.tangent.SolidTangent` where a matrix is needed to precondition products
only (solvers.jacobian_products). The averaged pressure joins neighbours of neighbours, which makes
five times as many entries; plain tetrahedra have those of their edges.
"""

import numpy as np

from ..kernels.build.blocks import find_slots, joined_pattern
from ..kernels.bulk.stiffness import add_tetrahedra


class NearTangent:
    """Linear elasticity of this rank's grains in their reference places. Local.

    Args:
        solid: :class:`~mufe_fenicsx.bulk.solid.Solid`, all of whose grains deform.

    Attributes:
        offset, columns: Compressed rows of 3 × 3 blocks, a row for each node of the mesh.
        diagonal: Place of each node's own block, shape (num_nodes,).
        blocks: Shape (num_blocks, 3, 3).
    """

    def __init__(self, solid):
        mesh = solid.mesh
        n, cells = mesh.num_nodes, np.ascontiguousarray(mesh.cells)
        none = np.zeros(n + 1, np.int64), np.empty(0, np.int32)
        first = np.arange(0, cells.size + 1, 4)
        self.offset, self.columns = joined_pattern(first, cells.ravel().astype(np.int32), *none, n)
        nodes = np.arange(n)
        self.diagonal = find_slots(self.offset, self.columns, nodes, nodes.astype(np.int32))
        self.blocks = np.zeros((self.columns.size, 3, 3))
        lame = (solid.bulk - 2 / 3 * solid.shear)[mesh.grain_of_cell]
        shear = solid.shear[mesh.grain_of_cell]
        add_tetrahedra(self.blocks, self.offset, self.columns, mesh.x, cells, lame, shear)
