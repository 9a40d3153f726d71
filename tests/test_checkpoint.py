"""A run that stops, by whatever, goes on as if it had not."""


import pytest
from mpi4py import MPI

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.grains import save_grains
from mufe_fenicsx.materials.auto import Auto
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.materials.rigid import Rigid
from mufe_fenicsx.run import run_scene
from mufe_fenicsx.scene import (
    Contact,
    Group,
    Oedometer,
    Output,
    Scene,
    Wall,
)
from tests.bodies import RADIUS, packed_grains

COMM = MPI.COMM_WORLD
ROCK = (100e9, 0.15, 2650.0)
TABLE = ((0.0, 10e6), (0.05, 110e6))


def scene(**output):
    """Friction, yielding, a rigid grain, one that is so until loaded, and a wall with a servo."""
    return Scene(
        material=J2(*ROCK, TABLE),
        materials={
            "hard": Group((2,), Rigid(*ROCK)),
            "late": Group((3, 5), Auto(*ROCK, TABLE, margin=0.05)),
        },
        contact=Contact(friction=0.4, wall_friction=0.2),
        oedometer=Oedometer(strain=0.012, speed=20.0, seating_stress=1e4),
        walls={"x_max": Wall(stress=2e5, speed=1.0)},
        output=Output(fields=3, history=41, **output),
    )


@pytest.fixture
def folder(tmp_path_factory):
    """A folder that all ranks share, with the grains: two layers of spheres."""
    path = COMM.bcast(tmp_path_factory.mktemp("keep") if COMM.rank == 0 else None)
    if COMM.rank == 0:
        save_grains(path / "grains", packed_grains((2, 2, 2), h=0.7 * RADIUS))
    COMM.Barrier()
    return path


def run(folder, name, **options):
    given = options.pop("scene", scene())
    return run_scene(given, folder / "grains", folder / name, COMM, quiet=True, **options)


def files(path):
    """Names of all files of a run that hold results, and the bytes of the tables."""
    names = [p for p in path.rglob("*") if p.is_file() and "checkpoints" not in p.parts]
    found = {str(p.relative_to(path)): p.read_bytes() for p in names if p.suffix != ".vtkhdf"}
    del found["run.json"]
    return found | {str(p.relative_to(path)): None for p in names if p.suffix == ".vtkhdf"}


@pytest.mark.mpi
def test_resumed_runs_give_the_same_bytes(folder):
    """Stopped while seating, before and after a grain begins to deform, between states."""
    whole = run(folder, "whole")
    assert whole["finished"]
    for steps in (7, 100, 200, whole["num_steps"] - 1):
        run(folder, "parts", max_steps=steps, resume=steps > 7)
    parts = run(folder, "parts", resume=True)
    assert parts["finished"] and parts["resumed_at_steps"] == [7, 100, 200, whole["num_steps"] - 1]
    if COMM.rank == 0:
        assert files(folder / "parts") == files(folder / "whole")
    assert parts["stages"] == whole["stages"] and parts["contact"] == whole["contact"]
    with pytest.raises(InputError, match="is finished"):
        run(folder, "parts", resume=True)
