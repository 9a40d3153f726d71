"""The speed of loading follows its targets, on a linear column whose answer is known."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.loading.quasi_static import AIM, HELD, QuasiStaticSpeed
from mufe_fenicsx.scene import QuasiStatic

MASS, HEIGHT, STIFFNESS = 1.6e-6, 1e-3, 2e5
TRAVEL = math.sqrt(MASS / STIFFNESS)


class Column:
    """A spring with the linear profile of speed that the equations assume, and its platens."""

    def __init__(self, settings, speed, shortened=0.0):
        self.comm, self.dt = MPI.COMM_SELF, TRAVEL / 100
        self.state = SimpleNamespace(t=0.0)
        self.control = QuasiStaticSpeed(self, settings, 0, 1)
        self.control.begin(speed)
        self.shortened, self.burst, self.rows = shortened, 0.0, []

    def wall_forces(self):
        unbalanced = 0.5 * MASS * self.control.acceleration + self.burst
        force = STIFFNESS * self.shortened
        return np.array([force + 0.5 * unbalanced, force - 0.5 * unbalanced])

    def mass_of_grains(self):
        return MASS

    def energies(self):
        v = self.control.speed
        elastic = 0.5 * STIFFNESS * self.shortened**2
        return {"kinetic": MASS * v**2 / 6, "elastic": elastic, "plastic": 0.0, "contact": 0.0}

    def advance(self, until):
        """Step until the strain; columns of time, strain, speed, acceleration and k."""
        self.rows = []
        while (strain := self.shortened / HEIGHT) < until:
            speed = self.control(strain)
            self.shortened += self.dt * speed
            self.state.t += self.dt
            e = self.energies()
            k = e["kinetic"] / e["elastic"] if e["elastic"] else math.inf
            self.rows.append((self.state.t, strain, speed, self.control.acceleration, k))
        return np.array(self.rows).T


def test_speed_grows_with_strain_at_a_constant_energy_ratio():
    """k of the targets asks for v = strain H sqrt(3 k)/T; d is then 3k/2 and does not bind."""
    target = QuasiStatic(kinetic=0.01, unbalanced=0.05, slowest=1e-3, fastest=100.0)
    column = Column(target, speed=0.5, shortened=0.005 * HEIGHT)
    t, strain, speed, _acceleration, k = column.advance(0.3)
    assert column.control.travel_time == pytest.approx(TRAVEL, rel=1e-9)
    end = strain > 0.03  # e-folds of the strain enough to forget the start
    # The filter lags by T behind a ratio that it keeps even: what is left is that lag, squared.
    assert np.allclose(np.sqrt(k[end] / 0.01), AIM, atol=0.05)
    exact = AIM * strain * HEIGHT * math.sqrt(3 * 0.01) / TRAVEL
    assert np.allclose(speed[end], exact[end], rtol=0.07)
    # The same way at the constant speed with the same largest k, which is at strain 0.03.
    constant = (0.3 - 0.03) * HEIGHT / speed[end][0]
    assert t[-1] - t[end][0] < 0.3 * constant  # ln(10)/9 of it


def test_changes_of_speed_are_bounded_and_the_targets_before_the_load_are_absolute():
    target = QuasiStatic(kinetic=0.01, unbalanced=0.02, loaded=0.05, slowest=0.1, fastest=3.0)
    column = Column(target, speed=1.3, shortened=1e-4 * HEIGHT)
    _t, strain, speed, acceleration, k = column.advance(0.2)
    force = STIFFNESS * strain * HEIGHT
    allowed = 0.02 * np.maximum(force, STIFFNESS * 0.05 * HEIGHT)
    # Half of the difference allowed; the force that counts is filtered, hence a little later.
    assert np.all(0.5 * MASS * np.abs(acceleration) <= 0.5 * 1.05 * allowed)
    assert np.all(k[strain > 0.05] <= 0.01)
    before = (strain > 0.02) & (strain < 0.05)
    loaded = 0.01 * 0.5 * STIFFNESS * (0.05 * HEIGHT) ** 2
    assert np.all(MASS * speed[before] ** 2 / 6 <= 1.05 * loaded)
    assert speed.max() <= 3.0 and speed[-1] > 2.7  # smoothly up to its limit
    # A smooth speed: its second derivative is bounded by twice the acceleration over T/4.
    jump = np.abs(np.diff(acceleration)) / (allowed[1:] / MASS)
    assert jump.max() < 2.0 * (1 - math.exp(-4 / 32)) * 1.2


def test_a_rearrangement_slows_the_test_but_never_stops_it():
    target = QuasiStatic(kinetic=0.5, unbalanced=0.02, slowest=0.2, fastest=5.0)
    column = Column(target, speed=1.0, shortened=0.02 * HEIGHT)
    column.advance(0.04)
    before = column.control.speed
    column.burst = 0.5 * STIFFNESS * 0.04 * HEIGHT  # half of the force out of balance
    start = column.state.t
    while column.state.t < start + 30 * TRAVEL:
        column.advance(column.shortened / HEIGHT + 1e-4)
    assert 0.2 <= column.control.speed < 0.25 and column.control.falling
    column.burst = 0.0
    column.advance(0.3)
    assert column.control.speed > before and not column.control.falling


def test_speed_is_what_a_servo_can_follow():
    """A side that lags by 0.1 v/(1 m/s) of its stress keeps it to 4 % at 0.4 m/s, times 0.9."""
    column = Column(QuasiStatic(kinetic=0.5, unbalanced=0.5, slowest=0.1, fastest=5.0), 2.0, 1e-5)
    column.control.lack_of_held = lambda: 0.1 * column.control.speed
    _t, _, speed, _, _ = column.advance(0.3)
    assert speed[-1] == pytest.approx(AIM * HELD / 0.1, rel=0.02)


def test_without_contact_the_platen_travels_freely():
    column = Column(QuasiStatic(slowest=0.1, fastest=5.0), speed=1.0)
    column.wall_forces = lambda: np.zeros(2)
    column.energies = lambda: dict.fromkeys(("kinetic", "elastic", "plastic", "contact"), 0.0)
    _t, _, speed, _, _ = column.advance(0.01)
    assert np.all(speed == 1.0)
