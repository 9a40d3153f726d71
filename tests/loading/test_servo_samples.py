"""What a servo knows of a sample: measured anew as soon as stresses say more than at first."""

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.container import BOX
from mufe_fenicsx.loading import wall_servo

DENSITY, SIDE, DT, MODULUS = 1600.0, 2e-3, 2e-8, 2e8
#: ρ c of a sample with MODULUS, and time of a wave through it [s].
IMPEDANCE = np.sqrt(DENSITY * MODULUS)
TRAVEL = SIDE * DENSITY / IMPEDANCE


def simulation_of(state):
    """All that a servo asks of a simulation, whose grains rest."""
    return SimpleNamespace(
        state=state, dt=DT, comm=MPI.COMM_SELF, mass_of_grains=lambda: DENSITY * SIDE**3,
        kinetic_energy=lambda: 0.0, damping=0.0,
    )  # fmt: skip


def test_what_grains_show_that_carry_next_to_nothing_is_soon_forgotten(monkeypatch):
    """At first ρ c is 1e-10 of what it is: a wave would cross the sample in hours.

    Stresses grow with time. Samples are taken at intervals that double at most, so that the last
    one was taken at half of the time at least, and then it is right at once.
    """
    state, wrong = SimpleNamespace(t=0.0), 1e-10
    simulation = simulation_of(state)
    measures = SimpleNamespace(container=BOX, carried=lambda stress: stress)
    servo = wall_servo.Servo(simulation, measures)
    stress = np.zeros(3)

    def energy(_):
        seen = IMPEDANCE * (wrong if stress[0] < 10.0 else 1.0)
        return DENSITY * SIDE**3 * float(stress @ stress) / (2.0 * seen**2)

    monkeypatch.setattr(wall_servo, "energy_in_sample", energy)
    for step in range(1, 4000):
        state.t = step * DT
        stress[:] = 1e-6 if step < 100 else 1e3 * step
        servo.sample(stress, np.full(3, SIDE))
    assert servo.impedance == pytest.approx(IMPEDANCE, rel=1e-12)
    assert servo.travel_time == pytest.approx(TRAVEL, rel=1e-12)


def test_a_rattling_sample_changes_what_is_known_of_it_by_a_factor_of_two_at_most(monkeypatch):
    """Stresses that fall and come back let ρ c change no more than stresses that stay."""
    state = SimpleNamespace(t=0.0)
    simulation = simulation_of(state)
    servo = wall_servo.Servo(simulation, SimpleNamespace(container=BOX, carried=lambda s: s))
    found = []
    for stress, seen in ((1e4, 1.0), (1.0, 1.0), (1e4, 100.0)):
        state.t += 1.0
        stress = np.full(3, stress)
        energy = DENSITY * SIDE**3 * float(stress @ stress) / (2.0 * (seen * IMPEDANCE) ** 2)
        monkeypatch.setattr(wall_servo, "energy_in_sample", lambda _, energy=energy: energy)
        servo.sample(stress, np.full(3, SIDE))
        found.append(servo.impedance / IMPEDANCE)
    assert found == pytest.approx([1.0, 1.0, wall_servo.CHANGE])
