"""Grains that stay rigid until they carry a load."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.materials.auto import Auto
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.run.from_bodies import build
from tests.bodies import sphere

ROCK = {"E": 1e9, "nu": 0.15, "rho": 2650.0, "yield_stress": ((0.0, 10e6), (0.05, 110e6))}
#: Stays rigid under the load of these tests, and does not.
LATE, SOON = 0.999, 1e-4


def balls(margin, material=Auto, velocity=None):
    """Two balls on each other and a plane, another plane coming down; two balls far from all."""
    points, cells = sphere(1e-3, 0.5e-3)
    place = [(0, 0, 0), (0, 0, 1.98e-3), (9e-3, 0, 1e-3), (9e-3, 9e-3, 1e-3)]
    bodies = [(points + np.array(p), cells) for p in place]
    low = Wall("low", np.array([0, 0, -0.99e-3]), np.eye(3)[2], friction=0.4)
    top = Wall("top", np.array([0, 0, 2.97e-3]), -np.eye(3)[2], velocity=-np.eye(3)[2])
    options = {} if material is J2 else {"margin": margin}
    return build(
        MPI.COMM_WORLD, bodies, material(**ROCK, **options), (0, 0, 0), (0, 0, 0), axes="",
        walls=[low, top], friction=0.4, velocity=velocity, time_step_factor=0.4,
    )  # fmt: skip


def spinning(x, _):
    """Velocities of all nodes as of one rigid body [m/s]."""
    return np.cross([0.0, 50.0, 80.0], x) + 0.1


def balance(s):
    """Energies, and momentum with angular momentum of all nodes."""
    mv = s.solid.mass[:, None] * s.state.v
    local = np.concatenate([mv.sum(axis=0), np.cross(s.state.x, mv).sum(axis=0)])
    e = s.energies()
    kinetic = e["kinetic"] - s.initial_kinetic
    energies = np.array([kinetic, e["contact"], e["elastic"], e["residual"]])
    return energies, s.comm.allreduce(local)


@pytest.mark.mpi
def test_nothing_jumps_when_a_grain_begins_to_deform():
    """Forces, energies and momenta are those of before: the same bodies, contact and masses."""
    s = balls(LATE, velocity=spinning)
    for _ in range(40):  # until both balls that touch are loaded
        s.step()
    assert s.comm.allreduce(s.solid.grains.size) == 0
    (before, momenta), wall_forces = balance(s), s.wall_forces()
    x, v = s.state.x.copy(), s.state.v.copy()
    s.watch.largest *= SOON
    s._release_loaded()
    assert s.comm.allreduce(s.solid.grains.size) == 2
    (after, momenta_after), _ = balance(s), s.wall_forces()
    assert np.array_equal(x, s.state.x) and np.array_equal(v, s.state.v)
    assert np.array_equal(wall_forces, s.wall_forces())
    # Sums over nodes instead of those of the bodies: rounding.
    assert np.allclose(after, before, rtol=0, atol=1e-12 * before.max())
    assert np.allclose(momenta_after, momenta, rtol=0, atol=1e-12 * np.abs(momenta).max())


def test_only_loaded_grains_deform_and_answer_as_j2_does():
    auto, full = balls(SOON), balls(None, J2)
    force = []
    for s in (auto, full):
        forces = []
        while s.state.t < 6e-5:
            s.step()
            forces.append(s.wall_forces().mean())
        force.append(np.mean(forces[-50:]))
        e = s.energies()
        # Bodies that begin to deform in the middle of a step leave a part of one step's work;
        # trapezoids of springs that are not linear 1.5e-4 at twice the step.
        assert abs(e["residual"]) < 1e-4 * e["work"]
    mesh = auto.mesh
    labels = auto.comm.allgather(mesh.labels[mesh.grains[auto.solid.grains]])
    assert sorted(np.concatenate(labels)) == [1, 2]
    # What the bulk would have given way until then: the margin's part of a diameter.
    assert force[0] == pytest.approx(force[1], rel=0.02)
