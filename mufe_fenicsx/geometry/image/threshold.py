"""The grey level that parts grains from voids."""

from contextlib import suppress

import numpy as np
import scipy.ndimage
import scipy.optimize
import skimage.filters

from ...errors import InputError
from ..settings import METHODS, check_method

NUM_BINS = 256

#: Of the lower of two modes: a valley between them is at most as high.
HIGHEST_VALLEY = 0.8

#: Of the contrast of both phases: a threshold farther than this from Otsu's is reported.
DISAGREEMENT = 0.1


class NoThreshold(InputError):
    """A threshold that is refused.

    Args:
        message: One line.
        image: The filtered image that it was to part.
        inside: True in the field of view; None: everywhere.
        level: Of the threshold, where there is one.
    """

    def __init__(self, message, image, inside=None, level=None):
        super().__init__(message)
        self.image, self.inside, self.level = image, inside, level


def candidates(image):
    """Thresholds of all methods that suit a histogram: {method: level}."""
    found = {}
    for method in METHODS:
        with suppress(InputError):
            found[method] = find_threshold(image, method)
    return found


def find_threshold(image, method):
    """The threshold by ``method``: "otsu", "gaussians", "middle" or a grey level.

    Raises:
        InputError: the image is constant, the method is unknown or does not
            suit the histogram, or the level leaves only one phase.
    """
    low, high = float(image.min()), float(image.max())
    if not low < high:
        raise InputError(f"image is constant, all voxels = {low:g}, expected grains and voids")
    check_method(method)
    if method == "otsu":
        level = otsu(image)
    elif method == "gaussians":
        level = between_gaussians(image)
    elif method == "middle":
        level = sum(modes(image, otsu(image), parted=True)) / 2
    else:
        level = float(method)
    if not low <= level < high:
        raise InputError(f"threshold = {level:g}, expected between {low:g} and {high:g}")
    return level


def otsu(image):
    """The level that makes the variance between both classes largest.

    Source: N. Otsu, IEEE Trans. Systems, Man and Cybernetics 9 (1979) 62-66.
    """
    return float(skimage.filters.threshold_otsu(image, nbins=NUM_BINS))


def doubt_about(image, level):
    """A line on what speaks against a threshold, or None; and the grey levels of both phases.

    Otsu's level lies off the middle of the phases where one of them fills more of the image or
    many voxels are cut by surfaces. The phases are the modes of the histogram on either side; they
    are None where no valley parts them or the threshold does not lie between them, for nothing can
    be derived from them then.
    """
    void, solid, parted = _phases(image, level)
    if not (parted and void < level < solid):
        what = (
            f"the modes of the histogram, {void:g} and {solid:g}, lie on one side"
            if parted
            else f"no valley parts the levels around it ({void:g} and {solid:g})"
        )
        line = (
            f"the threshold {level:g} parts no two phases: {what}, expected two modes with a "
            "valley between them; contact_level is not used: look at the outlines in the picture"
        )
        return line, None, None
    reference = otsu(image)
    part = (level - reference) / (solid - void)
    lower, upper = sorted((level, reference))
    none_between = np.count_nonzero((image > lower) & (image <= upper)) < 1e-4 * image.size
    if abs(part) <= DISAGREEMENT or none_between:
        return None, void, solid
    return (
        f"the threshold {level:g} lies {abs(part):.0%} of the contrast ({void:g} to {solid:g}) "
        f"{'above' if part > 0 else 'below'} Otsu's {reference:g}, expected at most "
        f"{DISAGREEMENT:.0%}: look at the outlines in the picture",
        void,
        solid,
    )


def modes(image, level, *, parted=False):
    """The most frequent grey levels below and above ``level``: middles of the peaks' upper halves.

    Raises:
        InputError: ``parted`` is asked for, and no valley parts the peaks.
    """
    void, solid, valley = _phases(image, level)
    if parted and not valley:
        raise _not_bimodal((float(image.min()), float(image.max())))
    return void, solid


def has_valley(image):
    """Whether the histogram has a valley between its modes on either side of Otsu's level."""
    return _phases(image, otsu(image))[2]


def _phases(image, level):
    """The modes below and above ``level``, and whether a valley parts them."""
    low, high = float(image.min()), float(image.max())
    if np.all((image == low) | (image == high)):  # parted before
        return low, high, True
    density, levels = _histogram(image)
    split = int(np.clip(np.searchsorted(levels, level), 1, NUM_BINS - 1))
    peaks = [int(np.argmax(density[:split])), split + int(np.argmax(density[split:]))]
    valley = density[peaks[0] : peaks[1] + 1].min()
    result = []
    for peak in peaks:
        around = _upper_half(density, peak, valley)
        result.append(float(np.average(levels[around], weights=density[around])))
    return *result, bool(valley <= HIGHEST_VALLEY * density[peaks].min())


def between_gaussians(image):
    """The minimum between two Gaussians fitted to the modes of the histogram."""
    (a1, m1, s1), (a2, m2, s2) = fitted_gaussians(image)
    x = np.linspace(m1, m2, 2001)
    return float(x[np.argmin(_log_sum(x, a1, m1, s1, a2, m2, s2))])


def fitted_gaussians(image):
    """Height, mean and deviation of two Gaussians fitted to the modes of the histogram.

    Only the upper half of each mode, above the valley, is fitted: voxels cut by
    a surface fill the valley and belong to neither.

    Raises:
        InputError: the histogram has no two modes with a valley between them.
    """
    density, level = _histogram(image)
    unit = (level - level[0]) / np.ptp(level)
    split = int(np.clip(np.searchsorted(level, otsu(image)), 1, NUM_BINS - 1))
    modes = [int(np.argmax(density[:split])), split + int(np.argmax(density[split:]))]
    valley = density[modes[0] : modes[1] + 1].min()
    fitted, first_guess = np.zeros(NUM_BINS, dtype=bool), []
    for mode in modes:
        around = _upper_half(density, mode, valley)
        fitted |= around
        first_guess += [density[mode], unit[mode], max(around.sum() / 2.35, 1) / NUM_BINS]
    # In units of the range and the highest bin, all six parameters are of order one or less.
    low, high = [0, 0, 0.5 / NUM_BINS] * 2, [2, 1, 1] * 2
    fit = scipy.optimize.least_squares(
        lambda p: two_gaussians(unit[fitted], *p) - density[fitted],
        np.clip(first_guess, low, high),
        bounds=(low, high),
    ).x
    (a1, m1, s1), (a2, m2, s2) = sorted([fit[:3], fit[3:]], key=lambda mode: mode[1])
    if not (min(a1, a2) > 0 and m2 - m1 > 2 / NUM_BINS):
        raise _not_bimodal(level)
    x = np.linspace(m1, m2, 2001)
    lowest = x[np.argmin(_log_sum(x, a1, m1, s1, a2, m2, s2))]
    peaks = np.interp([m1, m2], unit, density)
    if lowest in (m1, m2) or np.interp(lowest, unit, density) > HIGHEST_VALLEY * peaks.min():
        raise _not_bimodal(level)
    whole = float(np.ptp(level))
    return tuple((float(a), float(level[0] + m * whole), float(s * whole))
                 for a, m, s in ((a1, m1, s1), (a2, m2, s2)))  # fmt: skip


def _histogram(image):
    """Smoothed counts over the highest one, and the grey levels of the bins."""
    counts, edges = np.histogram(image, bins=NUM_BINS)
    density = scipy.ndimage.gaussian_filter1d(counts / counts.max(), 1.0)
    return density, (edges[1:] + edges[:-1]) / 2


def _upper_half(density, peak, valley):
    """Bins around a peak that are higher than half-way from the valley."""
    runs, _ = scipy.ndimage.label(density >= (density[peak] + valley) / 2)
    return runs == runs[peak]


def _log_sum(x, a1, m1, s1, a2, m2, s2):
    return np.logaddexp(
        np.log(a1) - (x - m1) ** 2 / (2 * s1**2), np.log(a2) - (x - m2) ** 2 / (2 * s2**2)
    )


def two_gaussians(x, a1, m1, s1, a2, m2, s2):
    """Sum of two normal distributions at x: a₁ exp(-(x-m₁)²/2s₁²) + a₂ exp(-(x-m₂)²/2s₂²)."""
    first = a1 * np.exp(-((x - m1) ** 2) / (2 * s1**2))
    return first + a2 * np.exp(-((x - m2) ** 2) / (2 * s2**2))


def _not_bimodal(level):
    return InputError(
        f"threshold: the histogram from {level[0]:g} to {level[-1]:g} has no two modes "
        "with a valley between them, expected two; choose otsu or a grey level"
    )
