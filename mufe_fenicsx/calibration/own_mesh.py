"""A grain of any shape: its force over that of the ball of its volume, from runs with its mesh.

``mufe new single-grain`` presses a grain between two platens. What its shape does to the force is
a smooth function of the approach, which depends little on the material,

    F(δ) = ψ(δ/R; Y/E*, H/Y) F_ball(δ),   ψ = F_run/F_ball at the material of a run.

By dimensions no other number of the material enters. Elastic grains count as Y = H = E, of which no
ball yields. Between runs log ψ is a Gaussian process of the logarithms of Y/E* and 1 + H/Y/10
(Rasmussen & Williams, Gaussian Processes for Machine Learning, 2006, eq. 2.25), so that at each run
it is that run's own. Contacts of less than one edge per radius are those of a mesh and not of a
grain: there ψ is not known.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..materials.elastic import Elastic
from ..materials.j2 import J2
from ..results.run import Run
from ..scene.reading import load_scene
from . import ball
from .data import LEAST, Size
from .model import Setup

#: Approaches of ψ, and rows of a run at least.
POINTS, ROWS = 64, 12
#: Columns of platens; force over that of a later row from which on it did not stay.
PLATENS, LOST = ("force_z_min", "force_z_max"), 2.0
#: Force on side walls over that on platens from which on a grain is not pressed alone.
SIDES = 0.01
#: Edges per radius of the contact from which on a run counts.
RESOLVED = 1.0
#: Force goes with R^½ where a grain is elastic and with R where it flows: the part of log ψ by
#: which materials that are a factor e apart may differ.
PART = 1 / 3
#: Logarithms over which log ψ may bend, and the scatter of a run's own.
BEND, NOISE = 2.0, 0.002
#: Logarithms of materials that are farther want another run, and from which on no error is known.
FAR, SPOILT = 0.4, 1.0


@dataclass(frozen=True)
class Shape:
    """ψ of some runs with the mesh of one grain."""

    delta: np.ndarray  #: approaches over R, shape (num_points,)
    log_ratio: np.ndarray  #: log ψ, shape (num_runs, num_points)
    places: np.ndarray  #: of the materials, as by :func:`place`, shape (num_runs, 2)
    least: float  #: force over R² [Pa] from which on contacts are resolved
    nu: float  #: Poisson's ratio of the runs

    def ratio(self, delta, Y, k):
        """ψ at approaches over R, for Y/E* and H/Y."""
        return np.exp(self._at(np.log(delta), place(Y, k)))

    def _at(self, log_delta, where):
        mean = self.log_ratio.mean(axis=0)
        every = _alike(self.places, self.places) + NOISE**2 * np.eye(len(self.places))
        weights = np.linalg.solve(every, _alike(self.places, where[None])[:, 0])
        return np.interp(log_delta, np.log(self.delta), mean + weights @ (self.log_ratio - mean))

    def distance(self, Y, k):
        """Of a material from the nearest run, in logarithms."""
        return float(np.linalg.norm(self.places - place(Y, k), axis=1).min())

    def error(self, delta, Y, k):
        """Standard deviation of log ψ at approaches over R: the farther from runs, the larger."""
        own = self._at(np.log(delta), place(Y, k))
        return PART * own * min(self.distance(Y, k), 1.0)


def as_grain(data, shape):
    """The data with sizes of balls as large, and without forces below those that runs resolve.

    Args:
        data: :class:`~.data.Data`; its notes say what is left out.
        shape: :class:`Shape`.

    Raises:
        InputError: Too few rows of a curve are left.
    """
    curves = []
    for curve in data.curves:
        size = Size(*[curve.size.diameter] * 3)
        least = shape.least * size.radius**2
        keep = curve.force >= least
        if keep.sum() < LEAST:
            raise InputError(
                f"curve {curve.name} has {keep.sum()} points from {least:.3g} N on, where the run "
                f"has an edge per contact radius, expected {LEAST}"
            )
        if not keep.all():
            data.notes.append(
                f"{curve.name}: {(~keep).sum()} rows below {least:.3g} N, where the run has less "
                "than an edge per contact radius, left out"
            )
        curves.append(replace(curve, displacement=curve.displacement[keep],
                              force=curve.force[keep], size=size))  # fmt: skip
    return replace(data, curves=curves)


def how_far(fit, setup):
    """Sentences where a material is far from those of all runs, and whether that spoils it. Local.

    Args:
        fit: :class:`~.fit.Fit`.
        setup: :class:`~.model.Setup`.
    """
    if setup.shape is None:
        return [], False
    E, Y, H = (fit.material[name] for name in ("E", "yield", "hardening"))
    away = setup.shape.distance(Y / setup.modulus(E), H / Y)
    if away < FAR:
        return [], False
    said = (
        f"No run has nearly this material (a factor of {np.exp(away):.2g} in yield stress over "
        "modulus or in hardening), for which intervals are wider."
    )
    return [said], away > SPOILT


def _alike(one, other):
    """Covariance of log ψ of materials, shape (num_one, num_other)."""
    apart = np.linalg.norm(one[:, None] - other[None], axis=2)
    return (PART * BEND) ** 2 * np.exp(-0.5 * (apart / BEND) ** 2)


def place(Y, k):
    """Logarithms by which materials differ, of Y/E* and H/Y, shape (2,)."""
    highest = ball.load().yields[-1]  # beyond, a ball is elastic
    return np.array([np.log(min(Y, highest)), np.log1p(k / ball.KNEE)])


def shape_of_runs(paths):
    """:class:`Shape` of runs with the mesh of one grain. Local.

    Args:
        paths: Folders of runs of one grain between the walls z.

    Raises:
        InputError: One is none, it has more grains or another material, nothing is pressed, or
            Poisson's ratios differ.
    """
    runs = [_read(path) for path in paths]
    nu = runs[0][0].nu
    for path, (material, *_) in zip(paths, runs, strict=True):
        if material.nu != nu:
            raise InputError(
                f"run {path} has nu = {material.nu:g}, expected {nu:g}, as of {paths[0]}"
            )
    first, last = max(x[0] for _, x, _ in runs), min(x[-1] for _, x, _ in runs)
    if not first < last:
        raise InputError(
            f"runs go from {first:.3g} and to {last:.3g} radii a contact, expected that they share "
            "a way: press all by the same strain"
        )
    at, ratios, places = np.geomspace(first, last, POINTS), [], []
    for material, x, stress in runs:
        Y, H = linear(material)
        delta, own, _ = Setup(nu).course(material.E, Y, H)
        ratio = np.log(stress / np.interp(x, delta, own))
        ratios.append(np.interp(np.log(at), np.log(x), ratio))
        places.append(place(Y / Setup(nu).modulus(material.E), H / Y))
    least = max(float(np.interp(first, x, stress)) for _, x, stress in runs)
    return Shape(at, np.array(ratios), np.array(places), least, nu)


def linear(material):
    """Yield stress and slope of hardening [Pa] of a table; of elastic grains as fits have them."""
    if not isinstance(material, J2):
        return material.E, material.E
    strain, stress = material.yield_table()
    return stress[0], (stress[-1] - stress[0]) / strain[-1] if strain[-1] > 0 else 0.0


def _read(path):
    """Material, approaches over radius and forces over its square [Pa] of a run."""
    run, scene = Run(path), load_scene(Path(path) / "scene.toml")
    history, material = run.history, scene.material
    grains, mass = (run.summary.get(key) for key in ("num_grains", "mass"))
    if grains != 1 or not mass or not isinstance(material, J2 | Elastic) or history.empty:
        raise InputError(
            f"run {path} has {grains} grains of {type(material).__name__}, mass = {mass} and "
            f"{len(history)} rows, expected one grain, elastic or j2, as of mufe new single-grain"
        )
    rows = history.iloc[: int(np.argmin(history["height"])) + 1]
    height = rows["height"].to_numpy()
    both = rows[list(PLATENS)].to_numpy()
    beside = [name for name in rows if name.startswith("force_") and name not in PLATENS]
    most = float(np.abs(rows[beside].to_numpy()).max(initial=0.0))
    if most > SIDES * both.max():
        raise InputError(
            f"run {path} has {most:.3g} N on side walls, expected at most {SIDES:g} of "
            f"{both.max():.3g} N on the platens: move the side walls out"
        )
    force, R = both.mean(axis=1), 0.5 * np.cbrt(6 * mass / (np.pi * material.rho))
    x = (_touch(height, both.min(axis=1)) - height) / (2 * R)
    resolved = (rows["elements_per_radius"].to_numpy() >= RESOLVED) & (force > 0.0)
    resolved &= (x > 0.0) & (x <= ball.load().delta[-1])
    if resolved.sum() < ROWS:
        raise InputError(
            f"run {path} has {resolved.sum()} rows with {RESOLVED:g} edge per contact radius or "
            f"more, expected {ROWS}: press farther, with more rows of history, or a finer mesh"
        )
    # Time steps shake a platen: a row above the next ones is no way back.
    x, grown = np.unique(np.maximum.accumulate(x[resolved]), return_index=True)
    return material, x, force[resolved][grown] / R**2


def _touch(height, force):
    """Height of first touch [m], by Hertz from the first two rows of the force that stays.

    Before, a loose grain is pushed about: its force is gone again at a later row.
    """
    stays = np.minimum.accumulate(force[::-1])[::-1]
    lost = np.flatnonzero((stays <= 0.0) | (force > LOST * stays))
    first = lost[-1] + 1 if lost.size else 0
    later = first + int(np.argmax(height[first:] < height[first]))
    ratio = np.cbrt(force[later] / force[first]) ** 2
    back = (height[first] - height[later]) / max(ratio - 1.0, 1e-9)
    return float(min(height[first] + back, height[max(first - 1, 0)]))
