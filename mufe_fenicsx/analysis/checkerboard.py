"""How much the pressure alternates between neighbouring tetrahedra."""

import numpy as np

from mufe_fenicsx.geometry.measure import FACES


def checkerboard(cells, pressure, volume):
    """Part of the pressure that alternates from a tetrahedron to its neighbours [-].

        ½ √(Σ V (p - p̄)² / Σ V p²),  p̄ the mean over the tetrahedra that share a face

    It is 1 where all neighbours have the opposite pressure, 0 where it is even, and small
    where it varies smoothly. Linear tetrahedra that lock show it; those with averaged
    nodal pressure should not.

    Args:
        cells: Nodes of the tetrahedra, shape (num_cells, 4).
        pressure: Of the tetrahedra [Pa], shape (num_cells,).
        volume: Their volumes [m³], shape (num_cells,).
    """
    faces = np.sort(np.concatenate([cells[:, list(face)] for face in FACES]), axis=1)
    cell = np.tile(np.arange(len(cells)), len(FACES))
    order = np.lexsort(faces.T)
    same = np.flatnonzero((faces[order][1:] == faces[order][:-1]).all(axis=1))
    one, other = cell[order[same]], cell[order[same + 1]]
    count = np.bincount(np.concatenate([one, other]), minlength=len(volume))
    total = np.bincount(
        np.concatenate([one, other]),
        np.concatenate([pressure[other], pressure[one]]),
        minlength=len(volume),
    )
    inside = count > 0
    off = (pressure[inside] - total[inside] / count[inside]) ** 2
    scale = volume @ pressure**2
    return 0.5 * float(np.sqrt(volume[inside] @ off / scale)) if scale > 0 else 0.0
