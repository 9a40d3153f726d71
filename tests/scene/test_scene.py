"""Scene files: what is read is what is written, and nothing unusable gets in."""

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
from mufe_fenicsx.units import to_si

SMALLEST = """
[material]
E = 100e9
nu = 0.15
rho = 2650
yield_stress = [[0.0, 10e6], [0.05, 110e6]]
[contact]
friction = 0.23
[oedometer]
strain = 0.1
speed = 2
"""

FULL = (
    SMALLEST
    + """
ramp = 0.01
seating_stress = "20 kPa"
seating_speed = "50 cm/s"
[image]
file = "scans/sand.raw"
voxel_size = "5 um"
shape = [200, 300, 400]
dtype = "<u2"
crop = [[0, 50], [10, 60], [0, 400]]
threshold = 1234
[mesh]
size = "0.03 mm"
processes = 2
[sample]
grains = "grains"
separation = false
[solver]
element = "p1"
damping = "2 ms^-1"
[walls.x_max]
stress = "100 kPa"
speed = 0.1
friction = 0.3
[walls.y_min]
velocity = "-1 mm/s"
[material.scatter]
strength = 0.2
distribution = "weibull"
seed = 3
[materials."soft ones"]
labels = [3, 5]
E = "1 GPa"
[materials.stones]
labels = [9]
model = "rigid"
"""
)

WITH_PAIRS = (
    FULL
    + """
[contact.pairs]
stones-material = 0.2
"soft ones-stones" = { friction = 0.3, friction_kinetic = 0.25 }
"""
)


def scene_file(folder, text):
    path = folder / "test.toml"
    path.write_text(text, encoding="utf-8")
    return path


def message_of(folder, text):
    with pytest.raises(InputError) as caught:
        load_scene(scene_file(folder, text))
    message = str(caught.value)
    assert "\n" not in message
    return message


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
        if field.name in ("title", "walls", "materials", "stages", "tools") or content is None:
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


# What is replaced in FULL, by what, and what the one line has to say.
BAD = [
    ('size = "0.03 mm"', 'size = "5 kg"', 'mesh.size = "5 kg", expected a length'),
    ('size = "0.03 mm"', "size = true", "mesh.size = true, expected a length"),
    ('size = "0.03 mm"', 'size = "0.03"', 'mesh.size = "0.03", expected a length'),
    ('size = "0.03 mm"', 'size = "5 umm"', 'mesh.size = "5 umm", expected a length'),
    ('size = "0.03 mm"', 'size = "__import__ m"', "mesh.size ="),
    ('size = "0.03 mm"', "size = 0.0", "mesh.size = 0.0, expected"),
    ('size = "0.03 mm"', "size = nan", "mesh.size = nan, expected a length"),
    ('size = "0.03 mm"', "szie = 1e-5", "mesh.szie = 1e-05 is not a known key, expected mesh.size"),
    ('size = "0.03 mm"', "", "mesh.size is missing, expected a length"),
    ("processes = 2", "processes = 2.5", "mesh.processes = 2.5, expected a whole number"),
    ("processes = 2", "friction = 2", "mesh.friction = 2 is not a known key, expected contact.fri"),
    ("[mesh]", "[mehs]", "mehs = a table is not a known key, expected mesh"),
    (
        "[mesh]",
        "[bladder]",
        "bladder = a table is not a known key, expected one of title, accuracy, gravity, image, ",
    ),
    (
        "processes = 2",
        "zz = 2",
        "mesh.zz = 2 is not a known key, expected one of size, smallest_size, sizing, ",
    ),
    (
        "[walls.y_min]",
        "[walls.ymin]",
        "walls.ymin = a table is not a known key, expected walls.y_m",
    ),
    ("[walls.y_min]", "[walls.z_max]", "walls.z_max.velocity = -0.001, expected none"),
    ("speed = 0.1\n", "", "walls.x_max.speed is missing"),
    (
        'velocity = "-1 mm/s"',
        "stress = -5.0\nspeed = 1",
        "walls.y_min.stress = -5.0, expected >= 0",
    ),
    ("nu = 0.15", "nu = 0.5", "material.nu = 0.5, expected -1 < nu < 0.5"),
    ("nu = 0.15", "nu = -1", "material.nu = -1.0, expected -1 < nu < 0.5"),
    ("nu = 0.15", "", "material.nu is missing, expected a number"),
    ("nu = 0.15", 'nu = "0.15 m"', 'material.nu = "0.15 m", expected a number'),
    ("E = 100e9", "E = 0", "material.E = 0.0, expected a stiffness > 0"),
    ("E = 100e9", "E = -1.0", "material.E = -1.0, expected a stiffness > 0"),
    ("E = 100e9", "E = inf", "material.E = inf, expected a stress"),
    ("rho = 2650", "rho = 0", "material.rho = 0.0, expected a density > 0"),
    (
        "[0.05, 110e6]",
        "[0.0, 110e6]",
        "material.yield_stress[1][0] = 0.0, expected a plastic strain",
    ),
    (
        "[0.05, 110e6]",
        "[0.05, 1e6]",
        "material.yield_stress[1][1] = 1000000.0, expected a stress >=",
    ),
    ("[0.05, 110e6]", '[0.05, "1 m"]', 'material.yield_stress[1][1] = "1 m", expected a stress'),
    ("[0.05, 110e6]", "[0.05]", "material.yield_stress[1] = [0.05], expected a list of 2"),
    ("[[0.0, 10e6], [0.05, 110e6]]", "[]", "material.yield_stress = (), expected points"),
    (
        "[[0.0, 10e6], [0.05, 110e6]]",
        "[[0.01, 10e6]]",
        "material.yield_stress[0][0] = 0.01, expect",
    ),
    ("[[0.0, 10e6], [0.05, 110e6]]", "[[0.0, 0.0]]", "material.yield_stress[0][1] = 0.0, expected"),
    ("[material]", '[material]\nbeyond = "flt"', 'beyond = "flt", expected "flat" or "slope"'),
    ("[material]", '[material]\nmodel = "j3"', 'material.model = "j3", expected "j2" or "elastic"'),
    (
        "[material]",
        '[material]\nmodel = "elastic"',
        "material.yield_stress is given, expected none",
    ),
    ("friction = 0.23", "friction = -0.1", "contact.friction = -0.1, expected >= 0"),
    ("friction = 0.23", "friction = 0.2\ncompliance = 0", "contact.compliance = 0.0, expected > 0"),
    (
        "friction = 0.23",
        "friction = 0.2\nfriction_kinetic = 0.3",
        "contact.friction_kinetic = 0.3, expected 0 <= friction_kinetic <= friction = 0.2",
    ),
    (
        "friction = 0.3\n",
        "friction_kinetic = 0.3\n",
        "walls.x_max.friction_kinetic = 0.3, expected a friction beside it",
    ),
    ("friction = 0.23", "friction = [0.2]", "contact.friction = [0.2], expected a number"),
    ("friction = 0.23", "friction = 0.2\npairs = 3", "contact.pairs = 3, expected a table [cont"),
    ("strain = 0.1", "strain = 1.0", "oedometer.strain = 1.0, expected 0 < strain < 1"),
    ("strain = 0.1", "strain = 0", "oedometer.strain = 0.0, expected 0 < strain < 1"),
    ("speed = 2", "speed = -2", "oedometer.speed = -2.0, expected > 0"),
    ("speed = 2", 'speed = "2 m"', 'oedometer.speed = "2 m", expected a speed'),
    ("ramp = 0.01", "ramp = 0.2", "oedometer.ramp = 0.2, expected 0 <= ramp <= strain = 0.1"),
    (
        'element = "p1"',
        'element = "p2"',
        'solver.element = "p2", expected "averaged" or "p1" or "composite"',
    ),
    ('element = "p1"', "time_step_factor = 1", "solver.time_step_factor = 1.0, expected 0 < time"),
    ('damping = "2 ms^-1"', "damping = -1", "solver.damping = -1.0, expected >= 0"),
    ("separation = false", "separation = 0", "sample.separation = 0, expected true or false"),
    ("separation = false", 'close_gaps = "2 Pa"', 'sample.close_gaps = "2 Pa", expected a length'),
    (
        "separation = false",
        "separation = false\nclose_gaps_over_h = 0.2",
        "sample.close_gaps_over_h = 0.2, expected 0 where separation = false",
    ),
    ('grains = "grains"', "grains = 5", "sample.grains = 5, expected a path"),
    ("shape = [200, 300, 400]", "shape = [200, 300]", "image.shape = [200, 300], expected a list"),
    ("[0, 50]", "[50, 5]", "image.crop = 50 to 5 along z, expected a first voxel below the last"),
    ("[200, 300, 400]", "[200, 0, 400]", "image.shape = (200, 0, 400), expected three numbers"),
    ('"<u2"', '"O"', "image.dtype = 'O', expected a NumPy type of numbers"),
    (
        "threshold = 1234",
        "upsample = 1e9",
        "image.upsample = 1000000000.0, expected 0 < upsample <= 100",
    ),
    ("threshold = 1234", "filter_radius = 1e9", "image.filter_radius = 1000000000.0, expected 0"),
    ("threshold = 1234", "mask = true", "image.mask = true, expected a number"),
    ("threshold = 1234", 'mask = "../m.tif"', 'image.mask = "../m.tif" leaves the folder'),
    ("[0, 50]", "[0, 5.5]", "image.crop[0][1] = 5.5, expected a whole number"),
    ("threshold = 1234", 'threshold = "otto"', "image.threshold = 'otto', expected"),
    ('dtype = "<u2"', "dtype = 2", "image.dtype = 2, expected a text"),
    ("[solver]", "[output]\nfields = 1\n[solver]", "output.fields = 1, expected >= 2"),
    ("[contact]\nfriction = 0.23", "", "[contact] is missing"),
    ("[contact]\nfriction = 0.23", "contact = 3", "contact.friction"),
]


BAD_PAIRS = [
    (
        "stones-material",
        "stone-material",
        "contact.pairs.stone-material names no pair of materials, expected NAME-NAME, each one of "
        "material, soft ones, stones",
    ),
    ("stones-material", "stones", "contact.pairs.stones names no pair of materials, expected"),
    (
        "stones-material = 0.2",
        "stones-material = 0.2\nmaterial-stones = 0.2",
        "contact.pairs.material-stones is given, expected one entry for a pair: stones-material is",
    ),
    (
        "stones-material = 0.2",
        "stones-material = -1",
        "pairs.stones-material = -1.0, expected >= 0",
    ),
    ("stones-material = 0.2", 'stones-material = "rough"', 'material = "rough", expected a number'),
    (
        "stones-material = 0.2",
        "stones-material = 1e9",
        "stones-material = 1000000000.0, expected 0",
    ),
    (
        "friction_kinetic = 0.25",
        "friction_kinetic = 0.35",
        "contact.pairs.soft ones-stones.friction_kinetic = 0.35, expected 0 <= friction_kinetic <=",
    ),
    (
        "friction_kinetic = 0.25",
        "kinetic = 0.25",
        "stones.kinetic = 0.25 is not a known key, expec",
    ),
    ("{ friction = 0.3, friction_kinetic = 0.25 }", "{}", "soft ones-stones.friction is missing"),
    ("[materials.stones]", "[materials.material]", "materials.material is given, expected another"),
    (
        '"soft ones-stones" = { friction = 0.3, friction_kinetic = 0.25 }',
        "a-b-c = 0.2\n"
        + "".join(
            f"[materials.{n}]\nlabels = [{k}]\n"
            for k, n in enumerate(("a", "b-c", "a-b", "c"), start=20)
        ),
        "contact.pairs.a-b-c is a and b-c or a-b and c, expected names of materials that leave",
    ),
]


@pytest.mark.parametrize("old, new, said", BAD_PAIRS)
def test_unusable_pair_of_materials_is_named_in_one_line(tmp_path, old, new, said):
    assert WITH_PAIRS.count(old) == 1
    with pytest.raises(InputError) as error:
        load_scene(scene_file(tmp_path, WITH_PAIRS.replace(old, new)))
    assert said in str(error.value) and len(str(error.value).splitlines()) == 1


@pytest.mark.parametrize("old, new, said", BAD, ids=[case[2][:40] for case in BAD])
def test_unusable_value_is_named_in_one_line(tmp_path, old, new, said):
    assert old in FULL
    if new == "contact = 3":
        text = new + "\n" + FULL.replace(old, "")
        said = "contact = 3, expected a table [contact]"
    else:
        text = FULL.replace(old, new, 1)
    assert said in message_of(tmp_path, text)


@pytest.mark.parametrize(
    "content, said",
    [
        (b"[material\n", "is not valid TOML"),
        (b"\xff\xfe", "is not UTF-8"),
        (b"", "[material] is mi"),
    ],
)
def test_file_that_is_no_scene(tmp_path, content, said):
    path = tmp_path / "test.toml"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        load_scene(path)
    assert said in str(caught.value) and str(path) in str(caught.value)


def test_missing_scene_and_folder_instead_of_scene(tmp_path):
    for path in (tmp_path / "none.toml", tmp_path):
        with pytest.raises(InputError, match="expected a TOML file"):
            load_scene(path)


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


def test_numbers_beyond_floats():
    with pytest.raises(InputError, match="finite"):
        to_si(10**400, "", "n")
    with pytest.raises(InputError, match="finite"):
        to_si("1e999 m", "m", "x")


def test_a_default_that_does_not_fit_is_called_so(tmp_path):
    text = FULL.replace("ramp = 0.01\n", "").replace("strain = 0.1\n", "strain = 0.004\n")
    said = "oedometer.ramp = 0.005 (the default), expected 0 <= ramp <= strain = 0.004"
    assert said in message_of(tmp_path, text)
