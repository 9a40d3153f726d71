"""Motion of grains: the best rigid one, and the strain that it leaves."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from mufe_fenicsx.analysis.by_grain import blocks, index_grains, sum_by_grain
from mufe_fenicsx.geometry.measure import tet_volumes


@dataclass(frozen=True)
class Motion:
    """How grains have moved and deformed since the reference configuration."""

    labels: np.ndarray  #: shape (num_grains,)
    centre: np.ndarray  #: of mass in the reference configuration [m], shape (num_grains, 3)
    translation: np.ndarray  #: of the centre of mass [m], shape (num_grains, 3)
    rotation: np.ndarray  #: proper rotation matrices, shape (num_grains, 3, 3)
    rotation_vector: np.ndarray  #: axis times angle [rad], shape (num_grains, 3)
    misfit: np.ndarray  #: root mean square distance from the rigid motion [m], (num_grains,)
    deformation: np.ndarray  #: mean deformation gradient [-], shape (num_grains, 3, 3)
    volume_ratio: np.ndarray  #: volume now over the reference one [-], shape (num_grains,)

    @property
    def angle(self):
        """Angle of the rotation [rad], 0 to π, shape (num_grains,)."""
        return np.linalg.norm(self.rotation_vector, axis=1)

    @property
    def axis(self):
        """Unit axis of the rotation, shape (num_grains, 3); zero where nothing turned."""
        angle = self.angle[:, None]
        return np.divide(
            self.rotation_vector, angle, out=np.zeros_like(self.rotation_vector), where=angle > 0
        )

    @property
    def remaining_strain(self):
        """Strain that the rigid motion leaves, sym(Rᵀ F̄) - 1 [-], shape (num_grains, 3, 3).

        In the axes of the reference configuration, tension positive.
        """
        turned_back = np.swapaxes(self.rotation, 1, 2) @ self.deformation
        return 0.5 * (turned_back + np.swapaxes(turned_back, 1, 2)) - np.eye(3)


def grain_motion(reference, points, cells, grain_of_cell):
    """The rigid motion x = x̄ + R (X - X̄) that fits each grain best, and its mean strain.

    The fit is that of W. Kabsch (Acta Cryst. A32, 1976, 922-923; A34, 1978, 827-828): the
    rotation R with the least Σ m |x - x̄ - R (X - X̄)|², m the lumped masses of the nodes,
    from the singular values of Σ m (x - x̄)(X - X̄)ᵀ, never a reflection. The mean of
    the deformation gradient F̄ is that over the reference volume.

    Args:
        reference: Nodes before [m], shape (num_nodes, 3).
        points: The same nodes now [m], shape (num_nodes, 3).
        cells: Nodes of the tetrahedra, shape (num_cells, 4).
        grain_of_cell: Label of each cell's grain, shape (num_cells,).

    Returns:
        :class:`Motion`, grains in the order of their labels.
    """
    labels, index = index_grains(grain_of_cell)
    n = labels.size
    volume = tet_volumes(reference, cells)
    total = sum_by_grain(volume, index, n)
    first, last, moment, gradient = (
        np.zeros((n, *shape)) for shape in ((3,), (3,), (3, 3), (3, 3))
    )
    misfit = np.zeros(n)
    for part in blocks(len(cells)):
        mass, at = volume[part, None] / total[index[part], None], index[part]
        first += sum_by_grain(mass * reference[cells[part]].mean(axis=1), at, n)
        last += sum_by_grain(mass * points[cells[part]].mean(axis=1), at, n)

    def corners(part):
        """Of some cells, from the centres of their grains, before and now."""
        at, nodes = index[part], cells[part]
        return reference[nodes] - first[at][:, None], points[nodes] - last[at][:, None]

    for part in blocks(len(cells)):
        before, now = corners(part)
        products = np.swapaxes(volume[part, None, None] / 4 * now, 1, 2) @ before
        moment += sum_by_grain(products, index[part], n)
        edges, edges_now = (np.swapaxes(x[:, 1:] - x[:, :1], 1, 2) for x in (before, now))
        gradients = volume[part, None, None] * (edges_now @ np.linalg.inv(edges))
        gradient += sum_by_grain(gradients, index[part], n)
    u, _, vt = np.linalg.svd(moment)
    u[:, :, 2] *= np.linalg.det(u @ vt)[:, None]
    rotation = u @ vt
    for part in blocks(len(cells)):
        before, now = corners(part)
        left = now - before @ np.swapaxes(rotation, 1, 2)[index[part]]
        squares = volume[part] / 4 * np.einsum("cai,cai->c", left, left)
        misfit += sum_by_grain(squares, index[part], n)
    return Motion(
        labels=labels,
        centre=first,
        translation=last - first,
        rotation=rotation,
        rotation_vector=Rotation.from_matrix(rotation).as_rotvec(),
        misfit=np.sqrt(misfit / total),
        deformation=gradient / total[:, None, None],
        volume_ratio=sum_by_grain(tet_volumes(points, cells), index, n) / total,
    )
