"""Runs of demonstrations are kept: one that has finished stays, another goes on."""

import json

from mpi4py import MPI

from mufe_fenicsx.run.run import run_scene


def finished(folder):
    """What run.json says of a run that has finished, or None."""
    path = folder / "run.json"
    summary = json.loads(path.read_text()) if path.exists() else {}
    return summary if summary.get("finished") else None


def go_on(folder, scene):
    """Run a test, from its last checkpoint on where there is one."""
    resume = (folder / "checkpoints").exists()
    run_scene(
        scene, scene.sample.grains, folder, MPI.COMM_WORLD, overwrite=not resume, quiet=True,
        resume=resume,
    )  # fmt: skip
