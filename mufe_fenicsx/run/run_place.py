"""The folder of a run: made when all else was found to be right, with the inputs of the run."""

import csv
import sys

from ..errors import InputError
from ..machine.files import parts_of, replacing, write_atomically
from ..machine.ranks import on_first_rank
from ..output.run_folder import abandon_run_folder, create_run_folder

#: Tables of `mufe mesh` that stay with the run.
TABLES = ("quality.csv", "grains.csv", "labels.csv", "label_contacts.csv", "labels.png")


class RunPlace:
    """The folder of a test, written when all else was found to be right. Collective.

    Args:
        folder: Run folder.
        lock: :class:`~mufe_fenicsx.output.run_lock.RunLock` of it.
        scene_text: The scene in TOML.
        grains_folder: Folder that `mufe mesh` wrote, or its file of grains.
        options: :class:`~mufe_fenicsx.run.run_options.RunOptions`.
    """

    def __init__(self, folder, lock, scene_text, grains_folder, options):
        self.folder, self.lock, self.comm = folder, lock, lock.comm
        self._scene_text, self._options = scene_text, options
        self.grains_folder = grains_folder
        self._tables = grains_folder if grains_folder.is_dir() else grains_folder.parent
        self._made = None  #: folders that were made, in that of a new run

    def open(self):
        """Make the folder unless the test goes on in it, and keep the scene there."""
        if not self._options.resume:
            overwrite = self._options.overwrite
            self._made = create_run_folder(self.comm, self.folder, self.lock, overwrite)
        try:
            on_first_rank(self.comm, self._write_inputs)
        except InputError:
            self.abandon()
            raise

    def _write_inputs(self):
        """Keep the scene with the run, and in a new one the tables of the grains."""
        for name in ("scene.toml", "run.json"):  # of a run that was killed
            for part in self.folder.glob(parts_of(name)):
                part.unlink()
        write_atomically(self.folder / "scene.toml", self._scene_text)
        for name in () if self._options.resume else TABLES:
            if (self._tables / name).is_file():
                with replacing(self.folder / name) as part:
                    part.write_bytes((self._tables / name).read_bytes())

    def abandon(self):
        """Leave nothing of a new run."""
        if self._made is None:
            return
        self.lock.free()
        if self.comm.rank == 0:
            abandon_run_folder(self.folder, self._made)
        self.comm.Barrier()

    def failed_grains(self):
        """Labels of the grains that `mufe mesh` could not mesh, or None; on all ranks."""
        tables = self.folder if self._options.resume else self._tables
        failed = on_first_rank(self.comm, lambda: _failed_grains(tables / "quality.csv"))
        return self.comm.bcast(failed)


def _failed_grains(path):
    """Labels of the grains that `mufe mesh` could not mesh, from its table; None without it.

    Raises:
        InputError: It is not that table.
    """
    if not path.is_file():
        return None
    try:
        with path.open(newline="", encoding="utf-8") as file:
            return [int(row["label"]) for row in csv.DictReader(file) if row["status"] != "ok"]
    except (KeyError, TypeError, ValueError, csv.Error):
        raise InputError(
            f"{path} is not the table that `mufe mesh` wrote, expected columns label and status"
        ) from None


def say(comm, line, quiet):
    """Print a line on rank 0, unless there is none or the run is quiet. Local."""
    if line and comm.rank == 0 and not quiet:
        print(f"mufe: {line}", file=sys.stderr, flush=True)
