"""Stages where friction of side walls carries a part of the load between opposite walls."""

import math
import re
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.errors import SolverError
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.loading import waiting
from mufe_fenicsx.loading.tasks import Carry, Straight
from mufe_fenicsx.loading.waiting import WAVES
from mufe_fenicsx.run.from_bodies import build
from mufe_fenicsx.run.resume_check import (
    FREE_KEYS,
    FREE_TABLES,
    MAY_CHANGE,
    OF_INTEGRATOR,
    _first_difference,
)
from mufe_fenicsx.scene.stages import Axis, Stage
from tests.loading.staged import SIZE, STUFF, TOLERANCE, cube, loading_of, steps

#: Of the four sides, and K0 = ν/(1 - ν) of the elastic cube between them.
FRICTION, K0 = 0.3, 0.25
STRESS = 1e6


def rough_cube():
    """A simulation of an elastic cube between platens and four rough sides."""
    sides = dict.fromkeys(("x_min", "x_max", "y_min", "y_max"), FRICTION)
    body = box((SIZE,) * 3, (3, 3, 3))
    corners = np.zeros(3), np.full(3, SIZE)
    return build(MPI.COMM_SELF, [body], STUFF, *corners, wall_friction=sides, damping=1e6)


def test_a_stage_reaches_the_mean_of_platens_that_friction_holds_apart():
    """Janssen (1895): σbottom/σtop = exp(-4 μ K0 H/L), as a bound where not all of it slips.

    The cube is in static equilibrium then: the friction of the sides is what platens differ by.
    """
    sim = rough_cube()
    loading = loading_of(sim, (Stage("load", z=Axis(stress=STRESS, walls="max")),), 0.02)
    for _ in steps(sim, loading):
        pass
    bottom, top = loading.apparatus.gauges.wall_stress(sim.wall_forces())[-2:]
    assert loading.take_notice() is None
    # The mean over a travel time is within the tolerance; what still rings adds as much again.
    assert 0.5 * (top + bottom) == pytest.approx(STRESS, rel=2.0 * TOLERANCE)
    assert math.exp(-4.0 * FRICTION * K0) - 0.02 < bottom / top < 1.0 - 20.0 * TOLERANCE


def test_only_walls_that_something_holds_apart_may_differ():
    """Sides carry along z; of a smooth cube no wall may differ from the one across."""
    program = (Stage("load", xyz=Axis(stress=STRESS)),)
    for sim, expected in ((rough_cube(), True), (cube(), False)):
        gauges = loading_of(sim, program, 0.02).apparatus.gauges
        assert gauges.supported.tolist() == [expected] * 6
        gauges.means.stress = [0.0, 0.0, 0.0, 0.0, 1.0, 3.0]
        led = [2.0, 2.0] if expected else [1.0, 3.0]
        assert gauges.led(np.array(gauges.means.stress))[-2:].tolist() == led


def test_the_tolerance_of_stresses_may_change_where_a_run_goes_on():
    old = '[solver]\nintegrator = "explicit"\n[loading]\nspeed = 1.0\ntolerance = 0.01\n'
    assert _first_difference(old, old.replace("0.01", "0.03")) is None
    assert _first_difference(old, old.replace("1.0", "2.0")) == "loading.speed = 2.0, was 1.0"
    for name in (*FREE_KEYS, *FREE_TABLES, *OF_INTEGRATOR):
        assert name in MAY_CHANGE


def test_a_stage_that_waits_at_rest_says_so_once(monkeypatch):
    monkeypatch.setattr(Carry, "is_there", lambda *_: False)
    sim = cube(2)
    loading = loading_of(sim, (Stage("load", xyz=Axis(stress=STRESS)),), 0.1)
    found = []
    # ρ c is known after the first load; then some times of the comparison go by.
    while sim.state.t <= max(5.0 * WAVES * loading.apparatus.servo.travel_time, 1e-5):
        loading.before_step()
        sim.step()
        assert not loading.finished
        found += [line for line in [loading.take_notice()] if line]
    assert len(found) == 1
    # The cube is pressed alike along x, y and z: which is the farthest, rounding decides.
    waits = r'stage "load" waits at rest: stress_[xyz] = 1000 kPa, expected 1000 kPa '
    assert re.match(waits, found[0])
    assert "loading.tolerance = 0.002" in found[0]


def test_a_seating_that_cannot_come_to_rest_or_to_its_stress_ends(monkeypatch):
    """The first goes on with a line; the second stops and names what walls carry."""
    program = Stage("seat", xyz=Axis(stress=STRESS), zero=True), Stage("go on", hold=1e-9)
    monkeypatch.setattr(waiting, "AT_REST", -1.0)
    monkeypatch.setattr(waiting, "LONGEST", 4.0)
    sim = cube(2)
    loading, found = loading_of(sim, program, 0.1), []
    while not loading.loaded:
        loading.before_step()
        sim.step()
        found += [line for line in [loading.take_notice()] if line]
        assert sim.state.num_steps < 4000
    assert len(found) == 1 and found[0].startswith('stage "seat" does not come to rest: kinetic')
    monkeypatch.setattr(waiting, "NEVER", 4.0)
    monkeypatch.setattr(Carry, "is_there", lambda *_: False)
    sim = cube(2)
    loading = loading_of(sim, program, 0.1)
    with pytest.raises(SolverError, match='stage "seat" has not got to its stresses in 4 times'):
        for _ in steps(sim, loading, 4000):
            pass


def test_a_free_wall_comes_with_no_more_than_it_shall_carry():
    """The blow of a wall as fast as v is ρ c v, where ρ c is known; else it has its speed."""
    impedance, last, speed = 1e6, 1e5, 5.0
    wall = Carry(2, (0,), 1.0, (0,), Straight(0.0, last), speed, ends=True)
    pace = SimpleNamespace(leading=True, factor=1.0, fastest=speed, speed=speed)
    for gain, expected in ((math.inf, speed), (1 / impedance, last / impedance)):
        now = SimpleNamespace(axis_stress=np.zeros(3), stiffness=[0.0], gain=[gain], stress=[0.0])
        assert wall.speeds(0.0, now, pace) == [pytest.approx(expected)]
