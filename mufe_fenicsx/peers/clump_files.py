"""Clumps of all grains in a folder: text of YADE, and tables for any other program."""

import csv
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..machine.files import new_folder
from .body import bodies_of
from .clumps import clump_of

YADE, SPHERES, TABLE = "clumps.txt", "spheres.csv", "clumps.csv"
#: What the summary tells of all grains.
ERRORS = ("volume_error", "centroid_error", "inertia_error", "missing", "protruding")


def export_clumps(
    folder, grains, *, num_spheres=20, missing=0.02, grow=True, progress=None, overwrite=False
):
    """Write the grains as clumps of spheres.

    Files: ``clumps.txt``, what YADE's ``ymport.textClumps`` reads (x y z r clumpId, the label);
    ``spheres.csv``, the same as a table; ``clumps.csv``, a row a grain with the volume and inertia
    of the grain itself and the errors of its clump.

    Args:
        folder: Folder to make.
        grains: :class:`~mufe_fenicsx.geometry.grains.Grains`.
        num_spheres, missing, grow: See :func:`~mufe_fenicsx.peers.clumps.clump_of`.
        progress: Called with the number of grains done, of all, and the label.
        overwrite: Replace a folder that was written so.

    Returns:
        Summary, a dict: means and the worst of the errors.

    Raises:
        InputError: no spheres, a part that is none, or a folder that is in use.
    """
    if num_spheres < 1:
        raise InputError(f"--spheres = {num_spheres}, expected at least 1")
    if not 0 <= missing < 1:
        raise InputError(f"--missing = {missing}, expected 0 <= missing < 1")
    rows, spheres = [], []
    with new_folder(folder, overwrite=overwrite, marker=TABLE) as made:
        for k, body in enumerate(bodies_of(grains), start=1):
            clump = clump_of(body, num_spheres, missing, grow)
            rows.append(_row(body, clump))
            places = body.in_sample(clump.centres)
            spheres += [
                (body.label, *place, radius)
                for place, radius in zip(places.tolist(), clump.radii.tolist(), strict=True)
            ]
            if progress is not None:
                progress(k, grains.num_grains, body.label)
        with (made / YADE).open("w", encoding="ascii") as file:
            file.write("#format x_y_z_r_clumpId\n# lengths in metres, clumpId the label\n")
            file.writelines(
                f"{x:.12g} {y:.12g} {z:.12g} {r:.12g} {label}\n" for label, x, y, z, r in spheres
            )
        with (made / SPHERES).open("w", newline="", encoding="utf-8") as file:
            table = csv.writer(file)
            table.writerow(("label", "x_m", "y_m", "z_m", "radius_m"))
            table.writerows(spheres)
        with (made / TABLE).open("w", newline="", encoding="utf-8") as file:
            table = csv.DictWriter(file, rows[0])
            table.writeheader()
            table.writerows(rows)
    found = {name: np.abs([row[name] for row in rows]) for name in ERRORS}
    return {
        "folder": str(Path(folder)),
        "num_grains": grains.num_grains,
        "num_spheres": len(spheres),
        **{f"mean_{name}": float(values.mean()) for name, values in found.items()},
        **{f"largest_{name}": float(values.max()) for name, values in found.items()},
    }


def _row(body, clump):
    return {
        "label": body.label,
        "spheres": len(clump.radii),
        "volume_m3": body.volume,
        **{f"centroid_{a}_m": body.centroid[k] for k, a in enumerate("xyz")},
        **{f"moment_{k + 1}_m5": body.moments[k] for k in range(3)},
        **{f"quaternion_{a}": body.quaternion[k] for k, a in enumerate("xyzw")},
        "smallest_radius_m": clump.radii.min(),
        "largest_radius_m": clump.radii.max(),
        "growth_m": clump.growth,
        **{name: getattr(clump, name) for name in ERRORS},
    }
