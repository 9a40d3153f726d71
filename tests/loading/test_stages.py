"""Tests by stages: walls led by stress, strain or speed, on bodies whose answer is known."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.analysis.macro import triaxial_curves
from mufe_fenicsx.contact.walls import SERVO_GAIN, Wall
from mufe_fenicsx.container import CYLINDER, Bounds
from mufe_fenicsx.errors import InputError, SolverError
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.loading.stages import StagedLoading
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.output.history import read_history
from mufe_fenicsx.run.from_bodies import build
from mufe_fenicsx.scene import (
    Contact,
    ContainerSettings,
    Output,
    QuasiStatic,
    Scene,
    Solver,
    load_scene,
    scene_to_toml,
)
from mufe_fenicsx.scene.stages import Axis, Loading, Stage, Until, named
from mufe_fenicsx.theory.servo import absorbing_gain, stable_gain
from tests.bodies import RADIUS, cylinder
from tests.checkpoints import arrays
from tests.loading.staged import (
    SIZE,
    STUFF,
    TOLERANCE,
    cube,
    loading_of,
    run,
    shared_folder,
    steps,
)


def block(program, speed=0.02, divisions=3, **settings):
    """An elastic cube between six smooth walls, and its loading by stages."""
    sim = cube(divisions)
    return sim, loading_of(sim, program, speed, **settings)


def march(sim, loading, watch=None):
    """To the end; (stress, strain, name) at the end of each stage, and of its leading part."""
    ends, led = {}, {}
    for _ in steps(sim, loading):
        now = (
            loading.apparatus.gauges.wall_stress(sim.wall_forces()),
            loading.apparatus.gauges.strains.copy(),
        )
        ends[loading.stage] = now
        if loading._now.hold_from is None:
            led[loading.stage] = now
        if watch:
            watch(loading.stage, *now)
    return ends, led


def layers(sim):
    """Compliance of the contact layers of two opposite walls over that of stress [1/Pa]."""
    _, stiffness = sim.walls.pressing(sim.comm)
    return 2 * SIZE / stiffness.mean()


def test_stresses_on_three_axes_and_back_again():
    """Hooke's law of a cube, straight stress paths, no loss in a cycle, no creep in a hold."""
    low, high = 2e5, (4e5, 6e5, 10e5)
    back = Axis(stress=low)
    away = {a: Axis(stress=value) for a, value in zip("xyz", high, strict=True)}
    sim, loading = block(
        (
            Stage("start", zero=True, xyz=back),
            Stage("load", **away),
            Stage("unload", xyz=back),
            Stage("reload", hold=20e-6, **away),
        )
    )
    paths = {}
    ends, led = march(sim, loading, lambda name, stress, strain: paths.setdefault(
        name, []).append((stress[0::2] + stress[1::2]) / 2))  # fmt: skip
    for name, wanted in (("start", [low] * 3), ("load", high), ("unload", [low] * 3)):
        assert np.allclose(ends[name][0], np.repeat(wanted, 2), rtol=TOLERANCE)

    # The layers take some of the strain, evenly but for the edges of the cube: 10 % of that part.
    soft, change = layers(sim), np.array(high) - low
    hooke = (change * (1 + STUFF.nu) - STUFF.nu * change.sum()) / STUFF.E
    strain = ends["load"][1]
    assert np.allclose(strain, hooke + soft * change, atol=0.1 * soft * change.max())
    # Between the walls two states of one elastic body differ by what the tolerance lets them.
    free = 3 * TOLERANCE * max(high) * (1 / STUFF.E + soft)
    assert np.abs(ends["unload"][1]).max() < free
    assert np.abs(ends["reload"][1] - strain).max() < free
    # A hold: what the servo still makes up for at its start, and nothing after that.
    drift = np.abs(ends["reload"][1] - led["reload"][1]).max()
    assert drift < TOLERANCE * max(high) * (1 / STUFF.E + soft)
    # A straight line in the space of stresses, but for waves: as each other part of the way.
    path = (np.array(paths["load"]) - low) / change
    on = (path.min(axis=1) > 0.3) & (path.max(axis=1) < 0.9)
    assert on.sum() > 20 and np.ptp(path[on], axis=1).max() < 0.1
    energies = sim.energies()
    assert abs(energies["residual"]) < 1e-3 * energies["work"]


def test_stresses_on_the_axes_of_a_cylinder():
    """Hooke's law of a cylinder: σr on its side, σz on its ends, and back without a loss."""
    points, cells = cylinder(0.5 * SIZE, SIZE, SIZE / 6)
    radius = np.linalg.norm(points[:, :2], axis=1).max()
    bounds = Bounds(points.min(axis=0), points.max(axis=0), np.zeros(2), radius)
    walls = [Wall(s.name, s.point, s.normal, radius=s.radius) for s in CYLINDER.surfaces(bounds)]
    sim = build(
        MPI.COMM_SELF, [(points, cells)], STUFF, bounds.low, bounds.high, axes="", walls=walls
    )
    back, high = Axis(stress=2e5), np.array([8e5, 5e5])
    program = (
        Stage("start", zero=True, rz=back),
        Stage("load", r=Axis(stress=high[0]), z=Axis(stress=high[1])),
        Stage("unload", rz=back),
    )
    ends, _ = march(sim, loading_of(sim, program, 0.02))
    (stress, strain), change = ends["load"], high - 2e5
    assert np.allclose(stress, [high[0], high[1], high[1]], rtol=TOLERANCE)
    nu = STUFF.nu
    hooke = np.array([(1 - nu) * change[0] - nu * change[1], change[1] - 2 * nu * change[0]])
    # Of a diameter and of a height two layers take their part, to 10 % of it at the edges.
    layer = float(np.average(sim.contact.points.layer, weights=sim.contact.points.area))
    soft = 2 * layer / SIZE
    assert np.allclose(strain, hooke / STUFF.E + soft * change, atol=0.1 * soft * change.max())
    free = 3 * TOLERANCE * high.max() * (1 / STUFF.E + soft)
    assert np.abs(ends["unload"][1]).max() < free
    energies = sim.energies()
    assert abs(energies["residual"]) < 1e-3 * energies["work"]


def test_oedometer_by_stress_and_by_strain():
    """Side walls at rest: the constrained modulus, up by speed and stress, down by strain."""
    sim, loading = block(
        (
            Stage("touch", zero=True, xyz=Axis(stress=1e5)),
            Stage("fix", hold=1e-6, xy=Axis(speed=0.0), until=Until(time=1e-6)),
            # Strains that are there already end nothing.
            Stage(
                "fast",
                z=Axis(speed=0.02, walls="max"),
                xy=Axis(strain=0.0),
                until=Until(stress_z=5e5),
            ),
            Stage("step", z=Axis(stress=8e5)),
            Stage("down", z=Axis(strain=0.0)),
        )
    )
    speeds, after = [], []

    def watch(name, stress, strain):
        if name == "fast":
            speeds.append(loading.speed_now)
        elif name == "step" and len(after) < 40:  # two times that a wave travels
            after.append(stress[4:].mean())

    ends, _ = march(sim, loading, watch)
    across = [np.abs(ends[name][1][:2]).max() for name in ("fast", "step", "down")]
    assert max(across) < 1e-6  # the walls have not moved since strains count from their place
    # What the brakes take of the way, half of the ramp, and the mean of what a wave does later.
    modulus, travel = STUFF.constrained_modulus, SIZE / STUFF.wave_speed
    more = modulus * (0.5 * 1e-4 + 0.02 / SIZE * travel)
    fast = ends["fast"][0][4:].mean()
    assert 5e5 < fast < 5e5 + 1.1 * more
    # No jump: speeds are those of the smooth step, up and down, whose slope is at most 15/8.
    steep = 15 / 8 * 0.02 / (1e-4 * SIZE / 0.02) * sim.dt
    assert np.abs(np.diff(speeds)).max() < 1.2 * steep and max(speeds) == 0.02
    assert speeds[-1] < 0.05 * 0.02 and min(after) > 0.97 * fast
    assert ends["step"][0][4:] == pytest.approx([8e5] * 2, rel=TOLERANCE)
    assert ends["down"][1][2] == pytest.approx(0.0, abs=1e-9)
    assert ends["down"][0][4:].mean() == pytest.approx(1e5, rel=0.05)  # waves of unloading
    # σz = M εz + λ(εx + εy) of the block, whose own strain is less by that of the layers.
    soft, nu = layers(sim), STUFF.nu
    rise = 0.5 * (ends["step"][0][0::2] + ends["step"][0][1::2]) - 1e5
    own = np.array([0.0, 0.0, ends["step"][1][2]]) - soft * rise
    lame = STUFF.E * nu / ((1 + nu) * (1 - 2 * nu))
    hooke = 2 * STUFF.shear_modulus * own + lame * own.sum()
    assert np.allclose(rise, hooke, atol=0.05 * rise.max())


def test_rows_are_evenly_apart_where_a_value_of_until_stands_still():
    """A cube that flows below the deviator that would end its stage, while its strain goes on."""
    flows, end = J2(1e9, 0.2, 2650.0, ((0.0, 1e5), (0.1, 1e5))), 1e-3
    sim = build(MPI.COMM_SELF, [box((SIZE,) * 3, (1, 1, 1))], flows, np.zeros(3), np.full(3, SIZE))
    program = (
        Stage("touch", zero=True, xyz=Axis(stress=5e4)),
        Stage("shear", z=Axis(strain=end), until=Until(deviator=2e5)),
    )
    loading = StagedLoading(sim, Loading(speed=0.05, ramp=1e-4, tolerance=0.02), named(program))
    rows, due = [], 0.0
    while not loading.finished:
        loading.before_step()
        sim.step()
        if loading.stage == "shear" and loading.course >= due:
            rows.append((loading.strain, loading._now.parts[0]))
            due = math.floor(10 * loading.course) / 10 + 0.1
    strain, q = np.array(rows).T
    assert q.max() < 0.8 and np.ptp(q[strain > 0.4 * end]) < 0.1  # it stands still
    # Ten intervals for each of both; steps are 0.02 of the strain, and 0.05 of the deviator.
    assert np.diff(strain).max() < 1.2 * 0.1 * end and np.diff(q).max() < 2 * 0.1
    assert len(rows) < 30


def test_a_stage_of_time_has_the_rows_that_are_asked_for():
    """It had those of a wait as well, as if nobody knew its end: 385 for 60."""
    sim = cube(1)
    rest = Stage("rest", until=Until(time=1000 * sim.dt), hold=100 * sim.dt)
    loading = loading_of(sim, (rest,), 1.0)
    interval = loading.interval(61)
    rows = [interval * math.floor(loading.course / interval) for _ in steps(sim, loading)]
    # 60 of the time, and a tenth of that for the hold by either of both ways.
    assert 60 <= len(set(rows)) <= 75


def test_speed_follows_quasi_static_targets():
    """A cube loaded slower than it needs be by its first speed: as fast as the targets allow."""
    target = QuasiStatic(kinetic=0.01, unbalanced=0.05, slowest=1e-3, fastest=5.0)
    speed, ratio, speeds = 0.1, [], []
    program = (Stage("touch", zero=True, xyz=Axis(stress=1e4, speed=0.3)),
               Stage("load", xyz=Axis(stress=2e7)))  # fmt: skip
    sim, loading = block(program, speed, quasi_static=target)

    def watch(name, stress, strain):
        if name == "touch":  # as fast as it says, whatever the targets
            assert loading.control.range[1] == 0.0
            return
        e = sim.energies()
        speeds.append(loading.speed_now)
        if 6e6 < stress.min():
            ratio.append(e["kinetic"] / e["elastic"])

    ends, _ = march(sim, loading, watch)
    assert len(ratio) > 100 and max(ratio) < 0.01
    assert sim.state.t < 0.5 * ends["load"][1].max() * SIZE / speed
    # Walls have the speed that is asked for; they have not while waves pass, by some percent.
    assert max(speeds) == pytest.approx(loading.control.range[1], rel=0.05)


def test_a_sample_that_carries_nothing_stops_the_test():
    sim, loading = block((Stage("load", z=Axis(stress=1e12)),), speed=50.0, largest_strain=0.05)
    with pytest.raises(SolverError, match=r"stage \"load\": the length along z changed by"):
        march(sim, loading)


@pytest.mark.parametrize("omega_dt", [0.0, 1.0, math.sqrt(2.0)])
def test_gain_of_the_servo_is_below_its_limit_of_stability(omega_dt):
    """A wall on a node with its spring: the recurrence itself decays below the limit alone."""

    def grows(gain):
        wall = node = before = 0.0
        largest = []
        for _ in range(4000):
            force = wall - node  # K = 1; the wanted force is 1
            wall, node, before = (
                wall + gain * (1.0 - force), 2 * node - before + omega_dt**2 * force, node
            )  # fmt: skip
            largest.append(abs(1.0 - force))
        return largest[-1] > 2.0

    limit = stable_gain(omega_dt)
    assert not grows(limit * (1 - 1e-2)) and grows(limit * (1 + 1e-2))
    assert SERVO_GAIN < 0.6 * limit


def test_a_wave_that_meets_a_servo_wall_does_not_come_back():
    """A bar hit at one end, held by walls of its own impedance: it is at rest after 2 L/c."""
    bar = Elastic(1e9, 0.0, 2650.0)
    gain = absorbing_gain(bar.constrained_modulus, bar.rho)
    assert gain == pytest.approx(1 / (bar.rho * bar.wave_speed))
    sim = build(
        MPI.COMM_SELF, [box((10 * SIZE, SIZE, SIZE), (40, 2, 2))], bar, np.zeros(3),
        np.array([10 * SIZE, SIZE, SIZE]), axes="x",
    )  # fmt: skip
    travel, rest = 10 * SIZE / bar.wave_speed, 1e5
    area, kinetic = SIZE**2, []
    while sim.state.t < 4 * travel:
        stress = sim.wall_forces() / area
        hit = 1e4 * math.sin(math.pi * min(2 * sim.state.t / travel, 1.0)) ** 2
        ramp = rest * min(sim.state.t / travel, 1.0)
        sim.walls.velocity[:, 0] = gain * (np.array([ramp + hit, ramp]) - stress) * [1, -1]
        sim.step()
        kinetic.append(sim.energies()["kinetic"])
    kinetic, end = np.array(kinetic), len(kinetic)
    # The layer in front of the wall and the mesh send back some percent of the speed.
    assert kinetic[int(0.9 * end) :].max() < 0.01 * kinetic.max()


# --- in a run -----------------------------------------------------------------------------


def scene(**changes):
    """Two balls on top of each other: seating, isotropic, sheared until a stress is passed."""
    stages = (
        Stage(zero=True, xyz=Axis(stress=1e6)),
        Stage("isotropic", xyz=Axis(stress=5e6), hold=2e-6),
        Stage("shear", z=Axis(strain=0.01), until=Until(deviator=5e6)),
    )
    values = {
        "material": J2(100e9, 0.15, 2650.0, ((0.0, 1e9), (0.05, 2e9))),
        "contact": Contact(friction=0.4, wall_friction=0.1),
        "solver": Solver(damping=2e5),
        "loading": Loading(speed=0.5, ramp=2e-4, tolerance=0.05),
        "stages": stages,
        "output": Output(fields=4, history=31, checkpoint_steps=300),
    }
    return Scene(**(values | changes))


@pytest.fixture
def folder(tmp_path_factory):
    return shared_folder(tmp_path_factory, grains=((1, 1, 2), 0.9))


def test_a_run_by_stages_reaches_its_stresses_and_resumes_to_the_same_bits(folder):
    whole = run(folder, "whole", scene())
    assert whole["finished"] and whole["stop_reason"] == "last stage done"
    history = read_history(folder / "whole" / "history.csv")
    names = [stage["name"] for stage in whole["stages"]]
    assert names == ["seating", "isotropic", "shear"] == list(dict.fromkeys(history["stage"]))
    last = history["stage"] == "isotropic"
    for axis in "xyz":
        stress, strain = history[f"stress_{axis}"][last], history[f"strain_{axis}"][last]
        assert stress[-1] == pytest.approx(5e6, rel=0.05) and strain[-1] > 0
    # Held while z is pressed, but for the waves of two balls, twice the tolerance; the deviator
    # ends the stage, where walls brake over a part of it.
    x, y, z = (history[f"stress_{axis}"][-1] for axis in "xyz")
    assert [x, y] == pytest.approx([5e6] * 2, rel=0.1) and 4.9e6 < z - 0.5 * (x + y) < 6e6
    assert np.all(history["stress"] == history["stress_z"])

    # The same in parts: stopped twice, then finished with two stages, the third added after that.
    first, steps = scene(stages=scene().stages[:2]), whole["stages"]
    cuts = [steps[1]["step"] - 7, steps[1]["step"] + 111]
    for number, cut in enumerate(cuts):
        run(folder, "parts", first, max_steps=cut, resume=number > 0)
    assert run(folder, "parts", first, resume=True)["finished"]
    with pytest.raises(InputError, match=r"all 2 stages .* are done, expected further"):
        run(folder, "parts", first, resume=True)
    other = scene(stages=(Stage(zero=True, xyz=Axis(stress=2e6)), *scene().stages[1:]))
    with pytest.raises(InputError, match=r"stage\[1\].xyz.stress = 2000000.0, was 1000000.0, exp"):
        run(folder, "parts", other, resume=True)
    with pytest.raises(InputError, match=r"\[\[stage\]\] of the scene = 1, expected the first 2"):
        run(folder, "parts", scene(stages=scene().stages[:1]), resume=True)
    parts = run(folder, "parts", scene(), resume=True)
    assert parts["resumed_at_steps"] == [*cuts, steps[2]["step"]]
    assert parts["stages"] == whole["stages"] and parts["num_steps"] == whole["num_steps"]
    assert arrays(folder / "parts") == arrays(folder / "whole")


def test_a_run_in_a_cylinder_resumes_to_the_same_bits(folder):
    """Its side holds a pressure while the platens go on: by force, area, diameter, volume."""
    program = (
        Stage(zero=True, rz=Axis(stress=2e6)),
        Stage("shear", r=Axis(stress=2e6), z=Axis(strain=0.005)),
    )
    given = scene(container=ContainerSettings("cylinder"), stages=program)
    # Stopped while the servo goes to its pressure: the same a little farther on as without a stop.
    run(folder, "round", given, max_steps=300)
    run(folder, "round", given, max_steps=400, resume=True)
    run(folder, "begin", given, max_steps=400)
    assert arrays(folder / "round") == arrays(folder / "begin")
    whole = run(folder, "round", given, resume=True)
    history = read_history(folder / "round" / "history.csv")
    assert whole["finished"] and whole["container"]["radius"] == pytest.approx(RADIUS, rel=0.01)
    D, H = history["diameter"], history["height"]
    assert history["stress_r"] == pytest.approx(history["force_side"] / (np.pi * D * H))
    both = 0.5 * (history["force_z_min"] + history["force_z_max"])
    assert history["stress_z"] == pytest.approx(both / (np.pi * D**2 / 4))
    assert history["stress_r"][-1] == pytest.approx(2e6, rel=0.05)
    shear = history["stage"] == "shear"  # strains count from its start
    volume, shrunk = (D**2 * H)[shear], triaxial_curves(history)["strain_volume"][shear]
    assert shrunk == pytest.approx(1 - volume / volume[0], abs=1e-3 * np.ptp(shrunk))


# --- the tables ---------------------------------------------------------------------------

TEXT = """
[material]
model = "elastic"
E = 1e9
nu = 0.2
rho = 2650
[contact]
friction = 0.3
[loading]
speed = "10 mm/s"
[[stage]]
zero = true
xyz = { stress = "100 kPa" }
[[stage]]
name = "shear"
xy = { stress = "1 MPa", walls = "max" }
z = { speed = 0.1 }
until = { strain_z = 0.05, deviator = "3 MPa" }
hold = "2 us"
"""


def test_stages_are_read_as_they_are_written(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(TEXT)
    given = load_scene(path)
    assert [stage.name for stage in given.stages] == ["seating", "shear"]
    assert given.stages[1].axes["y"] == Axis(stress=1e6, walls="max")
    assert given.stages[1].until == Until(strain_z=0.05, deviator=3e6)
    assert given.stages[1].hold == 2e-6
    path.write_text(scene_to_toml(given))
    assert load_scene(path) == given


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("[loading]", "[solver]\nintegrator = 'static'\n[loading]",
         '[loading] is given, expected [oedometer] for solver.integrator = "static"'),
        ("[loading]", "[oedometer]\nstrain = 0.1\nspeed = 1\n[loading]", "none beside [oedometer]"),
        ("[loading]", "[walls.x_min]\nvelocity = 1\n[loading]",
         "walls.x_min.velocity = 1.0, expected none: [[stage]] moves the walls"),
        ('"100 kPa" }', '"100 kPa", strain = 0.1 }', "stage[1].xyz.strain = 0.1, expected none"),
        ('"100 kPa"', '"-1 kPa"', "stage[1].xyz.stress = -1000.0, expected > 0 Pa"),
        ('"100 kPa"', '"1 m"', 'stage[1].xyz.stress = "1 m", expected a stress'),
        ('{ stress = "100 kPa" }', '"100 kPa"', 'stage[1].xyz = "100 kPa", expected a table'),
        ('walls = "max"', 'walls = "top"', 'stage[2].xy.walls = "top", expected "both"'),
        ("z = { speed", "yz = { speed", "stage[2].yz is given, expected y once: xy has it"),
        ("strain_z", "strainz", "stage[2].until.strainz = 0.05 is not a known key, expected"),
        ('"shear"', '"seating"', 'stage[2].name = "seating", expected names that differ'),
        ("z = { speed", "r = { speed", "stage[2] leads r, expected x or y or z with container"),
        ("[loading]", "[container]\nshape = 'cylinder'\n[loading]", "stage[1] leads x, expected r"),
        ("strain_z =", "strain_r =", "stage[2].until.strain_r is given, expected none with"),
        ("z = { speed = 0.1 }", "z = { walls = 'both' }", "stage[2].z.stress is missing"),
    ],
)  # fmt: skip
def test_what_stages_must_not_be(tmp_path, old, new, words):
    path = tmp_path / "scene.toml"
    path.write_text(TEXT.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        load_scene(path)
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_stages_without_an_end_are_refused():
    with pytest.raises(InputError, match="until is missing"):
        Stage(z=Axis(speed=1.0))
    with pytest.raises(InputError, match="hold = 0"):
        Stage("nothing")
    assert SimpleNamespace(**Until(time=1.0).given).time == 1.0
    # Whose strains are reached before it begins, which no scene can tell.
    touch, on = Stage("touch", hold=1e-6), Stage("on", z=Axis(speed=0.02), xy=Axis(strain=0.0))
    with pytest.raises(SolverError, match='stage "on": until is missing'):
        march(*block((touch, on)))
