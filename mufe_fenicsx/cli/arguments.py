"""Texts from the command line, checked and turned into settings, numbers and names."""

import functools
import inspect
import re
from typing import Annotated

import typer

from ..errors import InputError, nearest_name
from ..units import QUANTITIES, keys_of, to_si

#: A part in percent.
_PERCENT = re.compile(r"\s*[+-]?(\d+\.?\d*|\.\d+)\s*%\s*")


def with_settings(cls):
    """Let a command take each setting of a class as an option.

    The command gets them by name as ``given``, None where an option is left out; the options stand
    where this parameter does.
    """

    def decorate(command):
        @functools.wraps(command)
        def run(**values):
            given = {name: _read(key, values.pop(name)) for name, key in keys_of(cls).items()}
            return command(**values, given=given)

        own = inspect.signature(command)
        options = [own.parameters["given"].replace(name=key.name, annotation=_option(key))
                   for key in keys_of(cls).values()]  # fmt: skip
        parameters = []
        for name, parameter in own.parameters.items():
            parameters += options if name == "given" else [parameter]
        run.__signature__ = own.replace(parameters=parameters)
        run.__annotations__ = {each.name: each.annotation for each in parameters}
        return run

    return decorate


def _option(key):
    """Type of the option of a key, with its name and help."""
    name = "--" + key.name.replace("_", "-")
    text = _help(key, name)
    if bool in key.kinds:
        return Annotated[bool | None, typer.Option(f"{name}/--{key.off}", help=text)]
    kind = int if key.kinds == (int,) else str
    return Annotated[kind | None, typer.Option(name, metavar=key.form or None, help=text)]


def _help(key, name):
    """What a key means as a sentence, with an example of its unit and its default."""
    meaning, _, notes = key.meaning.partition(";")
    if key.unit:
        example = QUANTITIES[key.unit][1]
        meaning += f', such as "{",".join([example] * (len(key.form.split(",")) or 1))}"'
    elif key.symbol not in ("", "-"):
        meaning += f", in {key.symbol}"
    parts = [meaning[0].upper() + meaning[1:], *([notes.strip()] if notes else [])]
    if isinstance(key.default, bool):
        parts.append(f"default: {name}" if key.default else f"default: --{key.off}")
    elif isinstance(key.default, float):
        parts.append(f"default: {key.default:g} {key.unit}".rstrip())
    elif isinstance(key.default, str | int):
        parts.append(f"default: {key.default}")
    return "; ".join(parts).replace("None:", "default:") + "."


def _read(key, text):
    """What the text of an option says, for a key: a number, a list, or the text as it is."""
    if not isinstance(text, str):  # a whole number, a flag, or nothing
        return text
    if len(key.shape) == 2:
        return crop_ranges(text)
    if key.shape and not key.unit:
        return whole_numbers("--" + key.name.replace("_", "-"), text, key.form)
    return lengths(text) if key.shape else number_or_text(text) if float in key.kinds else text


def merged_settings(cls, in_scene, given):
    """Settings of the scene, where there is one, with those of the options put over them."""
    from ..scene.values import build

    stated = {} if in_scene is None else {name: getattr(in_scene, name) for name in keys_of(cls)}
    stated |= {name: value for name, value in given.items() if value is not None}
    stated = {name: value for name, value in stated.items() if value is not None}
    return build(cls, stated, _option_name)


def _option_name(text):
    """A message about "voxel_size = 0" as one about "--voxel-size = 0"."""
    key, space, rest = text.partition(" ")
    return "--" + key.replace("_", "-") + space + rest


def whole_numbers(name, text, form):
    """Numbers of a text like "1,2,3"."""
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise InputError(f'{name} = "{text}", expected whole numbers {form}') from None


def crop_ranges(text):
    """[[z0, z1], [y0, y1], [x0, x1]] of "z0:z1,y0:y1,x0:x1"."""
    try:
        return [[int(end) for end in part.split(":")] for part in text.split(",")]
    except ValueError:
        raise InputError(f'--crop = "{text}", expected z0:z1,y0:y1,x0:x1') from None


def lengths(text):
    """A number or text, or a list of them from a text with commas: "5 um,5 um,10 um"."""
    if text is None or "," not in text:
        return number_or_text(text)
    return [number_or_text(part.strip()) for part in text.split(",")]


def voxel_edges(text):
    """Edge of voxels [m], or three (z, y, x), of a text such as "5 um"; None where that is None."""
    found = lengths(text)
    if isinstance(found, list):
        return tuple(to_si(part, "m", "--voxel-size") for part in found)
    return None if found is None else to_si(found, "m", "--voxel-size")


def place(text):
    """A place [m] of a text "x,y,z", numbers in m or with units: "0.1 mm,0.2 mm,50 um"."""
    parts = [number_or_text(part.strip()) for part in text.split(",")]
    if len(parts) != 3:
        raise InputError(f'--point "{text}", expected three coordinates x,y,z')
    return [to_si(part, "m", "--point") for part in parts]


def number_or_text(text):
    """A number where the text is one, "10 %" is 0.1; else the text, or None."""
    try:
        return float(text) if text is not None else None
    except ValueError:
        return to_si(text, "", "number") if _PERCENT.fullmatch(text) else text


def ratio(name, text):
    """A number without a unit, or a part in percent, of an option; None where it is left out."""
    return None if text is None else to_si(number_or_text(text), "", name)


def parameters(changes):
    """{"k": v} from texts "k=v"; a value that is a number becomes one."""
    return {key: number_or_text(text) for key, text in stated_texts(changes).items()}


def stated_texts(changes):
    """{"k": "v"} from texts "k=v"."""
    result = {}
    for setting in changes or []:
        key, equals, value = setting.partition("=")
        if not (key.strip() and equals and value.strip()):
            raise InputError(f'--set "{setting}", expected name=value')
        result[key.strip()] = value.strip()
    return result


def known_names(names, cases):
    """The names, all of them in ``cases``; all cases where there are none."""
    for name in names or []:
        if name not in cases:
            raise InputError(f"case {name} is not known, expected {nearest_name(name, cases)}")
    return list(names or cases)
