"""The state that Newton's method finds is one in which nothing moves."""

import math

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.verification.hertz_bodies import RADIUS, make, whole_contact
from mufe_fenicsx.verification.pressed import FRAME, Pressed, measure, turn

NU = 0.15


def test_time_steps_leave_the_equilibrium_at_rest():
    """A half ball pressed on a plane in one go, then stepped without damping, its base held."""
    theory = whole_contact("sphere-plane", 0.05 * RADIUS, NU)
    pressed = Pressed(MPI.COMM_SELF, make("sphere-plane", 1.5, 0.05, NU, 0.4))
    s, solver = pressed.simulation, pressed.equilibrium
    pressed.press(0.5 * theory.delta)
    pressed.press(theory.delta, tolerance=1e-7)
    force = s.wall_forces()[0]
    # Tolerance of the solver; Hertz within the error of a coarse mesh.
    assert pressed.reaction() == pytest.approx(force, rel=1e-6)
    assert force == pytest.approx(theory.force, rel=0.06)

    stored = s.energies()["elastic"]
    for _ in range(300):
        solver.hold(s.state.v)
        solver.hold(s.state.a)
        s.step()
    solver.hold(s.state.v)
    # What the residual left lets go: 1e-7 in the energy norm, squared.
    assert 0.5 * (s.solid.mass @ (s.state.v**2).sum(axis=1)) < 1e-13 * stored
    assert s.wall_forces()[0] == pytest.approx(force, rel=1e-6)


def test_increments_and_time_steps_find_the_same_state():
    """One indentation by each; increments to Newton's tolerances, steps to what still swings."""
    delta = whole_contact("sphere-plane", 0.05 * RADIUS, NU).delta
    forces = []
    for integrator in ("equilibrium", "static", "explicit"):
        pressed = Pressed(MPI.COMM_SELF, make("sphere-plane", 1.5, 0.05, NU, 0.4), integrator)
        pressed.press(delta)
        forces.append(pressed.simulation.wall_forces()[0])
        assert pressed.reaction() == pytest.approx(forces[-1], rel=5e-3)
    assert forces[1] == pytest.approx(forces[0], rel=1e-4)
    assert forces[2] == pytest.approx(forces[0], rel=5e-3)


def test_size_and_pressure_of_a_sampled_half_ellipsoid():
    a, b, p0 = 2.0, 1.0, 3.0
    n = 400
    grid = (np.stack(np.meshgrid(np.arange(n), np.arange(n)), axis=-1).reshape(-1, 2) + 0.5) / n
    x = (2 * grid - 1) * [a, b]
    pressure = p0 * np.sqrt(np.maximum(1 - ((x / [a, b]) ** 2).sum(axis=1), 0.0))
    area = np.full(len(x), 4 * a * b / n**2)
    turned = x @ turn([0, 0, 0.4])[:2, :2].T + [0.3, -0.2]
    found = measure(turned, pressure * area, area, np.zeros(n**2), np.array([a, b]))
    # The midpoint rule, with a root at the edge.
    assert found["force"] == pytest.approx(2 / 3 * math.pi * a * b * p0, rel=1e-4)
    assert (found["a"], found["b"]) == pytest.approx((a, b), rel=1e-3)
    assert found["p0"] == pytest.approx(p0, rel=1e-3)
    assert found["area_radius"] == pytest.approx(math.sqrt(a * b), rel=1e-2)
    assert found["spread"] < 1e-2


def test_rotation_of_a_vector():
    """Half a turn about z; and the frame of the contact is a rotation."""
    np.testing.assert_allclose(turn([0, 0, math.pi]), np.diag([-1, -1, 1]), atol=1e-15)
    np.testing.assert_allclose(FRAME @ FRAME.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(FRAME) == pytest.approx(1.0, rel=1e-15)
