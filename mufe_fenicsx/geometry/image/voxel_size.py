"""The voxel size that a TIFF states in its metadata."""

import html
import json
import re

from ...errors import InputError

#: Voxels of all tomography lie between [m].
SMALLEST, LARGEST = 1e-10, 1.0

_PREFIXES = {"k": 1e3, "": 1.0, "d": 1e-1, "c": 1e-2, "m": 1e-3, "u": 1e-6, "n": 1e-9, "p": 1e-12}
_NAMES = ("kilo", "", "deci", "centi", "milli", "micro", "nano", "pico")
#: Metres a unit, by the names that ImageJ, OME and ITK's formats use; see `metres`.
UNITS = {
    **{f"{prefix}m": factor for prefix, factor in _PREFIXES.items()},
    **{
        f"{name}{metre}": factor
        for name, factor in zip(_NAMES, _PREFIXES.values(), strict=True)
        for metre in ("meter", "metre", "meters", "metres")
    },
    **dict.fromkeys(("micron", "microns"), 1e-6),
    **dict.fromkeys(("\N{LATIN CAPITAL LETTER A WITH RING ABOVE}", "angstrom", "angstroms"), 1e-10),
    **dict.fromkeys(("in", "inch", "inches"), 25.4e-3),
    **{"thou": 25.4e-6, "li": 25.4e-3 / 12, "pt": 25.4e-3 / 72, "ft": 0.3048, "yd": 0.9144},
}
#: Dots an inch of screens and printers, which programs write where nothing was measured.
OF_SCREENS = (1, 72, 96, 100, 150, 200, 300, 600)


def metres(unit):
    """Metres a unit, by its name in a file; None where it is no length.

    Two letters look like µ, and one like Å; ImageJ writes µ by its code, XML by its number.
    """
    text = html.unescape(str(unit)).strip()
    text = re.sub(r"\\u([0-9a-fA-F]{4})", lambda code: chr(int(code[1], 16)), text)
    text = text.replace("\N{MICRO SIGN}", "u").replace("\N{GREEK SMALL LETTER MU}", "u")
    text = text.replace("\N{ANGSTROM SIGN}", "\N{LATIN CAPITAL LETTER A WITH RING ABOVE}")
    return UNITS.get(text, UNITS.get(text.lower()) if len(text) > 2 else None)


def tiff_voxel_size(file):
    """Voxel size (z, y, x) [m] of an open TIFF: ours, ImageJ's or OME's.

    Args:
        file: `tifffile.TiffFile`.

    Returns:
        Three lengths; a text where what is stated is no length along each axis; None if nothing is.
    """
    own = own_voxel_size(file)
    if own is not None:
        return (own,) * 3
    if file.is_imagej:
        meta = file.imagej_metadata or {}
        x, y = (_pixels(file, name) for name in ("XResolution", "YResolution"))
        z = meta.get("spacing")
        # ImageJ writes the units of y and z where they are not that of x.
        units = [meta.get(name, meta.get("unit", "")) for name in ("zunit", "yunit", "unit")]
        return _lengths([z and abs(z), y and 1 / y, x and 1 / x], units)
    if file.is_ome:
        lengths, units = [], []
        for axis in "ZYX":
            size = re.search(rf'PhysicalSize{axis}=["\']([^"\']+)', file.ome_metadata)
            unit = re.search(rf'PhysicalSize{axis}Unit=["\']([^"\']+)', file.ome_metadata)
            lengths.append(size and float(size[1]))
            units.append(unit[1] if unit else "µm")
        return _lengths(lengths, units)
    tags = file.pages[0].tags
    unit = {2: "inch", 3: "cm"}.get(int(tags.valueof("ResolutionUnit", 2)))
    x, y = (_pixels(file, name) for name in ("XResolution", "YResolution"))
    if unit is None or not x or not y or round(x if unit == "inch" else 2.54 * x) in OF_SCREENS:
        return None
    return _lengths([None, 1 / y, 1 / x], [unit] * 3)


def _pixels(file, name):
    """Pixels a unit by a tag of the first page; None where it has none, or zero."""
    tags = file.pages[0].tags
    value = tags[name].value if name in tags else (0, 1)
    return value[0] / value[1] if 0 not in value else None


def _lengths(lengths, units):
    """Three lengths (z, y, x) [m], a text where one is missing or its unit unknown, or None."""
    factors = [metres(unit) for unit in units]
    if not any(lengths) or set(map(str, units)) == {""}:
        return None
    if None in factors or not all(lengths):
        words = [
            f"{n:.6g} {html.unescape(str(u))}".strip() if n else "nothing"
            for n, u in zip(lengths, units, strict=True)
        ]
        return "{} along z, {} along y, {} along x".format(*words)
    return tuple(n * f for n, f in zip(lengths, factors, strict=True))


def own_voxel_size(file):
    """The voxel size [m] in the description that `label_files.write_labels` writes, or None."""
    size = own_description(file).get("voxel_size")
    return float(size) if isinstance(size, int | float) and size > 0 else None


def own_description(file):
    """The dictionary that `label_files.write_labels` writes into an open TIFF; {} of others."""
    try:
        found = json.loads(file.pages[0].description)
    except (ValueError, AttributeError, TypeError):
        return {}
    return found if isinstance(found, dict) else {}


def known_voxel_size(given, stated, path):
    """The voxel size (z, y, x) [m]: the given one, a length or three, else the stated one.

    Raises:
        InputError: neither is known, or the stated one (a text, see `tiff_voxel_size`) is no three
            lengths.
    """
    size = stated if given is None else given
    if size is None or isinstance(size, str):
        how = "not stated" if size is None else f"stated as {size}"
        raise InputError(
            f"voxel_size of {path} is {how}, expected a length in metres, or three (z, y, x), by "
            "voxel_size or --voxel-size"
        )
    size = tuple(map(float, size)) if isinstance(size, tuple | list) else (float(size),) * 3
    if len(size) != 3 or not all(SMALLEST <= s <= LARGEST for s in size):
        raise InputError(
            f"voxel_size = {size} of {path}, expected lengths of {SMALLEST:g} to {LARGEST:g} m"
        )
    return size
