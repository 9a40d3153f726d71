"""Grains move to other ranks where the work is uneven, and the test stays the same."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.geometry.grains import save_grains
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.output.history import read_history
from mufe_fenicsx.run import from_scene as preparation
from mufe_fenicsx.run import time_loop
from mufe_fenicsx.run.rebalance import better_partition, imbalance, work_of_grains
from mufe_fenicsx.run.run import run_scene
from mufe_fenicsx.scene import Contact, Oedometer, Output, Scene
from tests.bodies import RADIUS, packed_grains

COMM = MPI.COMM_WORLD


@pytest.fixture
def folder(tmp_path_factory):
    """A folder that all ranks share, with 3 x 2 x 1 spheres."""
    folder = COMM.bcast(tmp_path_factory.mktemp("balance") if COMM.rank == 0 else None)
    if COMM.rank == 0:
        save_grains(folder / "grains", packed_grains((3, 2, 1), h=0.7 * RADIUS))
    COMM.Barrier()
    return folder


def run(folder, name, **options):
    scene = Scene(
        material=J2(100e9, 0.15, 2650.0, ((0.0, 10e6), (0.05, 110e6))),
        contact=Contact(friction=0.23),
        oedometer=Oedometer(strain=0.006, speed=20.0, seating_stress=1e4),
        output=Output(fields=3, history=21),
    )
    return run_scene(scene, folder / "grains", folder / name, COMM, quiet=True, **options)


def test_imbalance_is_the_busiest_rank_over_the_mean():
    assert imbalance(np.array([3.0, 1.0, 2.0]), np.array([0, 1, 1]), 2) == 1.0
    assert imbalance(np.array([3.0, 1.0]), np.array([0, 0]), 2) == 2.0


@pytest.mark.mpi
def test_moving_grains_changes_nothing_but_the_last_digits(folder, monkeypatch):
    """A test that begins with most grains on one rank, on others from then on."""
    plain = run(folder, "plain")
    assert plain["balanced_at_steps"] == []

    def lopsided(weights, centroids, num_ranks):
        return np.maximum(np.arange(weights.size) - weights.size + num_ranks, 0)

    monkeypatch.setattr(preparation, "partition_grains", lopsided)
    monkeypatch.setattr(time_loop, "INTERVAL", 0.004)
    moved = run(folder, "moved")
    if COMM.size == 1:
        assert moved["balanced_at_steps"] == []
        return
    assert len(moved["balanced_at_steps"]) == 1
    a, b = (read_history(folder / name / "history.csv") for name in ("plain", "moved"))
    assert np.array_equal(a["step"], b["step"])  # nothing twice, nothing missing
    # As of a checkpoint that goes on on another number of ranks.
    scale = np.abs(a["force_z_max"]).max()
    assert np.abs(a["force_z_max"] - b["force_z_max"]).max() < 1e-9 * scale
    # A checkpoint of then goes on to the same bits.
    step = (moved["balanced_at_steps"][0] + moved["num_steps"]) // 2
    run(folder, "cut", max_steps=step)
    run(folder, "cut", resume=True)
    c = read_history(folder / "cut" / "history.csv")
    # Stopping writes a row of its own; all others are those of the run that did not stop.
    _, in_b, in_c = np.intersect1d(b["step"], c["step"], return_indices=True)
    assert in_b.size >= b["step"].size - 1 and c["step"].size <= b["step"].size + 1
    assert np.array_equal(b["work"][in_b], c["work"][in_c])


@pytest.mark.mpi
def test_even_work_stays_where_it_is(folder):
    from mufe_fenicsx.run.from_scene import load_mesh, make_simulation
    from mufe_fenicsx.run.preparation import Prepared

    mesh = load_mesh(COMM, folder / "grains")
    scene = Scene(
        material=J2(100e9, 0.15, 2650.0, ((0.0, 10e6), (0.05, 110e6))),
        contact=Contact(friction=0.23),
        oedometer=Oedometer(strain=0.01, speed=20.0),
    )
    simulation = make_simulation(scene, Prepared.of(scene, mesh))
    # Nothing touches: tets alone. Six equal grains on two or three ranks are even.
    assert work_of_grains(simulation).sum() == mesh.num_cells
    assert better_partition(simulation) is None
