"""Closed surfaces of grains as STL, PLY or OBJ files, one a grain."""

from pathlib import Path

import meshio
import numpy as np

from ..errors import InputError
from ..geometry.measure import boundary_triangles, compact, surface_volume
from ..machine.files import new_folder

#: Formats by name, and how meshio is to write them: binary ones where there are.
FORMATS = {"stl": {"binary": True}, "ply": {"binary": True}, "obj": {}}


def export_surfaces(folder, grains, *, kind="stl", unit=1.0, overwrite=False):
    """Write the surface of each grain into ``folder`` as ``grain_<label>.<kind>``.

    STL keeps seven digits and no common vertices, PLY all digits. Read back in the natural
    order of their names, as `mufe mesh` does, they get the labels 1 to n in the order of ours.

    Args:
        folder: Folder to make.
        grains: :class:`~mufe_fenicsx.geometry.grains.Grains`.
        kind: One of `FORMATS`.
        unit: Length that is written as 1 [m].
        overwrite: Replace a folder that was written so.

    Returns:
        Summary, a dict.

    Raises:
        InputError: an unknown format, a unit that is no length, or a folder that is in use.
    """
    if kind not in FORMATS:
        raise InputError(f'--format = "{kind}", expected one of {", ".join(FORMATS)}')
    if not 0 < unit < float("inf"):
        raise InputError(f"--unit = {unit} m, expected a length > 0")
    width, volumes, num_facets = len(str(grains.labels[-1])), 0.0, 0
    with new_folder(folder, overwrite=overwrite, marker=_name(grains, 0, width, kind)) as made:
        for g in range(grains.num_grains):
            points, cells = grains.grain(g)
            points, triangles = compact(points, boundary_triangles(cells))
            mesh = meshio.Mesh(points / unit, [("triangle", triangles.astype(np.int32))])
            meshio.write(made / _name(grains, g, width, kind), mesh, kind, **FORMATS[kind])
            volumes += surface_volume(points, triangles)
            num_facets += len(triangles)
    return {
        "folder": str(Path(folder)),
        "num_grains": grains.num_grains,
        "num_facets": num_facets,
        "volume_m3": float(volumes),
        "unit_m": float(unit),
    }


def _name(grains, g, width, kind):
    return f"grain_{grains.labels[g]:0{width}d}.{kind}"
