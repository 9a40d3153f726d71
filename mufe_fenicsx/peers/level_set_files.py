"""Level sets of all grains in a folder: HDF5, ParaView, the text of LS-DEM, a script for YADE."""

import csv
from pathlib import Path

import h5py
import numpy as np
import pyvista

from ..errors import InputError
from ..machine.files import new_folder
from .body import bodies_of
from .level_sets import level_set
from .lsdem import morphology, place

HDF5, TABLE, YADE, LSDEM = "level_sets.h5", "grains.csv", "yade_level_sets.py", "lsdem"

SCRIPT = '''"""Grains of level_sets.h5 as bodies of YADE with LevelSet shapes.

Call: yade yade_level_sets.py. Needs YADE with the feature LS_DEM, and h5py. Lengths are in metres.
"""

import os
import h5py

FOLDER = os.path.dirname(os.path.abspath(__file__))
DENSITY = 2650.0  # kg/m3

O.materials.append(FrictMat(young=1e8, poisson=0.3, frictionAngle=0.4, density=DENSITY))
with h5py.File(os.path.join(FOLDER, "level_sets.h5"), "r") as file:
    for name in sorted(file):
        grain = file[name]
        n = grain["distance"].shape
        grid = RegularGrid(
            min=Vector3(*map(float, grain.attrs["origin"])),
            nGP=Vector3i(*map(int, n)),
            spacing=float(grain.attrs["spacing"]),
        )
        x, y, z, w = map(float, grain.attrs["quaternion"])
        O.bodies.append(
            levelSetBody(
                grid=grid,
                distField=grain["distance"][:].tolist(),
                center=Vector3(*map(float, grain.attrs["centroid"])),
                orientation=Quaternion(w, x, y, z),
                nSurfNodes=1002,
            )
        )
print(len(O.bodies), "grains")
'''


def export_level_sets(folder, grains, *, spacing=None, overwrite=False):
    """Write the signed distances of all grains.

    Files: ``level_sets.h5`` with a group a grain; ``vti/grain_<label>.vti`` in the sample's frame
    for ParaView; ``lsdem/`` with the text files of :mod:`~mufe_fenicsx.peers.lsdem`;
    ``yade_level_sets.py``, a script of YADE; ``grains.csv``.

    Args:
        folder: Folder to make.
        grains: :class:`~mufe_fenicsx.geometry.grains.Grains`.
        spacing: Of the grids [m]; None: half the length of edges of the meshes.
        overwrite: Replace a folder that was written so.

    Returns:
        Summary, a dict. ``volume_error``: the largest difference of a grain's volume from what its
        grid gives, over it, the boundary cells cut by their distance.

    Raises:
        InputError: a spacing that is no length or makes huge grids, or a folder that is in use.
    """
    spacing = 0.5 * grains.element_size if spacing is None else float(spacing)
    if not 0 < spacing < float("inf"):
        raise InputError(f"--spacing = {spacing} m, expected a length > 0")
    rows, positions, rotations = [], [], []
    with new_folder(folder, overwrite=overwrite, marker=HDF5) as made:
        (made / LSDEM).mkdir()
        (made / "vti").mkdir()
        with h5py.File(made / HDF5, "w") as file:
            file.attrs["length_unit"] = "m"
            for i, body in enumerate(bodies_of(grains), start=1):
                grid = level_set(body, spacing)
                _write_group(file, body, grid)
                _write_vti(made / "vti" / f"grain_{body.label}.vti", body, grid)
                text = morphology(body, grid)
                (made / LSDEM / f"morph_{i}.dat").write_text(text, encoding="ascii")
                for lines, line in zip((positions, rotations), place(body, spacing), strict=True):
                    lines.append(line)
                rows.append(_row(i, body, grid))
        (made / LSDEM / "positions.dat").write_text("".join(positions), encoding="ascii")
        (made / LSDEM / "rotations.dat").write_text("".join(rotations), encoding="ascii")
        (made / YADE).write_text(SCRIPT, encoding="utf-8")
        with (made / TABLE).open("w", newline="", encoding="utf-8") as file:
            table = csv.DictWriter(file, rows[0])
            table.writeheader()
            table.writerows(rows)
    nodes = [row["grid_nodes"] for row in rows]
    return {
        "folder": str(Path(folder)),
        "num_grains": grains.num_grains,
        "spacing_m": spacing,
        "grid_nodes": int(sum(nodes)),
        "grid_nodes_of_largest": int(max(nodes)),
        "volume_error": max(abs(row["volume_error"]) for row in rows),
    }


def _write_group(file, body, grid):
    group = file.create_group(f"grain_{body.label:06d}")
    group.create_dataset("distance", data=grid.distance, compression="gzip", shuffle=True)
    group["surface_points"] = body.points
    for name, value in (
        ("label", body.label),
        ("origin", grid.origin),
        ("spacing", grid.spacing),
        ("centroid", body.centroid),
        ("axes", body.axes),
        ("quaternion", body.quaternion),
        ("volume", body.volume),
        ("moments", body.moments),
    ):
        group.attrs[name] = value


def _write_vti(path, body, grid):
    image = pyvista.ImageData(
        dimensions=grid.distance.shape,
        spacing=(grid.spacing,) * 3,
        origin=body.in_sample(grid.origin),
    )
    image.SetDirectionMatrix(*body.axes.T.ravel())
    image.point_data["distance"] = grid.distance.ravel(order="F")
    image.save(path)


def _row(i, body, grid):
    # Part of the cube around a node that is inside, to first order in the distance.
    inside = np.clip(0.5 - grid.distance / grid.spacing, 0, 1).sum() * grid.spacing**3
    return {
        "number": i,
        "label": body.label,
        "volume_m3": body.volume,
        **{f"centroid_{a}_m": body.centroid[k] for k, a in enumerate("xyz")},
        **{f"moment_{k + 1}_m5": body.moments[k] for k in range(3)},
        **{f"quaternion_{a}": body.quaternion[k] for k, a in enumerate("xyzw")},
        "grid_nodes": grid.distance.size,
        "volume_error": inside / body.volume - 1,
    }
