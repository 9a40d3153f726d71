"""Scene files: what is read is what is written."""

import dataclasses
import tomllib

import numpy as np
import pytest

from mufe_fenicsx.container import BOX
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.materials.rigid import Rigid
from mufe_fenicsx.materials.scatter import Scatter
from mufe_fenicsx.run.demo import demo_scene
from mufe_fenicsx.scene import Scene, image_path, load_scene, scene_to_toml
from mufe_fenicsx.scene.usual import unusual
from tests.scene.scene_files import FULL, SMALLEST, WITH_PAIRS, message_of, scene_file


@pytest.mark.parametrize("text", [SMALLEST, FULL, 'title = "sand \\"A\\" µm \\\\"\n' + SMALLEST])
def test_written_scene_is_the_scene_read(tmp_path, text):
    scene = load_scene(scene_file(tmp_path, text))
    written = scene_to_toml(scene)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    assert load_scene(scene_file(elsewhere, written)) == scene


def test_written_scene_states_every_default(tmp_path):
    written = scene_to_toml(load_scene(scene_file(tmp_path, SMALLEST)))
    tables = tomllib.loads(written)
    assert set(tables["walls"]) == set(BOX.walls)
    for field in dataclasses.fields(Scene):
        table, content = (
            tables.get(field.name),
            getattr(load_scene(tmp_path / "test.toml"), field.name),
        )
        if (
            field.name in ("title", "walls", "materials", "stages", "tools", "references")
            or content is None
        ):
            continue
        for inner in dataclasses.fields(content):
            assert inner.name in table or getattr(content, inner.name) is None


def test_grains_of_other_materials(tmp_path):
    """What a group leaves out is that of [material]; scatter depends on the label alone."""
    scene = load_scene(scene_file(tmp_path, FULL))
    materials = scene.materials_of([2, 9, 3, 5], range(10))
    other, rigid, soft, softer = materials
    assert type(other) is J2 and other.E == 100e9 and type(rigid) is Rigid and rigid.E == 100e9
    assert soft.E == softer.E == 1e9 and len({m.yield_stress for m in (soft, softer, other)}) == 3
    assert scene.materials_of([5], range(10)) == [softer]


@pytest.mark.parametrize(
    "text, words",
    [
        ("[materials.a]\nE = 1e9", "materials.a.labels is missing"),
        ("[materials.a]\nlabels = [1]\nnu = 0.7", "materials.a.nu = 0.7"),
        ("[materials.a]\nlabels = []", "materials.a.labels = []"),
        ("[materials.a]\nlabels = [1]\n[materials.b]\nlabels = [1]", "each label in one group"),
        ("[materials.a]\nlabels = [1]\nmodel = 'rigid'\n[solver]\ntime_step = 'element'",
         'solver.time_step = "element"'),
        ("[material.scatter]\nE = 2.0", "material.scatter.E = 2.0"),
        ("[materials.a]\nlabels = [1]\nmodel = 'elastic'\nscatter = {strength = 0.1}",
         "the material has no yield_stress"),
    ],
)  # fmt: skip
def test_what_other_materials_must_not_be(tmp_path, text, words):
    assert words in message_of(tmp_path, SMALLEST + text)


def test_a_group_names_grains_of_the_sample(tmp_path):
    scene = load_scene(scene_file(tmp_path, SMALLEST + "[materials.a]\nlabels = [7]"))
    with pytest.raises(InputError, match="has 7, expected a label of the sample, 1 to 3"):
        scene.materials_of([1, 2], [1, 2, 3])


@pytest.mark.parametrize("distribution", ["lognormal", "weibull"])
def test_scatter_has_mean_one_and_its_variation(distribution):
    scatter = Scatter(E=0.3, distribution=distribution, seed=1)
    material = Elastic(1.0, 0.2, 1.0)
    values = np.array([scatter.of(material, label).E for label in range(4000)])
    # Standard errors of 4000 draws: 0.3/63 of the mean, about 1.5 % of the variation.
    assert values.mean() == pytest.approx(1.0, abs=4 * 0.3 / 63)
    assert values.std() == pytest.approx(0.3, rel=0.06)


def test_units_and_paths_are_converted_at_the_door(tmp_path):
    """Decimal fractions keep their digits: "5 um" is the number 5e-06 itself."""
    scene = load_scene(scene_file(tmp_path, FULL))
    assert scene.image.voxel_size == 5e-6
    assert scene.mesh.size == 3e-5
    assert scene.oedometer.seating_stress == 20e3
    assert scene.oedometer.seating_speed == 0.5
    assert scene.solver.damping == 2000.0
    assert scene.walls["y_min"].velocity == -1e-3
    assert scene.image.crop == ((0, 50), (10, 60), (0, 400))
    assert scene.image.mask is None and not scene.image.invert
    assert scene.image.path == tmp_path / "scans" / "sand.raw"
    assert scene.sample.grains == tmp_path / "grains"


def test_a_byte_order_mark_is_no_part_of_a_scene(tmp_path):
    """Editors of Windows put one before the text."""
    path = tmp_path / "scene.toml"
    path.write_text(SMALLEST.lstrip(), encoding="utf-8-sig")
    assert load_scene(path).oedometer.speed == 2.0


def test_walls_that_state_no_friction_take_that_of_contact(tmp_path):
    text = FULL.replace("friction = 0.23", "friction = 0.23\nwall_friction = 0.05")
    scene = load_scene(scene_file(tmp_path, text))
    assert scene.walls["x_max"].friction == 0.3
    assert scene.walls["z_min"].friction == 0.05
    assert scene.walls["z_max"].friction == 0.05


def test_kinetic_friction_goes_with_the_friction_that_it_belongs_to(tmp_path):
    """A wall without a friction of its own takes both of contact; written, it is read again."""
    contact = "friction_kinetic = 0.2\nwall_friction = 0.1\nwall_friction_kinetic = 0.05"
    text = FULL.replace("friction = 0.23", "friction = 0.23\n" + contact).replace(
        "friction = 0.3\n", "friction = 0.3\nfriction_kinetic = 0.25\n"
    )
    scene = load_scene(scene_file(tmp_path, text))
    assert scene.contact.friction_kinetic == 0.2
    assert (scene.walls["x_max"].friction, scene.walls["x_max"].friction_kinetic) == (0.3, 0.25)
    assert (scene.walls["z_min"].friction, scene.walls["z_min"].friction_kinetic) == (0.1, 0.05)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    assert load_scene(scene_file(elsewhere, scene_to_toml(scene))) == scene


def test_friction_of_grains_is_that_of_the_pair_of_their_materials(tmp_path):
    """Of no pair, of grains in no group, and with hyphens in names."""
    text = WITH_PAIRS.replace("[materials.stones]", "[materials.soft-ones-stones]\nlabels = [7]\n"
                        "[materials.stones]")  # fmt: skip
    text += "soft-ones-stones-stones = 0.1\n"
    scene = load_scene(scene_file(tmp_path, text))
    friction = scene.friction_of(np.arange(1, 10))
    # Labels 1 and 2 are of [material], 3 of "soft ones", 7 of soft-ones-stones, 9 of stones.
    first, second = np.array([[1, 1, 3, 7, 9, 9], [2, 9, 9, 9, 9, 1]]) - 1
    found = friction.table(None, 9).coefficients[friction.rows(first, second)]
    none = (0.23, 0.23)
    assert found.tolist() == [list(c) for c in (none, (0.2, 0.2), (0.3, 0.25), (0.1, 0.1), none,
                                                (0.2, 0.2))]  # fmt: skip
    assert [friction.static(i, j) for i, j in zip(first, second, strict=True)] == [
        static for static, _ in found
    ]
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    assert load_scene(scene_file(elsewhere, scene_to_toml(scene))) == scene
    # Without grains of a material its pairs are of no effect.
    assert scene.friction_of(np.array([1, 2])).rows(np.array([0]), np.array([1])).size == 0


def test_scene_of_the_demonstration():
    """The material and the strain of Nadimi & Fonseca (2018)."""
    scene = load_scene(demo_scene())
    assert scene.material == J2(100e9, 0.15, 2650.0, ((0.0, 10e6), (0.05, 110e6)))
    assert scene.contact.friction == 0.23
    assert scene.oedometer.strain == 0.1
    assert scene.output.checkpoint == 300.0  # "5 min"
    assert all(wall.friction == 0 for wall in scene.walls.values())


def test_moduli_of_isotropic_elasticity():
    """E = 9KG/(3K + G), and uniaxial strain: M = E(1-ν)/((1+ν)(1-2ν)) = ρc²."""
    solid = Elastic(E=70e9, nu=0.2, rho=2500.0)
    K, G = solid.bulk_modulus, solid.shear_modulus
    M = 70e9 * 0.8 / (1.2 * 0.6)
    # Only round-off of a few operations.
    assert 9 * K * G / (3 * K + G) == pytest.approx(70e9, rel=1e-14)
    assert 2500.0 * solid.wave_speed**2 == pytest.approx(M, rel=1e-14)
    assert solid.contact_modulus == pytest.approx(70e9 / 0.96, rel=1e-14)


def test_packaged_image_is_found_without_importing_its_package(monkeypatch):
    import sys

    pytest.importorskip("spam", reason="the extra `demo` is not installed")
    for name in [name for name in sys.modules if name.split(".")[0] == "spam"]:
        monkeypatch.delitem(sys.modules, name)
    assert image_path("spam:snow").is_file()
    assert "spam" not in sys.modules


def test_packaged_image_that_is_not_installed(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(InputError, match="spam, which is not installed"):
        image_path("spam:snow")


def test_numbers_without_their_units_are_told(tmp_path):
    """All but those of the full scene were taken for pascals, kg/m³ and radians without a word."""
    assert unusual(load_scene(scene_file(tmp_path, FULL))) == []
    turn = '[container]\nshape = "cylinder"\n[loading]\nspeed = 1\n[[stage]]\nturn.angle = 90\n'
    text = SMALLEST[: SMALLEST.index("[oedometer]")] + "wall_friction = 0.3\n" + turn
    scene = load_scene(scene_file(tmp_path, text))
    scene = dataclasses.replace(scene, material=Elastic(70.0, 0.2, 2.65))
    assert [line.split(",")[0] for line in unusual(scene)] == [
        "material.E = 70 Pa", "material.rho = 2.65 kg/m³", "stages[1].turn.angle = 90 rad",
    ]  # fmt: skip
    assert unusual(scene)[0].endswith("usual is 10 kPa to 1500 GPa: has a unit been left out?")
