"""Settings state default, unit, meaning and bounds once; checks and texts follow from that."""

import math
from dataclasses import dataclass

import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.units import REQUIRED, check_keys, keys_of, setting, to_si


@dataclass(frozen=True)
class Settings:
    """Some of each kind."""

    speed: float = setting(REQUIRED, "m/s", "of a wall", gt=0)
    share: float = setting(0.5, "-", "of the mass; 1: all", ge=0, le=1)
    rate: float | None = setting(None, "s^-1", "of damping", ge=0, expected="a rate >= 0")
    law: str = setting("flat", "", "how it goes on", allowed=lambda: ("flat", "slope"))
    table: tuple = setting((), ("-", "Pa"), "strain [-], stress [Pa]", shape=(-1, 2))
    plain: int = 3

    def __post_init__(self):
        check_keys(self)


def test_units_and_texts():
    keys = keys_of(Settings)
    assert list(keys) == ["speed", "share", "rate", "law", "table", "plain"]
    assert [key.unit for key in keys.values()] == ["m/s", "", "s^-1", "", ("", "Pa"), ""]
    assert keys["share"].text == "of the mass [-]; 1: all"
    assert keys["rate"].text == "of damping [1/s]"
    assert keys["table"].text == "strain [-], stress [Pa]" and keys["table"].units == ("", "Pa")
    assert keys["law"].text == "how it goes on" and keys["law"].choices == ("flat", "slope")
    assert keys["speed"].required and not keys["rate"].required and keys["plain"].default == 3
    assert keys["share"].bounds == {"minimum": 0, "maximum": 1}


@pytest.mark.parametrize(
    "values, message",
    [
        ({"speed": 0.0}, "speed = 0.0, expected > 0 m/s"),
        ({"speed": math.nan}, "speed = nan, expected a finite number"),
        ({"speed": math.inf}, "speed = inf, expected a finite number"),
        ({"share": 1.5}, "share = 1.5, expected 0 <= share <= 1"),
        ({"share": -0.1}, "share = -0.1, expected 0 <= share <= 1"),
        ({"rate": -1}, "rate = -1.0, expected a rate >= 0"),
        ({"law": "steep"}, 'law = "steep", expected "flat" or "slope"'),
    ],
)
def test_what_is_out_of_bounds_is_named(values, message):
    with pytest.raises(InputError) as error:
        Settings(**({"speed": 1.0} | values))
    assert str(error.value) == message


def test_bounds_that_belong_and_what_is_not_set_are_taken():
    assert Settings(speed=1e-9, share=1.0, rate=0.0).rate == 0.0
    assert Settings(speed=1.0, share=0.0).rate is None


@pytest.mark.parametrize(
    ("text", "unit", "number"),
    [
        ("2 kilopascals", "Pa", 2e3), ("2 bars", "Pa", 2e5), ("3 metres", "m", 3.0),
        ("3 ms", "s", 3e-3), ("3 s", "s", 3.0), ("5 kPas", "Pa", None), ("5 Hzs", "s^-1", None),
        ("5 mins", "s", None),
    ],
)  # fmt: skip
def test_names_of_units_have_a_plural_and_symbols_none(text, unit, number):
    """kPa s is no stress."""
    if number is not None:
        assert to_si(text, unit, "q") == pytest.approx(number, rel=1e-12)
        return
    with pytest.raises(InputError, match=f'q = "{text}", expected'):
        to_si(text, unit, "q")
