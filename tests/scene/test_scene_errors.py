"""Nothing unusable gets into a scene: one line names the value and what was expected."""

import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.scene import load_scene
from mufe_fenicsx.units import to_si
from tests.scene.scene_files import FULL, WITH_PAIRS, message_of, scene_file

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
    ("E = 100e9", "E = 100.0", "material.yield_stress[0][1] = 1e+07 Pa, expected at most E = 100"),
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


def test_numbers_beyond_floats():
    with pytest.raises(InputError, match="finite"):
        to_si(10**400, "", "n")
    with pytest.raises(InputError, match="finite"):
        to_si("1e999 m", "m", "x")


def test_a_default_that_does_not_fit_is_called_so(tmp_path):
    text = FULL.replace("ramp = 0.01\n", "").replace("strain = 0.1\n", "strain = 0.004\n")
    said = "oedometer.ramp = 0.005 (the default), expected 0 <= ramp <= strain = 0.004"
    assert said in message_of(tmp_path, text)
