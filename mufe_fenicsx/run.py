"""An oedometer test from a scene to a run folder."""

import csv
import math
import os
import signal
import sys
import time
from pathlib import Path

import numpy as np
from mpi4py import MPI

from .contact.network import find_network
from .contact.nodal import nodal_contact
from .contact.separation import separate
from .contact.walls import Wall
from .energy_guard import EnergyGuard
from .errors import InputError, Interrupted, SolverError
from .geometry.grains import load_grains, read_grain_table
from .geometry.refine import PARTS, split
from .interruption import Interruption
from .launcher import TERMINAL
from .loading import LOADING, STRAIN_DEFINITION, OedometerLoading
from .memory import peak_memory, return_freed_arrays
from .mesh import create_grain_mesh, partition_grains
from .origin import check_origin, grains_checksum
from .output.checkpoint import CheckpointWriter, find_checkpoint, read_tables
from .output.contacts import ContactWriter
from .output.fields import FieldWriter
from .output.history import HistoryWriter
from .output.run_folder import (
    create_run_folder,
    raise_together,
    versions,
    write_atomically,
    write_run_json,
)
from .restart import restore, restore_reference, snapshot
from .scene import WALLS, load_scene, scene_to_toml
from .simulation import ENERGIES, Simulation
from .solid import von_mises

#: Seconds between two updates of the progress line.
REFRESH_SECONDS = 0.5


def read_scene(comm, path):
    """The scene in the file ``path``, read by rank 0 alone. Collective.

    Raises:
        InputError: The file cannot be read, or holds what a scene must not.
    """
    scene, message = None, None
    if comm.rank == 0:
        try:
            scene = load_scene(path)
        except InputError as error:
            message = str(error)
    raise_together(comm, message)
    return comm.bcast(scene)


def load_mesh(comm, grains_folder, element="averaged"):
    """Read each rank's own grains and make the distributed mesh. Collective.

    Args:
        comm: MPI communicator.
        grains_folder: Folder that `mufe mesh` wrote.
        element: Tetrahedra are split where it is "composite".

    Raises:
        InputError: The folder cannot be used, or there are more ranks than grains.
    """
    table, message = None, None
    try:
        table = read_grain_table(grains_folder)
    except (InputError, OSError) as error:
        message = str(error)
    raise_together(comm, message)
    labels, num_cells, _, centroids = table
    if comm.size > labels.size:
        raise InputError(
            f"number of ranks = {comm.size}, expected at most the number of grains, {labels.size}"
        )
    rank_of_grain = partition_grains(num_cells, centroids, comm.size)
    mine = np.flatnonzero(rank_of_grain == comm.rank)
    grains = load_grains(grains_folder, which=mine)
    cell_grain = np.repeat(mine, np.diff(grains.cell_offset))
    points, cells, family = grains.points, grains.cells, 1
    if element == "composite":
        points, cells = split(points, cells)
        cell_grain, family = np.repeat(cell_grain, PARTS), PARTS
    return create_grain_mesh(comm, points, cells, cell_grain, labels, rank_of_grain, family)


def make_walls(scene, low, high):
    """The six walls of a scene at the faces of the box from ``low`` to ``high`` [m]."""
    walls = []
    size = high - low
    for name in WALLS:
        settings = scene.walls[name]
        axis = "xyz".index(name[0])
        normal = np.zeros(3)
        normal[axis] = 1.0 if name.endswith("min") else -1.0
        area = size[(axis + 1) % 3] * size[(axis + 2) % 3]
        walls.append(
            Wall(
                name=name,
                point=(low if name.endswith("min") else high).copy(),
                normal=normal,
                friction=settings.friction,
                friction_kinetic=settings.friction_kinetic,
                velocity=settings.velocity * normal,
                target=None if not settings.stress else settings.stress * area,
                speed=settings.speed or 0.0,
            )
        )
    return walls


class Recorder:
    """Writes history and fields of a test as it goes on. Collective.

    With ``kept``, of :meth:`keep`, it goes on from there; ``same_ranks``: on as many ranks.
    """

    def __init__(
        self, folder, simulation, loading, area, output, energy_limit, kept=None, same_ranks=True
    ):
        mesh = simulation.mesh
        kept = kept or {}
        self.simulation, self.loading, self.area = simulation, loading, area
        self.guard = EnergyGuard(simulation, energy_limit)
        self.history = HistoryWriter(
            folder / "history.csv", comm=mesh.comm, kept=kept.get("history")
        )
        labels = mesh.labels[mesh.grains[mesh.grain_of_cell]]
        self.fields = FieldWriter(
            mesh.comm, folder, mesh.x, mesh.cells, labels, kept.get("fields"), same_ranks
        )
        self.contacts = ContactWriter(mesh.comm, folder, kept.get("contacts", ()))
        self.num_states = kept.get("num_states", 0)
        self._history_interval = loading.final_strain / (output.history - 1)
        self._field_interval = loading.final_strain / (output.fields - 1)
        self._stage, self._next_row, self._next_state = kept.get("next", (None, 0.0, 0.0))

    def keep(self):
        """What a recorder that goes on from here has to know, fit for JSON; rows are on disk."""
        return {
            "history": self.history.sync(),
            "fields": self.fields.kept,
            "contacts": self.contacts.kept,
            "num_states": self.num_states,
            "next": (self._stage, self._next_row, self._next_state),
        }

    def after_step(self):
        """Write what is due."""
        loading = self.loading
        if loading.stage != self._stage:
            self._stage, self._next_row, self._next_state = loading.stage, 0.0, 0.0
        progress = loading.progress
        if loading.stage == LOADING and progress >= self._next_state:
            self._next_state += self._field_interval * (1 - 1e-12)
            self.write_state()
        if progress >= self._next_row:
            self._next_row = progress - math.fmod(progress, self._history_interval)
            self._next_row += self._history_interval * (1 - 1e-12)
            self.write_row()

    def write_row(self):
        """One row of the history. Returns its energies [J]."""
        sim, loading = self.simulation, self.loading
        forces, energies = sim.wall_forces(), sim.energies()
        active = sim.num_active_grains()
        row = {
            "step": sim.state.num_steps,
            "time": sim.state.t,
            "dt": sim.dt,
            "stage": loading.stage,
            "strain": loading.strain,
            "height": loading.height,
            "stress": 0.5 * (forces[4] + forces[5]) / self.area,
            "num_contacts": sim.num_contacts,
            "num_active_grains": active,
            "num_active_contacts": sim.mean_active_contacts(),
        }
        row.update({f"force_{name}": f for name, f in zip(WALLS, forces, strict=True)})
        row.update({name: energies[name] for name in ENERGIES})
        self.history.append(row)
        self.guard.check(
            energies, f"at strain {loading.strain:.4f}", loaded=loading.stage == LOADING
        )
        return energies

    def write_state(self):
        """One state of all fields."""
        sim, state = self.simulation, self.simulation.state
        sim.complete()
        stress = sim.solid.stress(state)
        self.fields.write(
            self.num_states,
            state.t,
            self.loading.strain,
            self.loading.stage,
            {
                "displacement": state.u,
                "velocity": state.v,
                **nodal_contact(sim.contact, sim.mesh.num_nodes),
            },
            {
                "stress": stress,
                "von_mises": von_mises(sim.solid.deviator(state)),
                "pressure": -stress[:, :3].mean(axis=1),
                "plastic_strain": state.plastic_strain,
            },
        )
        network = find_network(sim.contact, sim.mesh, sim.solid.mass, state.x)
        self.contacts.write(self.num_states, state.t, network)
        self.num_states += 1


def run_scene(
    scene,
    grains_folder,
    output_folder,
    comm,
    *,
    overwrite=False,
    max_steps=None,
    quiet=False,
    command=(),
    resume=False,
):
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
            any number of ranks.

    Returns:
        What run.json holds, on every rank.

    Raises:
        InputError: Something the user gave cannot be used; nothing was written.
        SolverError: The computation failed; all up to there was written.
        Interrupted: A signal asked it to end; there is a checkpoint of the last step.
    """
    return_freed_arrays()
    started = time.perf_counter()
    identity = {"scene": scene_to_toml(scene), "grains": grains_checksum(comm, grains_folder)}
    checkpoint = None
    if resume:
        checkpoint = find_checkpoint(comm, output_folder)
        check_origin(comm, checkpoint, identity, Path(output_folder), quiet)
        started -= checkpoint.header["wall_s"]
    mesh = load_mesh(comm, grains_folder, scene.solver.element)
    materials = scene.materials_of(mesh.labels[mesh.grains], mesh.labels)
    sample, separation = scene.sample, None
    if checkpoint is not None:
        separation = checkpoint.header["separation"]
        tables, own = read_tables(comm, checkpoint, mesh.grains)
        restore_reference(mesh, tables)
        folder = Path(output_folder)
    else:
        if sample.separation:
            separation = separate(
                mesh, sample.max_shift, sample.close_gaps, sample.close_gaps_over_h
            ).as_dict()
        folder = create_run_folder(comm, Path(output_folder), overwrite)
        message = None
        if comm.rank == 0:
            try:
                write_atomically(folder / "scene.toml", identity["scene"])
                _copy_tables(Path(grains_folder), folder)
            except (InputError, OSError) as error:
                message = str(error)
        raise_together(comm, message)

    low, high = np.empty(3), np.empty(3)
    comm.Allreduce(mesh.x.min(axis=0), low, op=MPI.MIN)
    comm.Allreduce(mesh.x.max(axis=0), high, op=MPI.MAX)
    solver, oedometer = scene.solver, scene.oedometer
    simulation = Simulation(
        mesh,
        materials,
        make_walls(scene, low, high),
        friction=scene.contact.friction,
        friction_kinetic=scene.contact.friction_kinetic,
        compliance=scene.contact.compliance,
        points=scene.contact.points,
        law=scene.contact.law,
        self_contact=scene.contact.self_contact,
        element=solver.element,
        damping=solver.damping,
        assembled=solver.time_step == "assembled",
        time_step_factor=solver.time_step_factor,
    )
    area = float((high - low)[0] * (high - low)[1])
    loading = OedometerLoading(
        simulation,
        oedometer.strain,
        oedometer.speed,
        oedometer.ramp,
        oedometer.seating_stress * area,
        oedometer.seating_speed,
    )
    kept, same_ranks = None, True
    checkpoints = CheckpointWriter(comm, folder)
    if checkpoint is not None:
        restore(simulation, tables, own, checkpoint.header["state"])
        loading.go_on(checkpoint.header["loading"])
        kept, same_ranks = checkpoint.header["recorder"], checkpoint.num_ranks == comm.size
        del tables
        checkpoints.remove_after(checkpoint)
    recorder = Recorder(
        folder, simulation, loading, area, scene.output, solver.energy_limit, kept, same_ranks
    )
    summary = {
        "title": scene.title,
        "command": list(command),
        "versions": versions(),
        "num_ranks": comm.size,
        "num_grains": int(mesh.labels.size),
        "num_cells": comm.allreduce(mesh.num_cells),
        "num_nodes": comm.allreduce(mesh.num_nodes),
        "element": solver.element,
        "family": mesh.family,
        "finished": False,
        "stop_reason": "running",
        "strain_definition": STRAIN_DEFINITION,
        "area": area,
        "first_height": float(loading.first_height),
        "separation": separation,
        "failed_grains": _failed_grains(folder / "quality.csv"),
        "setup_s": time.perf_counter() - started,
        "resumed_at_steps": [],
    }
    if checkpoint is not None:
        summary["setup_s"] = checkpoint.header["setup_s"]
        before = checkpoint.header["resumed_at_steps"]
        summary["resumed_at_steps"] = [*before, checkpoint.header["step"]]

    def save():
        """Write a checkpoint, unless there is one of this step."""
        step = simulation.state.num_steps
        if checkpoints.last is not None and checkpoints.last.name == f"step-{step:09d}":
            return
        tables, own, state = snapshot(simulation)
        header = {
            "state": state,
            "loading": loading.keep(),
            "recorder": recorder.keep(),
            "wall_s": time.perf_counter() - started,
            **{k: summary[k] for k in ("setup_s", "separation", "resumed_at_steps")},
            **identity,
        }
        checkpoints.write(step, tables, own, header)

    if comm.rank == 0:
        write_run_json(folder, _now(summary, simulation, loading, started, 0))

    error = None
    try:
        summary["stop_reason"] = _march(
            simulation, loading, recorder, scene.output, save, max_steps, quiet, resume
        )
        summary["finished"] = bool(loading.finished)
    except (SolverError, Interrupted) as failure:
        error = failure
        summary["stop_reason"] = str(failure)
        if isinstance(failure, SolverError):
            recorder.write_state()
    except InputError as failure:  # a disk that is full
        if checkpoints.last is None:
            raise
        raise InputError(f"{failure}; --resume goes on from {checkpoints.last}") from failure
    memory = peak_memory(comm)
    summary = _now(summary, simulation, loading, started, memory)
    summary["contact"] = {
        "num_searches": simulation.contact.num_searches,
        "num_adopted": comm.allreduce(simulation.contact.num_adopted),
        "num_too_deep": comm.allreduce(simulation.contact.num_deep),
        "deepest_adopted": comm.allreduce(simulation.contact.deepest, op=MPI.MAX),
    }
    if comm.rank == 0:
        write_run_json(folder, summary)
    comm.Barrier()  # every rank finds complete files when this returns
    if error is not None:
        raise error
    return summary


def _march(simulation, loading, recorder, output, save, max_steps, quiet, resumed):
    """Step until the end of the test; returns why it stopped. Collective."""
    state = simulation.state
    due = _Due(output, loading)
    with (
        _Progress(simulation.comm, loading, quiet) as progress,
        Interruption(simulation.comm, output.checkpoint) as interruption,
    ):
        while True:
            if not resumed:  # that step is recorded already
                recorder.after_step()
            resumed = False
            progress.update(simulation)
            if loading.finished:
                break
            if max_steps is not None and state.num_steps >= max_steps:
                save()
                recorder.write_row()
                return f"max_steps = {max_steps} reached"
            number, by_time = interruption()
            if number or by_time or due(state.num_steps):
                save()
                interruption.saved()
            if number:
                raise Interrupted(
                    f"stopped by {signal.Signals(number).name} at step {state.num_steps}, strain "
                    f"{loading.strain:.4f}, after a checkpoint: --resume goes on from it",
                    number,
                )
            loading.before_step()
            simulation.step(everywhere=False)
    simulation.check()
    return "final strain reached"


def _now(summary, simulation, loading, started, memory):
    """The summary with what changes during a run."""
    return summary | {
        "num_steps": simulation.state.num_steps,
        "time": simulation.state.t,
        "time_step": simulation.dt,
        "element_time_step": simulation.dt_element,
        "strain": float(loading.strain),
        "reference_height": float(loading.reference_height),
        "stages": loading.stages,
        "wall_s": time.perf_counter() - started,
        "peak_memory_bytes": memory,
    }


class _Due:
    """Whether a checkpoint is due by steps or by strain."""

    def __init__(self, output, loading):
        self.output, self.loading = output, loading
        self._passed = self._count()

    def _count(self):
        interval = self.output.checkpoint_strain
        return math.floor(self.loading.strain / interval) if interval else 0

    def __call__(self, step):
        before, self._passed = self._passed, self._count()
        interval = self.output.checkpoint_steps
        return self._passed > before or bool(interval and step and step % interval == 0)


def _copy_tables(grains_folder, folder):
    """Keep the tables of the grains with the run."""
    source = grains_folder if grains_folder.is_dir() else grains_folder.parent
    for path in source.glob("*.csv"):
        (folder / path.name).write_bytes(path.read_bytes())


def _failed_grains(path):
    """Labels of the grains that `mufe mesh` could not mesh, from its table; None without it."""
    if not path.is_file():
        return None
    with path.open(newline="") as file:
        return [int(row["label"]) for row in csv.DictReader(file) if row["status"] != "ok"]


class _Progress:
    """A line with strain, step rate and time left; nothing where no terminal listens."""

    def __init__(self, comm, loading, quiet):
        self.loading = loading
        terminal = sys.stderr.isatty() or os.environ.get(TERMINAL) == "1"
        self.active = comm.rank == 0 and not quiet and terminal

    def __enter__(self):
        if self.active:
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

            self.bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                TextColumn("{task.fields[text]}"),
                TimeRemainingColumn(),
                console=Console(stderr=True, force_terminal=True),
            )
            self.bar.start()
            self.task = self.bar.add_task(
                self.loading.stage, total=self.loading.final_strain, text=""
            )
            self.last, self.last_steps = time.perf_counter(), 0
        return self

    def update(self, simulation):
        if not self.active:
            return
        now = time.perf_counter()
        if now - self.last < REFRESH_SECONDS:
            return
        steps = simulation.state.num_steps
        rate = (steps - self.last_steps) / (now - self.last)
        self.last, self.last_steps = now, steps
        self.bar.update(
            self.task,
            description=self.loading.stage,
            completed=self.loading.strain,
            text=f"strain {self.loading.strain:.4f}  {rate:.0f} steps/s",
        )

    def __exit__(self, *_):
        if self.active:
            self.bar.stop()
