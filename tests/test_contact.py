"""Contact between grains and with walls: balance, energy, Coulomb's law, any number of ranks."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.materials.elastic import Elastic
from tests.bodies import RADIUS, packed_spheres, simulation_of

COMM = MPI.COMM_WORLD
QUARTZ = Elastic(100e9, 0.15, 2650.0)
FRICTION = 0.3

#: Time step over the limit of stability: nodes that meet a wall at speed v leave it no
#: faster only if (ω Δt)² <= 2 for their contact spring, 0.7 of the limit ω Δt = 2.
FACTOR = 0.6


def total(values):
    return COMM.allreduce(values.sum(axis=0))


def collision(friction=FRICTION, speed=20.0):
    """Three balls in a row: the outer ones run into the middle one, spinning and off centre."""
    mesh = packed_spheres(COMM, (3, 1, 1), gap=0.002)
    grain = mesh.grains[mesh.grain_of_node]
    centre = np.array([(2.002 * k + 1.001) * RADIUS for k in range(3)])[grain]
    arm = mesh.x - np.column_stack([centre, np.full((len(grain), 2), 1.001 * RADIUS)])
    drift = speed * np.array([[1.0, 0.2, 0], [0, 0, 0], [-1.0, 0, 0.3]])[grain]
    spin = speed / RADIUS * np.array([[0.2, 0, 0.5], [0, 0, 0], [0, -0.7, 0.1]])[grain]
    velocity = drift + np.cross(spin, arm)
    return simulation_of(
        mesh, QUARTZ, friction=friction, velocity=velocity, time_step_factor=FACTOR
    )


@pytest.mark.mpi
def test_momentum_angular_momentum_and_dissipation_of_a_collision():
    """Checked at every step; sticking, sliding, facet changes and release all occur."""
    s = collision()
    largest, dissipated, counts = 0.0, 0.0, set()
    for _ in range(400):
        s.step()
        f, x = s.force.x.array.reshape(-1, 3), s.state.x
        size = COMM.allreduce(np.abs(f).sum())
        largest = max(largest, size)
        if size > 0:
            # Round-off of a sum of some thousand terms.
            assert np.abs(total(f)).max() < 1e-12 * size
            assert np.abs(total(np.cross(x, f))).max() < 1e-12 * size * 6 * RADIUS
        now = COMM.allreduce(s.contact.dissipated)
        assert now >= dissipated
        dissipated = now
        p = s.contact.pairs
        kept = p.closed
        shear = np.linalg.norm(p.shear[kept], axis=1)
        depth = np.minimum(p.offset - p.gap, s.contact.largest_depth)[kept]
        # Coulomb's limit to rounding.
        assert np.all(shear <= FRICTION * p.stiffness[kept] * depth * (1 + 1e-9) + 1e-12)
        counts.add(COMM.allreduce(int(kept.sum())))
    assert largest > 0 and dissipated > 0
    assert len(counts) > 3


@pytest.mark.mpi
def test_smooth_contact_dissipates_nothing():
    s = collision(friction=0.0)
    for _ in range(300):
        s.step()
    e = s.energies()
    assert COMM.allreduce(s.contact.dissipated) == 0.0
    # Nodes meet at speed, each time with an error of the order of (dt over contact time).
    assert abs(e["residual"]) < 2e-3 * s.initial_kinetic


@pytest.mark.mpi
def test_overlap_at_the_start_releases_nothing():
    """Balls that start 2 % of a radius deep in each other and in the walls stay at rest."""
    mesh = packed_spheres(COMM, (3, 1, 1), gap=-0.02)
    corner = np.array([6.0, 2.0, 2.0]) * RADIUS
    walls = [
        Wall("x_min", np.full(3, 0.01 * RADIUS), np.array([1.0, 0, 0]), friction=FRICTION),
        Wall("x_max", corner * 0.98, np.array([-1.0, 0, 0]), friction=FRICTION),
    ]
    s = simulation_of(mesh, QUARTZ, walls, friction=FRICTION, time_step_factor=FACTOR)
    for _ in range(50):
        s.step()
    assert COMM.allreduce(s.contact.num_adopted) > 0
    assert COMM.allreduce(np.abs(s.state.v).max(initial=0.0), op=MPI.MAX) == 0.0
    assert np.all(s.wall_forces() == 0.0)

    # From there they resist at once.
    s.walls.velocity[1] = [-1.0, 0, 0]
    for _ in range(400):
        s.step()
    assert s.wall_forces()[1] > 0.0
    e = s.energies()
    assert abs(e["residual"]) < 2e-3 * e["work"]


@pytest.mark.mpi
def test_compressed_row_carries_the_same_force_throughout():
    """Newton's third law through three balls and two walls, damped to rest."""
    mesh = packed_spheres(COMM, (3, 1, 1), h=0.6 * RADIUS)
    walls = [
        Wall("x_min", np.zeros(3), np.array([1.0, 0, 0])),
        Wall("x_max", np.array([6.0, 0, 0]) * RADIUS, np.array([-1.0, 0, 0])),
    ]
    s = simulation_of(mesh, QUARTZ, walls, damping=2e6, time_step_factor=FACTOR)
    s.walls.velocity[1] = [-1.0, 0, 0]
    while s.walls.point[1, 0] > 6 * RADIUS - 3e-6:
        s.step()
    s.walls.velocity[1] = 0.0
    for _ in range(1500):
        s.step()
    left, right = s.wall_forces()
    # What motion is left: root of kinetic over elastic energy.
    e = s.energies()
    assert left > 0
    assert abs(left / right - 1) < 3 * np.sqrt(e["kinetic"] / e["elastic"]) + 1e-6


# --- number of ranks --------------------------------------------------------------------------


def packing_forces(num_steps):
    """Wall forces of eight balls under a platen, every tenth step, shape (num_records, 6)."""
    mesh = packed_spheres(COMM, (2, 2, 2))
    size = 4.0 * RADIUS
    walls = []
    for axis, normal in zip("xyz", np.eye(3), strict=True):
        walls.append(Wall(f"{axis}_min", np.zeros(3), normal, friction=FRICTION))
        walls.append(Wall(f"{axis}_max", np.full(3, size), -normal, friction=FRICTION))
    walls[-1].velocity = np.array([0.0, 0.0, -5.0])
    s = simulation_of(mesh, QUARTZ, walls, friction=FRICTION, time_step_factor=FACTOR)
    forces = []
    for k in range(num_steps):
        s.step()
        if k % 10 == 9:
            forces.append(s.wall_forces().tolist())
    return forces


def test_one_two_and_three_ranks_agree(tmp_path):
    """The same forces on all walls over 500 steps, to 1e-9 of the largest.

    Sums over ranks differ by rounding, which 500 stable steps do not amplify beyond that.
    """
    beside = Path(sys.executable).parent / "mpirun"
    mpirun = str(beside) if beside.exists() else shutil.which("mpirun")
    if mpirun is None:
        pytest.skip("no mpirun beside Python or on PATH")
    answers = []
    for num_ranks in (1, 2, 3):
        path = tmp_path / f"{num_ranks}.json"
        subprocess.run(
            [
                *(mpirun, "-n", str(num_ranks), sys.executable, "-m", "mpi4py"),
                *("-m", "tests.test_contact", str(path), "500"),
            ],
            cwd=Path(__file__).resolve().parents[1],
            check=True,
            timeout=120,
        )
        answers.append(np.array(json.loads(path.read_text())))
    size = np.abs(answers[0]).max()
    assert size > 0 and np.all(answers[0][-1, 4:] > 0)
    for answer in answers[1:]:
        assert np.abs(answer - answers[0]).max() < 1e-9 * size


if __name__ == "__main__":
    result = packing_forces(int(sys.argv[2]))
    if COMM.rank == 0:
        Path(sys.argv[1]).write_text(json.dumps(result))
