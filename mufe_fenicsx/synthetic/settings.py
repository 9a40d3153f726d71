"""What a user may choose about a synthetic scan."""

from dataclasses import dataclass

from ..errors import InputError, nearest_name, shown
from ..units import check_keys, keys_of, require, setting, to_si

#: Diameters of grains [m] that are taken for no slip of the keyboard.
LEAST_SIZE, LARGEST_SIZE = 1e-7, 1.0


@dataclass(frozen=True)
class SynthesisSettings:
    """Grains, their packing and their image.

    Size is the diameter of the sphere of equal volume, log-normal by mass. Form is that
    of the ellipsoid with the second moments of the grain, with the axes L >= I >= S.
    Roundness is how fast the surface's waves fall with their number n around the grain:
    ln(radius) is a random field on the sphere, whose degrees n = 3, 4, … have root mean squares
    in proportion to n^-falloff and ``roughness`` all together. The 95 crushed stones
    FDOT-57 (NIST TSQUARE) have a falloff of 1.45 and a roughness of 0.10 to 0.19; the
    defaults are rounder, as natural sand is.
    """

    shape: tuple = setting((120, 120, 120), "", "voxels of the image, (z, y, x)", shape=(3,))
    voxel_size: float = setting(5e-6, "m", "edge of a voxel", gt=0)
    d50: float = setting(
        300e-6, "m", "half of the mass is in smaller grains", ge=LEAST_SIZE, le=LARGEST_SIZE
    )
    uniformity: float = setting(1.4, "", "d60/d10 by mass", gt=1, le=3)
    elongation: float = setting(0.75, "", "mean of W/L", ge=0.3, le=1)
    flatness: float = setting(0.80, "", "mean of T/W", ge=0.3, le=1)
    form_spread: float = setting(0.08, "", "standard deviation of both", ge=0, le=0.2)
    roughness: float = setting(
        0.06, "", "root mean square of ln(radius) over degrees >= 3", ge=0, le=0.2
    )
    falloff: float = setting(1.7, "", "exponent of that spectrum; larger: rounder", ge=0.5, le=5)
    max_degree: int = setting(15, "", "last degree of the spectrum", ge=3, le=20)
    margin: float = setting(
        1.0, "d50", "of the packing around the image, next to its walls", ge=0, le=5
    )
    overlap: float = setting(
        0.1, "voxels", "mean depth of contacts at which the packing is done", ge=0.01, le=1
    )
    void_grey: float = setting(16000.0, "", "grey level of voids", ge=0)
    solid_grey: float = setting(36000.0, "", "grey level of grains", le=65535)
    blur: float = setting(0.8, "voxels", "standard deviation of the point-spread function", ge=0)
    noise: float = setting(
        0.06, "", "standard deviation of additive noise over the contrast of both levels", ge=0
    )
    shot_noise: float = setting(
        0.03, "", "the same of noise that grows as the root of the level, at solids", ge=0
    )
    rings: float = setting(
        0.02, "", "standard deviation of the ring artefact over the contrast", ge=0
    )
    supersampling: int = setting(
        4, "", "points along each edge of a voxel cut by a surface", ge=1, le=10
    )
    seed: int = setting(1, "", "of the random numbers", ge=0)

    def __post_init__(self):
        require(len(self.shape) == 3 and min(self.shape) >= 8, "shape", self.shape, "3 x >= 8")
        check_keys(self)
        require(self.d50 >= 6 * self.voxel_size, "d50", self.d50, ">= 6 voxels")
        require(self.void_grey < self.solid_grey, "solid_grey", self.solid_grey,
                f"void_grey = {self.void_grey} < solid_grey <= 65535")  # fmt: skip


def settings_from(given):
    """Settings from numbers and texts with units, by name.

    Raises:
        InputError: an unknown name, a wrong unit or type, or a value out of range.
    """
    known = keys_of(SynthesisSettings)
    values = {}
    for name, value in given.items():
        if name not in known:
            near = nearest_name(name, known)
            raise InputError(f"{name} = {shown(value)} is not a known setting, expected {near}")
        if name == "shape":
            if not isinstance(value, tuple | list):
                raise InputError(f"shape = {shown(value)}, expected --shape z,y,x")
            values[name] = tuple(value)
            continue
        number = to_si(value, known[name].unit, name)
        if known[name].hint is int:
            if number != int(number):
                raise InputError(f"{name} = {shown(value)}, expected a whole number")
            number = int(number)
        values[name] = number
    return SynthesisSettings(**values)
