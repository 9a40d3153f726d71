"""The folder of one run: its creation, run.json and versions."""

import contextlib
import importlib
import importlib.metadata
import json
import os
import platform
import tempfile
from pathlib import Path

import mufe_fenicsx
from mufe_fenicsx.errors import InputError, raise_on_broken_pipes, raise_together, shortened
from mufe_fenicsx.machine.files import parts_of, reason, regular, write_atomically
from mufe_fenicsx.output.run_kinds import sorted_out

#: Made by whoever writes into a run folder, and gone when that ends (:mod:`.run_lock`).
LOCK = "run.lock"

#: Time by parts, of runs with a profile.
PROFILE = "profile.csv"

#: What a run and its report write into their folder; only this, and parts of it, is ever deleted.
OWN_FILES = (
    "scene.toml",
    "run.json",
    "history.csv",
    "events.csv",
    "strengths.csv",
    PROFILE,
    "quality.csv",
    "quality.png",
    "grains.csv",
    "labels.csv",
    "label_contacts.csv",
    "labels.png",
    "report.html",
    "paraview_state.py",
    "paraview/*.vtp",
    "paraview/*.vtp.series",
    "fields/*.vtkhdf",
    "fields/mesh.h5",
    "fields/states.vtkhdf.series",
    "figures/*.png",
    "figures/*.pdf",
    "figures/*.csv",
    "figures/*.tex",
    "figures/animation.*",
    "figures/index.json",
    "contacts/*.csv",
    "contacts/*.vtkhdf",
    "contacts/states.vtkhdf.series",
    "tools/*.vtkhdf",
    "tools/states.vtkhdf.series",
    "fields/mesh_*.h5",
    "retries.log",
    "checkpoints/step-*/rank-*.h5",
    "checkpoints/step-*/manifest.json",
)

OWN_FOLDERS = ("fields", "figures", "contacts", "tools", "checkpoints", "paraview")


def remove_states_after(folder, states, *patterns):
    """Remove what was stored in a folder after ``states``; what went wrong, or None.

    Args:
        folder: Of the files.
        states: List of dicts whose ``name`` is the file of a state; its stem is its number.
        patterns: Of the files whose names end with that number.
    """
    kept = {Path(state["name"]).stem for state in states}
    try:
        for name in (state["name"] for state in states):
            if not (folder / name).is_file():
                return f"{folder / name} is missing, expected the state that the checkpoint counts"
        for path in folder.glob("*.part"):
            path.unlink()
        for pattern in patterns:
            for path in folder.glob(pattern):
                if path.stem[-4:] not in kept:
                    path.unlink()
        series = folder / "states.vtkhdf.series"
        if states:
            content = {"file-series-version": "1.0", "files": states}
            write_atomically(series, json.dumps(content, indent=1) + "\n")
        else:
            series.unlink(missing_ok=True)
    except InputError as error:
        return str(error)
    except OSError as error:
        return f"{folder} cannot be written ({reason(error)})"
    return None


def check_run_folder(comm, folder, overwrite=False):
    """See that a folder can become that of a run; nothing is written. Collective.

    Args:
        comm: MPI communicator; rank 0 does the work.
        folder: Path.
        overwrite: It may hold an earlier run.

    Raises:
        InputError: It is not empty, not a folder, cannot be written to, or a part of an earlier
            run leads out of it; on all ranks.
    """
    raise_together(comm, _obstacle(Path(folder), overwrite) if comm.rank == 0 else None)


def create_run_folder(comm, folder, lock, overwrite=False):
    """Create the folder of a run, take its lock and see that it can be written to. Collective.

    Args:
        comm: MPI communicator; rank 0 does the work.
        folder: Path; parents are created too.
        lock: Its :class:`~.run_lock.RunLock`.
        overwrite: Delete the files of an earlier run (:data:`OWN_FILES`) if it is
            not empty. Files that the program did not write stay.

    Returns:
        Folders that were made, for :func:`abandon_run_folder`; on rank 0.

    Raises:
        InputError: As of :func:`check_run_folder`, or another run writes it; nothing is left.
    """
    folder, made, message = Path(folder), [], None
    check_run_folder(comm, folder, overwrite)
    if comm.rank == 0:
        made = [p for p in (folder, *folder.parents) if not p.exists()]
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            message = f"output folder {folder} cannot be created ({reason(error)})"
    raise_together(comm, message)
    try:
        lock.take()
        if comm.rank == 0:
            message = _prepare(folder, overwrite)
        raise_together(comm, message)
    except InputError:
        lock.free()
        if comm.rank == 0:
            _remove_empty(made)
        raise
    return made


def abandon_run_folder(folder, made):
    """Remove what a run that cannot begin has written. To be called on one rank.

    Args:
        folder: The run folder.
        made: What :func:`create_run_folder` returned.
    """
    with contextlib.suppress(OSError):
        _remove_own_files(Path(folder))
    _remove_empty(made)


def _remove_empty(folders):
    for path in folders:
        with contextlib.suppress(OSError):
            path.rmdir()


def check_inside(folder):
    """Raise InputError where a folder of a run's own files is a link that leads elsewhere."""
    folder = Path(folder)
    for path in [folder / name for name in OWN_FOLDERS] + list(folder.glob("checkpoints/step-*")):
        if path.is_symlink():
            raise InputError(
                f"{path} is a symbolic link, expected a folder: what is outside of a run folder "
                "is not deleted"
            )


def _obstacle(folder, overwrite):
    """What keeps a folder from becoming that of a run, or None."""
    try:
        first = next(p for p in (folder, *folder.absolute().parents) if p.exists())
        if not first.is_dir():
            return f"output folder {folder} is not a folder (a part of the path is a file)"
        if not os.access(first, os.W_OK | os.X_OK):
            return f"output folder {folder} cannot be written to (no permission in {first})"
        if first != folder:
            return None
        if not overwrite and (message := _not_empty(folder)):
            return message
        check_inside(folder)
    except InputError as error:
        return str(error)
    except OSError as error:
        return f"output folder {folder} cannot be written to ({reason(error)})"
    return None


def _not_empty(folder):
    """Line for a folder that holds more than the lock of its run, or None."""
    if all(path.name.startswith(LOCK) for path in folder.iterdir()):
        return None
    resume = "--resume to go on with its run, " if any(folder.glob("checkpoints/step-*")) else ""
    return (
        f"output folder {folder} is not empty, expected a new one, {resume}or --overwrite to "
        "replace its run"
    )


def _prepare(folder, overwrite):
    """Empty the folder and try it; what went wrong, or None."""
    try:
        if overwrite:
            check_inside(folder)
            _remove_own_files(folder)
        elif message := _not_empty(folder):
            return message
        with tempfile.TemporaryFile(dir=folder) as probe:
            probe.write(b"x" * 4096)
            probe.flush()
    except InputError as error:
        return str(error)
    except OSError as error:
        return f"output folder {folder} cannot be written to ({reason(error)})"
    return None


def _remove_own_files(folder):
    inside = folder.resolve()
    for pattern in OWN_FILES:
        for path in [*folder.glob(pattern), *folder.glob(parts_of(pattern))]:
            if path.parent.resolve().is_relative_to(inside) and not path.is_dir():
                path.unlink()
    folders = [folder / name for name in OWN_FOLDERS]
    for path in [*folder.glob("checkpoints/step-*"), *folders]:
        if path.is_dir() and not path.is_symlink() and not any(path.iterdir()):
            path.rmdir()


def write_run_json(folder, run):
    """Write run.json atomically. To be called on one rank.

    Args:
        folder: The run folder.
        run: Dictionary of numbers, strings, lists and NumPy scalars or arrays.

    Raises:
        InputError: It cannot be written.
    """
    text = json.dumps(run, indent=2, default=plain, ensure_ascii=False)
    write_atomically(Path(folder) / "run.json", text + "\n")


def plain(value):
    """A NumPy scalar or array, or a path, as JSON can hold it."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")


def read_run_json(folder):
    """What run.json says; entries that are of another kind than they should be are left out.

    Raises:
        InputError: It is absent or not a JSON object.
    """
    return sorted_out(_read_run_json(folder))[0]


def wrong_entries(folder):
    """Names of the entries of run.json that are left out; raises as :func:`read_run_json`."""
    return sorted_out(_read_run_json(folder))[1]


def _read_run_json(folder):
    path = Path(folder) / "run.json"
    try:
        run = json.loads(regular(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path} cannot be read ({reason(error)})") from error
    except RecursionError:
        raise InputError(f"{path} is nested too deep, expected what mufe run wrote") from None
    except ValueError as error:
        raise InputError(f"{path} is not valid JSON ({shortened(error)})") from error
    if not isinstance(run, dict):
        raise InputError(f"{path} holds a {type(run).__name__}, expected a JSON object")
    return run


def versions():
    """Versions of the program and of what it computes with, dict name -> text."""
    result = {"mufe_fenicsx": mufe_fenicsx.__version__, "python": platform.python_version()}
    distributions = {"dolfinx": "fenics-dolfinx"}
    for name in ("dolfinx", "petsc4py", "mpi4py", "numpy", "numba", "gmsh"):
        try:
            result[name] = importlib.metadata.version(distributions.get(name, name))
        except importlib.metadata.PackageNotFoundError:
            try:
                result[name] = str(importlib.import_module(name).__version__)
            except (ImportError, OSError, AttributeError):
                result[name] = "absent"
    raise_on_broken_pipes()  # dolfinx, where it had to be asked, has started PETSc
    return result
