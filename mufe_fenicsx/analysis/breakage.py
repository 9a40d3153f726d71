"""How far grains are broken: sizes of fragments by volume, and numbers of breakage.

A fragment is as large as the ball of its volume, d = ∛(6 V/π): it passes a sieve of that width. Of
the volume (of one density: of the mass) the part F(d) is finer. All numbers are means over the
volume of ln d, which are areas beside F over the logarithm of the size.
"""

from dataclasses import dataclass

import numpy as np

#: Size from which on a soil is silt [m]: Hardin's limit of breakage.
SILT = 74e-6
#: Fractal dimension of the sizes that grains are crushed to in the end (Einav 2007).
ULTIMATE_DIMENSION = 2.6
#: Part of a grain's volume that its second fragment has at least where it is split, not chipped.
SPLIT = 0.1


def diameter(volume):
    """Diameters of balls of these volumes [m]."""
    return np.cbrt(6.0 * np.asarray(volume, dtype=float) / np.pi)


def size_at(volume, part):
    """Least size that so much of the volume is no larger than [m]: d50 of a half."""
    own = diameter(volume)
    order = np.argsort(own)
    share = np.cumsum(np.asarray(volume, dtype=float)[order])
    return float(own[order][np.searchsorted(share, part * share[-1] * (1.0 - 1e-12))])


def _mean_log(volume, least=0.0):
    """Mean over the volume of ln d, of sizes below the least one that of this."""
    return float(np.average(np.log(np.maximum(diameter(volume), least)), weights=volume))


def hardin(first, now):
    """Relative breakage B_r = B_t/B_p [-], nan where all is silt from the start.

        B_t = ∫ (F - F₀) d log d ,    B_p = ∫ (1 - F₀) d log d ,

    both from 74 µm on.

    Args:
        first, now: Volumes of the grains and of the fragments [m³].

    Source: B. O. Hardin, J. Geotech. Eng. 111 (1985) 1177-1192.
    """
    start = _mean_log(first, SILT)
    potential = start - np.log(SILT)
    return (start - _mean_log(now, SILT)) / potential if potential > 0.0 else np.nan


def einav(first, now, dimension=ULTIMATE_DIMENSION):
    """Breakage B [-]: 0 at the start, 1 where F is (d/d_max)^(3 - α), of the largest grain's d.

        B = ∫ (F - F₀) d ln d / ∫ (F_u - F₀) d ln d .

    Args:
        first, now: As of :func:`hardin`.
        dimension: α.

    Source: I. Einav, J. Mech. Phys. Solids 55 (2007) 1274-1297, with a least size of nothing.
    """
    start = _mean_log(first)
    ultimate = np.log(diameter(np.max(first))) - 1.0 / (3.0 - dimension)
    return (start - _mean_log(now)) / (start - ultimate)


@dataclass(frozen=True)
class Breakage:
    """Numbers of the breakage of a sample."""

    num_fragments: int  #: pieces of broken grains
    broken: float  #: part of the grains in more than one piece
    split: float  #: part of the grains whose second piece has a tenth of the volume and more
    chipped: float  #: part of the grains that are broken but not split
    hardin: float  #: relative breakage B_r
    einav: float  #: breakage B
    d10: float  #: size that a tenth of the volume is finer than [m]
    d50: float  #: the same of a half [m]


def breakage(volume, grain):
    """:class:`Breakage` of fragments; whole grains are one each.

    Args:
        volume: First volumes of the fragments [m³], shape (num_fragments,).
        grain: Numbers of their grains, shape (num_fragments,).
    """
    volume = np.asarray(volume, dtype=float)
    grain = np.unique(grain, return_inverse=True)[1]
    order = np.lexsort((-volume, grain))
    count, whole = np.bincount(grain), np.bincount(grain, volume)
    first = np.cumsum(count) - count
    second = np.where(count > 1, volume[order][np.minimum(first + 1, volume.size - 1)], 0.0)
    split, broken = second >= SPLIT * whole, count > 1
    return Breakage(
        num_fragments=int(count[broken].sum()),
        broken=float(broken.mean()),
        split=float(split.mean()),
        chipped=float((broken & ~split).mean()),
        hardin=float(hardin(whole, volume)),
        einav=float(einav(whole, volume)),
        d10=size_at(volume, 0.1),
        d50=size_at(volume, 0.5),
    )


def fragments_of(volume, grain, piece):
    """Volumes and grains of the fragments that cells are in, both of shape (num_fragments,).

    Args:
        volume: Of the cells [m³], shape (num_cells,).
        grain, piece: Numbers of their grains and of the pieces there, shape (num_cells,).
    """
    names, of = np.unique(np.stack([grain, piece], axis=1), axis=0, return_inverse=True)
    return np.bincount(of.ravel(), volume), names[:, 0]
