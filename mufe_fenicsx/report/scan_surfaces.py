"""Surfaces of grains from scans over those of a run: for the 3D view of a page, for ParaView.

Those of a scan are of its labels (:func:`~mufe_fenicsx.geometry.form.shape.label_surface`). Each
knows how far its nodes are from the other one of the same grain, outside positive.
"""

import json
from dataclasses import dataclass

import numpy as np
import pyvista

from mufe_fenicsx.container import CYLINDER, WALLS
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.form.shape import label_surface
from mufe_fenicsx.geometry.image.labels import grains_in
from mufe_fenicsx.machine.files import own_folder
from mufe_fenicsx.report import style
from mufe_fenicsx.report.packing import GRID_STEPS, Packer, to_bytes, to_grid
from mufe_fenicsx.report.paraview import save_polydata, write_series
from mufe_fenicsx.report.sample import boundary_faces
from mufe_fenicsx.report.surfaces import in_order
from mufe_fenicsx.report.view import parts_of
from mufe_fenicsx.report.view_data import ViewData, maps

#: Grains that are shown unless others are chosen, and nodes of a surface in the page.
FEW, NODES = 6, 800
FOLDER, KINDS = "surfaces", ("run", "scan")
#: What is told of a surface: of all its nodes, root mean square and largest.
COLUMNS = {"rms": "Distance to the other surface, root mean square", "most": "The same, largest"}


@dataclass(frozen=True)
class Stage:
    """Surfaces at one scan."""

    name: str  #: of the scan
    strain: float  #: of the run there [-]
    time: float  #: the same [s]
    pairs: dict  #: grain -> (of the run, of the scan), pyvista.PolyData, "distance" at points [m]


def grains_shown(table, chosen=()):
    """Those that are asked for, else the few whose displacements differ most in a table.

    Raises:
        InputError: One that is asked for is not in the table.
    """
    known = table["grain"].tolist()
    for grain in chosen:
        if grain not in known:
            raise InputError(f"grain {grain} is not compared, expected one of {known[0]} to "
                             f"{known[-1]} that is tracked")  # fmt: skip
    if chosen:
        return sorted(set(chosen))
    worst = table.nlargest(FEW, "displacement_difference")["grain"]
    return sorted(worst.tolist())


def stage_of(name, moment, labels, label_of, voxel_size, shift=(0.0, 0.0, 0.0)):
    """Surfaces of grains at one scan.

    Args:
        name: Of the scan.
        moment: :class:`~mufe_fenicsx.results.scans.Moment`, the run there.
        labels: Of the scan, (z, y, x).
        label_of: Labels of the grains that are shown, dict; those with 0 are left out.
        voxel_size: [m].
        shift: By which the run is moved before [m].

    Returns:
        :class:`Stage`.
    """
    pairs, boxes = {}, dict(grains_in(labels))
    for grain, label in label_of.items():
        if label not in boxes:
            continue
        points, triangles, _ = label_surface(labels, label, boxes[label], voxel_size)
        faces, _ = boundary_faces(moment.state.cells[moment.state.grain == grain])
        nodes, own = np.unique(faces, return_inverse=True)
        run = pyvista.PolyData.from_regular_faces(
            moment.points[nodes] + np.asarray(shift), own.reshape(-1, 3)
        )
        scan = pyvista.PolyData.from_regular_faces(points, triangles)
        for one, other in ((run, scan), (scan, run)):
            away = one.compute_implicit_distance(other)["implicit_distance"]
            one.point_data["distance"] = np.asarray(away)
        pairs[grain] = run, scan
    return Stage(name, moment.strain, moment.time, pairs)


def write_surfaces(folder, stages):
    """Write ``surfaces/run_0000.vtp`` …, ``scan_0000.vtp`` … and lists of both for ParaView.

    Their time is that of the run [s], as of its other files: all play together.
    """
    folder = own_folder(folder / FOLDER)
    for k, kind in enumerate(KINDS):
        listed = []
        for number, stage in enumerate(stages):
            parts = []
            for grain, pair in stage.pairs.items():
                parts.append(pair[k].copy())
                parts[-1].cell_data["grain"] = np.full(pair[k].n_cells, grain, np.int32)
            file = f"{kind}_{number:04d}.vtp"
            save_polydata(pyvista.merge(parts) if parts else pyvista.PolyData(), folder / file)
            listed.append({"name": file, "time": stage.time})
        write_series(folder / f"{kind}.vtp.series", listed)


def view_of(stages, container):
    """The stages as a :class:`~mufe_fenicsx.report.view.View` of the page; None without surfaces.

    Each surface is a body of its own there, which is shown at its stage alone.
    """
    rows = [
        (grain, k, number, _thin(pair[k]))
        for number, stage in enumerate(stages)
        for grain, pair in stage.pairs.items()
        for k in range(2)
    ]
    if not rows:
        return None
    packer, points = Packer(), np.concatenate([mesh.points for *_, mesh in rows])
    low, high = points.min(axis=0), points.max(axis=0)
    counts = [mesh.n_points for *_, mesh in rows]
    first = np.append(0, np.cumsum(counts)[:-1])
    faces = [mesh.regular_faces + at for at, (*_, mesh) in zip(first, rows, strict=True)]
    a, b, c = in_order(np.concatenate(faces)).T
    packer.add("num_of_grain", counts, "u4")
    packer.add("faces", np.concatenate([np.diff(a, prepend=0), b - a, c - a]), "u4")
    steps = to_grid(points, low, high)
    packer.add("points.0", steps.T, "u2", differences=True)
    for number in range(len(stages)):
        packer.add(f"points.{number + 1}", 0 * steps.T, "u2", differences=True)
    packer.add("colour", [k for _, k, *_ in rows], "u1")
    for name, table in maps().items():
        packer.add(f"map.{name}", table, "u1")
    header = {
        "low": low.tolist(), "high": high.tolist(),
        "labels": [int(grain) for grain, *_ in rows],
        "sources": [{"kind": KINDS[k], "stage": number} for _, k, number, _ in rows],
        "stages": [
            {"state": n, "strain": stage.strain, "time": n, "stage": stage.name}
            for n, stage in enumerate(stages)
        ],
        "fields": [_pack_distance(packer, rows, len(stages))],
        "columns": _pack_columns(packer, rows, len(stages)),
        "walls": list(WALLS), "round": container is CYLINDER, "arrays": packer.entries,
    }  # fmt: skip
    step = (high - low).max() / GRID_STEPS / 2
    grains = style.number(len({grain for grain, *_ in rows}))
    text = (
        f"Surfaces of {grains} grains at {len(stages)} scans: those of the run, and of the labels, "
        f"smoothed, thinned to {NODES} nodes or so. Positions are exact to "
        f"{style.quantity(step, 'm', 2)}. All are in {FOLDER} for ParaView."
    )
    told = json.dumps(header, ensure_ascii=False).replace("<", "\\u003c")
    return parts_of(ViewData(told, packer.text(), text))


def _thin(mesh):
    """A surface of few nodes, with distances and outward triangles."""
    share = 1 - NODES / mesh.n_points
    if share <= 0:
        return mesh
    thin = mesh.decimate_pro(share, splitting=False, preserve_topology=True)
    kept, used = np.unique(thin.regular_faces, return_inverse=True)
    found = pyvista.PolyData.from_regular_faces(thin.points[kept], used.reshape(-1, 3))
    found.point_data["distance"] = thin["distance"][kept]
    return found


def _pack_distance(packer, rows, num_stages):
    """Pack the distances, the same at all stages; what the page has to know of them."""
    values = np.concatenate([mesh["distance"] for *_, mesh in rows])
    most = float(np.abs(values).max()) or 1.0
    q = to_bytes(values, -most, most, 1)
    for number in range(num_stages):
        packer.add(f"field.distance.{number}", q, "u1", differences=True)
    limit = style.round_limit(float(np.percentile(np.abs(values), 99)) or most)
    factor, unit = style.unit_of([limit], "m")
    return {
        "name": "distance", "title": "Distance to the other surface, outside positive",
        "unit": unit, "factor": factor, "low": -most, "high": most, "power": 1, "limit": limit,
        "colours": "signed",
    }  # fmt: skip


def _pack_columns(packer, rows, num_stages):
    """Pack the numbers of the surfaces, the same at all stages; what the page has to know."""
    found = {"rms": [], "most": []}
    for *_, mesh in rows:
        away = np.abs(mesh["distance"])
        found["rms"].append(np.sqrt(np.mean(away**2)))
        found["most"].append(away.max())
    columns = []
    for name, values in found.items():
        factor, unit = style.unit_of(values, "m")
        for number in range(num_stages):
            packer.add(f"grain.{name}.{number}", values, "f4")
        columns.append(
            {"name": name, "title": COLUMNS[name], "unit": unit, "factor": factor,
             "high": float(max(values)), "signed": False, "coloured": False}
        )  # fmt: skip
    return columns
