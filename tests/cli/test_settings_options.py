"""Options of `mufe segment` and `mufe mesh` are the settings of their classes, each one of them."""

import typing

import pytest
import typer.main

from mufe_fenicsx.cli.arguments import merged_settings, parameters, ratio
from mufe_fenicsx.cli.main import app
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.settings import MeshSettings, SegmentSettings
from mufe_fenicsx.synthetic.rigid_packing.settings import PackSettings
from mufe_fenicsx.units import keys_of

COMMANDS = {"segment": SegmentSettings, "mesh": MeshSettings}


def options(command):
    """Options of a command by name of their parameter."""
    return {each.name: each for each in typer.main.get_command(app).commands[command].params}


@pytest.mark.parametrize("command", COMMANDS)
def test_each_setting_is_an_option(command):
    found = options(command)
    for name, key in keys_of(COMMANDS[command]).items():
        option = found[name]
        assert option.opts == ["--" + name.replace("_", "-")]
        assert option.secondary_opts == (["--" + key.off] if bool in key.kinds else [])
        first = key.meaning.partition(";")[0]
        assert option.help.startswith(first[0].upper() + first[1:])
        # A unit that needs writing has an example, any other is named.
        assert key.unit == "" or "such as" in option.help
        assert key.unit or key.symbol in ("", "-") or f"in {key.symbol}" in option.help


def test_help_tells_defaults():
    found = {name: option.help for name, option in options("mesh").items()}
    assert found["size"] == 'Wanted length of edges, at most, such as "5 um".'
    assert found["time_limit"].endswith("default: 120 s.")
    assert found["keep_volume"].endswith("default: --keep-volume.")
    assert found["conforming"].endswith("default: --apart.")
    assert found["contact_reach"].endswith("default: that size.")


@pytest.fixture
def given(monkeypatch):
    """What a command makes of its options: a function of the command and its arguments."""

    def parsed(command, *arguments):
        found = {}
        name = "mufe_fenicsx.cli.grains.merged_settings"
        monkeypatch.setattr(name, lambda cls, scene, given: found.update(given) or 1 / 0)
        with pytest.raises(ZeroDivisionError):
            app([command, *arguments], standalone_mode=False)
        return {key: value for key, value in found.items() if value is not None}

    return parsed


def test_options_are_read_by_the_type_of_their_setting(given, tmp_path):
    common = ("-o", str(tmp_path / "out"), "--voxel-size", "5 um,5 um,10 um", "--shape", "4,5,6")
    found = given("segment", "a.raw", *common, "--crop", "0:1,2:3,4:5", "--mask", "3.5",
                  "--threshold", "otsu", "--upsample", "2", "--min-grain-voxels", "7",
                  "--keep-pores", "--invert", "--dtype", "2")  # fmt: skip
    assert found == {
        "voxel_size": ["5 um", "5 um", "10 um"], "shape": [4, 5, 6],
        "crop": [[0, 1], [2, 3], [4, 5]], "mask": 3.5, "threshold": "otsu", "upsample": 2.0,
        "min_grain_voxels": 7, "fill_pores": False, "invert": True, "dtype": "2",
    }  # fmt: skip
    assert [type(number) for number in found["shape"]] == [int] * 3
    found = given("mesh", "a.raw", *common, "--size", "30 um", "--keep-cavities")
    assert found["size"] == "30 um" and found["fill_cavities"] is False


def test_what_is_given_comes_before_the_scene():
    scene = MeshSettings(3e-5, growth=0.7, voxel_size=1e-6)
    found = merged_settings(MeshSettings, scene, {"size": "20 um", "growth": None})
    assert (found.size, found.growth, found.voxel_size) == (2e-5, 0.7, 1e-6)
    with pytest.raises(InputError, match=r"^--smallest-size = "):
        merged_settings(MeshSettings, scene, {"smallest_size": "40 um"})


@pytest.mark.parametrize("text", ["0.1", "10%", "10 %", " 1e-1"])
def test_a_part_may_be_given_in_percent(text):
    """As an option, as a change of a case and as a setting: one parser reads all of them."""
    assert ratio("--accuracy", text) == pytest.approx(0.1, rel=1e-15)
    assert parameters([f"nu={text}"]) == {"nu": ratio("nu", text)}
    assert merged_settings(PackSettings, None, {"friction": text.strip()}).friction == 0.1


def test_options_read_as_numbers_have_units_of_their_own():
    """They know no percent: what is a part is read by `ratio`."""
    found, groups = set(), [app]
    while groups:
        group = groups.pop()
        groups += [each.typer_instance for each in group.registered_groups]
        for command in group.registered_commands:
            hints = typing.get_type_hints(command.callback)
            found |= {name for name, hint in hints.items() if hint in (float, float | None)}
    assert found == {"minutes", "interval", "chain_angle", "penalty", "nu"}  # no part: Poisson's


def test_a_part_that_is_none_is_refused_in_a_line():
    with pytest.raises(InputError, match=r'^--accuracy = "ten", expected a number$'):
        ratio("--accuracy", "ten")
