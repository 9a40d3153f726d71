"""Contact between grains and with walls: balance, energy, Coulomb's law, any number of ranks."""

import platform

import numpy as np
import pytest
from mpi4py import MPI
from scipy.spatial.transform import Rotation

from mufe_fenicsx.contact.laws import COMPLIANCE, edge_of_area
from mufe_fenicsx.contact.pairs.facet_pairs import Pairs
from mufe_fenicsx.contact.results.nodal_fields import current_gaps
from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.kernels.build.native import load
from mufe_fenicsx.kernels.contact import pairs as pair_kernels
from mufe_fenicsx.kernels.contact import walls as wall_kernels
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.mesh import create_grain_mesh
from mufe_fenicsx.run.from_bodies import build, drive, settle
from tests.bodies import RADIUS, packed_spheres, simulation_of

COMM = MPI.COMM_WORLD
QUARTZ = Elastic(100e9, 0.15, 2650.0)
FRICTION = 0.3

#: Time step over the limit of stability: nodes that meet a wall at speed v leave it no
#: faster only if (ω Δt)² <= 2 for their contact spring, 0.7 of the limit ω Δt = 2.
FACTOR = 0.6


def total(values):
    return COMM.allreduce(values.sum(axis=0))


def collision(friction=FRICTION, speed=20.0, factor=FACTOR, **options):
    """Three balls in a row: the outer ones run into the middle one, spinning and off centre."""
    mesh = packed_spheres(COMM, (3, 1, 1), gap=0.002)
    grain = mesh.grains[mesh.grain_of_node]
    centre = np.array([(2.002 * k + 1.001) * RADIUS for k in range(3)])[grain]
    arm = mesh.x - np.column_stack([centre, np.full((len(grain), 2), 1.001 * RADIUS)])
    drift = speed * np.array([[1.0, 0.2, 0], [0, 0, 0], [-1.0, 0, 0.3]])[grain]
    spin = speed / RADIUS * np.array([[0.2, 0, 0.5], [0, 0, 0], [0, -0.7, 0.1]])[grain]
    velocity = drift + np.cross(spin, arm)
    return simulation_of(
        mesh, QUARTZ, friction=friction, velocity=velocity, time_step_factor=factor, **options
    )


@pytest.mark.skipif(platform.machine() != "x86_64", reason="four lanes are forced by its options")
@pytest.mark.parametrize("option", ["-DTOGETHER=0", "-mno-avx512f"])
@pytest.mark.parametrize("points, radius", [("facets", 0.0), ("nodes", 0.0), ("facets", 8.0)])
def test_pairs_one_by_one_and_in_four_lanes(option, points, radius, monkeypatch):
    """The same law to rounding, which 200 steps of sliding and sticking multiply little.

    Two unlike blocks, one turned on the other, between plates that press and shear them, or a plate
    and a hollow of that radius; numbers of pairs are no multiples of the lanes.
    """
    found = []
    for options in ((), (option,)):
        for kernel in (pair_kernels, wall_kernels):
            monkeypatch.setattr(kernel, "load", lambda name, more=options: load(name, *more))
        low, low_cells = box((1.0, 1.0, 0.5), (4, 4, 2))
        high, high_cells = box((0.8, 0.8, 0.4), (5, 5, 2))
        turn = Rotation.from_rotvec([0.0, 0.0, 0.3]).as_matrix()
        high = (high - [0.4, 0.4, 0.0]) @ turn.T + [0.5, 0.5, 0.5]
        mesh = create_grain_mesh(
            MPI.COMM_SELF,
            np.concatenate([low, high]),
            np.concatenate([low_cells, high_cells + len(low)]),
            np.repeat([0, 1], [len(low_cells), len(high_cells)]),
            np.array([1, 2]),
            np.zeros(2, dtype=np.int32),
        )
        up = np.array([0.0, 0.0, 1.0])
        walls = [
            Wall("low", np.zeros(3), up, friction=0.2),
            Wall("top", 0.9 * up, -up, friction=0.2, velocity=np.array([0.5, 0.3, -2])),
        ]
        if radius:
            walls[1].point, walls[1].normal = (0.9 - radius) * up, np.zeros(3)
            walls[1].radius = radius
        s = simulation_of(mesh, QUARTZ, walls, friction=0.1, time_step_factor=FACTOR, points=points)
        for _ in range(200):
            s.step()
        sums = np.array([s.contact.dissipation.total, s.contact.energy()[0], s.walls.work])
        walls = np.concatenate([s.walls.force, s.walls.torque])
        found.append((s.force.x.array.copy(), s.state.v.copy(), walls, sums))
        for pairs in (s.contact.pairs, s.walls.pairs):
            assert (pairs.closed & pairs.sliding).any() and (pairs.closed & ~pairs.sliding).any()
    for one, two in zip(*found, strict=True):
        assert np.abs(one).max() > 0.0
        assert np.abs(one - two).max() < 1e-9 * np.abs(one).max()


@pytest.mark.mpi
def test_bounds_of_grains_that_move_together():
    """Balls that fly and stretch as one: the field takes all but its change over a wait."""
    s = collision(speed=0.0)
    slopes = 100.0 * np.array([[1.0, 0.3, 0.0], [-0.2, 0.5, 0.0], [0.0, 0.4, -1.0]])
    s.state.v[:] = [30.0, -20.0, 10.0] + s.state.x @ slopes
    s.update_time_step()
    contact = s.contact
    bound, bounds = contact.motion.bound, contact.pairs.motion_bounds.bounds.copy()
    for _ in range(10):
        s.step()
    assert contact.num_searches == 1
    # All nodes fly at 37 m/s or more; what is left is the slopes over the longest wait, 0.3 m/s.
    assert contact.motion.bound - bound > 0.99 * 2 * 37.0 * s.state.t
    advance = contact.pairs.motion_bounds.bounds - bounds
    assert (advance < 0.01 * (contact.motion.bound - bound)).all()


def test_the_time_step_is_found_before_a_bound_shows_more_than_was_expected():
    """A ball flies into three others at rest, which were not expected to move as far as it does."""
    mesh = packed_spheres(COMM, (4, 1, 1), gap=0.002)
    velocity = np.zeros_like(mesh.x)
    velocity[mesh.grains[mesh.grain_of_node] == 0, 0] = 20.0
    s = simulation_of(mesh, QUARTZ, friction=FRICTION, velocity=velocity, time_step_factor=FACTOR)
    expected_less, early = 0, 0
    for _ in range(600):
        early += s.contact.motion.overrun_of_all > 0.0
        s.step()
        motion_bounds = s.contact.pairs.motion_bounds
        assert (motion_bounds.bounds <= motion_bounds.until).all()
        expected_less += np.isfinite(motion_bounds.until).any()
    assert COMM.allreduce(int(expected_less)) > 0
    assert early > 0


@pytest.mark.parametrize("drift", [0.0, pytest.param(60.0, marks=pytest.mark.mpi)])
def test_what_is_known_of_pairs_after_a_search(drift):
    """Open pairs are no nearer than their bound says; those it has to count have a facet."""
    s = collision()
    s.state.v += drift * np.array([1.0, -0.5, 0.2])
    s.update_time_step()
    contact, num_kept = s.contact, 0
    for _ in range(600):
        searches = contact.num_searches
        s.step()
        if contact.num_searches == searches:
            continue
        pairs = contact.pairs
        gap = current_gaps(contact)[0]
        wait = pairs.next_check - pairs.motion_bounds.now
        # Distances of positions of some 1e-3 m have that much round-off.
        assert (wait <= np.maximum(gap, 0.0) + 1e-15)[~pairs.closed].all()
        assert (pairs.closest >= 0)[wait < contact.motion.skin].all()
        num_kept += np.count_nonzero(wait < gap - 1e-15)
    assert contact.num_searches > 3
    assert COMM.allreduce(num_kept) > 0  # not all were looked at
    # Facets that are not near any more, though the pairs are.
    bound = contact.motion.bound
    lost = Pairs(
        pairs.node,
        pairs.body,
        pairs.first,
        pairs.candidate,
        contact.points,
        contact.dissipation.num_grains,
        bound,
        False,
    )
    before = contact.surface.global_facet
    pairs.drop_candidates(before)
    lost.transfer(pairs, np.full_like(before, -1), np.inf)
    assert (lost.next_check <= lost.motion_bounds.now).all()


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
        now = COMM.allreduce(s.contact.dissipation.total)
        assert now >= dissipated
        dissipated = now
        p = s.contact.pairs
        kept = p.closed
        shear = np.linalg.norm(p.shear[kept], axis=1)
        # Coulomb's limit to rounding.
        assert np.all(shear <= FRICTION * p.normal_force[kept] * (1 + 1e-9) + 1e-12)
        counts.add(COMM.allreduce(int(kept.sum())))
    assert largest > 0 and dissipated > 0
    assert len(counts) > 3


def test_smooth_contact_dissipates_nothing():
    """Balls meet and part: the scheme keeps its energy, the better the shorter the step."""
    worsts = []
    for factor in (FACTOR, FACTOR / 4):
        s = collision(friction=0.0, speed=10.0, factor=factor)
        contacts, worst = 0, 0.0
        while s.state.t < 1.2e-5:
            s.step()
            if s.state.num_steps % 10 == 0:
                worst = max(worst, abs(s.energies()["residual"]) / s.initial_kinetic)
                contacts = max(contacts, s.num_contacts)
        assert contacts > 0 and s.num_contacts == 0
        assert COMM.allreduce(s.contact.dissipation.total) == 0.0
        worsts.append(worst)
    # Points that meet and part within a step leave a residual of second order: 4.9e-4, 1.1e-4 and
    # 0.2e-4 with FACTOR, a half and a quarter of it; half as much again for other roundings.
    assert worsts[0] < 7.5e-4
    assert worsts[1] < 0.1 * worsts[0]


@pytest.mark.mpi
def test_kinematic_contact_keeps_momentum_and_gains_no_energy():
    """Balls stopped by predictor and corrector: no springs in the time step, none overlaps."""
    s = collision(friction=0.0, speed=10.0, law="kinematic")
    free = s.dt
    momentum = total(s.solid.mass[:, None] * s.state.v)
    contacts = 0
    while s.state.t < 1.2e-5:
        s.step()
        if s.state.num_steps % 10 == 0:
            energies = s.energies()
            contacts = max(contacts, s.num_contacts)
            assert energies["contact"] == 0.0
            # Points that meet lose what they bring along: never the other way, but for the
            # elements' 5e-4 of the smooth case above.
            assert energies["residual"] > -1e-3 * s.initial_kinetic
            closed = s.contact.pairs.closed
            assert np.all(s.contact.pairs.gap[closed] > -0.02 * s.contact.edge)
    assert contacts > 0
    # Of the step, rounded down to 10 binary digits; it changes with the deformation alone.
    assert s.dt == pytest.approx(free, rel=0.05)
    size = COMM.allreduce((s.solid.mass[:, None] * np.abs(s.state.v)).sum())
    assert np.abs(total(s.solid.mass[:, None] * s.state.v) - momentum).max() < 1e-12 * size


def row_of_blocks(overlap, **options):
    """Three blocks along x between two walls, each ``overlap`` deep in the next."""
    side, bodies = RADIUS, []
    for k, (width, n) in enumerate([(1.2, 2), (1.0, 3), (1.2, 2)]):
        start = k * (side - overlap), -0.5 * width * side, -0.5 * width * side
        bodies.append(box((side, width * side, width * side), (n, n, n), start))
    low, high = np.full(3, overlap), np.full(3, 3 * side - 3 * overlap)
    return build(
        COMM, bodies, QUARTZ, low, high, "x", friction=FRICTION, time_step_factor=FACTOR, **options
    )


def test_overlap_at_the_start_releases_nothing():
    """Blocks that start 2 % deep in each other and in the walls stay at rest, exactly."""
    s = row_of_blocks(0.02 * RADIUS, wall_friction={"x_min": FRICTION, "x_max": FRICTION})
    for _ in range(50):
        s.step()
    # 9 nodes of each wide block on its wall; the faces of 16 and 9 nodes on each other.
    assert COMM.allreduce(s.contact.overlaps.num_accepted) >= 2 * 9 + 2 * 16
    assert COMM.allreduce(np.abs(s.state.v).max(initial=0.0), op=MPI.MAX) == 0.0
    assert np.all(s.wall_forces() == 0.0)

    # From there they resist at once: a wave takes 3 blocks / c, c = 6300 m/s, to the other end.
    drive(s, {"x_max": (-1e-6, 0, 0)}, 2e-6)
    left, right = s.wall_forces()
    assert left > 0 and right > 0
    e = s.energies()
    # Measured 2e-5; nodes meet at speed, each time with an error of some (Δt / contact time).
    assert abs(e["residual"]) < 1e-3 * e["work"]


def test_compressed_row_carries_the_same_force_throughout():
    """Newton's third law through three blocks and two walls, damped to rest."""
    s = row_of_blocks(0.0, damping=3e6)
    drive(s, {"x_max": (-1e-6, 0, 0)}, 5e-6)
    settle(s, 1e-12)
    left, right = s.wall_forces()
    # At rest to 1e-12 in energies, so 1e-6 in forces.
    assert left > 0 and right == pytest.approx(left, rel=1e-5)
    # Bars in series over E: L/A of two wide blocks and a narrow one, layers on both walls over the
    # wide faces, layers of both sides on the narrow ones. Wide blocks are pressed on the middle of
    # their faces, and friction holds faces: a per cent.
    wide, narrow = (
        COMPLIANCE * edge_of_area((width / n) ** 2 / 2, 1) * QUARTZ.E / QUARTZ.contact_modulus
        for width, n in ((1.2, 2), (1.0, 3))
    )
    series = 2 * (1 + wide) / 1.44 + 1 + 2 * (wide + narrow)
    assert left == pytest.approx(QUARTZ.E * 1e-6 * RADIUS / series, rel=0.01)


# --- number of ranks --------------------------------------------------------------------------


def packing_forces(comm, num_steps):
    """Wall forces of eight balls under a platen, every tenth step, shape (num_records, 6)."""
    mesh = packed_spheres(comm, (2, 2, 2))
    size = 4.0 * RADIUS
    walls = []
    for axis, normal in zip("xyz", np.eye(3), strict=True):
        walls.append(Wall(f"{axis}_min", np.zeros(3), normal, friction=FRICTION))
        walls.append(Wall(f"{axis}_max", np.full(3, size), -normal, friction=FRICTION))
    walls[-1].velocity = np.array([0.0, 0.0, -10.0])
    s = simulation_of(mesh, QUARTZ, walls, friction=FRICTION, time_step_factor=FACTOR)
    forces = []
    for k in range(num_steps):
        s.step()
        if k % 10 == 9:
            forces.append(s.wall_forces())
    return np.array(forces)


@pytest.mark.mpi
def test_three_ranks_and_one_agree():
    """The same forces on all walls over 400 steps, to 1e-9 of the largest; on one rank to the bit.

    Sums over ranks differ by rounding, which 400 stable steps do not amplify beyond that.
    """
    together, alone = packing_forces(COMM, 400), packing_forces(MPI.COMM_SELF, 400)
    size = np.abs(alone).max()
    assert np.all(alone[-1, 4:] > 1e-3 * size)
    assert np.abs(together - alone).max() <= (1e-9 * size if COMM.size > 1 else 0.0)
