"""Whatever stands in a scene file: a scene, or one line that says what is wrong."""

import random
import time

import pytest

from mufe_fenicsx.cli.exit_status import LONGEST
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.scene import load_scene, scene_to_toml
from mufe_fenicsx.scene.catalogue import TABLES
from mufe_fenicsx.units import keys_of
from tests.scene.scene_files import FULL, SMALLEST, UNLOADED

STAGES = (
    UNLOADED
    + """
[loading]
speed = 2.0
[[stage]]
zero = true
z = { stress = "20 kPa" }
[[stage]]
z = { strain = 0.1 }
until = { time = 1e-3 }
"""
)
#: Values that some day stood where a number or a text should.
VALUES = [
    "1e308", "-1e308", "1e-300", "5e-324", "nan", "-inf", "inf", "0", "-1", "0.0", "-0.0", "true",
    "9" * 400, "9" * 5000, "0x" + "f" * 5000, "1_000", "1e400", "10000000000000000",
    '"1e99999999999999999999 m/s"', '"1e999999 Pa"', '"5 um"', '"5 kg"', '"5"', '"m"', '""',
    '"1 9**9**9**9"', '"1 m**9**9**9"', '"1 (9**9)**9"', '"1 m^99999"', '"1 kg*9^99^99"', '"5 %"',
    '"~nosuchuser/x"', '"~/x"', '"/dev/zero"', '"../x"', '"a\\u0000b"', '"' + "x" * 5000 + '"',
    '"\\u001b[31m"', '"𝔘 ü"', '"=1+1"', '"-ksp_view :x"', '"-pc_type \\"lu"',
    '"' + "9" * 3000 + '"',
    "[]", "[1]", "[[0, 1], [0, 1], [0, 1]]", "[[1, 0], [0, 1], [0, 1]]", "[0, 0, 0]",
    "[" * 40 + "]" * 40, "[" * 900 + "]" * 900, "[" + "1," * 3000 + "]", "{}", "{ a = 1 }",
    "{ stress = 1e308 }", "1979-05-27", "07:32:00", "[[0.0, 1e308]]", "[[0.0, 1e7], [0.0, 1e7]]",
    "[[0.0, nan]]", "[[1e300, 1e7]]",
    '[["a", "b"]]', "[1e99, 1e99, 1e99]", "[18446744073709551616]",
]  # fmt: skip
NAMES = ["x", "E", "é", '"a b"', '"a\\nb"', '"' + "k" * 3000 + '"', "a." * 50 + "b", "labels"]


def mutated(chance, text):
    """A scene with one to three things changed."""
    lines = text.strip().splitlines()
    for _ in range(chance.randint(1, 3)):
        at = chance.randrange(len(lines))
        key = lines[at].partition("=")[0].strip()
        what = chance.random()
        if what < 0.55 and "=" in lines[at]:
            lines[at] = f"{key} = {chance.choice(VALUES)}"
        elif what < 0.7:
            cls = chance.choice(list(TABLES.values()))
            table = next(name for name, other in TABLES.items() if other is cls)
            lines += [f"[{table}]"] if f"[{table}]" not in lines else []
            key = chance.choice(list(keys_of(cls)))
            place = lines.index(f"[{table}]") + 1
            lines.insert(place, f"{key} = {chance.choice(VALUES)}")
        elif what < 0.8:
            lines.insert(at, f"{chance.choice(NAMES)} = {chance.choice(VALUES)}")
        elif what < 0.87:
            lines.insert(at, f"[{chance.choice(NAMES)}]")
        elif what < 0.92:
            del lines[at]
            lines = lines or [""]
        elif what < 0.96:
            line = lines[at]
            cut = chance.randrange(len(line) + 1)
            lines[at] = line[:cut] + chance.choice(["\x00", "\x7f", '"', "'", "=", "[", "\\", "é"])
        else:
            lines.append(chance.choice(lines))
    return "\n".join(lines)


def try_scenes(path, chance, count):
    """Counts of scenes that were taken, and of those that were refused."""
    taken = refused = 0
    for number in range(count):
        text = mutated(chance, chance.choice([SMALLEST, FULL, STAGES]))
        path.write_bytes(text.encode("utf-8", "surrogateescape"))
        began = time.process_time()
        try:
            written = scene_to_toml(load_scene(path))
        except InputError as error:
            message = str(error)
            assert len(message.splitlines()) == 1, (number, text)
            assert (len(message) < LONGEST and "expected" in message) or "TOML" in message, message
            refused += 1
        except Exception as error:
            raise AssertionError(f"scene {number}: {error!r}\n{text[:3000]}") from error
        else:
            path.write_text(written, encoding="utf-8")
            assert scene_to_toml(load_scene(path)) == written
            taken += 1
        # Of the processor, whatever else it does.
        assert time.process_time() - began < 20, (number, text)
    return taken, refused


def test_mutated_scenes(tmp_path):
    taken, refused = try_scenes(tmp_path / "scene.toml", random.Random(40), 300)
    assert taken > 0 and refused > 150


@pytest.mark.slow
def test_three_thousand_mutated_scenes(tmp_path):
    taken, refused = try_scenes(tmp_path / "scene.toml", random.Random(41), 3000)
    assert taken > 30 and refused > 1500


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('E = 1e308', 'material.E = 1e+308, expected a stress such as "10 MPa", of 1e-06 to 1e+1'),
        ('rho = 1e-300', 'material.rho = 1e-300, expected a density such as "2.65 g/cm^3", of '),
        (f'E = {"9" * 400}', 'material.E = a number of 400 digits, expected a stress such as "10'),
        ('nu = 0.4999999', 'material.nu = 0.4999999, expected -0.99 to 0.4999'),
        ('speed = "1e99999999999999999999 m/s"', 'oedometer.speed = "1e99999999999999999999 m/s"'),
        ('[sample]\ngrains = "~nosuchuser/x"', 'sample.grains = "~nosuchuser/x", expected a path'),
        ('[sample]\ngrains = "a\\u0000b"', 'sample.grains = "a?b", expected a path'),
        ('[output]\nhistory = 1000000000000000', 'output.history = 1000000000000000, expected a w'),
        ('[solver]\ntime_step_factor = 5e-324', 'solver.time_step_factor = 5e-324, expected a nu'),
        ('[solver]\ntime_step_factor = 1e-6', 'solver.time_step_factor = 1e-06, expected 0.001 t'),
        ('[image]\nfile = "a.tif"\nupsample = 1e9', 'image.upsample = 1000000000.0, expected 0 < '),
        ('[image]\nfile = "a.tif"\nfilter_radius = 1e9', 'image.filter_radius = 1000000000.0, ex'),
        (f'[mesh]\nsize = {"[" * 300}{"]" * 300}', 'mesh.size = [[[[…]]]], expected a length such'),
    ],
)  # fmt: skip
def test_what_is_not_plausible_is_named_briefly(tmp_path, line, message):
    key = line.partition("=")[0].strip()
    lines = [old for old in SMALLEST.splitlines() if old.partition("=")[0].strip() != key]
    if line[0] == "[":
        lines.append(line)
    else:
        table = "[oedometer]" if key == "speed" else "[material]"
        lines.insert(lines.index(table) + 1, line)
    (tmp_path / "scene.toml").write_text("\n".join(lines))
    with pytest.raises(InputError) as refused:
        load_scene(tmp_path / "scene.toml")
    assert str(refused.value).startswith(message)
    assert len(str(refused.value)) < 200


def test_a_pipe_is_not_waited_for(tmp_path):
    import os

    os.mkfifo(tmp_path / "scene.toml")
    with pytest.raises(InputError, match=r"scene .* is no file"):
        load_scene(tmp_path / "scene.toml")


def test_bounds_stand_in_the_documentation():
    """The page lists them; nothing else does."""
    from pathlib import Path

    from mufe_fenicsx.units import PLAUSIBLE

    page = (Path(__file__).resolve().parents[2] / "docs" / "reference" / "files.md").read_text(
        encoding="utf-8"
    )
    for unit, (least, largest) in PLAUSIBLE.items():
        assert f"| {unit or 'none'} | {least:g} | {largest:g} |" in page
