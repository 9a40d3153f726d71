"""Texts from the command line, checked and turned into settings, numbers and names."""

from dataclasses import fields

from ..errors import InputError, nearest_name


def merged_settings(cls, in_scene, **options):
    """Settings of the scene, where there is one, with those of the options put over them."""
    from ..scene.values import build

    given = {key: value for key, value in options.items() if value is not None}
    if in_scene is not None:
        names = [field.name for field in fields(cls)]
        stated = {key: getattr(in_scene, key) for key in names}
        given = {**{key: value for key, value in stated.items() if value is not None}, **given}
    return build(cls, given, _option_name)


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


def place(text):
    """A place [m] of a text "x,y,z", numbers in m or with units: "0.1 mm,0.2 mm,50 um"."""
    from ..units import to_si

    parts = [number_or_text(part.strip()) for part in text.split(",")]
    if len(parts) != 3:
        raise InputError(f'--point "{text}", expected three coordinates x,y,z')
    return [to_si(part, "m", "--point") for part in parts]


def number_or_text(text):
    """A number where the text is one; else the text, or None."""
    try:
        return float(text) if text is not None else None
    except ValueError:
        return text


def parameters(changes):
    """{"k": v} from texts "k=v"; a value that is a number becomes one."""
    result = {}
    for setting in changes or []:
        key, equals, value = setting.partition("=")
        if not (key.strip() and equals and value.strip()):
            raise InputError(f'--set "{setting}", expected name=value')
        result[key.strip()] = number_or_text(value.strip())
    return result


def known_names(names, cases):
    """The names, all of them in ``cases``; all cases where there are none."""
    for name in names or []:
        if name not in cases:
            raise InputError(f"case {name} is not known, expected {nearest_name(name, cases)}")
    return list(names or cases)
