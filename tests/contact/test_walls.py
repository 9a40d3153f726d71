"""Walls that a servo presses, and what is known of nodes near them between two looks."""

import platform

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.kernels.build.native import load
from mufe_fenicsx.kernels.contact import walls as wall_kernels
from mufe_fenicsx.materials.elastic import Elastic
from tests.bodies import RADIUS, packed_spheres, simulation_of


def test_servo_holds_its_force_and_its_work_is_in_the_balance():
    """Three balls side by side under a servo come to rest at the target force."""
    mesh = packed_spheres(MPI.COMM_WORLD, (3, 1, 1), gap=0.2)
    # Enough for several facets of each ball: on a single one it would roll.
    target = 20.0
    up = np.array([0.0, 0.0, 1.0])
    walls = [
        Wall("z_min", np.zeros(3), up),
        Wall("z_max", np.array([0.0, 0.0, 2.2 * RADIUS]), -up, target=target, speed=0.5),
    ]
    material = Elastic(1e9, 0.15, 2650.0)
    # A tenth of the frequency of a ball on its contacts: it settles in some periods.
    sim = simulation_of(mesh, material, walls, damping=2e4)
    for _ in range(9000):
        sim.step()
    bottom, top = sim.wall_forces()
    # The servo slows down in proportion to what is missing: it approaches exponentially.
    assert top == pytest.approx(target, rel=0.01)
    assert bottom == pytest.approx(target, rel=0.01)
    energies = sim.energies()
    assert abs(energies["residual"]) < 1e-3 * energies["work"]


def forces_on_fast_wall(comm, target):
    """Three alike balls under a servo that is in the end asked for twenty times what is stable."""
    mesh, up = packed_spheres(comm, (3, 1, 1), gap=0.0), np.array([0.0, 0.0, 1.0])
    top = Wall("z_max", np.array([0.0, 0.0, 2.0 * RADIUS]), -up, target=target, speed=0.5)
    s = simulation_of(mesh, Elastic(1e9, 0.15, 2650.0), [Wall("z_min", np.zeros(3), up), top],
                      damping=2e4)  # fmt: skip
    forces = []
    for number in range(3600):
        if number == 3000:
            force, stiffness = s.walls.pressing(comm)
            assert force[1] == pytest.approx(target, rel=0.05)
            top.speed = 20.0 * target / (stiffness[1] * s.dt)
        s.step()
        forces.append(s.wall_forces()[1])
    return np.array(forces)


def test_servo_on_a_stiff_sample_does_not_chatter():
    """It is not thrown off its contacts in one step and back, and ranks add rounding alone."""
    target = 20.0
    forces = forces_on_fast_wall(MPI.COMM_WORLD, target)
    # Balls on their contacts still swing by 0.2 %; without the bound forces are off by 20 times.
    assert np.abs(forces[3300:] / target - 1).max() < 0.01
    if MPI.COMM_WORLD.size > 1:
        # Sums in another order, 1e-16, which thousands of steps amplify, to 1e-13 here.
        alone = forces_on_fast_wall(MPI.COMM_SELF, target)
        assert np.abs(forces - alone).max() < 1e-9 * target


@pytest.mark.parametrize("spin", [pytest.param(0.0, marks=pytest.mark.mpi), 2e4])
def test_open_pairs_are_no_nearer_to_walls_than_their_bounds_say(spin):
    """Balls fly along a wall at rest and towards one that comes nearer, stretched and sheared."""
    mesh = packed_spheres(MPI.COMM_WORLD, (3, 1, 1), gap=0.02)
    slopes = 300.0 * np.array([[1.0, 0.3, 0.1], [-0.2, 0.5, 0.0], [0.2, 0.4, 0.0]])
    velocity = [30.0, -20.0, 0.0] + mesh.x @ slopes
    up, low, high = np.array([0.0, 0.0, 1.0]), mesh.x[:, 2].min(), mesh.x[:, 2].max()
    low, high = mesh.comm.allreduce(low, op=MPI.MIN), mesh.comm.allreduce(high, op=MPI.MAX)
    walls = [
        Wall("z_min", np.array([0.0, 0.0, low]) - 1e-7 * up, up),
        Wall("z_max", np.array([0.0, 0.0, high]) + 1e-7 * up, -up, velocity=-3.0 * up,
             angular_velocity=np.array([spin, 0.0, 0.0])),
    ]  # fmt: skip
    s = simulation_of(mesh, Elastic(1e9, 0.15, 2650.0), walls, velocity=velocity)
    contact, num_ahead, advance = s.contact, 0, {0: [], 1: []}
    for _ in range(60):
        bound, motion_bounds = contact.motion.bound, contact.walls.pairs.motion_bounds
        before = motion_bounds.bounds.copy()
        s.step()
        pairs, points = contact.walls.pairs, contact.points
        if pairs.motion_bounds is motion_bounds:
            for wall, parts in advance.items():
                of_wall = np.unique(motion_bounds.of[pairs.wall == wall])
                parts.extend(
                    (motion_bounds.bounds - before)[of_wall] / (contact.motion.bound - bound)
                )
        x = contact.ghosts.positions.array[contact.ghosts.num_before :][points.corner[pairs.node]]
        x = np.einsum("nk,nki->ni", points.weight[pairs.node], x)
        normal, point = contact.walls.normal[pairs.wall], contact.walls.point[pairs.wall]
        gap = ((x - point) * normal).sum(axis=1) + (points.recess - points.stands)[pairs.node]
        wait = (pairs.next_check - pairs.motion_bounds.now)[~pairs.closed]
        # Positions of some 1e-3 m have that much round-off.
        assert (wait <= np.maximum(gap[~pairs.closed], 0.0) + 1e-15).all()
        num_ahead += np.count_nonzero(wait > 0.0)
    assert mesh.comm.allreduce(num_ahead) > 0
    # The 36 m/s along the wall alone would be half of the common bound, which takes speeds twice;
    # the slopes' 0.2 m/s towards it and the waves of a ball that meets it are some hundredths.
    if advance[0]:
        assert np.median(advance[0]) < 0.1
    # A wall that turns has the common bound.
    if spin and advance[1]:
        assert np.median(advance[1]) == pytest.approx(1.0, abs=1e-9)


def test_a_wall_that_nothing_is_near_carries_nothing():
    """Where a step has no pairs to look at, forces of before are gone all the same."""
    mesh = packed_spheres(MPI.COMM_WORLD, (3, 1, 1), gap=2.0)
    floor = Wall("floor", np.array([0.0, 0.0, -2.0 * RADIUS]), np.array([0.0, 0.0, 1.0]))
    s = simulation_of(mesh, Elastic(1e9, 0.15, 2650.0), [floor])
    assert not s.contact.walls.pairs.node.size and not s.contact.pairs.node.size
    s.walls.force[:] = s.walls.torque[:] = 1.0
    s.step()
    assert not s.walls.force.any() and not s.walls.torque.any()


@pytest.mark.skipif(platform.machine() != "x86_64", reason="four lanes are forced by its options")
@pytest.mark.parametrize("option", ["-DTOGETHER=0", "-mno-avx512f"])
def test_walls_that_become_smooth_take_the_springs_of_friction(option, monkeypatch):
    """Pairs one by one have Coulomb's law with μ = 0, many together the law without friction.

    What is left of friction where it ends is in the account of either; then the same to rounding,
    which 100 steps multiply little.
    """
    found = []
    for options in ((), (option,)):
        monkeypatch.setattr(wall_kernels, "load", lambda name, more=options: load(name, *more))
        mesh, up = packed_spheres(MPI.COMM_SELF, (2, 1, 1), gap=0.0), np.array([0.0, 0.0, 1.0])
        walls = [
            Wall("low", 0.005 * RADIUS * up, up, friction=0.2),
            Wall("top", 1.99 * RADIUS * up, -up, friction=0.2, velocity=np.array([5.0, 3.0, -2.0])),
        ]
        s = simulation_of(mesh, Elastic(100e9, 0.15, 2650.0), walls, time_step_factor=0.6)
        for _ in range(100):
            s.step()
        pairs, before = s.walls.pairs, s.contact.dissipation.total
        rough = np.abs(pairs.shear).max()
        s.walls.friction[:] = s.walls.friction_kinetic[:] = 0.0
        s.step()
        released = s.contact.dissipation.total - before
        assert rough > 0.0
        assert released > 0.0
        slip = pairs.slip.sum()
        for _ in range(100):
            s.step()
        assert np.abs(pairs.shear[pairs.closed]).max() == 0.0
        assert s.contact.dissipation.total == before + released
        assert pairs.slip.sum() > slip
        sums = np.array([before, released, s.contact.energy()[0], s.walls.work, pairs.slip.sum()])
        found.append((s.state.v.copy(), s.walls.force.copy(), s.walls.torque.copy(), sums))
    for one, two in zip(*found, strict=True):
        assert np.abs(one).max() > 0.0
        assert np.abs(one - two).max() < 1e-9 * np.abs(one).max()
