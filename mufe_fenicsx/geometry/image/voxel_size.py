"""The voxel size that a TIFF states in its metadata."""

import json
import re

from ...errors import InputError

#: Voxels of all tomography lie between [m].
SMALLEST, LARGEST = 1e-10, 1.0

#: Metres a unit, by the names that ImageJ and OME use.
UNITS = {
    **{"m": 1.0, "cm": 1e-2, "mm": 1e-3, "nm": 1e-9},
    # Two letters look like µ; ImageJ writes one of them by its code.
    **dict.fromkeys(("um", "\N{MICRO SIGN}m", "\N{GREEK SMALL LETTER MU}m"), 1e-6),
    **dict.fromkeys(("micron", "microns", "\\u00B5m", "\\u00b5m"), 1e-6),
}


def tiff_voxel_size(file):
    """Voxel size (z, y, x) [m] of an open TIFF: ours, ImageJ's or OME's; None if none is stated.

    Args:
        file: `tifffile.TiffFile`.
    """
    own = own_voxel_size(file)
    if own is not None:
        return (own,) * 3
    if file.is_imagej:
        meta = file.imagej_metadata or {}
        unit = UNITS.get(str(meta.get("unit", "")).strip())
        tags = file.pages[0].tags
        if unit is None or "XResolution" not in tags or "YResolution" not in tags:
            return None
        x, y = (tags[name].value for name in ("XResolution", "YResolution"))
        if 0 in (*x, *y) or not meta.get("spacing"):
            return None
        return float(meta["spacing"]) * unit, y[1] / y[0] * unit, x[1] / x[0] * unit
    if file.is_ome:
        found = []
        for axis in "ZYX":
            size = re.search(rf'PhysicalSize{axis}="([^"]+)"', file.ome_metadata)
            unit = re.search(rf'PhysicalSize{axis}Unit="([^"]+)"', file.ome_metadata)
            unit = UNITS.get(unit[1] if unit else "µm")
            if size is None or unit is None:
                return None
            found.append(float(size[1]) * unit)
        return tuple(found)
    return None


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
        InputError: neither is known, or the stated one is no three lengths.
    """
    size = stated if given is None else given
    if size is None:
        raise InputError(
            f"voxel_size of {path} is not stated, expected a length in metres, or three (z, y, x)"
        )
    size = tuple(map(float, size)) if isinstance(size, tuple | list) else (float(size),) * 3
    if len(size) != 3 or not all(SMALLEST <= s <= LARGEST for s in size):
        raise InputError(
            f"voxel_size = {size} of {path}, expected lengths of {SMALLEST:g} to {LARGEST:g} m"
        )
    return size
