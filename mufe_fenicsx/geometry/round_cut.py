"""The cylinder that cuts the grains of labels: where it stands, and what is told of it."""

import numpy as np

from ..errors import InputError
from .image.cylinder import Cylinder
from .image.label_files import stated_cylinder
from .measure import area_on_cylinder


def cylinder_of(path, settings, shape, voxel_size):
    """The `Cylinder` that cuts the grains of labels [m], or None.

    Raises:
        InputError: It is not within the image, or grains share their facets.
    """
    stated = stated_cylinder(path)
    given = settings.cylinder_middle, settings.cylinder_radius
    if stated is None and given == (None, None):
        return None
    sides = [n * voxel_size for n in shape[1:]]
    y, x = (side / 2 for side in sides)
    if settings.cylinder_middle is not None:
        x, y = settings.cylinder_middle
    elif stated is not None:
        x, y = stated["x"], stated["y"]
    room = min(x, y, sides[1] - x, sides[0] - y)
    if stated is not None:
        room = stated["radius"] - float(np.hypot(x - stated["x"], y - stated["y"]))
    radius = room if settings.cylinder_radius is None else settings.cylinder_radius
    if not 0 < radius <= room * (1 + 1e-9):
        raise InputError(
            f"cylinder_radius = {radius:g} m about (x, y) = ({x:g}, {y:g}) m, expected > 0 and at "
            f"most {room:g} m, within the labels {path}"
        )
    if given == (None, None) and not stated["cut"]:
        return None
    if settings.conforming:
        raise InputError(
            "conforming = true with a cylinder that cuts grains, expected false: only faces of the "
            "image cut grains that share their facets"
        )
    return Cylinder(float(x), float(y), float(radius))


def place_of(cylinder):
    """Where a `Cylinder` stands, and its radius [m], as a file of labels states them."""
    return {name: float(getattr(cylinder, name)) for name in ("x", "y", "radius")}


def numbers_of(cylinder):
    """The same for a summary."""
    return {f"cylinder_{name}_m": value for name, value in place_of(cylinder).items()}


def faces_on(cylinder, meshes, height):
    """Part of a cylinder's side of that height [m] that is faces of grains."""
    x, y, radius = place_of(cylinder).values()
    area = sum(area_on_cylinder(mesh.points, mesh.cells, (x, y, radius)) for mesh in meshes)
    return float(area / (2 * np.pi * radius * height))
