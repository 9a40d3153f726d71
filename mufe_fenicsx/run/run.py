"""A test from a scene to a run folder."""

import math
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from ..arguments import checked
from ..errors import InputError, Interrupted, SolverError, UnstableError
from ..machine.doing import Doing
from ..machine.files import write_atomically
from ..machine.memory import return_freed_arrays
from ..machine.ranks import on_first_rank
from ..output.checkpoint import CheckpointWriter, find_checkpoint, written_by
from ..output.run_folder import PROFILE, write_run_json
from ..output.run_lock import LostFolder, RunLock
from ..scene import Scene
from ..scene.usual import unusual
from .coarse_meshes import coarse_zones, mean_edge_and_radius, warning_of_coarse_meshes
from .from_scene import load_mesh, make_loading, make_membrane, make_simulation, sleeve_of
from .judgement import judged
from .preparation import find_start, prepare
from .profile import Profile
from .rebalance import better_partition
from .recorder import Recorder
from .report import draw_report
from .restart import mesh_of, partition_of, restore_test
from .resume_check import reading
from .retries import Retries
from .run_options import RunOptions
from .run_place import RunPlace, say
from .signals import Signals
from .snapshot import snapshot
from .summary import masses, of_end, of_now, of_start, size_in_words
from .time_loop import run_time_loop
from .unusual import reach, relations


@checked
def run_scene(
    scene: Scene,
    grains_folder: str | Path,
    output_folder: str | Path,
    comm: MPI.Intracomm,
    **options: Any,
) -> dict:
    """Run the test of a scene. Collective.

    Args:
        scene: :class:`~mufe_fenicsx.scene.Scene`.
        grains_folder: Folder that `mufe mesh` wrote.
        output_folder: Run folder to create.
        comm: MPI communicator.
        options: Fields of :class:`~mufe_fenicsx.run.run_options.RunOptions` by name.

    Returns:
        What run.json holds, on every rank; with the path of the ``report`` where one was drawn.

    Raises:
        InputError: Something the user gave cannot be used; nothing was written.
        SolverError: The computation failed; all up to there was written.
        Interrupted: A signal asked it to end; there is a checkpoint.
    """
    if scene.fracture is None:  # a growth makes all arrays anew, and is faster in known memory
        return_freed_arrays()
    started = time.perf_counter()
    options = RunOptions.of(**options)
    lock = RunLock(comm, output_folder)
    try:
        folders = Path(grains_folder), Path(output_folder)
        with Doing("setting up", options.says(comm)) as doing:
            checkpoint, identity = find_start(scene, *folders, lock, options)
            started -= 0.0 if checkpoint is None else checkpoint.header["wall_s"]
            place = RunPlace(folders[1], lock, identity["scene"], folders[0], options)
            prepared, separation = prepare(scene, folders[0], comm, checkpoint)
            test = TestRun(scene, prepared, separation, place, identity, started, options)
            del prepared  # its mesh may have to make room for another one
            result = test.run(checkpoint, doing)
    finally:
        lock.free()
    comm.Barrier()  # whoever returns finds the folder free
    if scene.output.report and result["finished"]:
        result["report"] = draw_report(comm, folders[1], options.quiet)
    return result


#: Of the summary, what checkpoints keep.
KEPT = ("setup_s", "separation", "edges_per_diameter", "resumed_at_steps", "balanced_at_steps")


class TestRun:
    """One test: what stays the same when it begins anew from a checkpoint. Collective."""

    def __init__(self, scene, prepared, separation, place, identity, started, options):
        self.scene, self.prepared, self.place, self.options = scene, prepared, place, options
        self.comm = prepared.mesh.comm
        self.identity, self.started = identity, started
        self.checkpoints = CheckpointWriter(self.comm, place.folder)
        self.retries = Retries(self.comm, place.folder, scene.solver, options.quiet)
        self.first_kept = None
        noted = {"separation": separation, "failed_grains": place.failed_grains()}
        self.summary = of_start(scene, prepared, options) | noted

    def run(self, checkpoint, doing):
        """March to the end, with retries; returns the summary.

        Args:
            checkpoint: :class:`~.output.checkpoint.Checkpoint` to go on from, or None.
            doing: :class:`~.machine.doing.Doing`, where stages of the program are told.
        """
        comm, summary, resumed = self.comm, self.summary, checkpoint is not None
        doing.what = f"setting up {size_in_words(summary)}"
        with reading(checkpoint):
            self._set_up(checkpoint)
            begun = self.now()  # collective where there are tools
        on_first_rank(comm, lambda: write_run_json(self.place.folder, begun))
        # A signal between two loops, while all begins anew, is not lost.
        with Signals(comm, self.scene.output.checkpoint) as signals:
            error = self.run_to_end(signals, resumed)
        doing.what = "writing the summary"
        if error is None:
            return self._end()
        # Whatever comes of the rest, the first error is kept and told.
        summary["stop_reason"] = str(error)
        begun["stop_reason"] = str(error)
        if comm.rank == 0:
            with suppress(InputError):
                write_run_json(self.place.folder, begun)
        try:
            if isinstance(error, SolverError) and self._is_finite():
                self.recorder.write_last_state()
            self._end()
        except LostFolder:
            raise
        except Exception as failure:
            if comm.size == 1 or isinstance(failure, InputError):  # those all ranks raise
                raise error from failure
            say(comm, str(error), quiet=False)
            raise
        raise error

    def _set_up(self, checkpoint):
        """Simulation, loading and recorder of the start, or of a checkpoint, and what is told."""
        summary = self.summary
        self.begin(checkpoint, self.place)
        say(self.comm, warning_of_coarse_meshes(self.simulation), self.options.quiet)
        edge, radius = mean_edge_and_radius(self.simulation)
        self._tell_unusual(2.0 * radius)
        summary["first_height"] = float(self.loading.first_height)
        summary |= masses(self.simulation)
        summary["edges_per_diameter"] = 2.0 * radius / edge
        summary["strain_definition"] = self.loading.strain_definition
        summary["setup_s"] = time.perf_counter() - self.started
        if checkpoint is None:
            self._check_disk()
            return
        summary |= {name: checkpoint.header[name] for name in KEPT}
        summary["edges_per_diameter"] = float(summary["edges_per_diameter"])
        resumed = [*summary["resumed_at_steps"], checkpoint.header["step"]]
        summary["resumed_at_steps"] = resumed

    def _is_finite(self):
        """Whether the motion of all ranks is: of another no state can be written. Collective."""
        state = self.simulation.state
        finite = bool(np.isfinite(state.x).all() and np.isfinite(state.v).all())
        return self.comm.allreduce(finite, op=MPI.LAND)

    def _end(self):
        """Write and return the summary of what was computed. Collective."""
        comm, summary, tables = self.comm, self.summary, {}
        stress = float(self.recorder.vertical_stress())
        summary["stress"] = stress if math.isfinite(stress) else None
        summary |= self.now() | of_end(self.simulation)
        summary |= judged(self.simulation, self.place.folder, summary, self.recorder.volumes)
        if self.profile is not None:
            summary["profile"] = self.profile.summary()
            tables[PROFILE] = self.profile.table(self.loading.strain)
        if self.options.after is not None:
            summary |= self.options.after(summary)
        self.place.lock.check()

        def write():
            for name, text in tables.items():
                write_atomically(self.place.folder / name, text)
            write_run_json(self.place.folder, summary)

        on_first_rank(comm, write)
        comm.Barrier()  # every rank finds complete files when this returns
        return summary

    def _check_disk(self):
        """Leave the folder again, with an InputError, where checkpoints have no room."""
        try:
            self.checkpoints.check_room(*snapshot(self.simulation)[:2])
        except InputError:
            self.recorder.history.close()
            self.place.abandon()
            raise

    def _tell_unusual(self, diameter):
        """Say which values nobody means, and keep that for the report. Collective."""
        sizes = diameter, self.loading.first_height, reach(self.prepared.bounds, self.prepared.mesh)
        coarse = coarse_zones(self.simulation)
        self.summary["unusual"] = [*unusual(self.scene), *relations(self.scene, *sizes), *coarse]
        for line in self.summary["unusual"]:
            say(self.comm, line, self.options.quiet)

    def run_to_end(self, signals, resumed):
        """March to the end, again after each failure that has an answer; the error, or None."""
        while True:
            try:
                reason = run_time_loop(
                    self.simulation, self.loading, self.recorder, self.scene.output, signals,
                    self.save, self.balance, self.options.max_steps, self.options.quiet, resumed,
                )  # fmt: skip
                if reason is not None:
                    self.summary["stop_reason"] = reason
                    self.summary["finished"] = bool(self.loading.finished)
                    return None
                self.begin_again(find_checkpoint(self.comm, self.place.folder))
                resumed = True
            except UnstableError as failure:
                found = self.retries.answer(failure, self.simulation, self.checkpoints)
                if found is None:
                    return self.retries.exhausted(failure)
                resumed = found.checkpoint is not None
                self.begin_again(found.checkpoint)
            except (SolverError, Interrupted) as failure:
                return failure
            except LostFolder:
                raise
            except InputError as failure:  # a disk that is full
                if self.checkpoints.last is None:
                    return failure
                return InputError(f"{failure}; --resume goes on from {self.checkpoints.last}")

    def begin(self, checkpoint=None, place=None):
        """Simulation, loading and recorder of the start, or of a checkpoint.

        Args:
            checkpoint: :class:`~.output.checkpoint.Checkpoint`, or None.
            place: :class:`~mufe_fenicsx.run.run_place.RunPlace` that is opened when nothing but
                writing can fail any more; None: it is open.
        """
        scene = self.scene
        if checkpoint is not None:
            self.retries.know(checkpoint.header["retries"])
        self.simulation = make_simulation(scene, self.prepared, self.retries.shorter)
        measures = make_membrane(scene, self.simulation, self.prepared.bounds)
        self.loading = make_loading(scene, self.simulation, self.summary["area"], measures)
        recorder, same_ranks = self.first_kept, True
        if checkpoint is not None:
            with reading(checkpoint):
                num_retries = len(self.retries.done)
                restore_test(checkpoint, self.simulation, self.loading, scene, num_retries)
                recorder, ranks = checkpoint.header["recorder"], self.prepared.mesh.rank_of_grain
                same_ranks = written_by(checkpoint, self.comm.size, ranks)
        if place is not None:
            place.open()
        try:
            self.checkpoints.remove_after(checkpoint)
            with reading(checkpoint):
                self.recorder = Recorder(
                    self.place.folder, self.simulation, self.loading, scene.output,
                    scene.solver.energy_limit, recorder, same_ranks, self.place.lock,
                )  # fmt: skip
        except InputError:
            if place is not None:
                place.abandon()
            raise
        self.profile = Profile(self.simulation) if self.options.profile else None
        if self.profile is not None:
            self.profile.watch(self.recorder)
        if self.first_kept is None and checkpoint is None:
            self.first_kept = self.recorder.state_dict()

    def begin_again(self, checkpoint):
        """Go back to a checkpoint, or to the start if that is None."""
        self.recorder.history.close()
        self.simulation = self.loading = self.recorder = None  # their memory is free now
        mesh, scene = self.prepared.mesh, self.scene
        partition = checkpoint and partition_of(checkpoint, self.comm)
        if partition is None:
            partition = mesh.rank_of_grain
        if checkpoint is None:  # what has opened since is closed again
            self.prepared = replace(self.prepared, mesh=replace(mesh, opened=[]))
        elif scene.fracture or (partition != mesh.rank_of_grain).any():
            self.prepared, grains = replace(self.prepared, mesh=None), self.place.grains_folder
            tools, around = self.prepared.tools, sleeve_of(self.scene)
            mesh = load_mesh(self.comm, grains, partition, tools, around)
            mesh = mesh_of(checkpoint, mesh)
            self.prepared = replace(self.prepared, mesh=mesh)
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
        ranks = self.prepared.mesh.rank_of_grain
        header = {
            "state": state,
            "loading": self.loading.state_dict(),
            "recorder": self.recorder.state_dict(),
            "retries": self.retries.done,
            "strain": float(self.loading.strain),
            "wall_s": time.perf_counter() - self.started,
            "written_by": ranks.tolist(),
            "rank_of_grain": (ranks if partition is None else partition).tolist(),
            **{k: self.summary[k] for k in KEPT},
            **self.identity,
        }
        self.checkpoints.write(step, tables, own, header)

    def now(self):
        """The summary with what changes during a run. Collective."""
        now = of_now(self.simulation, self.loading, self.retries.done, self.started)
        return self.summary | now
