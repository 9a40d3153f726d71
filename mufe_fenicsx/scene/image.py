"""[image] of a scene: the tomography that its grains come from."""

import importlib.util
from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError
from ..geometry.settings import SegmentSettings
from ..units import REQUIRED, setting

#: Images that installed packages carry: name -> (package, path inside it).
PACKAGED_IMAGES = {"spam:snow": ("spam", "data/snow/snow.tif")}


@dataclass(frozen=True, kw_only=True)
class ImageSettings(SegmentSettings):
    """[image]: the tomography and how its grains are told apart."""

    file: str | Path = setting(
        REQUIRED, "", "image file or folder of slices, or a name in `PACKAGED_IMAGES`"
    )

    @property
    def path(self) -> Path:
        """Where the image is. Raises InputError where its package is not installed."""
        return image_path(self.file)


def image_path(file: str | Path) -> Path:
    """Where an image is: a path as it stands, or that of a packaged image.

    The package is located, not imported.

    Raises:
        InputError: the package that carries the image is not installed.
    """
    if str(file) not in PACKAGED_IMAGES:
        return Path(file)
    package, inside = PACKAGED_IMAGES[str(file)]
    found = importlib.util.find_spec(package)
    if found is None or not found.submodule_search_locations:
        raise InputError(
            f"image {file} is in the package {package}, which is not installed: "
            "expected pip install 'mufe-fenicsx[demo]'"
        )
    return Path(found.submodule_search_locations[0]) / inside
