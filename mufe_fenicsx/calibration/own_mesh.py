"""A grain of any shape: its force over that of the ball of its volume, from a run with its mesh.

``mufe new single-grain`` presses a grain between two platens. By how much its force differs from
that of a ball is a matter of its shape and hardly of its material, so that one run, at about the
material that was found with a ball, corrects the model:

    F(δ) = ψ(δ/R) F_ball(δ),   ψ = F_run/F_ball at the material of the run.
"""

from pathlib import Path

import numpy as np

from ..errors import InputError
from ..materials.j2 import J2
from ..results.run import Run
from ..scene.reading import load_scene
from .model import Setup

#: Approaches of ψ, and the part of the largest from which on the run counts: smaller contacts have
#: too few elements to tell a shape from a mesh.
POINTS, FROM = 6, 0.25


def shape_of_run(path):
    """Approach over radius and ψ there, each of shape (num_points,). Local.

    Args:
        path: Folder of a run of one grain between the walls z.

    Raises:
        InputError: It is none, it has more grains or another material, or nothing is pressed.
    """
    run, scene = Run(path), load_scene(Path(path) / "scene.toml")
    history, material = run.history, scene.material
    grains, mass = (run.summary.get(key) for key in ("num_grains", "mass"))
    if grains != 1 or not mass or not isinstance(material, J2) or history.empty:
        raise InputError(
            f"run {path} has {grains} grains of {type(material).__name__}, mass = {mass} and "
            f"{len(history)} rows, expected one grain of J2, as of mufe new single-grain"
        )
    last = int(np.argmin(history["height"]))
    height = history["height"].to_numpy()[: last + 1]
    force = history[["force_z_min", "force_z_max"]].to_numpy()[: last + 1].mean(axis=1)
    loaded = force > 1e-3 * force.max()
    if loaded.sum() < POINTS:
        raise InputError(f"run {path} has {loaded.sum()} rows with a force, expected {POINTS}")
    R = 0.5 * np.cbrt(6 * mass / (np.pi * material.rho))
    touched = _touch(height, force)
    x = (touched - height[loaded]) / (2 * R)
    at = np.geomspace(FROM * x[-1], x[-1], POINTS)
    strain, stress = material.yield_table()
    slope = (stress[-1] - stress[0]) / strain[-1] if strain[-1] > 0 else 0.0
    delta, ball, _ = Setup(material.nu).course(material.E, stress[0], slope)
    if x[-1] > delta[-1]:
        raise InputError(
            f"run {path} goes to {x[-1]:.3g} radii a contact, expected at most {delta[-1]:g}"
        )
    found = np.interp(at, np.maximum.accumulate(x), force[loaded])
    return at, found / (np.interp(at, delta, ball) * R**2)


def _touch(height, force):
    """Height of first touch [m]: F^⅔ of the rows up to a fifth of the force, drawn on to 0."""
    low = (force > 0.01 * force.max()) & (force < 0.2 * force.max())
    if low.sum() < 2:
        return float(height[force > 0.0][0])
    slope, level = np.polyfit(height[low], force[low] ** (2 / 3), 1)
    return float(min(-level / slope, height.max()))
