"""The circle of a round scan, recognised slice by slice: its field of view, or a mould's wall."""

import itertools

import numpy as np
import scipy.ndimage
import scipy.optimize
import scipy.stats

from ...errors import InputError
from .cylinder import Cylinder

#: Slices, or slabs of them, in which circles are looked for, at most.
SLICES, SLABS = 32, 8
#: Slices that a slab averages at most: noise and grains fade, a wall stays.
SLAB = 9
#: Directions from the middle, and the edges that are taken along each, from outside.
RAYS, EDGES = 360, 6
#: Points as near to a circle belong to it [voxels].
NEAR = 1.0
#: Circles through three random edges that are tried.
TRIALS = 1000
#: Part of the directions along which a circle is seen, at least.
SEEN = 0.6
#: An edge has at least this part of the slope that a fiftieth of all places exceed.
STEEP = 0.25
#: A mould is more even than what it encloses: standard deviation of its levels, at most.
SMOOTH = 0.5
#: Circles of slices differ by no more in radius [voxels].
SPREAD = 2.0
#: A smaller shift of the axis over the height is none [voxels].
UPRIGHT = 1.0


def field_circle(inside, source):
    """The circle of the field of view and what was found, in words.

    Args:
        inside: True where something was measured, (z, y, x), or None.
        source: Name of the image in messages.

    Returns:
        `Cylinder` in voxels, half a voxel within the rim, so that each of its voxels was measured;
        and a line.

    Raises:
        InputError: There is no field of view, or it is not round.
    """
    what = f'cylinder = "field": the field of view of {source}'
    wanted = "expected one value outside of a circle; or give cylinder_middle and cylinder_radius"
    if inside is None:
        raise InputError(f"{what} is not recognised, {wanted}")
    circles, worst = [], 0.0
    for k in np.unique(np.linspace(0, len(inside) - 1, SLICES).astype(int)):
        points = _rim(inside[k])
        if len(points) < 12:
            continue
        circle = _least_squares(points)
        off = np.abs(np.hypot(*(points - circle[:2]).T) - circle[2])
        worst = max(worst, float(np.quantile(off, 0.95)))
        circles.append((k + 0.5, *circle))
    if not circles:
        raise InputError(f"{what} has no rim within the image, {wanted}")
    if worst > 1.5 * NEAR:
        raise InputError(
            f"{what} is not round: its rim is {worst:.3g} voxels off a circle, {wanted}"
        )
    found = _stacked(np.array(circles), len(inside))
    if found is None:
        raise InputError(f"{what} has other circles in other slices, {wanted}")
    line = f"its rim is off by {worst:.2g} voxels at most in 95 % of the places"
    x, y, radius = found.x, found.y, found.radius - 0.5
    return Cylinder(x, y, radius, found.lean, found.z0), line


def mould_circle(grey, inside, source):
    """The inner wall of a mould, a ring around the sample of another level.

    Along rays from the middle of the image the steepest changes of the level are edges; of each
    ray those farthest out are taken. Circles are fitted to them by RANSAC, one after the other.
    The wall is the smallest circle that is seen along 60 % of the rays or more, and just beyond
    which levels vary less than within, since grains lie within.

    Args:
        grey: Levels, (z, y, x).
        inside: True where something was measured, or None.
        source: Name of the image in messages.

    Returns:
        `Cylinder` in voxels, and a line.

    Raises:
        InputError: No wall is recognised in half of the slabs.

    Source: M. A. Fischler, R. C. Bolles, Communications of the ACM 24 (1981) 381-395.
    """
    num_slabs = min(SLABS, max(1, len(grey) // 2))
    ends = np.linspace(0, len(grey), num_slabs + 1).astype(int)
    circles, seen = [], []
    for first, last in itertools.pairwise(ends):
        middle = (first + last) // 2
        part = slice(max(first, middle - SLAB // 2), min(last, middle + SLAB // 2 + 1))
        level = grey[part].mean(axis=0, dtype=float)
        measured = None if inside is None else inside[part].all(axis=0)
        found = _wall(level, measured)
        if found is not None:
            circles.append((0.5 * (part.start + part.stop), *found[0]))
            seen.append(found[1])
    cylinder = None
    if 2 * len(circles) >= num_slabs:
        cylinder = _stacked(np.array(circles), len(grey))
    if cylinder is None:
        raise InputError(
            f'cylinder = "mould": a wall is recognised in {len(circles)} of {num_slabs} slabs of '
            f"{source}, expected the same ring around the sample in half of them; or take "
            'cylinder = "given" and rim = "whole"'
        )
    line = (
        f"the wall is seen in {len(circles)} of {num_slabs} slabs, along {np.mean(seen):.0%} of "
        "the directions"
    )
    return cylinder, line


def _rim(seen):
    """Points (x, y) half-way between pixels inside and outside that are neighbours."""
    found = []
    j, i = np.nonzero(seen[1:] != seen[:-1])
    found.append(np.column_stack([i + 0.5, j + 1.0]))
    j, i = np.nonzero(seen[:, 1:] != seen[:, :-1])
    found.append(np.column_stack([i + 1.0, j + 0.5]))
    return np.concatenate(found)


def _least_squares(points):
    """x, y and radius of the circle whose squared distances from points are least."""
    a = np.column_stack([2 * points, np.ones(len(points))])
    x, y, c = np.linalg.lstsq(a, (points**2).sum(axis=1), rcond=None)[0]
    start = [x, y, np.sqrt(max(c + x * x + y * y, 1e-12))]

    def off(p):
        return np.hypot(*(points - p[:2]).T) - p[2]

    return scipy.optimize.least_squares(off, start).x


def _stacked(circles, height):
    """`Cylinder` through circles (z, x, y, radius) that agree; None if half of them do not.

    Lines through middles are those of Theil and Sen, the radius is a median: single slices that
    went wrong do not count.
    """
    z, x, y, radius = circles.T
    good = np.abs(radius - np.median(radius)) <= SPREAD
    if 2 * np.count_nonzero(good) < len(circles):
        return None
    z, x, y, radius = circles[good].T
    if len(z) < 3 or np.ptp(z) == 0:
        return Cylinder(float(np.median(x)), float(np.median(y)), float(np.median(radius)))
    slope_x, at_x = scipy.stats.theilslopes(x, z)[:2]
    slope_y, at_y = scipy.stats.theilslopes(y, z)[:2]
    if np.hypot(slope_x, slope_y) * height < UPRIGHT:
        return Cylinder(float(np.median(x)), float(np.median(y)), float(np.median(radius)))
    half = height / 2
    middle = float(at_x + slope_x * half), float(at_y + slope_y * half)
    return Cylinder(*middle, float(np.median(radius)), (float(slope_x), float(slope_y)), half)


def _wall(level, measured):
    """(x, y, radius) of a mould's inner wall in one slab and the part of rays; or None."""
    level = scipy.ndimage.gaussian_filter(level, 1.0, mode="nearest")
    points, ray = _edges(level, measured)
    rng = np.random.default_rng(1)
    circles = []
    for _ in range(EDGES):
        if len(points) < RAYS * SEEN:
            break
        near = _on_best_circle(points, rng)
        if np.count_nonzero(near) < 12:
            break
        circle = _least_squares(points[near])
        near = np.abs(np.hypot(*(points - circle[:2]).T) - circle[2]) <= NEAR
        seen = len(np.unique(ray[near])) / RAYS
        if seen < SEEN:
            break
        circle = _least_squares(points[near])
        if _encloses_grains(level, measured, circle):
            circles.append((circle, seen))
        near = np.abs(np.hypot(*(points - circle[:2]).T) - circle[2]) <= 2 * NEAR
        points, ray = points[~near], ray[~near]
    return min(circles, key=lambda found: found[0][2], default=None)


def _on_best_circle(points, rng):
    """Which points are near the circle through three of them that most are near to, by RANSAC.

    All trials are made at once: scikit-image's loop over them takes half a second a slab.
    """
    a, b, c = points[rng.integers(len(points), size=(3, TRIALS))]
    b, c = b - a, c - a
    twice = 2 * (b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0])
    real = np.abs(twice) > 1.0
    a, b, c, twice = a[real], b[real], c[real], twice[real]
    bb, cc = (b**2).sum(axis=1), (c**2).sum(axis=1)
    arm = np.column_stack([c[:, 1] * bb - b[:, 1] * cc, b[:, 0] * cc - c[:, 0] * bb])
    arm /= twice[:, None]
    middles, radii = a + arm, np.hypot(*arm.T)
    best, most = np.zeros(len(points), dtype=bool), 0
    for middle, radius in zip(middles, radii, strict=True):
        near = np.abs(np.hypot(*(points - middle).T) - radius) <= NEAR
        count = np.count_nonzero(near)
        if count > most:
            best, most = near, count
    return best


def _edges(level, measured):
    """Edges along rays from the middle: points (x, y) and the ray of each."""
    ny, nx = level.shape
    x0, y0 = nx / 2, ny / 2
    if measured is not None:
        rim = _rim(measured)
        x0, y0 = (rim.min(axis=0) + rim.max(axis=0)) / 2 if len(rim) else (x0, y0)
    angle = 2 * np.pi * np.arange(RAYS) / RAYS
    r = np.arange(2.0, np.hypot(nx, ny) / 2, 0.5)
    x, y = x0 + np.cos(angle)[:, None] * r, y0 + np.sin(angle)[:, None] * r
    at = np.stack([y - 0.5, x - 0.5])
    profile = scipy.ndimage.map_coordinates(level, at, order=1, mode="nearest")
    known = (x > 1) & (x < nx - 1) & (y > 1) & (y < ny - 1)
    if measured is not None:
        core = scipy.ndimage.binary_erosion(measured, iterations=3, border_value=1)
        known &= scipy.ndimage.map_coordinates(core.astype(float), at, order=0) > 0.5
    slope = np.where(known, np.abs(np.gradient(profile, axis=1)), 0.0)
    least = STEEP * np.quantile(slope[known], 0.98)
    peak = np.zeros_like(known)
    peak[:, 1:-1] = (slope[:, 1:-1] >= slope[:, :-2]) & (slope[:, 1:-1] > slope[:, 2:])
    peak &= slope > max(least, 0.0)
    # The last ones of each ray.
    after = np.cumsum(peak[:, ::-1], axis=1)[:, ::-1]
    ray, place = np.nonzero(peak & (after <= EDGES))
    return np.column_stack([x[ray, place], y[ray, place]]), ray


def _encloses_grains(level, measured, circle):
    """Whether levels just beyond a circle vary much less than those within it."""
    x0, y0, radius = circle
    if radius < 10:
        return False
    y, x = np.indices(level.shape) + 0.5
    distance = np.hypot(x - x0, y - y0)
    known = np.ones(level.shape, dtype=bool) if measured is None else measured
    within = level[known & (distance < radius - 3)]
    beyond = level[known & (distance > radius + 2) & (distance < radius + 4)]
    # A ring of two pixels' width that was measured half-way around.
    if len(within) == 0 or len(beyond) < 2 * np.pi * radius:
        return False
    return bool(beyond.std() < SMOOTH * within.std())
