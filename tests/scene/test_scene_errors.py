"""Nothing unusable gets into a scene: one line names the value and what was expected."""

import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.scene import load_scene
from mufe_fenicsx.synthetic.starter_scenes import KINDS
from mufe_fenicsx.units import to_si
from tests.scene.scene_files import FULL, WITH_PAIRS, message_of

#: What is replaced in FULL: by what, and what the one line has to say.
BAD = {
    'size = "0.03 mm"': [
        ('size = "5 kg"', 'mesh.size = "5 kg", expected a length'),
        ("size = true", "mesh.size = true, expected a length"),
        ('size = "0.03"', 'mesh.size = "0.03", expected a length'),
        ('size = "5 umm"', 'mesh.size = "5 umm", expected a length'),
        ('size = "__import__ m"', "mesh.size ="),
        ("size = 0.0", "mesh.size = 0.0, expected"),
        ("size = nan", "mesh.size = nan, expected a length"),
        ("szie = 1e-5", "mesh.szie = 1e-05 is not a known key, expected mesh.size"),
        ("", "mesh.size is missing, expected a length"),
    ],
    "processes = 2": [
        ("processes = 2.5", "mesh.processes = 2.5, expected a whole number"),
        ("friction = 2", "mesh.friction = 2 is not a known key, expected contact.fri"),
        ("zz = 2", "mesh.zz = 2 is not a known key, expected one of size, smallest_size, sizing, "),
        ("angle = 20", "mesh.angle = 20 is no key any more, expected none: mesh.sizing = "),
    ],
    "[mesh]": [
        ("[mehs]", "mehs = a table is not a known key, expected mesh"),
        ("[bladder]", "bladder = a table is not a known key, expected one of title, accuracy, "
         "modulus, gravity, image, "),
    ],
    "[walls.y_min]": [
        ("[walls.ymin]", "walls.ymin = a table is not a known key, expected walls.y_m"),
        ("[walls.z_max]", "walls.z_max.velocity = -0.001, expected none"),
    ],
    "speed = 0.1\n": [("", "walls.x_max.speed is missing")],
    'velocity = "-1 mm/s"': [
        ("stress = -5.0\nspeed = 1", "walls.y_min.stress = -5.0, expected > 0 Pa"),
        ("stress = 0.0\nspeed = 1", "walls.y_min.stress = 0.0, expected > 0 Pa (compression)"),
        ('velocity = "10 km/s"', "walls.y_min.velocity = 10000 m/s, expected less than the"),
    ],
    "nu = 0.15": [
        ("nu = 0.5", "material.nu = 0.5, expected -1 < nu < 0.5"),
        ("nu = -1", "material.nu = -1.0, expected -1 < nu < 0.5"),
        ("", "material.nu is missing, expected a number"),
        ('nu = "0.15 m"', 'material.nu = "0.15 m", expected a number'),
    ],
    "E = 100e9": [
        ("E = 0", "material.E = 0.0, expected a stiffness > 0"),
        ("E = -1.0", "material.E = -1.0, expected a stiffness > 0"),
        ("E = inf", "material.E = inf, expected a stress"),
        ("E = 100.0", "material.yield_stress[0][1] = 1e+07 Pa, expected at most E = 100"),
    ],
    "rho = 2650": [("rho = 0", "material.rho = 0.0, expected a density > 0")],
    "[0.05, 110e6]": [
        ("[0.0, 110e6]", "material.yield_stress[1][0] = 0.0, expected a plastic strain"),
        ("[0.05, 1e6]", "material.yield_stress[1][1] = 1000000.0, expected a stress >="),
        ('[0.05, "1 m"]', 'material.yield_stress[1][1] = "1 m", expected a stress'),
        ("[0.05]", "material.yield_stress[1] = [0.05], expected a list of 2"),
    ],
    "[[0.0, 10e6], [0.05, 110e6]]": [
        ("[]", "material.yield_stress = (), expected points"),
        ("[[0.01, 10e6]]", "material.yield_stress[0][0] = 0.01, expect"),
        ("[[0.0, 0.0]]", "material.yield_stress[0][1] = 0.0, expected"),
    ],
    "[material]": [
        ('[material]\nbeyond = "flt"', 'beyond = "flt", expected "flat" or "slope"'),
        ('[material]\nmodel = "j3"', 'material.model = "j3", expected "j2" or "elastic"'),
        ('[material]\nmodel = "elastic"', "material.yield_stress is given, expected none"),
    ],
    "friction = 0.23": [
        ("friction = -0.1", "contact.friction = -0.1, expected >= 0"),
        ("friction = 0.2\ncompliance = 0", "contact.compliance = 0.0, expected > 0"),
        ("friction = 0.2\nfriction_kinetic = 0.3", "contact.friction_kinetic = 0.3, "
         "expected 0 <= friction_kinetic <= friction = 0.2"),
        ("friction = [0.2]", "contact.friction = [0.2], expected a number"),
        ("friction = 0.2\npairs = 3", "contact.pairs = 3, expected a table [cont"),
    ],
    "friction = 0.3\n": [
        ("friction_kinetic = 0.3\n", "walls.x_max.friction_kinetic = 0.3, "
         "expected a friction beside it"),
    ],
    "strain = 0.1": [
        ("strain = 1.0", "oedometer.strain = 1.0, expected 0 < strain < 1"),
        ("strain = 0", "oedometer.strain = 0.0, expected 0 < strain < 1"),
    ],
    "speed = 2": [
        ("speed = -2", "oedometer.speed = -2.0, expected > 0"),
        ('speed = "2 m"', 'oedometer.speed = "2 m", expected a speed'),
    ],
    "ramp = 0.01": [("ramp = 0.2", "oedometer.ramp = 0.2, expected 0 <= ramp <= strain = 0.1")],
    'element = "p1"': [
        ('element = "composite"', 'solver.element = "composite", expected "averaged" or "p1"'),
        ("time_step_factor = 1", "solver.time_step_factor = 1.0, expected 0 < time"),
    ],
    'damping = "2 ms^-1"': [("damping = -1", "solver.damping = -1.0, expected >= 0")],
    "separation = false": [
        ("separation = 0", "sample.separation = 0, expected true or false"),
        ('close_gaps = "2 Pa"', 'sample.close_gaps = "2 Pa", expected a length'),
        ("separation = false\nclose_gaps_over_h = 0.2", "sample.close_gaps_over_h = 0.2, "
         "expected 0 where separation = false"),
    ],
    'grains = "grains"': [("grains = 5", "sample.grains = 5, expected a path")],
    "shape = [200, 300, 400]": [
        ("shape = [200, 300]", "image.shape = [200, 300], expected a list"),
    ],
    "[0, 50]": [
        ("[50, 5]", "image.crop = 50 to 5 along z, expected a first voxel below the last"),
        ("[0, 5.5]", "image.crop[0][1] = 5.5, expected a whole number"),
    ],
    "[200, 300, 400]": [("[200, 0, 400]", "image.shape = (200, 0, 400), expected three numbers")],
    '"<u2"': [('"O"', "image.dtype = 'O', expected a NumPy type of numbers")],
    "threshold = 1234": [
        ("upsample = 1e9", "image.upsample = 1000000000.0, expected 0 < upsample <= 100"),
        ("filter_radius = 1e9", "image.filter_radius = 1000000000.0, expected 0"),
        ("mask = true", "image.mask = true, expected a number"),
        ('mask = "../m.tif"', 'image.mask = "../m.tif" leaves the folder'),
        ('threshold = "otto"', "image.threshold = 'otto', expected"),
    ],
    'dtype = "<u2"': [("dtype = 2", "image.dtype = 2, expected a text")],
    "[solver]": [("[output]\nfields = 1\n[solver]", "output.fields = 1, expected >= 2")],
    "[contact]\nfriction = 0.23": [("", "[contact] is missing")],
}  # fmt: skip

#: The same in WITH_PAIRS.
BAD_PAIRS = {
    "stones-material": [
        ("stone-material", "contact.pairs.stone-material names no pair of materials, expected "
         "NAME-NAME, each one of material, soft ones, stones"),
        ("stones", "contact.pairs.stones names no pair of materials, expected"),
    ],
    "stones-material = 0.2": [
        ("stones-material = 0.2\nmaterial-stones = 0.2", "contact.pairs.material-stones is given, "
         "expected one entry for a pair: stones-material is"),
        ("stones-material = -1", "pairs.stones-material = -1.0, expected >= 0"),
        ('stones-material = "rough"', 'material = "rough", expected a number'),
        ("stones-material = 1e9", "stones-material = 1000000000.0, expected 0"),
    ],
    "friction_kinetic = 0.25": [
        ("friction_kinetic = 0.35", "contact.pairs.soft ones-stones.friction_kinetic = 0.35, "
         "expected 0 <= friction_kinetic <="),
        ("kinetic = 0.25", "stones.kinetic = 0.25 is not a known key, expec"),
    ],
    "{ friction = 0.3, friction_kinetic = 0.25 }": [("{}", "soft ones-stones.friction is missing")],
    "[materials.stones]": [
        ("[materials.material]", "materials.material is given, expected another"),
    ],
    '"soft ones-stones" = { friction = 0.3, friction_kinetic = 0.25 }': [
        ("a-b-c = 0.2\n[materials.a]\nlabels = [20]\n[materials.b-c]\nlabels = [21]\n"
         "[materials.a-b]\nlabels = [22]\n[materials.c]\nlabels = [23]\n",
         "contact.pairs.a-b-c is a and b-c or a-b and c, expected names of materials that leave"),
    ],
}  # fmt: skip

CASES = [
    (text, old, new, said)
    for text, bad in ((FULL, BAD), (WITH_PAIRS, BAD_PAIRS))
    for old, changes in bad.items()
    for new, said in changes
]


@pytest.mark.parametrize("text, old, new, said", CASES, ids=[case[3][:40] for case in CASES])
def test_unusable_value_is_named_in_one_line(tmp_path, text, old, new, said):
    assert old in text
    assert said in message_of(tmp_path, text.replace(old, new, 1))


def test_a_value_where_a_table_is_expected(tmp_path):
    text = "contact = 3\n" + FULL.replace("[contact]\nfriction = 0.23", "")
    assert "contact = 3, expected a table [contact]" in message_of(tmp_path, text)


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


@pytest.mark.parametrize(
    ("key", "text", "found"),
    [
        ("oedometer.speed", "3 mm/s", lambda s: s.oedometer.speed == 3e-3),
        ("oedometer.speed", "3", lambda s: s.oedometer.speed == 3),
        ("output.fields", "7", lambda s: s.output.fields == 7),
        ("sample.separation", "true", lambda s: s.sample.separation),
        ("materials.stones.labels", "[1, 2]", lambda s: s.materials["stones"].labels == (1, 2)),
        ("tool.1.speed", "2 m/s", "tool = a table"),
        ("contact.frictoin", "0.3", "contact.frictoin"),
        ("contact.friction.a", "0.3", "contact.friction is no table of the scene"),
        ("contact.friction", "-1", "contact.friction = -1"),
    ],
)
def test_a_scene_is_changed_by_dotted_keys(tmp_path, key, text, found):
    """As its file would be: the same values, and the same refusals."""
    path = tmp_path / "test.toml"
    path.write_text(FULL, encoding="utf-8")
    if callable(found):
        assert found(load_scene(path, {key: text}))
    else:
        with pytest.raises(InputError, match=found):
            load_scene(path, {key: text})


def test_stages_are_changed_by_their_numbers(tmp_path):
    path = tmp_path / "test.toml"
    path.write_text(KINDS["triaxial"][0], encoding="utf-8")
    assert load_scene(path, {"stage.2.hold": "3 us"}).stages[1].hold == 3e-6
    with pytest.raises(InputError, match=r"stage.0 is no table .*, expected stage.1 to stage.3"):
        load_scene(path, {"stage.0.hold": "3 us"})
    for key, said in (("stage.9.hold", "stage.9 is no table"), ("stage.hold", "stage.1.hold")):
        with pytest.raises(InputError, match=said):
            load_scene(path, {key: "1 s"})
