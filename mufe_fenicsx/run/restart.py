"""What a test takes from a checkpoint: ranks of its grains, their first shapes, its state."""

import numpy as np

from ..contact.snapshot import wrong_number
from ..errors import raise_together
from ..output.checkpoint import read_tables
from .resume_check import integrator_of
from .snapshot import OF_MESH, restore, restore_mesh


def partition_of(checkpoint, comm):
    """Ranks of the grains that a checkpoint asks for; None on another number of ranks."""
    if checkpoint.num_ranks != comm.size:
        return None
    return np.array(checkpoint.header["rank_of_grain"], dtype=np.int32)


def mesh_of(checkpoint, mesh):
    """A mesh with what had opened, and the reference configuration, of a checkpoint. Collective."""
    return restore_mesh(mesh, _read(checkpoint, mesh, OF_MESH)[0])


def restore_test(checkpoint, simulation, loading, scene, num_retries):
    """Bring simulation and loading from their start to the state of a checkpoint. Collective.

    Args:
        checkpoint: :class:`~.output.checkpoint.Checkpoint`.
        simulation, loading: Those of ``scene``.
        scene: :class:`~mufe_fenicsx.scene.Scene`, perhaps with another integrator than then.
        num_retries: Those up to now; with more than then, steps are shorter.
    """
    header, mesh = checkpoint.header, simulation.mesh
    tables, own = _read(checkpoint, mesh)
    wrong = wrong_number(tables, len(mesh.labels), len(simulation.walls.walls))
    raise_together(mesh.comm, wrong and f"checkpoint {checkpoint.path}: {wrong}")
    restore(simulation, tables, own, header["state"])
    del tables
    if len(header["retries"]) < num_retries:
        simulation.update_time_step()
    if integrator_of(header["scene"]) != scene.solver.integrator:
        simulation.take_over()
    loading.load_state_dict(header["loading"])


def _read(checkpoint, mesh, only=None):
    """Tables of a checkpoint for the grains of this rank, and what ranks had of their own."""
    return read_tables(mesh.comm, checkpoint, mesh.grains, mesh.rank_of_grain, only)
