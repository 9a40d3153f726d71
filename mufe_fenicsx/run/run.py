"""A test from a scene to a run folder."""

import math
import time
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from ..arguments import checked
from ..contact.mirrors import check_mirrors
from ..contact.snapshot import wrong_number
from ..errors import InputError, Interrupted, SolverError, UnstableError, raise_together
from ..loading.oedometer import OedometerLoading
from ..loading.stages import StagedLoading
from ..machine.doing import Doing
from ..machine.memory import peak_memory, return_freed_arrays
from ..output.checkpoint import CheckpointWriter, find_checkpoint, read_tables, written_by
from ..output.run_folder import (
    check_inside,
    check_run_folder,
    on_first_rank,
    versions,
    write_run_json,
)
from ..output.run_lock import LostFolder, RunLock
from ..scene import Scene, scene_to_toml
from ..scene.usual import unusual
from .coarse_meshes import mean_edge_and_radius, warning_of_coarse_meshes
from .from_scene import (
    find_bounds,
    load_mesh,
    make_membrane,
    make_simulation,
    make_walls,
    separate_surfaces,
    sleeve_of,
)
from .judgement import judged
from .profile import Profile
from .rebalance import better_partition
from .recorder import Recorder
from .report import draw_report
from .resume_check import (
    check_origin,
    check_results,
    grains_checksum,
    integrator_of,
    reading,
)
from .retries import Recovery
from .run_options import RunOptions
from .run_place import RunPlace, say
from .scene_tools import check_sizes, checksums_of_files, make_tools
from .seating import hold_of
from .signals import Interruption
from .snapshot import restore, restore_reference, snapshot
from .time_loop import march
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
    return_freed_arrays()
    started = time.perf_counter()
    options = RunOptions.of(**options)
    lock = RunLock(comm, output_folder)
    try:
        folders = Path(grains_folder), Path(output_folder)
        with Doing("setting up", options.says(comm)) as doing:
            test, checkpoint = _prepare(scene, *folders, lock, started, options)
            result = test.run(checkpoint, doing)
    finally:
        lock.free()
    if scene.output.report and result["finished"]:
        result["report"] = draw_report(comm, folders[1], options.quiet)
    return result


def _prepare(scene, grains_folder, folder, lock, started, options):
    """The test and the checkpoint that it goes on from, or None; nothing is written. Collective."""
    comm, checkpoint, quiet = lock.comm, None, options.quiet
    identity = {
        "scene": scene_to_toml(scene),
        "grains": grains_checksum(comm, grains_folder),
        "tools": checksums_of_files(comm, scene),
    }
    if options.resume:
        say(comm, lock.take(), quiet)
        on_first_rank(comm, lambda: check_inside(folder))
        checkpoint = find_checkpoint(comm, folder)
        check_origin(comm, checkpoint, identity, folder, quiet)
        check_results(comm, checkpoint, folder, options.accept_loss, quiet)
        started -= checkpoint.header["wall_s"]
    else:
        lock.look()
        check_run_folder(comm, folder, options.overwrite)
    with reading(checkpoint):
        partition = checkpoint and _partition(checkpoint, comm)
    load = partial(
        load_mesh, comm, grains_folder, tools=make_tools(comm, scene),
        around=sleeve_of(scene),
    )  # fmt: skip
    with reading((partition is not None and checkpoint) or None):
        mesh = load(partition)
    check_sizes(mesh, load.keywords["tools"])
    sample = mesh.labels[: mesh.num_sample_grains]
    scene.materials_of(sample, sample)
    check_mirrors(comm, make_walls(scene, find_bounds(scene, mesh)), mesh.x)
    if checkpoint is not None:
        separation = checkpoint.header["separation"]
        with reading(checkpoint):
            _take_reference(checkpoint, mesh)
    else:
        separation = separate_surfaces(mesh, scene.sample)
        separation = separation and separation.as_dict()
    place = RunPlace(folder, lock, identity["scene"], grains_folder, options)
    test = TestRun(scene, mesh, load, place, identity, started, options, separation)
    return test, checkpoint


#: Of the summary, what checkpoints keep.
KEPT = ("setup_s", "separation", "resumed_at_steps", "balanced_at_steps")


class TestRun:
    """One test: what stays the same when it begins anew from a checkpoint. Collective."""

    def __init__(self, scene, mesh, load, place, identity, started, options, separation):
        self.load = load  #: makes the mesh for given ranks of the grains
        self.tools = load.keywords["tools"]
        self.scene, self.mesh, self.place, self.options = scene, mesh, place, options
        self.comm = mesh.comm
        self.identity, self.started = identity, started
        self.bounds, container = find_bounds(scene, mesh), scene.container.kind
        self.area = float(container.areas(container.lengths_within(self.bounds))[-1])
        self.checkpoints = CheckpointWriter(self.comm, place.folder)
        self.recovery = Recovery(self.comm, place.folder, scene.solver, options.quiet)
        self.first_kept = None
        self.summary = {
            "title": scene.title,
            "command": list(options.command),
            "versions": versions(),
            "num_ranks": self.comm.size,
            "num_grains": mesh.num_sample_grains,
            "num_cells": self.comm.allreduce(mesh.num_sample_cells),
            "num_nodes": self.comm.allreduce(mesh.sample_nodes.size),
            "element": scene.solver.element,
            "finished": False,
            "stop_reason": "running",
            "strain_definition": None,
            "area": self.area,
            "container": container.note(self.bounds),
            "membrane": _note_of_membrane(mesh),
            "separation": separation,
            "failed_grains": place.failed_grains(),
            "resumed_at_steps": [],
            "balanced_at_steps": [],
        }

    def run(self, checkpoint, doing):
        """March to the end, with retries; returns the summary.

        Args:
            checkpoint: :class:`~.output.checkpoint.Checkpoint` to go on from, or None.
            doing: :class:`~.machine.doing.Doing`, where stages of the program are told.
        """
        comm, summary, resumed = self.comm, self.summary, checkpoint is not None
        doing.what = f"setting up {_size(summary)}"
        with reading(checkpoint):
            self._set_up(checkpoint)
            begun = self.now()  # collective where there are tools
        on_first_rank(comm, lambda: write_run_json(self.place.folder, begun))
        # A signal between two marches, while all begins anew, is not lost.
        with Interruption(comm, self.scene.output.checkpoint) as interruption:
            error = self.march(interruption, resumed)
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
                self.recorder.write_state()
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
        summary |= self.masses()
        summary["edges_per_diameter"] = 2.0 * radius / edge
        summary["strain_definition"] = self.loading.strain_definition
        summary["setup_s"] = time.perf_counter() - self.started
        if checkpoint is None:
            self._check_disk()
            return
        summary["setup_s"] = checkpoint.header["setup_s"]
        before = checkpoint.header["resumed_at_steps"]
        summary["resumed_at_steps"] = [*before, checkpoint.header["step"]]
        summary["balanced_at_steps"] = checkpoint.header["balanced_at_steps"]

    def _is_finite(self):
        """Whether the motion of all ranks is: of another no state can be written. Collective."""
        state = self.simulation.state
        finite = bool(np.isfinite(state.x).all() and np.isfinite(state.v).all())
        return self.comm.allreduce(finite, op=MPI.LAND)

    def _end(self):
        """Write and return the summary of what was computed. Collective."""
        comm, summary = self.comm, self.summary
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
        summary |= self.masses()
        summary |= judged(self.simulation, self.place.folder, summary, self.recorder.volumes)
        if self.profile is not None:
            summary["profile"] = self.profile.summary()
        if self.options.after is not None:
            summary |= self.options.after(summary)
        self.place.lock.check()
        on_first_rank(comm, lambda: write_run_json(self.place.folder, summary))
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
        sizes = diameter, self.loading.first_height, reach(self.bounds, self.mesh)
        self.summary["unusual"] = [*unusual(self.scene), *relations(self.scene, *sizes)]
        for line in self.summary["unusual"]:
            say(self.comm, line, self.options.quiet)

    def march(self, interruption, resumed):
        """March to the end, again after each failure that has an answer; the error, or None."""
        while True:
            try:
                reason = march(
                    self.simulation, self.loading, self.recorder, self.scene.output, interruption,
                    self.save, self.balance, self.options.max_steps, self.options.quiet, resumed,
                )  # fmt: skip
                if reason is not None:
                    self.summary["stop_reason"] = reason
                    self.summary["finished"] = bool(self.loading.finished)
                    return None
                self.begin_again(find_checkpoint(self.comm, self.place.folder))
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
            self.recovery.know(checkpoint.header["retries"])
        self.simulation = make_simulation(
            scene, self.mesh, self.bounds, self.recovery.shorter, self.tools
        )
        self.loading = self.make_loading(make_membrane(scene, self.simulation, self.bounds))
        recorder, same_ranks = self.first_kept, True
        if checkpoint is not None:
            with reading(checkpoint):
                self._restore(checkpoint)
                recorder = checkpoint.header["recorder"]
                same_ranks = written_by(checkpoint, self.comm.size, self.mesh.rank_of_grain)
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
            after_step = self.profile.timed(self.recorder.after_step, "output")
            self.recorder.after_step = after_step
        if self.first_kept is None and checkpoint is None:
            self.first_kept = self.recorder.state_dict()

    def _restore(self, checkpoint):
        """Bring simulation and loading to the state of a checkpoint. Collective."""
        header, mesh = checkpoint.header, self.mesh
        tables, own = _read(checkpoint, mesh)
        wrong = wrong_number(tables, len(mesh.labels), len(self.simulation.walls.walls))
        raise_together(self.comm, wrong and f"checkpoint {checkpoint.path}: {wrong}")
        restore(self.simulation, tables, own, header["state"])
        del tables
        if len(header["retries"]) < len(self.recovery.done):
            self.simulation.update_time_step()
        if integrator_of(header["scene"]) != self.scene.solver.integrator:
            self.simulation.take_over()
        self.loading.load_state_dict(header["loading"])

    def make_loading(self, measures=None):
        """What moves the walls of the present simulation, at its start. Collective.

        Args:
            measures: Of what surrounds the sample, of loading.measures; None: of its walls.
        """
        scene, oedometer = self.scene, self.scene.oedometer
        if oedometer is None:
            return StagedLoading(
                self.simulation, scene.loading, scene.stages, scene.quasi_static, measures
            )
        return OedometerLoading(
            self.simulation,
            oedometer.strain,
            oedometer.speed,
            oedometer.ramp,
            oedometer.seating_stress * self.area,
            oedometer.seating_speed,
            scene.quasi_static,
            hold_of(self.simulation, oedometer),
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

    def masses(self):
        """Mass of all grains, and what mass scaling has added to it [kg]. Collective."""
        whole, scaling = self.simulation.mass_of_grains(), self.simulation.scaling
        own = whole / (1.0 + (scaling.shares()[0] if scaling else 0.0))
        return {"mass": own, "added_mass": whole - own}

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
        if self.tools:
            found["tools"] = simulation.tools.summary()
        return found


def _note_of_membrane(mesh):
    """What run.json says of a sleeve: its label in the fields; None without one."""
    return {"label": mesh.labels_of_sleeves[0]} if mesh.sleeves else None


def _size(summary):
    """Grains, nodes and elements in words."""
    return "{num_grains} grains, {num_nodes} nodes, {num_cells} elements".format(**summary)


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
