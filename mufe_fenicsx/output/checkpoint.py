"""Checkpoints of a run: everything that it needs to go on, each whole or not there.

A checkpoint is the folder ``checkpoints/step-000012345`` of a run: a file ``rank-0000.h5`` of
each rank with the tables of its grains, and ``manifest.json`` with what all ranks have in
common, sizes and checksums of these files. It is written beside under another name, brought to
the disk, and then renamed: a folder without that name's end ``.part`` is complete. The last two
are kept, and those that a retry may go back to.

Tables have a column ``grain``: any number of ranks can read them, each the rows of its grains.
"""

import hashlib
import json
import os
import shutil
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from mufe_fenicsx.errors import InputError, raise_together, shortened
from mufe_fenicsx.machine.files import attempt, own_folder, reason, regular, try_room
from mufe_fenicsx.machine.ranks import on_first_rank
from mufe_fenicsx.output.run_folder import plain

FORMAT, VERSION = "mufe checkpoint", 19
MANIFEST = "manifest.json"
#: Checkpoints that stay.
NUM_KEPT = 2
#: Rows of a column that are taken at a time.
BLOCK = 1 << 15


@dataclass(frozen=True)
class Checkpoint:
    """A checkpoint that was found whole."""

    path: Path  #: its folder
    num_ranks: int  #: ranks that wrote it
    header: dict  #: what all ranks have in common
    notices: tuple = ()  #: a line for each later one that cannot be used


class CheckpointWriter:
    """Writes the checkpoints of a run. Collective, as its methods.

    Args:
        comm: MPI communicator.
        folder: The run folder, which exists.
    """

    def __init__(self, comm, folder):
        self.comm, self.folder = comm, Path(folder) / "checkpoints"
        self.last = None  #: folder of the last one, if any
        self._held = ""  # name of the newest of those that stay

    def hold(self, checkpoint):
        """Keep a :class:`Checkpoint` and those before it for the rest of this run; None: none."""
        self._held = "" if checkpoint is None else checkpoint.path.name

    def check_room(self, tables, own):
        """See that the checkpoints which stay, and the next one, fit on the disk. Collective.

        Args:
            tables, own: As of :meth:`write`.

        Raises:
            InputError: They do not, on all ranks.
        """
        needed = (NUM_KEPT + 1) * self.comm.allreduce(_size(tables, own))

        def look():
            folder = self.folder.parent
            free = _free_room(folder)
            if free < needed:
                raise InputError(
                    f"free room in {folder} = {free / 1e6:.3g} MB, expected at least "
                    f"{needed / 1e6:.3g} MB, for {NUM_KEPT} checkpoints and the next one"
                )

        on_first_rank(self.comm, look)

    def write(self, step, tables, own, header):
        """Write one, and remove all but the last two and those held.

        Args:
            step: Number of time steps so far.
            tables: dict of dicts of arrays of this rank, each with a column ``grain``.
            own: dict of arrays of this rank.
            header: What all ranks have in common, fit for JSON; that of rank 0 counts.

        Returns:
            Folder of the checkpoint.

        Raises:
            InputError: It cannot be written, as on a full disk; on all ranks together, and
                earlier ones stay as they are.
        """
        path = self.folder / f"step-{step:09d}"
        part = self.folder / (path.name + ".part")
        message = None
        if self.comm.rank == 0:
            message, _ = attempt(part, lambda: _new_folder(part))
        raise_together(self.comm, message)
        name = f"rank-{self.comm.rank:04d}.h5"
        message, file = attempt(path, lambda: _write_tables(part / name, tables, own))
        files = self.comm.gather(file)
        try:
            raise_together(self.comm, message)
            if self.comm.rank == 0:
                content = {"num_ranks": self.comm.size, "step": step, "files": files, **header}
                message, _ = attempt(path, lambda: self._finish(part, path, content))
            raise_together(self.comm, message)
        except InputError:
            if self.comm.rank == 0:
                shutil.rmtree(part, ignore_errors=True)
            raise
        self.last = path
        return path

    def _finish(self, part, path, content):
        text = _dump(content)
        manifest = {"format": FORMAT, "version": VERSION, "checksum": _checksum(text.encode())}
        with (part / MANIFEST).open("w", encoding="utf-8") as file:
            file.write(json.dumps(manifest)[:-1] + ', "content": ' + text + "}\n")
            file.flush()
            os.fsync(file.fileno())
        _sync_folder(part)
        if path.exists():  # of the same step, by an earlier start
            shutil.rmtree(path)
        os.rename(part, path)
        _sync_folder(self.folder)
        free = sorted(p for p in _folders(self.folder) if p.name > self._held)
        for old in free[:-NUM_KEPT]:
            _remove(old)

    def remove_after(self, checkpoint):
        """Remove all that is later than the checkpoint that a run goes on from, and torn parts.

        Args:
            checkpoint: :class:`Checkpoint`, or None for the start of the run.
        """
        after = "" if checkpoint is None else checkpoint.path.name
        message = None
        if self.comm.rank == 0:
            later = [p for p in _folders(self.folder) if p.name > after]
            parts = list(self.folder.glob("*.part"))
            message, _ = attempt(self.folder, lambda: [_remove(p) for p in later + parts])
        raise_together(self.comm, message)
        self.last = None if checkpoint is None else checkpoint.path


def find_checkpoint(comm, run_folder, before=None):
    """The last checkpoint of a run that is whole. Collective.

    Args:
        comm: MPI communicator.
        run_folder: The run folder.
        before: An earlier one than this :class:`Checkpoint`, or None where there is none.

    Raises:
        InputError: There is none, or it is of another version of the program.
    """
    found, message = None, None
    if comm.rank == 0:
        try:
            found = _find(Path(run_folder) / "checkpoints", before)
        except InputError as error:
            message = None if before else str(error)
    raise_together(comm, message)
    return comm.bcast(found)


def _find(folder, before=None):
    notices = []
    for path in sorted(_folders(folder), reverse=True):
        if before is not None and path.name >= before.path.name:
            continue
        content, damage = _read_manifest(path)
        if content is not None:
            return Checkpoint(path, content["num_ranks"], content, tuple(notices))
        notices.append(f"checkpoint {path} is damaged ({damage}), the one before it is used")
    if notices:
        first = notices[0].removesuffix(", the one before it is used")
        raise InputError(
            f"{first}, expected a whole one, and there is no other: --overwrite begins again"
        )
    raise InputError(
        f"no checkpoint in {folder}, expected one to go on from: --overwrite begins again"
    )


def _read_manifest(path):
    """Content of the manifest of a whole checkpoint and None, or None and what is wrong."""
    try:
        manifest = json.loads(regular(path / MANIFEST).read_text(encoding="utf-8"))
        kind = manifest["format"], manifest["version"]
    except OSError as error:
        return None, f"{MANIFEST}: {reason(error)}"
    except (ValueError, KeyError, TypeError, RecursionError):
        return None, f"{MANIFEST} is torn"
    if kind != (FORMAT, VERSION):
        found = " ".join(map(shortened, kind))
        raise InputError(
            f"format of checkpoint {path} is {found}, expected {FORMAT} {VERSION}: continue "
            "it with the version of the program that wrote it"
        )
    content = manifest.get("content")
    if not isinstance(content, dict) or manifest.get("checksum") != _checksum(
        _dump(content).encode()
    ):
        return None, f"{MANIFEST} has changed"
    names = [f"rank-{rank:04d}.h5" for rank in range(len(_files_of(content)))]
    if not names or content.get("num_ranks") != len(names):
        return None, f"{MANIFEST} does not list one file of each rank"
    for name, file in zip(names, _files_of(content), strict=True):
        if not isinstance(file, dict) or file.get("name") != name:
            return None, f"{MANIFEST} does not list {name}"
        try:
            if (path / name).stat().st_size != file.get("size"):
                return None, f"{name} is torn"
            with regular(path / name).open("rb") as stream:
                if _checksum(stream) != file.get("checksum"):
                    return None, f"{name} has changed"
        except OSError as error:
            return None, f"{name}: {reason(error)}"
    return content, None


def _files_of(content):
    """What a manifest lists of files, a list."""
    files = content.get("files")
    return files if isinstance(files, list) else []


def read_tables(comm, checkpoint, grains, rank_of_grain, only=None):
    """Tables with the rows of this rank's grains, and what ranks had of their own. Collective.

    Where grains are on other ranks than those that wrote it, what they had added up is found on
    rank 0, and the largest of all (names that begin with ``largest``) on every one.

    Args:
        comm: MPI communicator.
        checkpoint: :class:`Checkpoint`.
        grains: Global indices of this rank's grains, increasing, shape (num_grains,).
        rank_of_grain: Ranks of all grains, shape (num_grains_global,).
        only: Columns by the name of their table, where there is one, read with the column
            ``grain``; None: all.

    Raises:
        InputError: A file cannot be read; on all ranks together.
    """
    same = written_by(checkpoint, comm.size, rank_of_grain)
    ranks = [comm.rank] if same else range(checkpoint.num_ranks)
    result, message = None, None
    try:
        files = [checkpoint.path / f"rank-{r:04d}.h5" for r in ranks]
        parts = [_read_part(path, grains, same, only) for path in files]
        result = parts[0] if same else _joined(parts, comm.rank)
    except Exception as error:  # whatever a file raises that no run wrote
        message = f"checkpoint {checkpoint.path} cannot be read ({reason(error)})"
    raise_together(comm, message)
    return result


def written_by(checkpoint, num_ranks, rank_of_grain):
    """Whether as many ranks wrote a checkpoint, each with the same grains."""
    same = num_ranks == checkpoint.num_ranks
    return same and bool(np.array_equal(checkpoint.header["written_by"], rank_of_grain))


def _read_part(path, grains, everything, only):
    tables = {}
    with h5py.File(path, "r") as file:
        for name in file["tables"] if only is None else only.keys() & file["tables"].keys():
            group = file["tables"][name]
            keep = slice(None) if everything else np.isin(group["grain"][:], grains)
            columns = group if only is None else ("grain", *only[name])
            if len({len(group[column]) for column in columns}) > 1:
                raise ValueError(f"columns of table {name} have different lengths")
            tables[name] = {column: group[column][:][keep] for column in columns}
        own = {name: values[()] for name, values in file["own"].items()}
    return tables, own


def _joined(parts, rank):
    """Tables of several parts one after the other; nodes and cells grain after grain."""
    tables = {}
    for name in parts[0][0]:
        columns = {
            column: np.concatenate([tables[name][column] for tables, _ in parts])
            for column in parts[0][0][name]
        }
        if name in ("nodes", "cells", "surface"):
            order = np.argsort(columns["grain"], kind="stable")
            columns = {column: values[order] for column, values in columns.items()}
        tables[name] = columns
    own = {}
    for name in parts[0][1]:
        values = [own[name] for _, own in parts]
        if name.startswith("largest"):
            own[name] = np.max(values, axis=0)
        else:
            own[name] = np.sum(values, axis=0) * (rank == 0)
    return tables, own


def _write_column(file, name, values):
    """Write an array, or rows that are taken block after block."""
    if isinstance(values, np.ndarray):
        file[name] = values
        return
    column = file.create_dataset(name, values.shape, values.dtype)
    end = 0
    for rows in values.blocks(BLOCK):
        begin, end = end, end + len(rows)
        column[begin:end] = rows


def _size(tables, own):
    """Of what one rank writes [bytes]."""
    columns = [values for table in tables.values() for values in table.values()]
    return sum(values.nbytes for values in [*columns, *own.values()])


def _free_room(folder):
    """Of the disk of a folder [bytes]."""
    return shutil.disk_usage(folder).free


def _write_tables(path, tables, own):
    """Write the file of one rank to the disk; its name, size and checksum."""
    num_columns = sum(map(len, tables.values()))
    try_room(path, _size(tables, own) + 1024 * num_columns)
    with h5py.File(path, "w") as file:
        for name, table in tables.items():
            for column, values in table.items():
                _write_column(file, f"tables/{name}/{column}", values)
        for name, values in own.items():
            file[f"own/{name}"] = values
    with path.open("rb") as stream:
        os.fsync(stream.fileno())
        return {"name": path.name, "size": path.stat().st_size, "checksum": _checksum(stream)}


def file_checksum(path):
    """Checksum of a file, as text.

    Raises:
        InputError: It cannot be read.
    """
    try:
        with regular(path).open("rb") as stream:
            return _checksum(stream)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({reason(error)})") from error


def _checksum(data):
    if isinstance(data, bytes):
        return hashlib.blake2b(data, digest_size=16).hexdigest()
    return hashlib.file_digest(data, lambda: hashlib.blake2b(digest_size=16)).hexdigest()


def _dump(content):
    return json.dumps(content, default=plain)


def _folders(folder):
    """Checkpoints that were completed."""
    return [p for p in folder.glob("step-*") if p.is_dir() and not p.name.endswith(".part")]


def _new_folder(part):
    own_folder(part.parent)
    if part.exists():
        shutil.rmtree(part)
    part.mkdir()


def _remove(path):
    """Remove a folder; it is never seen in part under its own name."""
    gone = path if path.name.endswith(".part") else path.with_name(path.name + ".part")
    if gone != path:
        if gone.exists():
            shutil.rmtree(gone)
        os.rename(path, gone)
    shutil.rmtree(gone)


def _sync_folder(folder):
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
