"""A test from a scene to a run folder."""

import csv
import math
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from mpi4py import MPI

from ..contact.mirrors import check_mirrors
from ..contact.separation import separate
from ..errors import InputError, Interrupted, SolverError, UnstableError
from ..loading.oedometer import OedometerLoading
from ..loading.stages import StagedLoading
from ..machine.memory import peak_memory, return_freed_arrays
from ..output.checkpoint import CheckpointWriter, find_checkpoint, read_tables, written_by
from ..output.record import lost_results
from ..output.run_folder import (
    abandon_run_folder,
    check_inside,
    check_run_folder,
    create_run_folder,
    raise_together,
    versions,
    write_atomically,
    write_run_json,
)
from ..output.run_lock import LostFolder, RunLock
from ..scene import Scene, scene_to_toml
from .from_scene import bounding_box, load_mesh, make_simulation, make_walls
from .profile import Profile
from .rebalance import better_partition
from .recorder import Recorder
from .resume_check import check_origin, grains_checksum, integrator_of
from .retries import Recovery
from .signals import Interruption
from .snapshot import restore, restore_reference, snapshot
from .time_loop import march


def run_scene(
    scene: Scene,
    grains_folder: str | Path,
    output_folder: str | Path,
    comm: MPI.Intracomm,
    *,
    overwrite: bool = False,
    max_steps: int | None = None,
    quiet: bool = False,
    command: Sequence[str] = (),
    resume: bool = False,
    accept_loss: bool = False,
    profile: bool = False,
    after: Callable[[dict], dict] | None = None,
) -> dict:
    """Run the test of a scene. Collective.

    Args:
        scene: :class:`~mufe_fenicsx.scene.Scene`.
        grains_folder: Folder that `mufe mesh` wrote.
        output_folder: Run folder to create.
        comm: MPI communicator.
        overwrite: Replace an earlier run in that folder.
        max_steps: Stop after so many steps.
        quiet: Print nothing.
        command: The command line, to be kept with the run.
        resume: Go on from the last checkpoint in the folder, with the same scene and grains, on
            any number of ranks; a finished test too, where the scene's strain is larger now.

        accept_loss: Go on, too, where results before the checkpoint are gone or changed.
        profile: Keep the time of the parts of a step; "profile" in the result.
        after: Function of the last summary; what it returns, a dict, is added to it.

    Returns:
        What run.json holds, on every rank.

    Raises:
        InputError: Something the user gave cannot be used; nothing was written.
        SolverError: The computation failed; all up to there was written.
        Interrupted: A signal asked it to end; there is a checkpoint.
    """
    return_freed_arrays()
    started = time.perf_counter()
    lock = RunLock(comm, output_folder)
    try:
        test, checkpoint = _prepare(
            scene, Path(grains_folder), Path(output_folder), lock, started, overwrite, resume,
            accept_loss, quiet, list(command), profile, after,
        )  # fmt: skip
        return test.run(checkpoint, max_steps)
    finally:
        lock.free()


def _prepare(
    scene, grains_folder, folder, lock, started, overwrite, resume, accept_loss, quiet, command,
    profile, after,
):  # fmt: skip
    """The test and the checkpoint that it goes on from, or None; nothing is written. Collective."""
    comm, checkpoint = lock.comm, None
    identity = {"scene": scene_to_toml(scene), "grains": grains_checksum(comm, grains_folder)}
    if resume:
        _say(comm, lock.take(), quiet)
        _together(comm, lambda: check_inside(folder))
        checkpoint = find_checkpoint(comm, folder)
        check_origin(comm, checkpoint, identity, folder, quiet)
        _check_results(comm, checkpoint, folder, accept_loss, quiet)
        started -= checkpoint.header["wall_s"]
    else:
        lock.look()
        check_run_folder(comm, folder, overwrite)
    partition = checkpoint and _partition(checkpoint, comm)
    mesh = load_mesh(comm, grains_folder, scene.solver.element, partition)
    scene.materials_of(mesh.labels[mesh.grains], mesh.labels)
    check_mirrors(comm, make_walls(scene, *bounding_box(mesh)), mesh.x)
    if checkpoint is not None:
        separation = checkpoint.header["separation"]
        _take_reference(checkpoint, mesh)
    else:
        separation = _separate(scene.sample, mesh)
    load = partial(load_mesh, comm, grains_folder, scene.solver.element)
    place = _Place(folder, lock, identity["scene"], grains_folder, overwrite, resume, quiet)
    test = _Test(
        scene, mesh, load, place, identity, started, quiet, command, separation, profile, after
    )
    return test, checkpoint


def _check_results(comm, checkpoint, folder, accept_loss, quiet):
    """See that results are as the checkpoint counts them, or leave out what is not. Collective."""
    message, left = None, None
    if comm.rank == 0:
        lines, strain, left = lost_results(folder, checkpoint.header["recorder"])
        if lines:
            more = f" and {len(lines) - 3} more" if len(lines) > 3 else ""
            message = (
                f"results in {folder} are not those that checkpoint {checkpoint.path.name} "
                f"counts, from strain {strain:.4g} on: {', '.join(lines[:3])}{more}"
            )
    if accept_loss:
        _say(comm, message and f"{message}; going on without them", quiet)
    elif message is not None:
        message += "; expected them as they were written, or --accept-loss to go on without them"
    raise_together(comm, None if accept_loss else message)
    checkpoint.header["recorder"] = comm.bcast(left)


def _say(comm, line, quiet):
    if line and comm.rank == 0 and not quiet:
        print(f"mufe: {line}", file=sys.stderr, flush=True)


def _together(comm, action):
    """Do something on rank 0 that may raise an InputError, which all ranks raise then."""
    message = None
    if comm.rank == 0:
        try:
            action()
        except (InputError, OSError) as error:
            message = str(error)
    raise_together(comm, message)


class _Place:
    """The folder of a test, written when all else was found to be right. Collective."""

    def __init__(self, folder, lock, scene_text, grains_folder, overwrite, resume, quiet):
        self.folder, self.lock, self.comm = folder, lock, lock.comm
        self._scene_text, self._grains_folder = scene_text, grains_folder
        self._overwrite, self._resume, self._quiet = overwrite, resume, quiet
        self._made = None  #: folders that were made, in that of a new run

    def open(self):
        """Make the folder unless the test goes on in it, and keep the scene there."""
        tables = None
        if not self._resume:
            self._made = create_run_folder(self.comm, self.folder, self.lock, self._overwrite)
            tables = self._grains_folder
        try:
            _write_inputs(self.comm, self.folder, self._scene_text, tables)
        except InputError:
            self.abandon()
            raise

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
        found = []
        tables = self.folder if self._resume else self._grains_folder
        if not tables.is_dir():
            tables = tables.parent
        _together(self.comm, lambda: found.append(_failed_grains(tables / "quality.csv")))
        return self.comm.bcast(found[0] if found else None)


#: Tables of `mufe mesh` that stay with the run.
TABLES = ("quality.csv", "grains.csv", "labels.csv")

#: Of the summary, what checkpoints keep.
KEPT = ("setup_s", "separation", "resumed_at_steps", "balanced_at_steps")


class _Test:
    """One test: what stays the same when it begins anew from a checkpoint. Collective."""

    def __init__(
        self, scene, mesh, load, place, identity, started, quiet, command, separation, profile,
        after,
    ):  # fmt: skip
        self.after = after
        self.load = load  #: makes the mesh for given ranks of the grains
        self.wants_profile = profile
        self.scene, self.mesh, self.place, self.folder = scene, mesh, place, place.folder
        self.comm, self.quiet = mesh.comm, quiet
        self.identity, self.started = identity, started
        self.low, self.high = bounding_box(mesh)
        self.area = float((self.high - self.low)[0] * (self.high - self.low)[1])
        self.checkpoints = CheckpointWriter(self.comm, self.folder)
        self.recovery = Recovery(self.comm, self.folder, scene.solver, quiet)
        self.first_kept = None
        self.summary = {
            "title": scene.title,
            "command": command,
            "versions": versions(),
            "num_ranks": self.comm.size,
            "num_grains": int(mesh.labels.size),
            "num_cells": self.comm.allreduce(mesh.num_cells),
            "num_nodes": self.comm.allreduce(mesh.num_nodes),
            "element": scene.solver.element,
            "family": mesh.family,
            "finished": False,
            "stop_reason": "running",
            "strain_definition": None,
            "area": self.area,
            "separation": separation,
            "failed_grains": place.failed_grains(),
            "resumed_at_steps": [],
            "balanced_at_steps": [],
        }

    def run(self, checkpoint, max_steps):
        """March to the end, with retries; returns the summary."""
        comm, summary, resumed = self.comm, self.summary, checkpoint is not None
        self.begin(checkpoint, self.place)
        summary["first_height"] = float(self.loading.first_height)
        summary["mass"] = comm.allreduce(float(self.simulation.solid.mass.sum()))
        summary["strain_definition"] = self.loading.strain_definition
        summary["setup_s"] = time.perf_counter() - self.started
        if resumed:
            summary["setup_s"] = checkpoint.header["setup_s"]
            before = checkpoint.header["resumed_at_steps"]
            summary["resumed_at_steps"] = [*before, checkpoint.header["step"]]
            summary["balanced_at_steps"] = checkpoint.header["balanced_at_steps"]
        _together(comm, lambda: write_run_json(self.folder, self.now()))
        # A signal between two marches, while all begins anew, is not lost.
        with Interruption(comm, self.scene.output.checkpoint) as interruption:
            error = self.march(interruption, max_steps, resumed)
        if error is not None:
            summary["stop_reason"] = str(error)
        if isinstance(error, SolverError):
            self.recorder.write_state()
        stress = float(self.recorder.vertical_stress())
        summary["stress"] = stress if math.isfinite(stress) else None
        summary = self.now(peak_memory(comm))
        contact = self.simulation.contact
        if self.simulation.scaling is not None:
            limits = self.simulation.limits_with_and_without_added_mass()
            summary["mass_scaling"] = self.simulation.scaling.summary(limits)
        summary["contact"] = {
            "num_searches": contact.num_searches,
            "num_overlaps_at_start": comm.allreduce(contact.overlaps.num_accepted),
            "deepest_at_start": comm.allreduce(contact.overlaps.deepest, op=MPI.MAX),
            **dict(
                zip(
                    ("num_closed", "num_with_offset", "num_at_largest_force"),
                    comm.allreduce(contact.counts()).tolist(),
                    strict=True,
                )
            ),
        }
        if self.profile is not None:
            summary["profile"] = self.profile.summary()
        if self.after is not None:
            summary |= self.after(summary)
        self.place.lock.check()
        _together(comm, lambda: write_run_json(self.folder, summary))
        comm.Barrier()  # every rank finds complete files when this returns
        if error is not None:
            raise error
        return summary

    def march(self, interruption, max_steps, resumed):
        """March to the end, again after each failure that has an answer; the error, or None."""
        while True:
            try:
                reason = march(
                    self.simulation, self.loading, self.recorder, self.scene.output, interruption,
                    self.save, self.balance, max_steps, self.quiet, resumed,
                )  # fmt: skip
                if reason is not None:
                    self.summary["stop_reason"] = reason
                    self.summary["finished"] = bool(self.loading.finished)
                    return None
                self.begin_again(find_checkpoint(self.comm, self.folder))
                resumed = True
            except UnstableError as failure:
                found = self.recovery.answer(failure, self.simulation, self.checkpoints)
                if found is None:
                    return self.recovery.exhausted(failure)
                resumed = found.checkpoint is not None
                self.begin_again(found.checkpoint)
            except (SolverError, Interrupted) as failure:
                return failure
            except LostFolder:
                raise
            except InputError as failure:  # a disk that is full
                if self.checkpoints.last is None:
                    raise
                raise InputError(
                    f"{failure}; --resume goes on from {self.checkpoints.last}"
                ) from failure

    def begin(self, checkpoint=None, place=None):
        """Simulation, loading and recorder of the start, or of a checkpoint.

        Args:
            checkpoint: :class:`~.output.checkpoint.Checkpoint`, or None.
            place: :class:`_Place` that is opened when nothing but writing can fail any more; None:
                it is open.
        """
        scene = self.scene
        if checkpoint is not None:
            self.recovery.know(checkpoint.header["retries"])
        self.simulation = make_simulation(
            scene, self.mesh, self.low, self.high, self.recovery.shorter
        )
        self.loading = self.make_loading()
        recorder, same_ranks = self.first_kept, True
        if checkpoint is not None:
            header = checkpoint.header
            restore(self.simulation, *_read(checkpoint, self.mesh), header["state"])
            if len(header["retries"]) < len(self.recovery.done):
                self.simulation.update_time_step()
            if integrator_of(header["scene"]) != scene.solver.integrator:
                self.simulation.take_over()
            self.loading.load_state_dict(header["loading"])
            recorder = header["recorder"]
            same_ranks = written_by(checkpoint, self.comm.size, self.mesh.rank_of_grain)
        if place is not None:
            place.open()
        try:
            self.checkpoints.remove_after(checkpoint)
            self.recorder = Recorder(
                self.folder, self.simulation, self.loading, scene.output,
                scene.solver.energy_limit, recorder, same_ranks, self.place.lock,
            )  # fmt: skip
        except InputError:
            if place is not None:
                place.abandon()
            raise
        self.profile = Profile(self.simulation) if self.wants_profile else None
        if self.profile is not None:
            after_step = self.profile.timed(self.recorder.after_step, "output")
            self.recorder.after_step = after_step
        if self.first_kept is None and checkpoint is None:
            self.first_kept = self.recorder.state_dict()

    def make_loading(self):
        """What moves the walls of the present simulation, at its start. Collective."""
        scene, oedometer = self.scene, self.scene.oedometer
        if oedometer is None:
            return StagedLoading(self.simulation, scene.loading, scene.stages, scene.quasi_static)
        return OedometerLoading(
            self.simulation,
            oedometer.strain,
            oedometer.speed,
            oedometer.ramp,
            oedometer.seating_stress * self.area,
            oedometer.seating_speed,
            scene.quasi_static,
        )

    def begin_again(self, checkpoint):
        """Go back to a checkpoint, or to the start if that is None."""
        self.recorder.history.close()
        self.simulation = self.loading = self.recorder = None  # their memory is free now
        partition = checkpoint and _partition(checkpoint, self.comm)
        if partition is not None and (partition != self.mesh.rank_of_grain).any():
            self.mesh = None
            self.mesh = self.load(partition)
            _take_reference(checkpoint, self.mesh)
        self.begin(checkpoint)

    def balance(self):
        """Share the work of the ranks anew, by a checkpoint to begin from; whether it did."""
        better = better_partition(self.simulation)
        if better is None:
            return False
        self.save(better)
        self.summary["balanced_at_steps"].append(self.simulation.state.num_steps)
        return True

    def save(self, partition=None):
        """Write a checkpoint, unless there is one of this step; with ``partition`` in any case.

        Args:
            partition: Ranks of the grains from here on, shape (num_grains,); None: as they are.

        Raises:
            UnstableError: The state is not sound.
        """
        step = self.simulation.state.num_steps
        last = self.checkpoints.last
        if partition is None and last is not None and last.name == f"step-{step:09d}":
            return
        self.place.lock.check()
        self.simulation.check()
        self.recorder.check_energy(self.simulation.energies())
        tables, own, state = snapshot(self.simulation)
        header = {
            "state": state,
            "loading": self.loading.state_dict(),
            "recorder": self.recorder.state_dict(),
            "retries": self.recovery.done,
            "strain": float(self.loading.strain),
            "wall_s": time.perf_counter() - self.started,
            "written_by": self.mesh.rank_of_grain.tolist(),
            "rank_of_grain": (self.mesh.rank_of_grain if partition is None else partition).tolist(),
            **{k: self.summary[k] for k in KEPT},
            **self.identity,
        }
        self.checkpoints.write(step, tables, own, header)

    def now(self, memory=0):
        """The summary with what changes during a run."""
        simulation, loading = self.simulation, self.loading
        found = self.summary | {
            "num_steps": simulation.state.num_steps,
            "time": simulation.state.t,
            "time_step": simulation.dt,
            "element_time_step": simulation.dt_element,
            "strain": float(loading.strain),
            "reference_height": float(loading.reference_height),
            "stages": loading.stages,
            "retries": self.recovery.done,
            "wall_s": time.perf_counter() - self.started,
            "peak_memory_bytes": memory,
        }
        if loading.control is not None:
            found["quasi_static"] = loading.control.summary()
        return found


def _partition(checkpoint, comm):
    """Ranks of the grains that a checkpoint asks for; None on another number of ranks."""
    if checkpoint.num_ranks != comm.size:
        return None
    return np.array(checkpoint.header["rank_of_grain"], dtype=np.int32)


def _read(checkpoint, mesh, only=None):
    """Tables of a checkpoint for the grains of this rank, and what ranks had of their own."""
    return read_tables(mesh.comm, checkpoint, mesh.grains, mesh.rank_of_grain, only)


def _take_reference(checkpoint, mesh):
    """Give a mesh the reference configuration of a checkpoint."""
    restore_reference(mesh, _read(checkpoint, mesh, only=("nodes", "reference"))[0])


def _separate(sample, mesh):
    """Move overlapping surfaces apart where the scene wants that; what was moved, or None."""
    if not sample.separation:
        return None
    return separate(mesh, sample.max_shift, sample.close_gaps, sample.close_gaps_over_h).as_dict()


def _write_inputs(comm, folder, scene_text, grains_folder):
    """Keep the scene with the run, and the tables of the grains where they are given."""
    message = None
    if comm.rank == 0:
        try:
            write_atomically(folder / "scene.toml", scene_text)
            if grains_folder is not None:
                _copy_tables(grains_folder, folder)
        except (InputError, OSError) as error:
            message = str(error)
    raise_together(comm, message)


def _copy_tables(grains_folder, folder):
    """Keep the tables of the grains with the run."""
    source = grains_folder if grains_folder.is_dir() else grains_folder.parent
    for name in TABLES:
        if (source / name).is_file():
            (folder / name).write_bytes((source / name).read_bytes())


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
