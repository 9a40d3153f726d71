"""Undrained stages, paths of p and q: bodies whose answer is known."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.container import CYLINDER, Bounds
from mufe_fenicsx.errors import SolverError
from mufe_fenicsx.run.from_bodies import build
from mufe_fenicsx.scene.stages import Axis, Stage, Until
from tests.bodies import cylinder
from tests.loading.staged import (
    RAMP,
    SIZE,
    STUFF,
    TOLERANCE,
    cube,
    loading_of,
    steps,
)

SPEED = 0.05
PRESSURE = 1e6


def block(*stages):
    """An elastic cube between six smooth walls under 1 MPa, and its loading by further stages."""
    sim = cube()
    return sim, after_pressing(sim, "xyz", stages)


def bar(*stages):
    """The same of a cylinder in a smooth one."""
    points, cells = cylinder(0.5 * SIZE, SIZE, SIZE / 6)
    radius = np.linalg.norm(points[:, :2], axis=1).max()
    bounds = Bounds(points.min(axis=0), points.max(axis=0), np.zeros(2), radius)
    walls = [Wall(s.name, s.point, s.normal, radius=s.radius) for s in CYLINDER.surfaces(bounds)]
    sim = build(
        MPI.COMM_SELF, [(points, cells)], STUFF, bounds.low, bounds.high, axes="", walls=walls
    )
    return sim, after_pressing(sim, "rz", stages)


def after_pressing(sim, axes, stages):
    begin = Stage("start", zero=True, **{axes: Axis(stress=PRESSURE)})
    return loading_of(sim, [begin, *stages], SPEED)


def march(sim, loading):
    """To the end: stage -> rows of (stress along three directions, strain of them, volume, u)."""
    found, container = {}, loading.measures.container
    for _ in steps(sim, loading):
        gauges = loading.apparatus.gauges
        stress = gauges.axis_stress(sim.wall_forces())
        found.setdefault(loading.stage, []).append((
            container.three_stresses(stress, gauges.lengths),
            container.three_strains(gauges.strains, gauges.lengths),
            float(container.volume(gauges.lengths)), gauges.pore_pressure(stress),
        ))  # fmt: skip
    return {name: [np.array(values) for values in zip(*rows, strict=True)]
            for name, rows in found.items()}  # fmt: skip


def softness(sim):
    """Strain that two contact layers add to a stress of one [1/Pa], to 10 % at the edges."""
    layers = sim.contact.points
    return 2 * float(np.average(layers.layer, weights=layers.area)) / SIZE


def second_order(sim):
    """Change of volume in a step whose length is not the one that was foreseen.

    The step that counts is the longest so far, up to 1.9 times the last one.
    """
    return (1.9 * SPEED * sim.dt / SIZE) ** 2


# --- undrained ----------------------------------------------------------------------------


@pytest.mark.parametrize("make", [block, bar])
def test_an_elastic_body_has_a_vertical_effective_path_and_a_third_of_the_deviator_as_pressure(
    make,
):
    """No change of volume, none of p': σz' - σz0' = εz/((1 + ν)/E + layers), u half of that.

    Layers are as soft along each axis, so that Σ ε = Δp' (3 (1 - 2ν)/E + 3 layers) = 0. With the
    side stress less by half of what the vertical one is more, u = Δσz'/2 = q/3, Skempton's
    A = 1/3 at B = 1.
    """
    strain = 2e-3
    sim, loading = make(
        Stage("shut", z=Axis(strain=strain), undrained=True),
        Stage("back", z=Axis(strain=0.0), undrained=True),
        Stage("open", z=Axis(speed=0.0), until=Until(time=1e-9)),
    )
    found = march(sim, loading)
    stress, strains, volume, u = found["shut"]
    assert np.ptp(volume) < second_order(sim) * volume[0]
    assert strains[-1, 2] == pytest.approx(strain, rel=1e-8)
    q, p = stress[:, 2] - stress[:, 0], stress.mean(axis=1)
    # Waves of the platen, ρ c v, that are gone only slowly without a servo.
    wave = STUFF.rho * STUFF.wave_speed * SPEED
    assert np.abs(p - PRESSURE).max() < wave + 3 * TOLERANCE * PRESSURE
    change = strain / ((1 + STUFF.nu) / STUFF.E + softness(sim))
    assert stress[-1, 2] - PRESSURE == pytest.approx(change, rel=0.05)
    assert u[-1] == pytest.approx(q[-1] / 3, abs=wave + TOLERANCE * PRESSURE)
    # Total side stress, what the grains carry and u, is what it was held at.
    side = stress[:, :2].mean(axis=1)
    assert np.allclose(side + u, PRESSURE, rtol=1e-12)
    # Through stages in a row the pressure goes on, and the body comes back; then water may drain.
    stress, _, _, u = found["back"]
    assert np.allclose(stress[:, :2].mean(axis=1) + u, PRESSURE, rtol=1e-12)
    assert np.abs(stress[-1] - PRESSURE).max() < 0.05 * change
    assert not found["open"][3].any()


@pytest.mark.slow
def test_sand_that_liquefies_goes_on_without_stress_and_comes_back():
    """A cube pulled apart at constant volume leaves its platens: no stress, no error, and back."""
    pull = -4 * PRESSURE / STUFF.E
    sim, loading = block(
        Stage("shut", z=Axis(strain=pull), undrained=True, hold=2e-6),
        Stage("liquid", z=Axis(speed=-SPEED), undrained=True,
              until=Until(pore_pressure=20 * PRESSURE, strain_z=3 * pull)),
        Stage("again", xyz=Axis(stress=PRESSURE)),
    )  # fmt: skip
    found = march(sim, loading)
    stress, _, volume, u = found["liquid"]
    assert np.ptp(volume) < 10 * second_order(sim) * volume[0]  # steps grow without contact
    assert not stress[:, 2].any()  # the platens carry nothing, and nothing fails
    assert np.isfinite(u).all()
    assert found["again"][0][-1] == pytest.approx([PRESSURE] * 3, rel=2 * TOLERANCE)


def test_until_a_pore_pressure():
    sim, loading = block(
        Stage("shut", z=Axis(speed=SPEED), undrained=True, until=Until(pore_pressure=2e5))
    )
    u = march(sim, loading)["shut"][3]
    more = 0.5 * RAMP * STUFF.E + STUFF.rho * STUFF.wave_speed * SPEED
    assert 2e5 < u[-1] < 2e5 + more


# --- p, q and their ratio -----------------------------------------------------------------


def test_a_path_of_p_and_q_is_that_of_its_two_stresses_to_the_bit():
    p, q = 1.5e6, 0.6e6
    ends = []
    for stage in (
        Stage("path", p=p, q=q),
        Stage("path", xy=Axis(stress=p - q / 3.0), z=Axis(stress=p + 2.0 * q / 3.0)),
    ):
        sim, loading = block(stage)
        march(sim, loading)
        ends.append((sim.state.num_steps, sim.state.x.tobytes(), sim.state.v.tobytes()))
    assert ends[0] == ends[1]
    assert Stage("a", p=p, eta=q / p).stresses == pytest.approx(Stage("a", p=p, q=q).stresses)
    assert Stage("a", q=q, eta=q / p).stresses == pytest.approx(Stage("a", p=p, q=q).stresses)


@pytest.mark.parametrize("make", [block, pytest.param(bar, marks=pytest.mark.slow)])
def test_shear_at_constant_mean_stress(make):
    """p stays within its tolerance all the way; an elastic body then keeps its volume too."""
    strain = 1e-3
    sim, loading = make(
        Stage("shear", z=Axis(strain=strain), p=PRESSURE),
        Stage("higher", z=Axis(strain=2 * strain), p=1.3 * PRESSURE),
    )
    found = march(sim, loading)
    stress, strains, *_ = found["shear"]
    p = stress.mean(axis=1)
    wave = STUFF.rho * STUFF.wave_speed * SPEED
    assert np.abs(p - PRESSURE).max() < wave
    assert p[-1] == pytest.approx(PRESSURE, rel=TOLERANCE)
    soft = softness(sim)
    change = strain / ((1 + STUFF.nu) / STUFF.E + soft)
    assert stress[-1] - PRESSURE == pytest.approx([-change / 2, -change / 2, change], rel=0.05)
    free = TOLERANCE * PRESSURE * (1 / STUFF.E + soft)
    higher = found["higher"][0]
    assert higher[-1].mean() == pytest.approx(1.3 * PRESSURE, rel=TOLERANCE)
    # Layers on the facets of the side are as soft as those of the platens to a fifth.
    assert abs(strains[-1].sum()) < free + 0.2 * soft * change


def test_a_ratio_of_stresses_is_reached_and_then_kept():
    """η = 0.6: σside = σz/1.75. From there on εz = (1 - 2 ν k) Δσz/E and that of the layers."""
    eta, k = 0.6, 2.4 / 4.2
    sim, loading = block(
        Stage("reach", p=PRESSURE, eta=eta),
        Stage("keep", z=Axis(strain=4e-3), eta=eta),
        Stage("less", z=Axis(speed=0.0), eta=0.3, until=Until(time=3e-5)),
    )
    found = march(sim, loading)
    stress, strains, *_ = found["keep"]
    # Each side follows at a lag of its own speed over the gain, and waves pass.
    ratio = stress[:, :2] / stress[:, 2:]
    lag = STUFF.rho * STUFF.wave_speed * SPEED / stress[0, 2]
    assert np.abs(ratio - k).max() < lag
    assert ratio[-1] == pytest.approx([k, k], rel=3 * TOLERANCE)
    rise = stress[-1, 2] - stress[0, 2]
    strain = rise * ((1 - 2 * STUFF.nu * k) / STUFF.E + softness(sim))
    assert strains[-1, 2] - strains[0, 2] == pytest.approx(strain, rel=0.05)
    # It goes to another one where z is at rest: sides press until σside = 2.7/3.6 σz.
    stress = found["less"][0][-1]
    assert stress[:2] / stress[2] == pytest.approx([0.75] * 2, rel=0.02)


def test_no_side_stress_keeps_a_mean_stress_below_a_third_of_the_vertical_one():
    sim, loading = block(Stage("shear", z=Axis(strain=0.02), p=PRESSURE))
    with pytest.raises(SolverError, match=r'stage "shear": at stress_z = .* expected q < 3 p'):
        march(sim, loading)
