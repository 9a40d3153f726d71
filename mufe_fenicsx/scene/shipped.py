"""Meshes of grains that come with the program: `sample.grains = "meshes:twelve_grains"`."""

from pathlib import Path

from ..errors import InputError, nearest_name, shown

#: Begin of the name of such a mesh.
SHIPPED = "meshes:"


def shipped_meshes() -> dict[str, Path]:
    """Their folders by name: of the installed package, or of the source tree."""
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "meshes", package.parent / "meshes"):
        if files := sorted(folder.glob("*/grains.h5")):
            return {SHIPPED + path.parent.name: path.parent for path in files}
    return {}


def shipped_mesh(name: str, key: str = "mesh") -> Path:
    """Folder of such a mesh.

    Args:
        name: As ``meshes:two_spheres``.
        key: What messages call it.

    Raises:
        InputError: There is no mesh of that name.
    """
    known = shipped_meshes()
    if name not in known:
        raise InputError(f"{key} = {shown(name)}, expected {nearest_name(name, known)}")
    return known[name]
