"""What a user may choose about a synthetic scan."""

import math
from dataclasses import dataclass, fields

from ..errors import InputError, nearest_name, shown
from ..units import to_si


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

    shape: tuple = (120, 120, 120)  #: voxels of the image, (z, y, x)
    voxel_size: float = 5e-6  #: [m]
    d50: float = 300e-6  #: half of the mass is in smaller grains [m]
    uniformity: float = 1.4  #: d60/d10 by mass
    elongation: float = 0.75  #: mean of W/L
    flatness: float = 0.80  #: mean of T/W
    form_spread: float = 0.08  #: standard deviation of both
    roughness: float = 0.06  #: root mean square of ln(radius) over degrees >= 3
    falloff: float = 1.7  #: exponent of that spectrum; larger: rounder
    max_degree: int = 15  #: last degree of the spectrum
    margin: float = 1.0  #: of the packing around the image, next to its walls [d50]
    solid_fraction: float = 1.0  #: at most, between the walls; 1: as dense as without friction
    overlap: float = 0.1  #: mean depth of contacts at which the packing is done [voxels]
    void_grey: float = 16000.0  #: grey level of voids
    solid_grey: float = 36000.0  #: grey level of grains
    blur: float = 0.8  #: standard deviation of the point-spread function [voxels]
    noise: float = 0.06  #: standard deviation of additive noise over the contrast of both levels
    shot_noise: float = 0.03  #: the same of noise that grows as the root of the level, at solids
    rings: float = 0.02  #: standard deviation of the ring artefact over the contrast
    supersampling: int = 4  #: points along each edge of a voxel cut by a surface
    seed: int = 1

    def __post_init__(self):
        require = _require
        require(len(self.shape) == 3 and min(self.shape) >= 8, "shape", self.shape, "3 x >= 8")
        for name in ("voxel_size", "d50"):
            require(getattr(self, name) > 0, name, getattr(self, name), "a length > 0 in metres")
        require(self.d50 >= 6 * self.voxel_size, "d50", self.d50, ">= 6 voxels")
        require(1 < self.uniformity <= 3, "uniformity", self.uniformity, "1 < uniformity <= 3")
        for name in ("elongation", "flatness"):
            value = getattr(self, name)
            require(0.3 <= value <= 1, name, value, f"0.3 <= {name} <= 1")
        require(0 <= self.form_spread <= 0.2, "form_spread", self.form_spread, "0 to 0.2")
        require(0 <= self.roughness <= 0.2, "roughness", self.roughness, "0 to 0.2")
        require(0.5 <= self.falloff <= 5, "falloff", self.falloff, "0.5 to 5")
        require(3 <= self.max_degree <= 20, "max_degree", self.max_degree, "3 to 20")
        require(0 <= self.margin <= 5, "margin", self.margin, "0 to 5")
        require(0.3 <= self.solid_fraction <= 1, "solid_fraction", self.solid_fraction, "0.3 to 1")
        require(0.01 <= self.overlap <= 1, "overlap", self.overlap, "0.01 to 1 voxel")
        require(0 <= self.void_grey < self.solid_grey <= 65535, "solid_grey", self.solid_grey,
                f"void_grey = {self.void_grey} < solid_grey <= 65535")  # fmt: skip
        for name in ("blur", "noise", "shot_noise", "rings"):
            value = getattr(self, name)
            require(0 <= value and math.isfinite(value), name, value, ">= 0")
        require(1 <= self.supersampling <= 10, "supersampling", self.supersampling, "1 to 10")
        require(self.seed >= 0, "seed", self.seed, ">= 0")


#: Units of the settings that have one.
UNITS = {"voxel_size": "m", "d50": "m"}


def settings_from(given):
    """Settings from numbers and texts with units, by name.

    Raises:
        InputError: an unknown name, a wrong unit or type, or a value out of range.
    """
    known = {field.name: field.type for field in fields(SynthesisSettings)}
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
        number = to_si(value, UNITS.get(name, ""), name)
        if known[name] is int:
            if number != int(number):
                raise InputError(f"{name} = {shown(value)}, expected a whole number")
            number = int(number)
        values[name] = number
    return SynthesisSettings(**values)


def _require(holds, name, value, expected):
    if not holds:
        raise InputError(f"{name} = {value}, expected {expected}")
