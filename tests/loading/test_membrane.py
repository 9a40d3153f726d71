"""A membrane around a sample: what is glued, its volume, its work, and that it is no grain."""

import math

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.contact.results.network import find_network
from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.container import CYLINDER
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.sleeve import sleeve
from mufe_fenicsx.loading.measures import MembraneMeasures
from mufe_fenicsx.loading.membrane import Membrane
from mufe_fenicsx.loading.wall_servo import Servo
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.materials.neo_hookean import NeoHookean
from mufe_fenicsx.run.from_bodies import build
from mufe_fenicsx.run.snapshot import restore, snapshot
from tests.bodies import cylinder

R, H, T = 2e-3, 3e-3, 0.3e-3
UP = np.array([0.0, 0.0, 1.0])
SOFT, LATEX = Elastic(20e6, 0.2, 2000.0), NeoHookean()


def sample(comm, gap=0.02 * R, glued=(2,), **options):
    """A cylinder between platens in a sleeve, and its membrane."""
    bodies = [cylinder(R, H, 0.5 * R), sleeve(R + gap, T, H, 2 * T)]
    walls = [
        Wall("bottom", np.zeros(3), UP, bonded=glued),
        Wall("top", H * UP, -UP, bonded=glued, velocity=-0.1 * UP),
    ]
    options = {"sleeves": ["side"], "friction": 0.2, **options}
    return build(comm, bodies, [SOFT, LATEX], [0] * 3, [0] * 3, "", walls=walls, **options)


def test_a_sample_in_a_membrane_and_its_energies():
    """Pressure that comes at once presses it on; a top that comes down adds work, and shares."""
    s = sample(MPI.COMM_WORLD if MPI.COMM_WORLD.size < 3 else MPI.COMM_SELF, damping=2e4)
    # Facets enclose the area of the circle: exact.
    membrane = Membrane(s, 2)
    assert membrane.volume() == pytest.approx(math.pi * (1.02 * R) ** 2 * H, rel=1e-9)
    membrane.set_pressure(50e3)
    while s.state.t < 0.4e-3:
        s.step()
    energies = s.energies()
    fed = energies["work"] - energies["energy_cell_pressure"]
    # Of central differences, (ω Δt)²/4 of what swings, and contacts that close.
    assert abs(energies["residual"]) < 5e-3 * fed
    # The glued ends alone move with the platens: nodes of the cylinder do not.
    grain = s.mesh.grains[s.mesh.grain_of_node[s.specimen.glued.nodes]]
    assert (grain == 1).all()
    # The membrane is pressed on the cylinder: within the space that was between, and its layer.
    height = H - 0.1 * s.state.t
    assert membrane.volume() < math.pi * (1.01 * R) ** 2 * height
    # It is no grain.
    network = find_network(s.contact, s.mesh, s.solid.mass, s.state.x)
    share, forces = membrane.axial_forces(), s.wall_forces()
    own = s.mesh.grains[s.mesh.grain_of_node] == 0
    push = s.comm.allreduce(s.solid.mass[own] @ s.state.a[own])
    if network is not None:
        assert network.labels.tolist() == [1]
        assert network.walls == ["side", "bottom", "top"]
        c = network.contacts
        assert c.a.tolist() == [0] * 3 and c.b.tolist() == [1, 2, 3]
        # What platens feel is of the cylinder and of the glued ends; all of it moves the cylinder.
        assert np.abs(c.force[1:, 2]) + share == pytest.approx(forces, rel=1e-12)
        assert c.force.sum(axis=0) == pytest.approx(push, abs=1e-12 * forces.max())
        assert share.min() > 0.1
    assert s.num_active_grains() == 1 and s.mean_active_contacts() == 0.0


def test_a_rim_that_moves_along_is_in_the_potential():
    """A tube without stiffness to speak of: work of the platens is that of the pressure on it."""
    s = sample(MPI.COMM_SELF)
    membrane = Membrane(s, 2, pressure=1e5)
    state, cell = s.state, membrane.cell
    before = cell.energy(state)
    F = np.diag([0.97, 1.02, 0.9])
    rim = np.unique(np.concatenate([cell.facets.ravel(), s.specimen.glued.nodes]))
    z = s.mesh.x[:, 2] / H
    work, steps = 0.0, 2000
    old = state.x.copy()
    for k in range(steps):
        part = (k + 1) / steps
        bump = (4 * z * (1 - z))[:, None]
        moved = bump * part * (s.mesh.x @ (F - np.eye(3)).T) + part * z[:, None] * [1e-4, 0, -2e-4]
        middle = 0.5 * (old + s.mesh.x + moved)
        f = np.zeros_like(old)
        state.x[:] = middle
        cell.add_forces(f, state, 0.0)
        state.x[:] = s.mesh.x + moved
        work += np.vdot(f, state.x - old)
        old = state.x.copy()
    assert rim.size > 20 and abs(work) > 0
    # The midpoint rule: off by the square of a step.
    assert cell.energy(state) - before == pytest.approx(-work, rel=1e-5)


def test_the_servo_measures_the_grains_alone():
    """ρ c from energy and stress of the cylinder alone: its sleeve, in a gap, stores more.

    With the mean stress of a body and its energy, M = V Σσ²/2U is of the order of its moduli
    whatever the sleeve does: here below 3 K and above E.
    """
    s = sample(MPI.COMM_WORLD if MPI.COMM_WORLD.size < 3 else MPI.COMM_SELF, damping=5e4)
    s.walls.velocity[1] = 0.0
    measures = MembraneMeasures(Membrane(s, 2, pressure=50e3), LATEX.E * T, True)
    servo, found = Servo(s, measures), []
    cells = np.flatnonzero(s.mesh.grains[s.mesh.grain_of_cell] == 0)
    bulk, shear = SOFT.bulk_modulus, SOFT.shear_modulus
    while s.state.t < 0.5e-3:
        s.step()
        if s.state.num_steps % 50:
            continue
        servo.sample(np.array([50e3, 0.0]), measures.lengths())
        xx, yy, zz, xy, yz, xz = s.solid.stress(s.state, cells).T
        mean = (xx + yy + zz) / 3
        square = xx**2 + yy**2 + zz**2 + 2 * (xy**2 + yz**2 + xz**2) - 3 * mean**2
        v = s.solid.volume0[cells]
        energy = float(v @ (mean**2 / (2 * bulk) + square / (4 * shear)))
        parts = np.array([v @ (xx + yy), v @ zz, energy])
        radial, axial, energy = s.comm.allreduce(parts)
        if energy > 0.0:
            volume = float(CYLINDER.volume(measures.lengths()))
            stresses = (0.5 * radial**2 + axial**2) / volume**2
            found.append(math.sqrt(s.mass_of_grains() * stresses / (2 * energy)))
    # Springs between cylinder and platens add 2 % to the energy; averaged pressures besides.
    assert servo.impedance == pytest.approx(found[-1], rel=0.03)
    energies = s.energies()
    assert energies["elastic"] + energies["contact"] > 5.0 * energy
    density = s.mass_of_grains() / volume
    # Stresses that are not uniform store more: some per cent.
    assert 0.95 * density * SOFT.E < servo.impedance**2 < density * 3 * bulk


def test_a_checkpoint_keeps_what_is_glued_and_pressed():
    one, other = sample(MPI.COMM_SELF), sample(MPI.COMM_SELF)
    first = Membrane(one, 2, damping=1e4)
    second = Membrane(other, 2, damping=1e4)
    first.set_pressure(1e5)
    for _ in range(30):
        one.step()
    tables, own, common = snapshot(one)
    kept = {
        name: {column: np.array(_whole(values)) for column, values in table.items()}
        for name, table in tables.items()
    }
    restore(other, kept, own, common)
    for _ in range(20):
        one.step()
        other.step()
    assert second.pressure == 1e5 and second.volume() == first.volume()
    np.testing.assert_array_equal(one.state.x, other.state.x)
    assert one.energies() == other.energies()


def test_a_sleeve_may_stand_alone():
    """As a tube that theory is known of."""
    s = build(MPI.COMM_SELF, [sleeve(R, T, H, 2 * T)], LATEX, [0] * 3, [0] * 3, "", sleeves=["a"])
    assert s.mesh.num_sample_grains == 0 and len(s.mesh.sleeves) == 1


def _whole(values):
    return values if isinstance(values, np.ndarray) else np.concatenate(list(values.blocks(64)))


@pytest.mark.parametrize(
    ("attempt", "message"),
    [
        (
            lambda: Membrane(sample(MPI.COMM_SELF), 1),
            "label of the membrane = 1, expected that of a sleeve, 2: sleeves of build",
        ),
        (
            lambda: Membrane(sample(MPI.COMM_SELF, sleeves=[]), 2),
            "label of the membrane = 2, expected that of a sleeve, of which there is none: "
            "sleeves of build",
        ),
        (
            lambda: Membrane(sample(MPI.COMM_SELF, glued=()), 2),
            "platens that glue the membrane 2 = 0, expected a lower and an upper one, horizontal",
        ),
        (
            lambda: Membrane(sample(MPI.COMM_SELF), 2, damping=-1.0),
            "damping of the membrane = -1.0, expected >= 0",
        ),
        (
            lambda: sample(MPI.COMM_SELF, glued=(3,)),
            "nodes on the plane of the bonded wall bottom = 0, expected at least 3",
        ),
    ],
)
def test_what_is_no_membrane_is_named(attempt, message):
    with pytest.raises(InputError) as caught:
        attempt()
    assert str(caught.value) == message
