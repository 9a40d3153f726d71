"""Rigid grains: mass, constrained stiffness, and what they cannot be used with."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.bulk.mass_properties import mass_properties, point_properties, quaternion_of
from mufe_fenicsx.contact.walls import Wall, rotation_of
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.kernels.bulk.rigid import set_axes, set_spin
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.materials.rigid import Rigid
from mufe_fenicsx.run.from_bodies import build
from tests.bodies import sphere

ROCK = {"E": 1e9, "nu": 0.15, "rho": 2650.0}


def test_mass_and_inertia_of_bricks_are_exact():
    """Two of them, whose layers of tetrahedra are unlike: the mean of corners is no centre."""
    a, b, c = 1e-3, 2e-3, 3e-3
    points, cells = box((a, b, c), (2, 3, 3))
    points[:, 2] *= 0.5 * (1 + points[:, 2] / c)
    corner = np.array([5e-3, -1e-3, 0.0])
    both = np.concatenate([points, 2 * points + corner])
    cells = np.concatenate([cells, cells + len(points)])
    offset, rho = np.array([0, 0.5, 1]) * len(cells), np.array([1000.0, 2650.0])
    mass, centre, inertia = mass_properties(both, cells, offset.astype(int), rho)
    for k, size in enumerate((1, 2)):
        x, y, z = size * np.array([a, b, c])
        m = rho[k] * x * y * z
        exact = m / 12 * np.diag([y * y + z * z, x * x + z * z, x * x + y * y])
        # Sums over tens of tetrahedra: rounding.
        assert mass[k] == pytest.approx(m, rel=1e-14)
        assert np.allclose(centre[k], k * corner + [x / 2, y / 2, z / 2], rtol=0, atol=1e-16)
        assert np.allclose(inertia[k], exact, rtol=0, atol=1e-13 * exact.max())


def test_mass_and_inertia_of_points():
    """A dumb-bell of 1 and 3 kg, 4 m long: centre 1 m from the heavy end, m₁ m₂/m l² = 12."""
    x = np.array([[5.0, 0, 0], [5.0, 4.0, 0]])
    mass, centre, inertia = point_properties(x, np.array([1.0, 3.0]))
    assert mass.tolist() == [4.0] and centre.tolist() == [[5.0, 3.0, 0.0]]
    assert np.allclose(inertia[0], np.diag([12.0, 0.0, 12.0]), atol=1e-14)


def test_a_quaternion_gives_its_rotation_back():
    """Of half turns, which have no axial vector, and of any other."""
    turns = [2 * np.outer(axis, axis) - np.eye(3) for axis in np.eye(3)]
    for matrix in np.random.default_rng(1).normal(size=(20, 3, 3)):
        turn = np.linalg.qr(matrix)[0]
        turns.append(turn * np.sign(np.linalg.det(turn)))
    found = np.empty((len(turns), 3, 3))
    set_axes(found, np.array([quaternion_of(turn) for turn in turns]))
    assert np.allclose(found, turns, rtol=0, atol=1e-14)


def packing(materials, law="matched", **options):
    """Two balls on each other and on a plane, pressed a little."""
    points, cells = sphere(1e-3, 0.5e-3)
    lift = np.array([0, 0, 1.995e-3])
    walls = [Wall("low", np.array([0, 0, -0.99e-3]), np.eye(3)[2], friction=0.4)]
    return build(
        MPI.COMM_SELF, [(points, cells), (points + lift, cells)], materials, (0, 0, 0), (0, 0, 0),
        axes="", walls=walls, friction=0.4, law=law, **options,
    )  # fmt: skip


def test_step_of_rigid_grains_is_that_of_the_dense_matrix():
    """Two rigid balls and all springs within the margin: 12 degrees of freedom."""
    s = packing([Rigid(**ROCK)] * 2)
    rows, _ = s.stable.rows.masses(s.solid.mass)
    add = s.stable.rows.constrained(s.stable.add_springs, s.state)
    K = np.zeros((12, 12))
    for i in range(12):
        y, q = np.zeros((4, 3)), np.zeros((4, 3))
        q.ravel()[i] = 1.0
        add(y, q)
        K[:, i] = y.ravel()
    # Springs without moment of their own: the matrix is that of an energy.
    assert np.allclose(K, K.T, rtol=0, atol=1e-10 * np.abs(K).max())
    root = 1 / np.sqrt(rows.ravel())
    highest = np.sqrt(np.linalg.eigvalsh(root[:, None] * K * root)[-1])
    # Lanczos stops at a residual of 2 % of the eigenvalue, which is added.
    assert highest <= s.stable.highest_of_springs() * (1 + 1e-9)
    assert s.stable.highest_of_springs() == pytest.approx(highest, rel=0.01)


@pytest.mark.parametrize(
    "options, expected",
    [
        ({"law": "kinematic"}, "matched"),
        ({"assembled": False}, "assembled"),
    ],
)
def test_what_rigid_grains_cannot_be_used_with(options, expected):
    with pytest.raises(InputError, match=expected):
        packing([Rigid(**ROCK), Elastic(**ROCK)], **options)


def test_mass_factor_is_one_for_a_rigid_grain():
    points, cells = sphere(1e-3, 0.5e-3)
    shift = np.array([4e-3, 0, 0])
    bodies = [(points, cells), (points + shift, cells)]
    plain, heavy = (
        build(
            MPI.COMM_SELF, bodies, Rigid(**ROCK), (0, 0, 0), (0, 0, 0), axes="",
            mass_factor=factor,
        ).rigid
        for factor in (None, np.full(2 * len(points), 9.0))
    )  # fmt: skip
    assert np.allclose(heavy.mass, 9 * plain.mass) and np.allclose(heavy.inertia, 9 * plain.inertia)
    with pytest.raises(InputError, match="mass_factor varies"):
        build(
            MPI.COMM_SELF, bodies, Rigid(**ROCK), (0, 0, 0), (0, 0, 0), axes="",
            mass_factor=np.linspace(1, 2, 2 * len(points)),
        )  # fmt: skip


@pytest.mark.mpi
def test_time_step_knows_neither_ranks_nor_numbers():
    """The same first step with bodies on other ranks and their nodes and cells in another order.

    Moments of a ball and of a cube are equal, but for its mesh and rounding: so its principal axes
    may be any.
    """
    ball, cube = sphere(1e-3, 0.7e-3), box((2e-3, 2e-3, 2e-3), (2, 2, 2), (-1e-3, -1e-3, -1e-3))
    lift = np.array([0, 0, 2e-3])
    bodies = [(x + k * lift, c) for k, (x, c) in enumerate((cube, ball, cube, ball))]
    kinds = [Rigid(**ROCK), Rigid(**ROCK), Rigid(**ROCK), Elastic(**ROCK)]
    rng = np.random.default_rng(6)
    shuffled = []
    for x, cells in bodies:
        order = rng.permutation(len(x))
        shuffled.append((x[order], np.argsort(order)[cells][rng.permutation(len(cells))]))
    found = []
    for comm, given in ((MPI.COMM_WORLD, bodies), (MPI.COMM_SELF, shuffled)):
        walls = [Wall("low", np.array([0, 0, -1e-3]), np.eye(3)[2], friction=0.4)]
        s = build(comm, given, kinds, (0, 0, 0), (0, 0, 0), axes="", walls=walls, friction=0.4)
        found.append((s.stable.highest(), s.stable.highest_of_springs()))
    # Far from converged, so as far apart as the vectors that they start from, and those as the
    # last digits of positions over the length of their pattern, 1e-7 of the assembly.
    np.testing.assert_allclose(*found, rtol=1e-8)


@pytest.mark.mpi
def test_nodes_that_contact_does_not_read_need_not_follow():
    """Balls, a brick and a soft ball that fall on each other: the same to the last bit.

    Nor need the soft ball's velocities be known at the end of each step.
    """
    comm = MPI.COMM_WORLD
    ball, brick = sphere(1e-3, 0.6e-3), box((2e-3, 2e-3, 1e-3), (4, 4, 2), (-1e-3, -1e-3, -1e-3))
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    bodies = [
        (ball[0] + [0, 0, 1.02e-3], ball[1]),
        brick,
        (brick[0] @ turn.T + [0.2e-3, 0.1e-3, 3.9e-3], brick[1]),
        (ball[0] @ turn + [2.1e-3, 0, 1.2e-3], ball[1]),
    ]
    materials = [Rigid(**ROCK), Rigid(**ROCK), Rigid(**ROCK), Elastic(**ROCK)]
    found = []
    for everywhere in (True, False):
        s = on_ranks(comm, bodies, materials)
        if everywhere:
            s.contact_term._follow = lambda: None
        else:
            s.contact_term.add_forces = _spoiling(s)
        for _ in range(60):
            s.step(everywhere)
        s.complete()
        assert s.contact.num_searches > 2
        if not everywhere and s.rigid.num_grains:
            assert s.rigid.followed.nodes.size < s.rigid.lists.surface.size
        e = s.energies()
        assert e["friction"] > 0 and e["contact"] + e["friction"] > 1e-3 * e["kinetic"]
        a, damped = s.state.a[s.rigid.lists.soft], np.array([s.damped])
        found.append((s.state.x.copy(), s.state.u.copy(), s.state.v.copy(), a, damped))
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)


def _spoiling(s):
    """The forces of contact; what it must not read until its next search becomes nan."""
    add_forces = s.contact_term.add_forces

    def spoil(f, state, dt):
        add_forces(f, state, dt)
        if s.contact.ghosts.moving is not None:
            rest = np.ones(s.contact.own.nodes.size, dtype=bool)
            rest[s.contact.ghosts.moving] = False
            s.contact.ghosts.positions.own[rest] = np.nan

    return spoil


def on_ranks(comm, bodies, materials):
    """Bodies that fly at each other, distributed; none on ranks beyond their number."""
    centre = np.array([p.mean(axis=0) for p, _ in bodies])
    return build(
        comm, bodies, materials, (0, 0, 0), (0, 0, 0), axes="", friction=0.4, damping=1e3,
        velocity=lambda x, grain: -3e4 * (centre[grain] - centre.mean(axis=0)),
    )  # fmt: skip


def test_a_body_turns_at_its_momentum_over_its_moments():
    """ω = R diag(1/I) Rᵀ L, of three different moments about axes that have turned."""
    axes = rotation_of(np.array([0.4, -1.1, 0.7]))
    momentum, inertia, spin = np.array([0.3, 0.9, -0.5]), np.array([1.0, 2.0, 5.0]), np.empty(3)
    set_spin(spin, momentum, axes, inertia)
    assert spin == pytest.approx(axes @ (axes.T @ momentum / inertia), rel=1e-13)
