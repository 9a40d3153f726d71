"""What a mesh will come to, before it is begun."""

import numpy as np

from ...errors import InputError
from ...machine.memory import check_room

#: Tetrahedra in a cube as wide as the wanted length of edges: `docs/method/meshing.md`, How fine.
TETS_A_CUBE = 3.7
#: Tetrahedra that no machine makes faster [1/s], and what one takes at least in the end [bytes].
FASTEST, A_TET = 2e5, 150


def check_work(volumes, settings):
    """Raise InputError where no grain is as large as an edge, or the mesh too large.

    That is where it cannot end within ``time_limit``, or does not fit into the memory.

    Args:
        volumes: Of the grains [m³].
        settings: `MeshSettings`. The number of tetrahedra is estimated from below.
    """
    if settings.surface_nodes is not None or len(volumes) == 0:
        return
    largest = np.cbrt(6 / np.pi * max(volumes))
    if settings.least_size > largest:
        raise InputError(
            f"size = {settings.size:g} m: the largest grain is as a ball of {largest:.3g} m, "
            "expected a smaller size, a tenth of a grain or less"
        )
    edge = settings.size * settings.inner_size
    # Each on its own: a cube of a length may be zero or infinite where the length is not.
    tets = TETS_A_CUBE * (np.cbrt(np.asarray(volumes, dtype=float)) / edge) ** 3
    advice = ", expected a larger size, or another voxel_size"
    most = FASTEST * settings.time_limit
    if tets.max() > most:
        raise InputError(
            f"size = {settings.size:g} m: a grain of {largest:.3g} m takes {tets.max():.2g} "
            f"tetrahedra, which no time_limit of {settings.time_limit:g} s is enough for{advice}"
        )
    check_room(
        A_TET * float(tets.sum()),
        f"size = {settings.size:g} m: a mesh of {tets.sum():.2g} tetrahedra",
        advice,
    )
