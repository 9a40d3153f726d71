"""Walls that shear a sample: a box that tilts, platens that turn, a hollow cylinder."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.contact.walls import Wall, rotation_of
from mufe_fenicsx.container import BOX, HOLLOW_CYLINDER, Bounds
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.geometry.bodies.tube import tube
from mufe_fenicsx.loading.shearing import Torsion
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.output.history import read_history
from mufe_fenicsx.run.from_bodies import build
from mufe_fenicsx.scene import (
    Contact,
    ContainerSettings,
    Output,
    Scene,
    Solver,
    load_scene,
    scene_to_toml,
)
from mufe_fenicsx.scene import Wall as SceneWall
from mufe_fenicsx.scene.shearing import Shear, Turn
from mufe_fenicsx.scene.stages import Axis, Loading, Stage, Until
from tests.bodies import RADIUS
from tests.loading.staged import SIZE, STUFF, loading_of, run, shared_folder, steps

PRESSURE = 2e6
G = STUFF.shear_modulus


def within(container, bounds, body, program, bonded=(), friction=0.0, speed=0.05, **options):
    """An elastic body in a container, and its loading by stages."""
    walls = [
        Wall(s.name, s.point, s.normal, radius=s.radius, friction=friction,
             bonded=s.name in bonded)
        for s in container.surfaces(bounds)
    ]  # fmt: skip
    sim = build(
        MPI.COMM_SELF, [body], STUFF, bounds.low, bounds.high, axes="", walls=walls, **options
    )
    return sim, loading_of(sim, program, speed)


def march(sim, loading, watch=None):
    """To the end; what can end a stage at the end of each, by its name."""
    ends = {}
    for _ in steps(sim, loading):
        if watch:
            watch()
        ends[loading.stage] = loading.row(sim.wall_forces())
    return ends


# --- simple shear -------------------------------------------------------------------------


def test_an_elastic_cube_in_simple_shear():
    """τ = G γ, with the same stress on the walls that tilt along, which are as rough."""
    gamma = 5e-4
    bounds = Bounds(np.zeros(3), np.full(3, SIZE), np.zeros(2), 0.0)
    program = (
        Stage("press", zero=True, xyz=Axis(stress=PRESSURE), hold=5e-6),
        Stage("shear", shear=Shear(xz=gamma)),
        Stage("back", shear=Shear(rate=-40.0), until=Until(gamma_xz=0.0)),
    )
    sim, loading = within(
        BOX, bounds, box((SIZE,) * 3, (2, 2, 2)), program, compliance=0.02, damping=1e6
    )
    shape, beside, mises = [], [], []

    def watch():
        walls = sim.walls
        if loading.stage == "press":
            return
        # Pressed between smooth walls. Then those are rough that move as a sheared solid.
        for rough in (walls.friction, walls.friction_kinetic):
            rough[[0, 1, 4, 5]] = 1e3
        # The edges of the walls that tilt stay on those of the platens.
        edge = walls.point[5] - walls.point[4]
        shape.extend(np.abs(walls.normal[:2] @ edge) / SIZE)
        if loading.stage == "shear":
            beside[:] = [0.5 * (walls.force[0, 2] - walls.force[1, 2]) / SIZE**2]
            stress = loading.apparatus.gauges.axis_stress(sim.wall_forces())
            mises[:] = [loading.apparatus.gauges.values(stress, 0.0)["deviator"]]
            tensor = np.diag(stress) + loading.apparatus.shearing.stress * np.eye(3)[[2, 1, 0]] * [
                1,
                0,
                1,
            ]
            tensor -= np.trace(tensor) / 3.0 * np.eye(3)
            mises.append(np.sqrt(1.5 * (tensor**2).sum()))

    ends = march(sim, loading, watch)
    end = ends["shear"]
    assert end["gamma_xz"] == pytest.approx(gamma, abs=1e-9)
    assert ends["press"]["shear_xz"] == pytest.approx(0.0, abs=1e-3 * PRESSURE)
    # Contact acts within facets, and leaves edges free: `mufe verify sheared-box` has finer ones.
    assert 0.88 < end["shear_xz"] / (G * gamma) < 1.0
    assert beside[0] == pytest.approx(end["shear_xz"], rel=0.02)
    assert mises[0] == pytest.approx(mises[1], rel=1e-12) and mises[0] > end["shear_xz"]
    assert end["stress_x"] == pytest.approx(PRESSURE, rel=0.01)
    assert max(shape) < 1e-9  # but for a step that changes as it begins
    # Back by `until`: walls brake over the ramp beyond it, and nothing is lost.
    assert abs(ends["back"]["gamma_xz"]) < 0.2 * gamma
    assert abs(ends["back"]["shear_xz"] - G * ends["back"]["gamma_xz"]) < 0.03 * G * gamma
    energies = sim.energies()
    assert abs(energies["residual"]) < 2e-3 * energies["work"]


def test_shear_and_strain_come_along_one_line():
    """Height and shear of a smooth cube that is pressed as its box tilts, back as well."""
    bounds = Bounds(np.zeros(3), np.full(3, SIZE), np.zeros(2), 0.0)
    program = (
        Stage("there", z=Axis(strain=0.01), shear=Shear(xz=0.05)),
        Stage("slow", z=Axis(strain=0.02), shear=Shear(xz=0.0, rate=100.0)),
    )
    sim, loading = within(BOX, bounds, box((SIZE,) * 3, (1, 1, 1)), program, speed=5.0)
    path = {"there": [], "slow": []}
    rig = loading.apparatus
    march(sim, loading, lambda: path[loading.stage].append(
        (sim.state.t, rig.gauges.strains[2], rig.shearing.value)))  # fmt: skip
    for stage, first, last in (("there", (0, 0), (0.01, 0.05)), ("slow", (0.01, 0.05), (0.02, 0))):
        t, strain, gamma = np.array(path[stage]).T
        parts = [(v - a) / (b - a) for v, a, b in zip((strain, gamma), first, last, strict=True)]
        assert np.abs(parts[0] - parts[1]).max() < 1e-5
        assert [strain[-1], gamma[-1]] == pytest.approx(last, abs=1e-9)
    rate = np.abs(np.diff(gamma) / np.diff(t))
    assert np.quantile(rate, 0.95) == pytest.approx(100.0, rel=0.01)


def test_pressures_of_a_tilted_box():
    """A smooth box tilted by 45 degrees: N cos θ/(Ly H) is the pressure, Lx Ly H the volume."""
    bounds = Bounds(np.zeros(3), np.array([3.0, 2.0, 1.0]) * SIZE, np.zeros(2), 0.0)
    body = box(tuple(bounds.high), (1, 1, 1))
    sim, loading = within(BOX, bounds, body, (Stage(shear=Shear(xz=1.0)),))
    walls = sim.walls
    walls.angular_velocity[:2, 1], walls.velocity[5, 0] = 0.25 * math.pi, SIZE
    walls.move(1.0)
    assert loading.apparatus.shearing.value == pytest.approx(1.0, rel=1e-14)
    p, lengths = 3.0, loading.apparatus.gauges.lengths
    assert lengths == pytest.approx(bounds.high)
    # The same pressure on all faces: forces are p times their areas, those of tilted ones √2 Ly H.
    area = SIZE**2 * np.array([2 * math.sqrt(2), 2 * math.sqrt(2), 3, 3, 6, 6])
    assert loading.apparatus.gauges.wall_stress(p * area) == pytest.approx(np.full(6, p))
    # Nothing sums up on a closed surface: the tilted planes are where the sample ends.
    assert p * area @ walls.normal == pytest.approx(np.zeros(3), abs=1e-12 * area.max())
    assert BOX.volume(lengths) == pytest.approx(6 * SIZE**3)


# --- turning platens ----------------------------------------------------------------------

RADII, HEIGHT = (SIZE, 0.6 * SIZE), SIZE


def tube_between(program, away=0.0, bonded=(), friction=0.0, **options):
    """An elastic tube between platens and two walls beside, these ``away`` from it."""
    body = tube(*RADII, HEIGHT, (24, 2, 4))
    outer, inner = RADII[0] * (1 + away), RADII[1] * (1 - away)
    bounds = Bounds(body[0].min(axis=0), body[0].max(axis=0), np.zeros(2), outer, inner)
    return within(HOLLOW_CYLINDER, bounds, body, program, bonded, friction, **options), body


def polar_moment(body):
    """∫ρ² dA of the section that a body of tetrahedra has [m⁴]."""
    x = body[0][body[1]][:, :, :2]
    volume = np.abs(np.linalg.det(body[0][body[1]][:, 1:] - body[0][body[1]][:, :1])) / 6
    # Of ρ², linear functions squared: (Σ xi² + (Σ xi)²)/20 over the four nodes.
    square = ((x**2).sum(axis=(1, 2)) + (x.sum(axis=1) ** 2).sum(axis=1)) / 20
    return float(volume @ square) / HEIGHT


@pytest.mark.parametrize("wall", ["top", "bottom"])
def test_torsion_of_an_elastic_tube(wall):
    """T = G J φ/H, whichever platen turns; τ and γ of the means do its work."""
    angle = 2e-3
    (sim, loading), body = tube_between(
        (Stage("turn", turn=Turn(angle=angle, wall=wall), hold=2e-5),), 0.02, ("z_min", "z_max"),
        damping=1e5,
    )  # fmt: skip
    end = march(sim, loading)["turn"]
    assert end["twist"] == pytest.approx(angle, abs=1e-9)
    # Four tetrahedra along the height are stiffer by some percent: `mufe verify tube-in-torsion`.
    assert end["torque"] == pytest.approx(G * polar_moment(body) * angle / HEIGHT, rel=0.06)
    outer, inner = RADII[0] * 1.02, RADII[1] * 0.98
    volume = math.pi * (outer**2 - inner**2) * HEIGHT
    work = volume * end["shear_tz"] * end["gamma_tz"]
    assert work == pytest.approx(end["torque"] * angle, rel=1e-12)
    assert end["gamma_tz"] == pytest.approx(angle * 0.5 * (outer + inner) / HEIGHT, rel=0.03)
    energies = sim.energies()
    assert energies["elastic"] == pytest.approx(0.5 * end["torque"] * angle, rel=0.01)
    assert abs(energies["residual"]) < 1e-3 * energies["work"]


def test_whole_turns_are_counted():
    """Rotations say an angle but for whole turns: two and a half, and back by one."""
    walls = SimpleNamespace(rotation=np.tile(np.eye(3), (4, 1, 1)))
    torsion = Torsion(SimpleNamespace(walls=walls), HOLLOW_CYLINDER, 1.0)
    for turn, total in ((0.1, 50 * 0.1 * math.pi), (-0.1, 30 * 0.1 * math.pi)):
        for _ in range(50 if turn > 0 else 20):
            walls.rotation[3] = rotation_of(np.array([0, 0, turn * math.pi])) @ walls.rotation[3]
            torsion.value  # noqa: B018  asked for in every step
        assert torsion.value == torsion.value == pytest.approx(total)


def test_stresses_on_the_axes_of_a_hollow_cylinder():
    """Lamé's tube under pressures in and out and an axial stress: diameters and height change."""
    outer, inner, axial = 8e5, 5e5, 6e5
    program = (
        Stage("start", zero=True, oiz=Axis(stress=2e5)),
        Stage("load", o=Axis(stress=outer), i=Axis(stress=inner), z=Axis(stress=axial)),
    )
    (sim, loading), _ = tube_between(program)
    end = march(sim, loading)["load"]
    po, pi, change = outer - 2e5, inner - 2e5, axial - 2e5
    (R, r), nu, E = RADII, STUFF.nu, STUFF.E
    # σr = A - B/ρ², σθ = A + B/ρ² of Lamé, compression positive; εθ is that of the diameters.
    A = (po * R**2 - pi * r**2) / (R**2 - r**2)
    B = (po - pi) * R**2 * r**2 / (R**2 - r**2)
    hoop = [((A + B / q**2) - nu * (A - B / q**2) - nu * change) / E for q in RADII]
    layer = float(np.average(sim.contact.points.layer, weights=sim.contact.points.area))
    soft = layer * np.array([po / R, -pi / r, 2 * change / HEIGHT])
    expected = np.array([*hoop, (change - 2 * nu * A) / E]) + soft
    strain = np.array([end[f"strain_{a}"] for a in "oiz"])
    assert strain == pytest.approx(expected, abs=0.03 * np.abs(expected).max())
    assert [end[f"stress_{a}"] for a in "oiz"] == pytest.approx([outer, inner, axial], rel=0.01)
    # The means of Hight, Gens & Symes are those of Lamé's stresses over the volume.
    assert end["stress_r"] + end["stress_t"] == pytest.approx(2 * (A + 2e5), rel=0.01)
    energies = sim.energies()
    assert abs(energies["residual"]) < 1e-3 * energies["work"]


# --- in a run -----------------------------------------------------------------------------


def scene(**changes):
    """Grains pressed, then sheared at the volume that they have."""
    stages = (
        Stage(zero=True, xyz=Axis(strain=0.01)),
        Stage("shear", xyz=Axis(speed=0.0), shear=Shear(xz=0.02)),
        Stage("back", shear=Shear(rate=-2e3), until=Until(gamma_xz=0.015)),
    )
    values = {
        "material": Elastic(100e9, 0.15, 2650.0),
        "contact": Contact(friction=0.4),
        "walls": {name: SceneWall(friction=0.5) for name in ("z_min", "z_max")},
        "solver": Solver(damping=2e5),
        "loading": Loading(speed=3.0, ramp=1e-3, tolerance=0.05),
        "stages": stages,
        "output": Output(fields=4, history=31),
    }
    return Scene(**(values | changes))


@pytest.fixture
def folder(tmp_path_factory):
    return shared_folder(tmp_path_factory, grains=((1, 1, 2), 0.9), ring=((2, 2, 1), 1.0))


def test_a_sheared_run_resumes_to_the_same_history(folder):
    whole = run(folder, "whole", scene())
    history = read_history(folder / "whole" / "history.csv")
    names = [stage["name"] for stage in whole["stages"]]
    assert whole["finished"] and names == ["seating", "shear", "back"]
    sheared = history["stage"] == "shear"
    assert history["gamma_xz"][sheared][-1] == pytest.approx(0.02, abs=1e-9)
    assert np.ptp(history["height"][sheared]) < 1e-12 * history["height"][-1]
    assert np.ptp(history["shear_xz"][sheared]) > 0 and history["gamma_xz"][-1] < 0.02
    assert whole["stages"][2]["gamma_xz"] == pytest.approx(0.02, abs=1e-9)
    run(folder, "parts", scene(), max_steps=whole["stages"][2]["step"] - 60)
    assert run(folder, "parts", scene(), resume=True)["num_steps"] == whole["num_steps"]
    parts = read_history(folder / "parts" / "history.csv")
    for name in ("gamma_xz", "shear_xz", "stress_x", "work"):
        assert np.array_equal(parts[name], history[name])


def test_a_ring_of_grains_is_turned_in_a_hollow_cylinder(folder):
    """Four balls between two walls and two platens: the hole is the largest, and turns count."""
    program = (
        Stage(zero=True, z=Axis(strain=0.03)),
        Stage("turn", z=Axis(speed=0.0), turn=Turn(angle=0.02, wall="bottom")),
        Stage("on", turn=Turn(rate=-5e3), until=Until(twist=0.01)),
    )
    given = scene(stages=program, container=ContainerSettings("hollow cylinder"))
    whole = run(folder, "ring-run", given, "ring")
    kept, history = whole["container"], read_history(folder / "ring-run" / "history.csv")
    assert kept["radius"] == pytest.approx(RADIUS * (1 + math.sqrt(2)), rel=0.02)
    # Facets with edges as long as the radius lie up to an eighth of it within the ball.
    assert 0.0 <= kept["inner_radius"] / RADIUS - (math.sqrt(2) - 1) < 1 / 8
    turned = history["stage"] == "turn"
    assert history["twist"][turned][-1] == pytest.approx(0.02, abs=1e-9)
    D, d, T = (history[name] for name in ("diameter", "inner_diameter", "torque"))
    assert history["shear_tz"] == pytest.approx(12 * T / (np.pi * (D**3 - d**3)))
    assert np.abs(T[turned]).max() > 0
    assert history["diameter"][0] - history["inner_diameter"][0] == pytest.approx(
        2 * (kept["radius"] - kept["inner_radius"])
    )
    run(folder, "ring-parts", given, "ring", max_steps=whole["stages"][1]["step"] + 40)
    assert run(folder, "ring-parts", given, "ring", resume=True)["num_steps"] == whole["num_steps"]


# --- the tables ---------------------------------------------------------------------------

TEXT = """
[material]
model = "elastic"
E = 1e9
nu = 0.2
rho = 2650
[contact]
friction = 0.3
wall_friction = 0.5
[loading]
speed = "10 mm/s"
[container]
shape = "box"
[[stage]]
zero = true
xyz = { stress = "100 kPa" }
[[stage]]
name = "shear"
z = { stress = "1 MPa" }
shear = { xz = 0.1, rate = "20 s^-1" }
until = { gamma_xz = 0.05, shear_xz = "3 MPa" }
"""
ROUND = (
    TEXT.replace('shape = "box"', 'shape = "hollow cylinder"\ninner_radius = "1 mm"')
    .replace("xyz", "oiz")
    .replace('{ xz = 0.1, rate = "20 s^-1" }', '{ angle = "90 deg", wall = "bottom" }')
    .replace("shear = ", "turn = ")
    .replace("{ gamma_xz = 0.05, shear_xz", "{ gamma_tz = 0.05, stress_t")
)


def test_tables_are_read_as_they_are_written(tmp_path):
    path = tmp_path / "scene.toml"
    for text in (TEXT, ROUND):
        path.write_text(text)
        given = load_scene(path)
        path.write_text(scene_to_toml(given))
        assert load_scene(path) == given
    assert given.stages[1].turn == Turn(angle=math.pi / 2, wall="bottom")
    assert given.container.inner_radius == 1e-3


@pytest.mark.parametrize(
    "text, old, new, words",
    [
        (TEXT, '"box"', '"cylinder"', "stage[1] leads x, expected r or z"),
        (TEXT, "shear = {", "turn = { angle = 1 }\nshear = {",
         'stage[2].turn is given, expected a cylinder with container.shape = "box"'),
        (ROUND, "turn = {", "shear = { xz = 1 }\nturn = {",
         "stage[2].shear is given, expected a box"),
        (TEXT, "wall_friction = 0.5", "", "walls.z_min is smooth, expected friction > 0 of walls"),
        (TEXT, "wall_friction = 0.5", "wall_friction = 0.5\n[walls.x_min]\nmirror = true\n",
         "walls.x_min.mirror = true, expected false: it tilts"),
        (TEXT, "xz = 0.1, rate = ", "rate = -1, xz = 0.1 } #",
         "stage[2].shear.rate = -1.0, expected > 0 beside xz"),
        (TEXT, 'xz = 0.1, rate = "20 s^-1"', "", "stage[2].shear.xz is missing, expected it or a"),
        (TEXT, "gamma_xz = 0.05", "torque = 1",
         "stage[2].until.torque is given, expected a stage with turn"),
        (ROUND, "stress_t", "stress_x", "stage[2].until.stress_x is given, expected none with"),
        (ROUND, "90 deg", "90 m", 'stage[2].turn.angle = "90 m", expected an angle such as'),
        (ROUND, '"bottom"', '"side"', 'stage[2].turn.wall = "side", expected "top" or "bottom"'),
        (ROUND, "oiz = {", 'oiz = { walls = "min",', 'stage[1].o.walls = "min", expected "both"'),
        (ROUND, "hollow cylinder", "cylinder", "container.inner_radius = 0.001, expected none of"),
        (ROUND, 'inner_radius = "1 mm"', 'inner_radius = 1\nradius = 1',
         "container.inner_radius = 1.0, expected less than radius = 1"),
    ],
)  # fmt: skip
def test_what_shearing_must_not_be(tmp_path, text, old, new, words):
    path = tmp_path / "scene.toml"
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        load_scene(path)
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_grains_in_the_hole_are_refused(folder):
    given = scene(
        container=ContainerSettings("hollow cylinder", inner_radius=RADIUS),
        stages=(Stage(zero=True, z=Axis(stress=2e6)),),
    )
    with pytest.raises(InputError, match=r"inner_radius = .*, expected more than 0 and at most"):
        run(folder, "none", given, "ring")
