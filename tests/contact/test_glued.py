"""Nodes glued to walls, and walls that turn: exact motion, reactions, balance of energy."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.contact.walls import Wall, rotation_of
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.mesh import create_grain_mesh
from mufe_fenicsx.run.from_bodies import drive, settle
from mufe_fenicsx.verification.case import on_first_ranks
from tests.bodies import cylinder, simulation_of

SIZE = 1e-3
STRAIN = 1e-5
COMM = MPI.COMM_WORLD
UP = np.array([0.0, 0.0, 1.0])


def clamped(comm, body, material, height, top=None, **options):
    """One body between two glued planes at z = 0 and at its ``height``."""
    points, cells = body
    zero = np.zeros(len(cells), dtype=int)
    mesh = create_grain_mesh(comm, points, cells, zero, np.array([1]), np.array([0]))
    walls = [
        Wall("low", np.zeros(3), UP, bonded=True),
        Wall("top", height * UP, -UP, bonded=True, **(top or {})),
    ]
    return simulation_of(mesh, material, walls, **options)


def loads(s):
    return s.walls.loads(s.comm)


@pytest.mark.parametrize("direction", [UP, -UP, np.array([0.6, 0.8, 0.0])])
def test_glued_bar_in_tension_compression_and_shear(direction):
    """ν = 0: F = E A ε where it is stretched, and no strain but the one prescribed."""
    material = Elastic(100e9, 0.0, 2650.0)
    body = box((2 * SIZE, 2 * SIZE, SIZE), (4, 4, 2))
    beat = 4 * SIZE / material.wave_speed

    def run(comm):
        s = clamped(comm, body, material, SIZE, damping=2.0 / beat, time_step_factor=0.8)
        drive(s, {"top": STRAIN * SIZE * direction}, 4 * beat)
        settle(s, 1e-14)
        at_top = s.mesh.x[:, 2] > SIZE * (1 - 1e-9)
        error = np.abs(s.state.u[at_top] - STRAIN * SIZE * direction).max()
        return *loads(s), s.energies(), error

    force, torque, energies, error = on_first_ranks(COMM, 1, run)
    # The constraint is exact; the drive stops to rounding of the wall's place.
    assert error < 1e-9 * STRAIN * SIZE
    # The reaction carries what the other end does not: rest to 1e-14 in energies.
    full = material.E * 4 * SIZE**2 * STRAIN
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-5 * full)
    if direction @ UP:
        # Small strain neglects terms of the order of the strain.
        np.testing.assert_allclose(force[1], -full * direction, atol=2 * STRAIN * full)
    else:
        # Less than simple shear, G A γ, for the free sides bend; opposite couples hold it.
        # More than a beam of Timoshenko, whose ends warp: 1/κ + (L/b)²/2, κ = 5/6, b = 2 L.
        beam = 1 / (6 / 5 + 0.5 / 2**2)
        assert beam < np.linalg.norm(force[1]) / (0.5 * full) < 1.0
        moment = torque.sum(axis=0) + np.cross(SIZE * UP, force[1])
        np.testing.assert_allclose(moment, 0.0, atol=1e-5 * full * SIZE)
    # Explicit steps at 0.8 of the limit and one change of the step.
    assert abs(energies["residual"]) < 1e-3 * energies["work"]


def test_glued_shaft_is_twisted():
    """T = G J θ/L of a round bar, whose ends stay plane whether glued or not."""
    radius, length, twist = SIZE, SIZE, 1e-4
    material = Elastic(100e9, 0.3, 2650.0)
    beat = 4 * SIZE / material.wave_speed
    errors = []
    for h in (0.3 * SIZE, 0.15 * SIZE):
        body = cylinder(radius, length, h)

        def run(comm, body=body):
            s = clamped(comm, body, material, length, damping=2.0 / beat)
            drive(s, {}, 4 * beat, turns={"top": twist * UP})
            settle(s, 1e-12)
            return *loads(s), s.energies()

        force, torque, energies = on_first_ranks(COMM, 1, run)
        exact = material.shear_modulus * 0.5 * np.pi * radius**4 * twist / length
        errors.append(-torque[1, 2] / exact - 1)
        # Rest to 1e-12 in energies, so 1e-6 in forces.
        moment = torque.sum(axis=0) + np.cross(length * UP, force[1])
        np.testing.assert_allclose(moment, 0.0, atol=1e-4 * exact)
        np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-4 * exact / radius)
        assert abs(energies["residual"]) < 1e-3 * energies["work"]
        # Linear: half the torque times the angle.
        assert energies["elastic"] == pytest.approx(-0.5 * torque[1, 2] * twist, rel=1e-3)
    # Linear tetrahedra are too stiff by some (h/r)²; measured 0.067 and 0.021.
    assert abs(errors[1]) < 0.03
    assert abs(errors[1]) < abs(errors[0]) / 2.5


def test_turning_wall_swings_its_body_around():
    """Held at one end only, the body follows a full turn about an oblique axis and stays whole."""
    material = Elastic(100e9, 0.2, 2650.0)
    period = 200 * SIZE / material.wave_speed
    axis = np.array([1.0, 2.0, 2.0]) / 3

    def run(comm):
        points, cells = box((SIZE, SIZE, SIZE), (2, 2, 2))
        zero = np.zeros(len(cells), dtype=int)
        mesh = create_grain_mesh(comm, points, cells, zero, np.array([1]), np.array([0]))
        walls = [Wall("low", np.zeros(3), UP, bonded=True)]
        s = simulation_of(mesh, material, walls)
        drive(s, {}, period, turns={"low": 2 * np.pi * axis})
        return s.state.u.copy(), s.walls.normal[0].copy(), s.energies(), mesh.x[:, 2] < 1e-9 * SIZE

    u, normal, energies, glued = on_first_ranks(COMM, 1, run)
    assert np.abs(u[glued]).max() < 1e-9 * SIZE
    np.testing.assert_allclose(normal, UP, atol=1e-9)
    # It still vibrates from the start and the stop, by some (beat/period)² of its size.
    assert np.abs(u).max() < 1e-2 * SIZE
    work = 0.5 * material.rho * SIZE**3 * (2 * np.pi / period * SIZE) ** 2
    assert abs(energies["residual"]) < 1e-3 * work


def test_rough_wall_that_turns_below_a_block():
    """Friction turns with it: the torque is the sum of μ p r over the nodes."""
    material = Elastic(100e9, 0.0, 2650.0)
    friction, pressure_strain, twist = 0.5, 1e-4, 0.05
    points, cells = box((2 * SIZE, 2 * SIZE, SIZE), (4, 4, 2), (-SIZE, -SIZE, 0.0))
    beat = 4 * SIZE / material.wave_speed

    def run(comm):
        zero = np.zeros(len(cells), dtype=int)
        mesh = create_grain_mesh(comm, points, cells, zero, np.array([1]), np.array([0]))
        walls = [
            Wall("low", np.zeros(3), UP, friction=friction),
            Wall("top", SIZE * UP, -UP, bonded=True),
        ]
        s = simulation_of(mesh, material, walls, damping=2.0 / beat)
        drive(s, {"top": -pressure_strain * SIZE * UP}, 4 * beat)
        settle(s, 1e-12)
        drive(s, {}, 40 * beat, turns={"low": twist * UP})
        s.contact.ghosts.place_points()
        pairs, x = s.walls.pairs, s.contact.ghosts.positions.array
        arm = np.linalg.norm(x[pairs.node[pairs.closed], :2], axis=1)
        pressed = pairs.gap[pairs.closed] / s.contact.points.layer[pairs.node[pairs.closed]]
        limit = friction * (s.contact.points.area[pairs.node[pairs.closed]] * -pressed * arm).sum()
        return *loads(s), s.energies(), limit

    _, torque, energies, limit = on_first_ranks(COMM, 1, run)
    # All nodes slide around the axis, but the one on it. Friction lags its direction by no more
    # than the elastic displacement over the way slid.
    assert -torque[0, 2] == pytest.approx(limit, rel=0.02)
    np.testing.assert_allclose(torque.sum(axis=0)[2], 0.0, atol=0.01 * limit)
    assert abs(energies["residual"]) < 1e-3 * energies["work"]


def test_rotation_matrices():
    for angle in (1e-6, 0.3, 3.0):
        turn = angle * np.array([2.0, -1.0, 2.0]) / 3
        R = rotation_of(turn)
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-15)
        np.testing.assert_allclose(R @ turn, turn, atol=1e-15)
        # Right-handed: x + θ x x to first order, and det R = 1.
        assert np.linalg.det(R) == pytest.approx(1, abs=1e-14)
        x = np.array([0.0, 1.0, 0.0])
        assert np.cross(turn, x) @ (R - R.T) @ x == pytest.approx(
            2 * np.sin(angle) / angle * np.cross(turn, x) @ np.cross(turn, x), rel=1e-9, abs=0.0
        )
        assert np.trace(R) == pytest.approx(1 + 2 * np.cos(angle), abs=1e-14)


def test_walls_that_cannot_be():
    with pytest.raises(InputError, match="friction of wall low = -1"):
        Wall("low", np.zeros(3), UP, friction=-1.0)
    with pytest.raises(InputError, match="length of the normal of wall low = 2"):
        Wall("low", np.zeros(3), 2 * UP)
    material = Elastic(100e9, 0.0, 2650.0)
    points, cells = box((SIZE, SIZE, SIZE), (1, 1, 1))
    with pytest.raises(InputError, match="bonded wall top = 0, expected at least 3"):
        clamped(MPI.COMM_SELF, (points, cells), material, 2 * SIZE)
    mesh = create_grain_mesh(
        MPI.COMM_SELF, points, cells, np.zeros(6, dtype=int), np.array([1]), np.array([0])
    )
    side = np.array([1.0, 0.0, 0.0])
    walls = [
        Wall("low", np.zeros(3), UP, bonded=True),
        Wall("side", np.zeros(3), side, bonded=True),
    ]
    with pytest.raises(InputError, match="glued to two bonded walls = 2"):
        simulation_of(mesh, material, walls)


@pytest.mark.parametrize("damping", [0.0, 1e5])
def test_steps_that_leave_glued_nodes_behind_bring_the_same_bits(damping):
    """Kick and drift in one pass; and how far grains move is that of glued nodes too."""
    material, found = Elastic(100e9, 0.2, 2650.0), []
    top = {"velocity": 3.0 * UP, "angular_velocity": np.array([0.0, 2e4, 1e3])}
    for everywhere in (True, False):
        body = box((2 * SIZE, 2 * SIZE, SIZE), (2, 2, 2))
        s = clamped(MPI.COMM_SELF, body, material, SIZE, top, damping=damping)
        field = 1e3 * np.arange(12.0).reshape(4, 3)
        for n in range(60):
            before = s.state.x.copy()
            s.motion.set_field(field)  # anew with each time step
            s.step(everywhere or n % 7 == 0)
            moves, field_now, _, dt = s.motion.beside_field(s.dt)
            if field_now is field:
                moved = s.state.x - before
                beside = moved - dt * (field[0] + before @ field[1:])
                largest = np.linalg.norm(beside, axis=1).max()
                # Of single steps: rounding of places of a millimetre over a move of a micrometre.
                assert moves[0] >= largest * (1 - 1e-8)
                assert s.motion.largest >= np.linalg.norm(moved, axis=1).max() * (1 - 1e-8)
        s.complete()
        bits = [s.state.x, s.state.u, s.state.v, s.state.a, s.walls.force]
        found.append(([values.copy() for values in bits], s.energies()))
    one, two = found
    assert all(map(np.array_equal, one[0], two[0])) and one[1] == two[1]
    assert (one[1]["damping"] > 0.0) == (damping > 0.0)
