"""The same sand in a box and as a cylinder: coefficient of lateral stress and constrained modulus.

    python demos/box_and_cylinder.py FOLDER       a quarter of an hour of one core

Spheres are packed, and a box and a cylinder of the same section and height are cut out of the
middle of each packing, with smooth faces that fit the walls. Both are pressed one-dimensionally by
smooth platens between smooth sides that rest. With the vertical stress σz, the mean stress σs on
the sides and the vertical strain εz,

    K0 = σs/σz,    M = dσz/dεz    at σz = 100 kPa.

A sample of very many grains has no shape. In a small one the layer at the walls counts: the sides
of a box are 2/√π = 1.13 times those of the cylinder. The means over several packings should agree
within their scatter. Finished runs in FOLDER are kept, and others go on where they stopped.
"""

import argparse
import json
from pathlib import Path

import mufe_fenicsx as mufe

# isort: split
import matplotlib
import numpy as np
import scipy.ndimage
from kept_runs import finished, go_on

from mufe_fenicsx.geometry.image.cylinder import Cylinder
from mufe_fenicsx.geometry.image.label_files import read_labels, write_labels
from mufe_fenicsx.geometry.pipeline import mesh_labels
from mufe_fenicsx.geometry.settings import MeshSettings
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.report.style import BLUE, PAGE, RC, RED, new_figure, panel_letter
from mufe_fenicsx.scene import (
    Axis,
    Contact,
    ContainerSettings,
    Loading,
    MassScaling,
    Output,
    Sample,
    Scene,
    Solver,
    Stage,
    Until,
)
from mufe_fenicsx.synthetic.rigid_packing.pipeline import pack
from mufe_fenicsx.synthetic.rigid_packing.settings import PackSettings

SEEDS = (1, 2, 3)
#: Grains of a packing, their size by mass, the edge of a voxel, and the friction while packing.
COUNT, D50, VOXEL, PACKING_FRICTION = 800, 300e-6, 15e-6, 0.1
#: Edge of the box and height of both samples [m], and wanted edges of the meshes [m].
EDGE, SIZE = 1.605e-3, 75e-6
RADIUS = EDGE / np.sqrt(np.pi)
#: What a cut leaves of a grain is kept from so many voxels and this thickness [voxels] on.
LEAST_VOXELS, LEAST_THICKNESS = 200, 5
#: Soft grains: E/p = 10⁴ at 100 kPa, where contacts are flattened by (p/E)^(2/3) = 0.2 % of D.
SAND = Elastic(E=1e9, nu=0.2, rho=2650.0)
#: Stresses at the end of the seating, where K0 and M are taken, and at the end [Pa].
SEATED, AT, END = 10e3, 100e3, 150e3
#: K0 and M are those of straight lines over this part of AT to both sides.
HALF_WINDOW = 0.2
#: Speeds of seating and loading, of the height [m/s].
SEATING_SPEED, SPEED = 0.1, 0.06
SHAPES = ("box", "cylinder")


def cut(packing, shape, path):
    """Write the labels of a sample cut out of the middle of a packing; returns their number."""
    labels, voxel = read_labels(packing / "labels.tif")
    across = EDGE if shape == "box" else 2 * RADIUS
    wanted = [round(length / voxel) for length in (EDGE, across, across)]
    if shape == "cylinder":  # room for the whole circle
        wanted[1:] = (int(np.ceil(across / voxel)) + 2 for _ in range(2))
    low = [(n - w) // 2 for n, w in zip(labels.shape, wanted, strict=True)]
    part = labels[tuple(slice(a, a + w) for a, w in zip(low, wanted, strict=True))].copy()
    about = None
    if shape == "cylinder":
        middle = wanted[1] / 2
        part[~Cylinder(middle, middle, RADIUS / voxel).inside(part.shape)] = 0
        about = {"x": middle * voxel, "y": middle * voxel, "radius": RADIUS, "cut": True}
    for label, box in enumerate(scipy.ndimage.find_objects(part), 1):
        if box is not None:
            mine = part[box] == label
            if mine.sum() < LEAST_VOXELS or min(mine.shape) < LEAST_THICKNESS:
                part[box][mine] = 0
    _, numbered = np.unique(part, return_inverse=True)
    write_labels(path, numbered.reshape(part.shape), voxel, about)
    return int(numbered.max())


def grains_of(folder, seed, shape):
    """Folder of the meshes of a sample, made where absent."""
    packing, grains = folder / f"packing-{seed}", folder / f"{shape}-{seed}-grains"
    if not packing.exists():
        settings = PackSettings(
            count=COUNT, d50=D50, friction=PACKING_FRICTION, voxel_size=VOXEL, seed=seed,
            element_size=2 * SIZE,
        )  # fmt: skip
        pack(None, settings, packing, spheres=True)
    if not grains.exists():
        labels = folder / f"{shape}-{seed}.tif"
        cut(packing, shape, labels)
        made = mesh_labels(labels, MeshSettings(size=SIZE, keep_largest_piece=True), grains)
        print(f"{shape} {seed}: {made['num_grains']} grains, {made['num_cells']} tetrahedra, "
              f"failed {made['failed']}", flush=True)  # fmt: skip
    return grains


def scene_of(grains, shape, speed=SPEED):
    """Seating from all sides, and one-dimensional compression in which the sides rest."""
    across = ("x", "y") if shape == "box" else ("r",)
    seating, rest = Axis(stress=SEATED, speed=SEATING_SPEED), Axis(speed=0.0)
    return Scene(
        title=f"One-dimensional compression, {shape}",
        sample=Sample(grains=grains),
        container=ContainerSettings(shape=shape),
        material=SAND,
        contact=Contact(friction=0.3),
        solver=Solver(damping=2e4),
        mass_scaling=MassScaling(added=0.05, added_to_grain=1.0),
        loading=Loading(speed=speed, ramp=0.001, tolerance=0.05),
        stages=(
            Stage(zero=True, **dict.fromkeys((*across, "z"), seating)),
            Stage(name="load", **dict.fromkeys(across, rest), z=Axis(strain=0.2),
                  until=Until(stress_z=END)),
        ),
        output=Output(fields=3, history=600, checkpoint=120.0),
    )  # fmt: skip


def curve(folder, shape):
    """Strain, vertical stress and mean stress on the sides [Pa] of the loading."""
    history = mufe.open_run(folder).history
    load = history[history["stage"] == "load"]
    sides = ("stress_x", "stress_y") if shape == "box" else ("stress_r",)
    side = np.mean([load[name] for name in sides], axis=0)
    return np.asarray(load["strain_z"]), np.asarray(load["stress_z"]), side


def window(vertical):
    """Rows near the stress at which numbers are taken."""
    return np.abs(vertical / AT - 1) < HALF_WINDOW


def tangent(strain, vertical):
    """Constrained modulus: slope of the line fitted near AT [Pa]."""
    near = window(vertical)
    return float(np.polyfit(strain[near], vertical[near], 1)[0])


def lateral_ratio(vertical, side):
    """K0: what the line fitted near AT has there, over AT."""
    near = window(vertical)
    return float(np.polyval(np.polyfit(vertical[near], side[near], 1), AT)) / AT


def numbers_of(folder, shape):
    """K0, M [Pa], solid fraction, and how still the sample is, at the stress AT."""
    strain, vertical, side = curve(folder, shape)
    near = window(vertical)
    done = mufe.open_run(folder)
    history = done.history[done.history["stage"] == "load"][near]
    apart = (history["force_z_max"] - history["force_z_min"]).mean()
    force = 0.5 * (history["force_z_max"] + history["force_z_min"]).mean()
    grains = mufe.load_grains(folder.parent / f"{folder.name}-grains")
    if shape == "box":
        area = history["length_x"] * history["length_y"]
    else:
        area = np.pi / 4 * history["diameter"] ** 2
    lateral, side_area = at_the_sides(folder)
    return {
        "grains": int(grains.num_grains),
        "solid_fraction": float(np.sum(grains.volumes) / (area * history["height"]).mean()),
        "coordination": float(history["num_active_contacts"].mean()),
        "K0": lateral_ratio(vertical, side),
        "M": tangent(strain, vertical),
        "kinetic": float((history["kinetic"] / history["elastic"]).max()),
        "unbalanced": float(apart / force),
        "lateral_inside": lateral,
        "side_area": side_area,
    }


def at_the_sides(folder):
    """Mean lateral over vertical strain of grains, and contact area [m²] of the sides at the end.

    Where sides give way, as rough or ill-fitting ones do, grains move outward: a negative ratio.
    """
    done = mufe.open_run(folder)
    table = done.localisation()
    table = table[np.isfinite(table["strain_deviator"])]
    mean = table[["strain_xx", "strain_yy", "strain_zz"]].mul(table["cell_volume"], axis=0).sum()
    contacts = done.contacts()
    side = contacts["wall"].astype(str).str.match("side|x_|y_")
    ratio = 0.5 * (mean["strain_xx"] + mean["strain_yy"]) / mean["strain_zz"]
    return float(ratio), float(contacts["area"][side].sum())


def compare(rows):
    """Mean and standard deviation by shape of K0 and M, and the ratio of the means.

    The standard error of the ratio is that of both means, as if they were independent.
    """
    found = {}
    for name in ("K0", "M"):
        values = {shape: np.array([row[name] for row in rows[shape]]) for shape in SHAPES}
        mean = {shape: float(v.mean()) for shape, v in values.items()}
        scatter = {shape: float(v.std(ddof=1)) for shape, v in values.items()}
        ratio = mean["cylinder"] / mean["box"]
        parts = [scatter[s] / mean[s] / np.sqrt(len(values[s])) for s in SHAPES]
        pairs = values["cylinder"] / values["box"]
        found[name] = {
            "mean": mean, "scatter": scatter, "ratio": ratio,
            "error": ratio * float(np.hypot(*parts)), "pairs": pairs.tolist(),
        }  # fmt: skip
    return found


def draw(folder, path):
    """Vertical stress over strain, and K0 over the vertical stress."""
    with matplotlib.rc_context(RC):
        figure, (left, right) = new_figure(PAGE, 0.4 * PAGE, ncols=2)
        for shape, colour in zip(SHAPES, (BLUE, RED), strict=True):
            for seed, line in zip(SEEDS, ("-", "--", ":"), strict=True):
                strain, vertical, side = curve(folder / f"{shape}-{seed}", shape)
                left.plot(100 * strain, vertical / 1e3, color=colour, linestyle=line,
                          label=f"{shape}, packing {seed}")  # fmt: skip
                right.plot(vertical / 1e3, side / vertical, color=colour, linestyle=line)
        left.set(xlabel="vertical strain [%]", ylabel="vertical stress [kPa]")
        left.legend()
        right.set(xlabel="vertical stress [kPa]", ylabel=r"$K_0$ [-]", ylim=(0, 1))
        for k, axis in enumerate((left, right)):
            panel_letter(axis, k)
        figure.savefig(path, dpi=150)


def main(folder, seeds=SEEDS):
    """Make and run what is missing, write the figure and the numbers, and compare them."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = {shape: [] for shape in SHAPES}
    for seed in seeds:
        for shape in SHAPES:
            path = folder / f"{shape}-{seed}"
            if finished(path) is None:
                go_on(path, scene_of(grains_of(folder, seed, shape), shape))
            rows[shape].append(numbers_of(path, shape))
            print(shape, seed, rows[shape][-1], flush=True)
    found = compare(rows)
    (folder / "box_and_cylinder.json").write_text(json.dumps(rows | found, indent=1))
    draw(folder, folder / "box_and_cylinder.png")
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, help="where packings, runs and the figure are written")
    parser.add_argument("--seeds", type=int, nargs="+", default=SEEDS, help="of the packings")
    given = parser.parse_args()
    print(main(given.folder, given.seeds))
