"""Bodies pressed on each other: increments against time steps, and what is measured."""

import math

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.verification.hertz_bodies import RADIUS, make, whole_contact
from mufe_fenicsx.verification.pressed import FRAME, Pressed, measure, turn

NU = 0.15


def test_increments_and_time_steps_find_the_same_state():
    """One indentation by each: increments to Newton's tolerance, steps to what still swings."""
    theory = whole_contact("sphere-plane", 0.05 * RADIUS, NU)
    forces = []
    for integrator, left in (("static", 1e-5), ("explicit", 5e-3)):
        pressed = Pressed(MPI.COMM_SELF, make("sphere-plane", 1.5, 0.05, NU, 0.4), integrator)
        pressed.press(theory.delta)
        forces.append(pressed.simulation.wall_forces()[0])
        assert pressed.reaction() == pytest.approx(forces[-1], rel=left)
    assert forces[1] == pytest.approx(forces[0], rel=5e-3)
    # Hertz within the error of a coarse mesh.
    assert forces[0] == pytest.approx(theory.force, rel=0.06)


def test_a_small_contact_is_in_balance():
    """A contact of a hundredth of the mean facet: what presses is what the base holds.

    Tolerance: ten times that of the residual, for the base adds up what is left in many nodes. The
    last increment is 4 % of the way and begins that much out of balance at most, though the one
    before was four times as long.
    """
    pressed = Pressed(MPI.COMM_SELF, make("sphere-plane", 1.5, 0.005, NU, 0.4))
    s, theory = pressed.simulation, whole_contact("sphere-plane", 0.005 * RADIUS, NU)
    for part in (0.9, 1.1, 1.15):
        pressed.press(part * theory.delta)
        assert pressed.reaction() == pytest.approx(s.wall_forces()[0], rel=1e-5)
    assert s._newton.history[0] < 0.04


def test_response_is_the_slope_of_the_force():
    """A small load on a node of two balls in contact, against the displacements it makes."""
    theory = whole_contact("spheres", 0.05 * RADIUS, NU)
    bodies = make("spheres", 1.5, 0.05, NU, 0.4)
    pressed = Pressed(MPI.COMM_SELF, bodies, petsc={"ksp_rtol": 1e-8})
    pressed.press(theory.delta)
    s = pressed.simulation
    x, force = s.state.x.copy(), s.specimen.f.copy()
    load = np.zeros_like(x)
    load[np.argmin((x**2).sum(axis=1))] = [1.0, 0.5, -2.0]
    load *= 1e-4 * theory.force
    moved = s.response(load)
    np.testing.assert_array_equal(s.state.x, x)
    s._begin(s.dt)
    s.equations.residual(moved)
    # Forces grow by what balances the load, to the second order of its size.
    change = s.equations.held.project(s.specimen.f - force)
    assert abs(change + s.equations.held.project(load)).max() < 1e-2 * abs(load).max()


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
