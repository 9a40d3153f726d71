"""Whether a checkpoint belongs to the scene and the grains that a run is to go on with."""

import tomllib
from contextlib import contextmanager
from pathlib import Path

from ..errors import InputError, Interrupted, SolverError, raise_together, shortened, shown
from ..machine.ranks import on_first_rank
from ..output.checkpoint import file_checksum
from ..output.record import lost_results
from ..output.run_folder import read_run_json
from .run_place import say


def grains_checksum(comm, grains_folder):
    """Checksum of the file of grains. Collective.

    Raises:
        InputError: There is none.
    """
    found = on_first_rank(comm, lambda: file_checksum(file_of_grains(grains_folder)))
    return comm.bcast(found)


def file_of_grains(path):
    """The file of grains in a folder, or that it is itself. Local.

    Raises:
        InputError: There is none.
    """
    path = Path(path)
    file = path / "grains.h5" if path.is_dir() else path
    if not file.exists():
        raise InputError(f"grains = {path} has no grains, expected a folder that `mufe mesh` wrote")
    return file


#: Keys of a scene that may differ where a run goes on, beside when the test ends; tables that
#: came before it, when what is written, and how time goes on.
FREE_KEYS = ("title", "sample.grains", "solver.integrator", "loading.tolerance")
FREE_TABLES = ("image", "mesh", "output", "implicit", "reference")
#: Tables that may differ where the integrator does: what drives only one of them.
OF_INTEGRATOR = ("quasi_static", "mass_scaling")
#: Where the test ends: it may do so later, or earlier but not before the checkpoint.
END = "oedometer.strain"
#: Parts of a test: those that have not begun may be others.
STAGES = "stage"
#: All of these, for a message.
MAY_CHANGE = ", ".join(
    (
        END,
        "[[stage]] to come",
        *FREE_KEYS,
        *(f"[{name}]" for name in FREE_TABLES),
        f"and {' and '.join(f'[{name}]' for name in OF_INTEGRATOR)} with the integrator",
    )
)


#: Entries that a checkpoint has, and their types.
ENTRIES = {
    **dict.fromkeys(("scene", "grains"), str),
    **dict.fromkeys(("tools", "state", "loading", "recorder"), dict),
    **dict.fromkeys(("written_by", "rank_of_grain", "retries"), list),
    **dict.fromkeys(("resumed_at_steps", "balanced_at_steps"), list),
    **dict.fromkeys(("step", "strain", "wall_s", "setup_s"), float | int),
    "separation": dict | None,
}


@contextmanager
def reading(checkpoint):
    """Whatever the use of a checkpoint raises that no run wrote becomes an InputError. Local."""
    try:
        yield
    except (InputError, SolverError, Interrupted):
        raise
    except Exception as error:
        if checkpoint is None:
            raise
        said = shortened(f"{type(error).__name__}: {error}")
        raise InputError(
            f"checkpoint {checkpoint.path} holds what no run wrote ({said}), expected one that "
            "`mufe run` wrote: --overwrite begins again"
        ) from error


def check_origin(comm, checkpoint, identity, folder, quiet):
    """See that a checkpoint belongs to this scene and these grains, and that there is more to do.

    Raises:
        InputError: It does not; on all ranks.
    """
    for notice in checkpoint.notices:
        say(comm, notice, quiet)

    def look():
        with reading(checkpoint):
            message = _wrong_entry(checkpoint) or _other_origin(checkpoint, identity, folder)
        if message is not None:
            raise InputError(message)

    on_first_rank(comm, look)


def _wrong_entry(checkpoint):
    """The line for an entry that is missing, or of another type, or None."""
    for name, kind in ENTRIES.items():
        if not isinstance(checkpoint.header.get(name, checkpoint), kind):
            return (
                f"{name} of checkpoint {checkpoint.path} is missing or of another type, expected "
                "what `mufe run` wrote: --overwrite begins again"
            )
    return None


def _other_origin(checkpoint, identity, folder):
    """What keeps a run from going on, or None."""
    header = checkpoint.header
    changed = _first_difference(header["scene"], identity["scene"])
    if changed:
        return (
            f"{changed}, expected the value of checkpoint {checkpoint.path}: a run that goes "
            f"on may only change {MAY_CHANGE}"
        )
    if header["grains"] != identity["grains"]:
        return (
            f"grains of checkpoint {checkpoint.path} are others than those given, "
            "expected the grains that the run began with"
        )
    if header["tools"] != identity["tools"]:
        return _other_file(header["tools"], identity["tools"], checkpoint.path)
    return _nothing_to_do(header, identity["scene"], folder)


def _other_file(then, now, path):
    """Which file of a tool differs from that of a checkpoint at ``path``."""
    file = next(file for file in now if now[file] != then.get(file))
    return (
        f"{file} is another file than that of checkpoint {path}, expected the one that the run "
        "began with"
    )


def check_results(comm, checkpoint, folder, accept_loss, quiet):
    """See that results are as the checkpoint counts them, or leave out what is not. Collective."""
    message, lost, left = None, None, None
    if comm.rank == 0:
        try:
            with reading(checkpoint):
                lines, strain, left = lost_results(folder, checkpoint.header["recorder"])
            lost = _words_of_lost(lines, strain, checkpoint, folder) if lines else None
        except InputError as error:
            message = str(error)
    if accept_loss:
        say(comm, lost and f"{lost}; going on without them", quiet)
    elif lost is not None:
        message = f"{lost}; expected them as they were written, or --accept-loss to go on without "
        message += "them"
    raise_together(comm, message)
    checkpoint.header["recorder"] = comm.bcast(left)


def _words_of_lost(lines, strain, checkpoint, folder):
    more = f" and {len(lines) - 3} more" if len(lines) > 3 else ""
    return (
        f"results in {folder} are not those that checkpoint {checkpoint.path.name} "
        f"counts, from strain {strain:.4g} on: {', '.join(lines[:3])}{more}"
    )


def integrator_of(scene):
    """The integrator of a scene in TOML."""
    return tomllib.loads(scene)["solver"].get("integrator", "explicit")


def _nothing_to_do(header, scene, folder):
    """What is wrong with the end of the test that a scene wants, or None."""
    old, new = (tomllib.loads(text).get(STAGES) for text in (header["scene"], scene))
    if new is not None:
        return _wrong_stages(old, new, header["loading"]["common"]["index"] + 1, folder)
    old, new = (tomllib.loads(text)["oedometer"]["strain"] for text in (header["scene"], scene))
    if read_run_json(folder).get("finished") and new <= old:
        return (
            f"run in {folder} is finished, expected one to go on with, or {END} above {old:g} "
            "to prolong it"
        )
    if new < min(old, header["strain"]):  # one killed after its last checkpoint only has to end
        return f"{END} = {new:g}, expected more than {header['strain']:.4g}, which is reached"
    return None


def _wrong_stages(old, new, num_begun, folder):
    """What is wrong with the stages that a scene wants, or None."""
    begun = f"{num_begun} stage{'s' if num_begun > 1 else ''} of the run in {folder}"
    if len(new) < num_begun:
        return f"[[stage]] of the scene = {len(new)}, expected the first {begun}, which have begun"
    for number, (then, now) in enumerate(zip(old[:num_begun], new, strict=False), start=1):
        difference = _difference(_flat(then), _flat(now), f"stage[{number}].")
        if difference:
            return f"{difference}, expected the value of the run in {folder}: that stage has begun"
    if read_run_json(folder).get("finished") and len(new) == num_begun:
        return f"all {begun} are done, expected further [[stage]] to go on with"
    return None


def _first_difference(old, new):
    """`key = new value, was old value` of the first key in which two scenes differ, or None."""
    old, new = (_flat(tomllib.loads(text)) for text in (old, new))
    free = FREE_TABLES
    if old.get("solver.integrator") != new.get("solver.integrator"):
        free = (*FREE_TABLES, *OF_INTEGRATOR)
    bound = [
        {
            key: value
            for key, value in scene.items()
            if key not in (*FREE_KEYS, END, STAGES) and key.split(".")[0].split("[")[0] not in free
        }
        for scene in (old, new)
    ]
    return _difference(*bound)


def _difference(old, new, prefix=""):
    """`key = new value, was old value` of the first key in which flat tables differ, or None."""
    for key in [*new, *(k for k in old if k not in new)]:
        if new.get(key) != old.get(key):
            now, then = (shown(of[key]) if key in of else "not set" for of in (new, old))
            return f"{prefix}{key} = {now}, was {then}"
    return None


def _flat(table, prefix=""):
    flat = {}
    for key, value in table.items():
        tables = isinstance(value, list) and value and all(isinstance(v, dict) for v in value)
        if isinstance(value, dict):
            flat |= _flat(value, f"{prefix}{key}.")
        elif tables and key != STAGES:
            for number, table in enumerate(value, start=1):
                flat |= _flat(table, f"{prefix}{key}[{number}].")
        else:
            flat[prefix + key] = value
    return flat
