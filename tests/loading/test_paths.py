"""Undrained stages, paths of p and q, measured motions, cycles: bodies whose answer is known."""

import h5py
import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.container import CYLINDER, Bounds
from mufe_fenicsx.errors import InputError, SolverError
from mufe_fenicsx.geometry.bodies.shapes import box, cylinder
from mufe_fenicsx.geometry.grains import save_grains
from mufe_fenicsx.loading.stages import StagedLoading
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.output.fields import read_states
from mufe_fenicsx.output.history import read_history
from mufe_fenicsx.output.measured import curve_through, read_measured, steepest
from mufe_fenicsx.run.from_bodies import build
from mufe_fenicsx.run.run import run_scene
from mufe_fenicsx.scene import Contact, Output, Scene, Solver, load_scene, scene_to_toml
from mufe_fenicsx.scene.stages import Axis, Loading, Stage, Until, named
from tests.bodies import RADIUS, packed_grains

COMM = MPI.COMM_WORLD
SIZE, STUFF = 1e-3, Elastic(1e9, 0.2, 2650.0)
TOLERANCE, RAMP, SPEED = 2e-3, 1e-4, 0.05
PRESSURE = 1e6


def block(*stages):
    """An elastic cube between six smooth walls under 1 MPa, and its loading by further stages."""
    sim = build(MPI.COMM_SELF, [box((SIZE,) * 3, (3, 3, 3))], STUFF, np.zeros(3), np.full(3, SIZE))
    return sim, loading_of(sim, "xyz", stages)


def bar(*stages):
    """The same of a cylinder in a smooth one."""
    points, cells = cylinder(0.5 * SIZE, SIZE, SIZE / 6)
    radius = np.linalg.norm(points[:, :2], axis=1).max()
    bounds = Bounds(points.min(axis=0), points.max(axis=0), np.zeros(2), radius)
    walls = [Wall(s.name, s.point, s.normal, radius=s.radius) for s in CYLINDER.surfaces(bounds)]
    sim = build(
        MPI.COMM_SELF, [(points, cells)], STUFF, bounds.low, bounds.high, axes="", walls=walls
    )
    return sim, loading_of(sim, "rz", stages)


def loading_of(sim, axes, stages):
    begin = Stage("start", zero=True, **{axes: Axis(stress=PRESSURE)})
    settings = Loading(speed=SPEED, ramp=RAMP, tolerance=TOLERANCE)
    return StagedLoading(sim, settings, named([begin, *stages]))


def march(sim, loading, most=40000):
    """To the end: stage -> rows of (stress along three directions, strain of them, volume, u)."""
    found, container = {}, loading.container
    while not loading.finished:
        loading.before_step()
        sim.step()
        gauges = loading.gauges
        stress = gauges.axis_stress(sim.wall_forces())
        found.setdefault(loading.stage, []).append((
            container.three_stresses(stress, gauges.lengths),
            container.three_strains(gauges.strains, gauges.lengths),
            float(container.volume(gauges.lengths)), gauges.pore_pressure(stress),
        ))  # fmt: skip
        assert sim.state.num_steps < most
    return {name: [np.array(values) for values in zip(*rows, strict=True)]
            for name, rows in found.items()}  # fmt: skip


def softness(sim):
    """Strain that two contact layers add to a stress of one [1/Pa], to 10 % at the edges."""
    layers = sim.contact.points
    return 2 * float(np.average(layers.layer, weights=layers.area)) / SIZE


def second_order(sim):
    """Change of volume in a step whose length is not the one that was foreseen."""
    return (SPEED * sim.dt / SIZE) ** 2


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


@pytest.mark.parametrize("make", [block, bar])
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


# --- measured motions ---------------------------------------------------------------------

TABLE = """# of a test on sand
time [min], strain_x [%], displacement_y [um], z_max [mm]
0, 0.1, 0, 5
1, 0.2, 1, 5

3, 0.15, 1.5, 4.998
4, 0.3, 1, 4.997
"""


def test_walls_follow_a_file(tmp_path):
    """Each row is met, at its part of the time, as fast as the fastest axis may; never beyond."""
    path = tmp_path / "motion.csv"
    path.write_text(TABLE)
    sim, loading = block(
        Stage("test", follow=path), Stage("rest", hold=1e-6, until=Until(time=1.0))
    )
    strains, z_min, ways, speeds = [], [], [], []
    while loading.index < 2:
        loading.before_step()
        sim.step()
        if loading.index == 1 and loading._now.hold_from is None:
            strains.append(loading.gauges.strains.copy())
            z_min.append(sim.walls.point[4, 2])
            ways.append(loading._now.s)
            speeds.append(loading.speed_now)
    strains, ways, L = np.array(strains), np.array(ways), loading.gauges.reference
    wanted = np.array([[0.001, 1e-6 / L[1], 0], [0.0005, 1.5e-6 / L[1], 2e-6 / L[2]],
                       [0.002, 1e-6 / L[1], 3e-6 / L[2]]])  # fmt: skip
    at = [np.argmin(np.abs(ways - part)) for part in (0.25, 0.75, 1.0)]
    step = SPEED * sim.dt / SIZE
    assert np.abs(strains[at] - wanted).max() < 1.5 * step
    assert strains[-1] == pytest.approx(wanted[-1], abs=1e-11)
    assert strains[:, 1].max() <= 1.5e-6 / L[1] + 1e-12 and np.ptp(z_min) < 1e-15
    assert 0.95 * SPEED < max(speeds) < 1.001 * SPEED


def test_curves_go_through_rows_without_overshoot():
    x, y = np.array([0.0, 0.2, 0.5, 1.0]), np.array([0.0, 1.0, 1.0, -2.0])
    curve = curve_through(x, y)
    fine = np.linspace(0, 1, 2001)
    assert curve(x) == pytest.approx(y, abs=1e-14) and curve(fine).max() <= 1.0 + 1e-14
    slopes = np.abs(np.diff(curve(fine)) / np.diff(fine))
    assert steepest(curve) == pytest.approx(slopes.max(), rel=1e-3)
    assert steepest(curve_through(np.array([0.0, 1.0]), np.array([0.0, 3.0]))) == pytest.approx(3.0)


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("strain_x", "strainx", 'line 2: "strainx" is not a known column, expected strain_x'),
        ("[um]", "[kPa]", 'line 2: displacement_y = "1 kPa", expected a length'),
        ("displacement_y [um]", "strain_x", "line 2: strain_x is there twice"),
        ("displacement_y [um]", "displacement_x", "has strain_x and displacement_x, expected one"),
        ("time [min]", "strain_y", "line 2: time is missing"),
        ("1, 0.2", "1, abc", 'line 4: strain_x = "abc", expected a finite number'),
        ("1, 0.2, 1, 5", "1, 0.2, 1", "line 4 has 3 values, expected 4"),
        ("3, 0.15", "1, 0.15", "line 6: time = 1, expected more than 1, that of the row before"),
    ],
)
def test_what_a_file_to_follow_must_not_be(tmp_path, old, new, words):
    path = tmp_path / "motion.csv"
    path.write_text(TABLE.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        block(Stage("test", follow=path))
    assert words in str(caught.value) and str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_must_not_lead_what_its_stage_leads(tmp_path):
    path = tmp_path / "motion.csv"
    path.write_text(TABLE)
    for given, words in (
        ({"z": Axis(strain=0.1)}, "z is given, expected none beside z_max"),
        ({"undrained": True}, "expected an axis that it leaves out"),
        ({"p": 1e6}, "expected z alone beside p or eta"),
    ):
        with pytest.raises(InputError, match=words):
            block(Stage("test", follow=path, **given))
    with pytest.raises(InputError, match=r"absent.csv cannot be read \(No such file"):
        block(Stage("test", follow=tmp_path / "absent.csv"))
    path.write_text("time, z_max\n0, 2e-3\n1, 0.9e-3")
    with pytest.raises(InputError, match=r"shortens z by 0\.0011 m, expected less than its length"):
        loading = block(Stage("test", follow=path))[1]
        loading._begin(np.zeros(6))
    assert read_measured(path, {"time": "s", "z_max": "m"}).columns["z_max"][1] == 0.9e-3


# --- cycles -------------------------------------------------------------------------------


def test_cycles_are_the_stages_written_out():
    cycle = Stage("load", z=Axis(strain=0.01)), Stage("unload", z=Axis(strain=0.0))
    seat, last = Stage(zero=True, xyz=Axis(stress=1e5)), Stage("more", z=Axis(strain=0.1))
    again = Stage("unload", z=Axis(strain=0.0), repeat=3, repeat_from="load")
    found = named([seat, cycle[0], again, last])
    written = [seat, *cycle]
    for k in (2, 3):
        written += [
            Stage(f"load {k}", z=Axis(strain=0.01)),
            Stage(f"unload {k}", z=Axis(strain=0.0)),
        ]
    assert found == named([*written, last]) and named(found) == found
    assert [s.name for s in named([Stage("one", hold=1e-6, repeat=2)])] == ["one", "one 2"]


@pytest.mark.parametrize(
    "stages, words",
    [
        ([Stage("a", hold=1.0, repeat=2, repeat_from="b"), Stage("b", hold=1.0)],
         r'stage\[1\].repeat_from = "b", expected the name of this stage or of one before it'),
        ([Stage("a", hold=1.0, repeat=2), Stage("b", hold=1.0, repeat=2, repeat_from="a")],
         r'stage\[2\].repeat_from = "a", expected a stage after those of the cycles before'),
        ([Stage("a", hold=1.0, zero=True, repeat=2)], "expected no stage with zero = true in it"),
        ([Stage("a 2", hold=1.0), Stage("a", hold=1.0, repeat=2)], 'name = "a 2", expected names'),
    ],
)  # fmt: skip
def test_what_cycles_must_not_be(stages, words):
    with pytest.raises(InputError, match=words):
        named(stages)


# --- in a run -----------------------------------------------------------------------------


@pytest.fixture
def folder(tmp_path_factory):
    """A folder that all ranks share, with the grains: a column of spheres."""
    path = COMM.bcast(tmp_path_factory.mktemp("paths") if COMM.rank == 0 else None)
    if COMM.rank == 0:
        save_grains(path / "grains", packed_grains((1, 1, 3), h=0.6 * RADIUS))
        (path / "motion.csv").write_text("time, strain_z\n0, 0\n1, 1e-3\n2, 1.5e-3\n")
    COMM.Barrier()
    return path


def scene(folder, **changes):
    """Seating, p and q, a path at constant p, undrained cycles by signed q, a file."""
    stages = (
        Stage(zero=True, xyz=Axis(stress=1e6)),
        Stage("path", p=3e6, q=1e6),
        Stage("constant p", z=Axis(strain=0.004), p=3e6, until=Until(q=2e6)),
        Stage("load", z=Axis(speed=0.5), undrained=True, until=Until(q=3e6, strain_z=0.01)),
        Stage("unload", z=Axis(speed=-0.5), undrained=True, until=Until(q=0.0, strain_z=-0.01),
              repeat=2, repeat_from="load"),
        Stage("follow", follow=folder / "motion.csv", xy=Axis(stress=2e6)),
    )  # fmt: skip
    values = {
        "material": J2(100e9, 0.15, 2650.0, ((0.0, 1e9), (0.05, 2e9))),
        "contact": Contact(friction=0.4, wall_friction=0.1),
        "solver": Solver(damping=2e5),
        "loading": Loading(speed=0.5, ramp=2e-4, tolerance=0.05),
        "stages": stages,
        "output": Output(fields=4, history=31, checkpoint_steps=300),
    }
    return Scene(**(values | changes))


def run(folder, name, given, **options):
    return run_scene(given, folder / "grains", folder / name, COMM, quiet=True, **options)


def arrays(run_folder):
    """Name and bytes of all that this rank has in the last checkpoint."""
    path = max(run_folder.glob("checkpoints/step-*[0-9]")) / f"rank-{COMM.rank:04d}.h5"
    found = []
    with h5py.File(path) as file:
        file.visititems(lambda name, item: found.append((name, item)))
        return [(n, v[()].tobytes()) for n, v in found if isinstance(v, h5py.Dataset)]


def test_a_run_along_paths_resumes_to_the_same_bits(folder):
    given = scene(folder)
    whole = run(folder, "whole", given)
    names = [stage["name"] for stage in whole["stages"]]
    assert whole["finished"] and names == [
        "seating", "path", "constant p", "load", "unload", "load 2", "unload 2", "follow",
    ]  # fmt: skip
    history = read_history(folder / "whole" / "history.csv")
    stage, u = history["stage"], history["pore_pressure"]
    undrained = np.isin(stage, names[3:7])
    assert not u[~undrained].any() and u[undrained].any()
    total = (history["stress_x"] + history["stress_y"])[undrained] / 2 + u[undrained]
    assert np.ptp(total) < 1e-9 * total.mean()
    volume = (history["length_x"] * history["length_y"] * history["height"])[undrained]
    assert np.ptp(volume) < 1e-9 * volume[0]
    p = sum(history[f"stress_{a}"] for a in "xyz") / 3
    # Balls in a column change p by the speed of the sides times ρ c, 8 MPa s/m over three.
    assert p[stage == "constant p"][-1] == pytest.approx(3e6, rel=0.1)
    # As many states as the scene says, at ends of stages, the last one among them.
    states = [state["stage"] for state in read_states(folder / "whole")]
    assert states == ["path", "path", "unload", "follow"]

    at = {stage["name"]: stage["step"] for stage in whole["stages"]}
    # One stop in each kind of stage; in the end with the file in its place, but not with another.
    cuts = [at["constant p"] + 30, at["load 2"] + 20, at["follow"] + 25]
    for number, cut in enumerate(cuts):
        run(folder, "parts", given, max_steps=cut, resume=number > 0)
    motion = folder / "motion.csv"
    text = COMM.bcast(motion.read_text() if COMM.rank == 0 else None)
    if COMM.rank == 0:
        motion.write_text(text + "3, 2e-3\n")
    COMM.Barrier()
    with pytest.raises(InputError, match='has changed, expected what stage "follow" of the run'):
        run(folder, "parts", given, resume=True)
    if COMM.rank == 0:
        motion.write_text(text)
    COMM.Barrier()
    parts = run(folder, "parts", given, resume=True)
    assert parts["num_steps"] == whole["num_steps"] and parts["stages"] == whole["stages"]
    assert arrays(folder / "parts") == arrays(folder / "whole")


def test_new_keys_are_read_as_they_are_written(tmp_path):
    path = tmp_path / "scene.toml"
    (tmp_path / "motion.csv").write_text(TABLE)
    path.write_text("""
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
name = "path"
p = "200 kPa"
eta = 0.5
[[stage]]
name = "load"
z = { speed = 0.1 }
undrained = true
until = { q = "50 kPa", pore_pressure = "99 kPa" }
repeat = 2
[[stage]]
follow = "motion.csv"
""")
    given = load_scene(path)
    assert [stage.name for stage in given.stages] == [
        "seating",
        "path",
        "load",
        "load 2",
        "stage 4",
    ]
    assert given.stages[4].follow == tmp_path / "motion.csv"
    path.write_text(scene_to_toml(given))
    assert load_scene(path) == given
    text = path.read_text().replace("undrained = true", "undrained = true\nxy = { speed = 0.0 }", 1)
    path.write_text(text)
    with pytest.raises(InputError, match=r"stage\[3\].undrained = true, expected an axis that is"):
        load_scene(path)
