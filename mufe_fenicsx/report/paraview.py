"""Files for ParaView: contacts as lines with what they carry, and a script that shows the run.

Written into a run folder: ``paraview/contacts_0003.vtp`` of each stored state, their list
``paraview/contacts.vtp.series`` with times, and ``paraview_state.py``; likewise
``paraview/grains_0003.vtp`` and ``paraview/grains.vtp.series`` with the strain around each grain,
and ``paraview/fragments_0003.vtp`` and ``paraview/fragments.vtp.series`` of grains that can break.
"""

import errno
import json
import pprint
from importlib.resources import files
from pathlib import Path

import numpy as np
import pyvista
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.machine.files import own_folder, reason, replacing, write_atomically
from mufe_fenicsx.output.quantities import about_field
from mufe_fenicsx.report import style
from mufe_fenicsx.results.localisation import Places, strain_table

FOLDER, SERIES, SCRIPT = "paraview", "contacts.vtp.series", "paraview_state.py"
GRAINS, FRAGMENTS = "grains.vtp.series", "fragments.vtp.series"
#: What a line carries, by its name in the table of contacts; vectors have three columns there.
NUMBERS = {
    "normal_force": np.float64,
    "area": np.float64,
    "friction_work": np.float64,
    "ratio": np.float64,
    "mobilised": np.float64,
    "strong": np.int8,
    "sliding": np.int8,
    "chain": np.int32,
    "grain_a": np.int32,
    "grain_b": np.int32,
}
VECTORS = ("normal", "force", "shear", "friction", "torque", "centroid")
#: Where the script holds what was found in the run.
MARK = "SETTINGS = {}"


def write_paraview(run):
    """Write the files into the run folder.

    Args:
        run: :class:`mufe_fenicsx.results.Run`.

    Returns:
        dict of plain values: ``script`` (path), ``contacts`` (number of states with contacts),
        ``grains`` (number of states with strains of grains), ``fragments`` (of pieces in the last
        state, 0 where grains cannot break),
        ``stages`` (strains of the three stages side by side), ``missing`` (sentences).

    Raises:
        InputError: No state was stored, or the folder cannot be written to.
    """
    states, missing = run.states, []
    if states.empty:
        raise InputError(f"{run.path / 'fields'} has no stored states, expected some to show")
    folder = run.path / FOLDER
    try:
        own_folder(folder)
    except OSError as error:
        raise InputError(f"{folder} cannot be created ({reason(error)})") from error
    listed = []
    for index, state in states.iterrows():
        try:
            lines = contact_lines(run, index)
        except InputError as error:
            missing.append(f"No contacts of state {index}: {error}.")
            continue
        name = f"contacts_{index:04d}.vtp"
        _save(lines, folder / name, "active_contacts")
        listed.append({"name": name, "time": float(state["time"])})
    write_series(folder / SERIES, listed)
    try:
        num_grains = _write_grains(run, folder)
    except InputError as error:
        num_grains = 0
        missing.append(f"No strains of grains: {error}.")
    settings = _settings(run, bool(listed))
    num_fragments = _write_fragments(run, folder)
    text = (files("mufe_fenicsx.report") / "assets" / SCRIPT).read_text(encoding="utf-8")
    text = text.replace(MARK, f"SETTINGS = {pprint.pformat(settings, sort_dicts=False)}", 1)
    write_atomically(run.path / SCRIPT, text)
    return {
        "script": str(run.path / SCRIPT),
        "contacts": len(listed),
        "grains": num_grains,
        "fragments": num_fragments,
        "stages": [stage["strain"] for stage in settings["stages"]],
        "missing": missing,
    }


def contact_lines(run, number):
    """Active contacts of a stored state as lines between centres, or from wall to centre.

    Returns:
        pyvista.PolyData: a line a contact, in the order of ``run.active_contacts(number)``, from
        grain_a to grain_b. Cell data are those of the table (SI units): ``force`` on grain_a,
        ``normal`` towards it, ``normal_force``, ``ratio`` over the mean of its kind,
        ``mobilised`` friction, ``sliding``, ``strong``, ``chain``, ``grain_a``, ``grain_b`` (0: a
        wall); point data ``grain``.

    Raises:
        InputError: The tables of contacts, or of the scene's friction, are not there.
    """
    table, grains = run.active_contacts(number), run.grains(number)
    centres = grains[["center_x", "center_y", "center_z"]].to_numpy()
    a = np.searchsorted(grains["grain"].to_numpy(), table["grain_a"].to_numpy())
    start = centres[a]
    end = start - table[["branch_x", "branch_y", "branch_z"]].to_numpy()
    points = np.stack([start, end], axis=1).reshape(-1, 3)
    lines = np.column_stack([np.full(len(a), 2), np.arange(len(points)).reshape(-1, 2)])
    found = pyvista.PolyData(points, lines=lines.ravel()) if len(a) else pyvista.PolyData()
    for name, kind in NUMBERS.items():
        found.cell_data[name] = table[name].to_numpy().astype(kind)
    for name in VECTORS:
        values = table[[f"{name}_{axis}" for axis in "xyz"]].to_numpy(dtype=float)
        array = numpy_to_vtk(values, deep=True)  # pyvista takes none without rows
        array.SetName(name)
        found.GetCellData().AddArray(array)
    ends = table[["grain_a", "grain_b"]].to_numpy().ravel()
    found.point_data["grain"] = ends.astype(np.int32)
    return found


def grain_points(first, now):
    """Grains as points with the strain around them since an earlier state.

    Args:
        first, now: :class:`~mufe_fenicsx.results.localisation.Places`.

    Returns:
        pyvista.PolyData: the centres of the grains, in the order of their labels. Point data are
        the numbers of ``run.localisation()``, and ``radius`` of a ball of the same volume [m].

    Raises:
        InputError: The grains are too few, or too far apart.
    """
    table = strain_table(first, now)
    found = pyvista.PolyData(now.centre)
    for name in table:
        found.point_data[name] = (
            table[name]
            .to_numpy()
            .astype(np.int32 if name in ("grain", "num_cells", "inside") else np.float64)
        )
    found.point_data["radius"] = now.radius
    return found


def _write_grains(run, folder):
    """Write the points of all states; their number."""
    first, listed = None, []
    for index, state in run.states.iterrows():
        now = Places.of(run.state(index))
        first = first or now
        name = f"grains_{index:04d}.vtp"
        _save(grain_points(first, now), folder / name, "localisation")
        listed.append({"name": name, "time": float(state["time"])})
    write_series(folder / GRAINS, listed)
    return len(listed)


def fragment_points(state):
    """Pieces of the grains in a state as points at their centres; whole grains are one.

    Args:
        state: :class:`~mufe_fenicsx.results.state.State` with the field ``fragment``.

    Returns:
        pyvista.PolyData. Point data: ``grain``, ``fragment`` (0: the largest of its grain),
        ``volume`` [m³], ``radius`` of a ball of the same volume [m], ``crack`` (softening of the
        worst facet, 1: failed).
    """
    names = np.stack([state.grain, state.field("fragment")], axis=1)
    names, of = np.unique(names, axis=0, return_inverse=True)
    of, middle = of.ravel(), state.points[state.cells].mean(axis=1)
    volume = np.bincount(of, state.volume)
    centre = np.column_stack([np.bincount(of, state.volume * x) for x in middle.T])
    found = pyvista.PolyData(centre / volume[:, None])
    worst = np.zeros(len(names))
    np.maximum.at(worst, of, state.field("crack"))
    found.point_data["grain"], found.point_data["fragment"] = names.T.astype(np.int32)
    found.point_data["volume"] = volume
    found.point_data["radius"] = np.cbrt(0.75 / np.pi * volume)
    found.point_data["crack"] = worst
    return found


def _write_fragments(run, folder):
    """Write the pieces of all states; how many there are in the last one."""
    if "fragment" not in run.state(-1).fields:
        return 0
    listed = []
    for index, state in run.states.iterrows():
        points, name = fragment_points(run.state(index)), f"fragments_{index:04d}.vtp"
        _save(points, folder / name, "fields")
        listed.append({"name": name, "time": float(state["time"])})
    write_series(folder / FRAGMENTS, listed)
    return points.n_points


def write_series(path, listed):
    """List files with their times, as ParaView reads them."""
    series = {"file-series-version": "1.0", "files": listed}
    write_atomically(path, json.dumps(series, indent=1) + "\n")


def _save(lines, path, method):
    """Write lines or points that carry numbers of a method of `Run`, and what these are."""
    about = [
        about_field(array.GetName(), array.GetNumberOfComponents(), method)[1]
        for data in (lines.GetPointData(), lines.GetCellData())
        for array in (data.GetArray(k) for k in range(data.GetNumberOfArrays()))
    ]
    if about:
        lines.field_data["about"] = about
    save_polydata(lines, path)


def save_polydata(data, path):
    """Write a pyvista.PolyData as a .vtp file, all of it or nothing.

    Raises:
        InputError: It cannot be written.
    """
    writer = vtkXMLPolyDataWriter()
    writer.SetInputData(data)
    try:
        with replacing(path) as part:
            writer.SetFileName(str(part))
            if not writer.Write():
                raise OSError(errno.EIO, "VTK did not write it whole")
    except OSError as error:
        raise InputError(f"{path} cannot be written ({reason(error)})") from error


def _settings(run, contacts):
    """What the script needs to know: folder, three stages, ends of the colours, the box."""
    states = run.states
    places = np.unique(np.linspace(0, len(states) - 1, 3).round().astype(int))
    chosen = states.iloc[places]
    limit = max(float(np.percentile(run.state(i).von_mises, 99)) for i in chosen.index)
    force = 0.0
    if contacts:
        last = run.with_contacts().index[-1]
        table = run.active_contacts(last)
        force = float(table["normal_force"].max()) if len(table) else 0.0
    last = run.state(-1)
    return {
        "folder": str(Path(run.path).resolve()),
        "stages": [
            {"file": f"fields/{index:04d}.vtkhdf", "strain": float(state["strain"])}
            for index, state in chosen.iterrows()
        ],
        "stress": style.round_limit(limit),
        "contacts": contacts,
        "force": style.round_limit(force),
        "fragments": int(last.field("fragment").max()) if "fragment" in last.fields else 0,
        "box": run.box.tolist(),
    }
