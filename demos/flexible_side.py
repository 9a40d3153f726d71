"""A triaxial test between a rigid side and in a membrane: strength, and whether a band forms.

    python demos/flexible_side.py FOLDER          half an hour of one core

About 200 spheres are packed densely, without friction, into a cylinder. They are sheared with
friction 0.5 between smooth platens at a side pressure of 100 kPa,

    wall        the side is a rigid cylinder whose radius a servo leads; its mean pressure is held
    membrane    a rubber sleeve under the pressure of a cell

The same grains have the same mean stresses in both, σz of the platens and σr of the side, each over
the volume that the side encloses. A wall prescribes one radius to all grains at it; a cell gives
each of them its own force, so that the sample may widen unevenly. The deviator q = σz - σr should
be the same until strain gathers in a band. Finished runs in FOLDER are kept, and others go on.
"""

import argparse
import json
from pathlib import Path

import mufe_fenicsx as mufe

# isort: split
import matplotlib
import numpy as np
from kept_runs import finished, go_on
from matplotlib.collections import EllipseCollection

from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.report.style import BLUE, PAGE, RC, RED, new_figure, panel_letter
from mufe_fenicsx.results.localisation import judge
from mufe_fenicsx.scene import (
    Axis,
    Contact,
    ContainerSettings,
    Loading,
    Output,
    Sample,
    Scene,
    Solver,
    Stage,
    Wall,
)
from mufe_fenicsx.scene.membrane import MembraneSettings
from mufe_fenicsx.synthetic.rigid_packing.pipeline import pack
from mufe_fenicsx.synthetic.rigid_packing.settings import PackSettings

#: Number of spheres, size by mass, d60/d10, proportions of the sample, and edges of meshes [m].
COUNT, D50, UNIFORMITY, CYLINDER, SIZE = 200, 280e-6, 1.3, (1.27e-3, 2.54e-3), 75e-6
#: E/p = 2000: contacts are flattened by (p/E)^(2/3) = 0.6 % of D, and a step is 2.2 times as long
#: as with 1 GPa.
SAND = Elastic(E=0.2e9, nu=0.2, rho=2650.0)
#: Pressures of the seating and of the shearing [Pa], strain at the end, speed of the height [m/s].
SEATED, CELL, STRAIN, SPEED = 20e3, 100e3, 0.1, 0.1
#: E t/R is 22 kPa, that of latex of 0.3 mm around a sample of 38 mm.
SLEEVE = MembraneSettings(thickness=30e-6, E=0.5e6, size=100e-6)
SIDES = ("wall", "membrane")
#: Stresses are means over this strain to both sides.
HALF_WINDOW = 2.5e-3


def scene_of(grains, side, speed=SPEED):
    """Seating, isotropic compression, and shearing at a constant pressure of the side."""
    flexible = side == "membrane"
    return Scene(
        title=f"Triaxial test, {side}",
        sample=Sample(grains=grains),
        container=ContainerSettings(shape="cylinder"),
        membrane=SLEEVE if flexible else None,
        material=SAND,
        contact=Contact(friction=0.5, wall_friction=0.0),
        walls={"side": Wall(friction=0.0)},
        solver=Solver(damping=2e4),
        loading=Loading(speed=speed, ramp=0.001, tolerance=0.1),
        stages=(
            Stage(zero=True, rz=Axis(stress=SEATED, speed=0.2)),
            Stage(name="isotropic", rz=Axis(stress=CELL)),
            Stage(name="shear", z=Axis(strain=STRAIN)),
        ),
        output=Output(fields=15, history=600, checkpoint=120.0),
    )  # fmt: skip


def curve(folder):
    """Axial strain, q over σr, and volumetric strain since the start of the shearing.

    Rows in which the platens slow down before the end are left out: the sample relaxes there.
    """
    history = mufe.open_run(folder).history
    shear = history[(history["stage"] == "shear") & (history["strain_z"] < STRAIN - 0.004)]
    ratio = np.asarray(shear["stress_z"] / shear["stress_r"]) - 1
    lengths = (1 - shear["strain_z"]) * (1 - shear["strain_r"]) ** 2
    first = history[history["stage"] == "isotropic"].iloc[-1]
    before = (1 - first["strain_z"]) * (1 - first["strain_r"]) ** 2
    strain = np.asarray(shear["strain_z"]) - first["strain_z"]
    return strain, ratio, 1 - np.asarray(lengths) / before


def smooth(strain, values, at, half=HALF_WINDOW):
    """Means of values over ``half`` of strain to both sides of ``at``: fewer rattles."""
    window = np.linspace(-half, half, 21)
    return np.interp(at[:, None] + window, strain, values).mean(axis=1)


def strains_of(folder):
    """Table of strains around the grains from the start of the shearing on, and its judgement."""
    done = mufe.open_run(folder)
    states = done.states
    since = int(states.index[states["stage"] == "isotropic"][-1])
    table = done.localisation(since=since)
    return table, judge(table)


def numbers_of(folder):
    """Peak of q/σr with its strain, q/σr at the end, and what the strains of grains say."""
    strain, ratio, volume = curve(folder)
    at = np.arange(HALF_WINDOW, strain[-1] - HALF_WINDOW, 5e-4)
    line = smooth(strain, ratio, at)
    top = int(np.argmax(line))
    _, found = strains_of(folder)
    band = found.band
    history = mufe.open_run(folder).history
    start = history[history["stage"] == "isotropic"].iloc[-1]
    marks = np.arange(0.01, at[-1], 0.01)
    return {
        "ratio": dict(zip((f"{m:.2f}" for m in marks),
                          smooth(strain, ratio, marks).round(3).tolist(), strict=True)),
        "contacts": float(start["num_active_contacts"]),
        "void_ratio_inside": found.void_ratio[0],
        "lost_diameter": float(1 - start["diameter"] / history["diameter"].iloc[0]),
        "peak": float(line[top]), "peak_strain": float(at[top]), "end": float(line[-1]),
        "volume": float(volume[-1]), "spread": found.spread, "is_band": bool(found.is_band),
        "share": band.share, "contrast": band.contrast, "inclination": band.inclination,
        "width_in_D": band.width / D50,
    }  # fmt: skip


def difference(wall, membrane):
    """q of the membrane over that of the wall, less 1: largest and mean up to the earlier peak.

    From 0.5 % of strain on; before, q rises from zero and the shift of a row counts.

    Args:
        wall, membrane: Strain and q/σr of each.
    """
    peaks = []
    for strain, ratio in (wall, membrane):
        at = np.arange(0.005, strain[-1] - HALF_WINDOW, HALF_WINDOW)
        peaks.append(at[np.argmax(smooth(strain, ratio, at))])
    at = np.arange(0.005, min(peaks) + 1e-9, HALF_WINDOW)
    change = smooth(*membrane, at) / smooth(*wall, at) - 1
    return float(np.abs(change).max()), float(change.mean())


def draw_grains(figure, axis, folder, limit):
    """Grains near the middle section by the deviatoric strain around them."""
    table, found = strains_of(folder)
    along = np.array([1.0, 0.0])
    if found.band is not None and found.band.inclination > 5:
        along = found.band.normal[:2] / np.linalg.norm(found.band.normal[:2])
    centre = table[["center_x", "center_y", "center_z"]].to_numpy()
    centre = centre - 0.5 * (centre.min(axis=0) + centre.max(axis=0))
    across = centre[:, :2] @ along
    away = centre[:, 0] * along[1] - centre[:, 1] * along[0]
    radius = np.cbrt(3 * table["volume"].to_numpy() / (4 * np.pi))
    near = np.argsort(-np.abs(away))
    near = near[np.abs(away[near]) < radius[near]]
    width = 2e3 * radius[near]
    grains = EllipseCollection(
        width, width, np.zeros(len(near)), units="xy", transOffset=axis.transData,
        offsets=1e3 * np.column_stack([across, centre[:, 2]])[near], cmap="viridis",
        array=100 * table["strain_deviator"].to_numpy()[near], edgecolors="k", linewidths=0.3,
    )  # fmt: skip
    grains.set_clim(0, limit)
    axis.add_collection(grains)
    half = 0.55e3 * np.ptp(centre, axis=0) + 0.1
    axis.set(xlim=(-half[0], half[0]), ylim=(-half[2], half[2]), aspect="equal",
             xlabel=f"{folder.name}: across [mm]", ylabel="z [mm]")  # fmt: skip
    figure.colorbar(grains, ax=axis, label=r"$\varepsilon_q$ [%]", shrink=0.7)


def draw(folder, path):
    """q over strain, change of volume, and the strains around grains at the end."""
    with matplotlib.rc_context(RC):
        figure, axes = new_figure(PAGE, 0.42 * PAGE, ncols=4, width_ratios=(1.5, 1.5, 1, 1))
        for side, colour in zip(SIDES, (BLUE, RED), strict=True):
            strain, ratio, volume = curve(folder / side)
            axes[0].plot(100 * strain, ratio, color=colour, label=side)
            axes[1].plot(100 * strain, -100 * volume, color=colour)
        axes[0].set(xlabel="axial strain [%]", ylabel=r"$q/\sigma_r$ [-]")
        axes[0].legend()
        axes[1].set(xlabel="axial strain [%]", ylabel="dilation [%]")
        for axis, side in zip(axes[2:], SIDES, strict=True):
            draw_grains(figure, axis, folder / side, 200 * STRAIN)
        for k, axis in enumerate(axes):
            panel_letter(axis, k)
        figure.savefig(path, dpi=150)


def main(folder, sides=SIDES, speed=SPEED):
    """Pack, run what is missing, and with both sides write the figure and the numbers."""
    folder.mkdir(parents=True, exist_ok=True)
    packing = folder / "packing"
    if not packing.exists():
        settings = PackSettings(
            count=COUNT, d50=D50, uniformity=UNIFORMITY, cylinder=CYLINDER, friction=0.0,
            element_size=SIZE,
        )  # fmt: skip
        pack(None, settings, packing, spheres=True)
    for side in sides:
        if finished(folder / side) is None:
            go_on(folder / side, scene_of(packing / "grains", side, speed))
    if set(sides) != set(SIDES):
        return None
    rows = {side: numbers_of(folder / side) for side in SIDES}
    rows["apart"], rows["mean_apart"] = difference(*(curve(folder / s)[:2] for s in SIDES))
    (folder / "flexible_side.json").write_text(json.dumps(rows, indent=1))
    draw(folder, folder / "flexible_side.png")
    return rows


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, help="where packing, runs and the figure are written")
    parser.add_argument("--sides", nargs="+", choices=SIDES, default=SIDES, help="to be run")
    parser.add_argument("--speed", type=float, default=SPEED, help="of the shearing [m/s]")
    given = parser.parse_args()
    print(json.dumps(main(given.folder, given.sides, given.speed), indent=1))
