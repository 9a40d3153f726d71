"""What run.json says of a test: dicts fit for JSON, the same on all ranks."""

import math
import time
from dataclasses import asdict

import numpy as np
from mpi4py import MPI

from ..analysis.breakage import breakage, fragments_of
from ..machine.memory import peak_memory
from ..output.run_folder import versions


def of_start(scene, prepared, options):
    """Of a test before its first step. Collective.

    Args:
        scene: :class:`~mufe_fenicsx.scene.Scene`.
        prepared: :class:`~.preparation.Prepared`.
        options: :class:`~.run_options.RunOptions`.
    """
    mesh, bounds, container = prepared.mesh, prepared.bounds, scene.container.kind
    return {
        "title": scene.title,
        "command": list(options.command),
        "versions": versions(),
        "num_ranks": mesh.comm.size,
        "num_grains": mesh.num_sample_grains,
        "num_cells": mesh.comm.allreduce(mesh.num_sample_cells),
        "num_nodes": mesh.comm.allreduce(mesh.sample_nodes.size),
        "element": scene.solver.element,
        "finished": False,
        "stop_reason": "running",
        "strain_definition": None,
        "area": float(container.areas(container.lengths_within(bounds))[-1]),
        "container": container.note(bounds),
        "membrane": {"label": mesh.labels_of_sleeves[0]} if mesh.sleeves else None,
        "resumed_at_steps": [],
        "balanced_at_steps": [],
    }


def size_in_words(summary):
    """Grains, nodes and elements."""
    return "{num_grains} grains, {num_nodes} nodes, {num_cells} elements".format(**summary)


def of_now(simulation, loading, retries, started):
    """What changes during a run. Collective.

    Args:
        simulation, loading: What moves.
        retries: A dict for each so far.
        started: When the run began, by `time.perf_counter` [s].
    """
    found = {
        "num_steps": simulation.state.num_steps,
        "time": simulation.state.t,
        "time_step": simulation.dt,
        "element_time_step": simulation.dt_element,
        "strain": float(loading.strain),
        "reference_height": float(loading.reference_height),
        "stages": loading.stages,
        "retries": retries,
        "wall_s": time.perf_counter() - started,
        "peak_memory_bytes": 0,
    }
    if loading.control is not None:
        found["quasi_static"] = loading.control.summary()
    if simulation.tools.any:
        found["tools"] = simulation.tools.summary()
    return found


def of_end(simulation):
    """What is counted at the end: memory, contacts and mass. Collective."""
    comm, contact, scaling = simulation.comm, simulation.contact, simulation.scaling
    found = {"peak_memory_bytes": peak_memory(comm)}
    if scaling is not None:
        limits = simulation.limit.with_and_without_added_mass(simulation.dt_element)
        found["mass_scaling"] = scaling.summary(limits)
    closed = ("num_closed", "num_with_offset", "num_at_largest_force")
    found["contact"] = {
        "num_searches": contact.num_searches,
        "num_overlaps_at_start": comm.allreduce(contact.overlaps.num_accepted),
        "deepest_at_start": comm.allreduce(contact.overlaps.deepest, op=MPI.MAX),
        **dict(zip(closed, comm.allreduce(contact.counts()).tolist(), strict=True)),
    }
    if simulation.specimen.opening_terms:
        numbers = asdict(_breakage(simulation)) | _opened(simulation)
        found["breakage"] = {k: v if math.isfinite(v) else None for k, v in numbers.items()}
    return found | masses(simulation)


def _opened(simulation):
    """Facets that opened, their area, what of it bears no more, and its work. Collective."""
    terms, state = simulation.specimen.opening_terms, simulation.state
    work = sum(term.parts_of_energy(state).get("fracture", 0.0) for term in terms)
    own = np.array([*sum(term.opened_and_failed() for term in terms), work])
    number, *rest = simulation.comm.allreduce(own).tolist()
    names = "opened_area", "failed_area", "fracture_work"
    return {"num_opened": int(number)} | dict(zip(names, rest, strict=True))


def _breakage(simulation):
    """:class:`~mufe_fenicsx.analysis.breakage.Breakage` of now. Collective."""
    mesh, cells = simulation.mesh, slice(simulation.mesh.num_sample_cells)
    piece = mesh.piece_of_cell
    piece = np.zeros(mesh.num_cells, dtype=np.int32) if piece is None else piece
    grain = mesh.grains[mesh.grain_of_cell[cells]]
    own = fragments_of(simulation.solid.volume0[cells], grain, piece[cells])
    return breakage(*map(np.concatenate, zip(*mesh.comm.allgather(own), strict=True)))


def masses(simulation):
    """Mass of all grains, and what mass scaling has added to it [kg]. Collective."""
    whole, scaling = simulation.mass_of_grains(), simulation.scaling
    own = whole / (1.0 + (scaling.shares()[0] if scaling else 0.0))
    return {"mass": own, "added_mass": whole - own}
