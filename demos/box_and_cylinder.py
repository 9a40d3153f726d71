"""The same sand in a box and in a cylinder cut out of it: does the shape of the walls matter?

    python demos/box_and_cylinder.py FOLDER [--seeds 3]       ten minutes or so on one core

Synthetic sand is pressed twice by a smooth oedometer: the whole of its box, and the largest
cylinder in it, whose grains are cut by its side as those of the box are by its planes. The
constrained modulus and K0 at the end are means of the last fifth of the strain. With several
packings it is seen whether the two shapes differ by more than packings do. It ends in a check:
the difference of the means is below twice its standard error, or below 3 %.
"""

import argparse
import json
import sys
from pathlib import Path

import mufe_fenicsx as mufe

# isort: split
import numpy as np
import scipy.ndimage
import tifffile
from mpi4py import MPI

from mufe_fenicsx.geometry.image.label_files import read_labels
from mufe_fenicsx.geometry.pipeline import mesh_labels
from mufe_fenicsx.geometry.settings import MeshSettings
from mufe_fenicsx.scene import Contact, ContainerSettings, Oedometer, Output, Sample, Scene, Solver
from mufe_fenicsx.synthetic.pipeline import synthesize
from mufe_fenicsx.synthetic.settings import SynthesisSettings

#: Voxels along an edge, their size, the grains' median diameter, and the meshes' edges [m].
NUM, VOXEL, D50, SIZE = 128, 5e-6, 1e-4, 2.4e-5
#: Soft grains are as good as stiff ones here, and their steps are longer.
SAND = mufe.Elastic(E=1e9, nu=0.2, rho=2650.0)
#: Grains thinner than so many voxels are left out.
THIN = 5
STRAIN, SPEED = 0.02, 0.25


def scene(shape):
    """The oedometer test of a shape."""
    return Scene(
        material=SAND,
        contact=Contact(friction=0.4),
        oedometer=Oedometer(strain=STRAIN, speed=SPEED, ramp=0.002, seating_stress=5e4),
        container=ContainerSettings(shape),
        sample=Sample(close_gaps_over_h=0.3),
        solver=Solver(damping=1e4),
        output=Output(fields=2, history=101),
        title=f"Sand in a {shape}",
    )


def test(folder, labels, shape):
    """Modulus [Pa], K0, void ratio and number of grains of one sample in one shape."""
    cut = {"cylinder_radius": 0.5 * NUM * VOXEL} if shape == "cylinder" else {}
    grains, results = folder / f"grains-{shape}", folder / shape
    if not (results / "run.json").exists():
        mesh_labels(
            labels,
            MeshSettings(size=SIZE, voxel_size=VOXEL, keep_largest_piece=True, **cut),
            grains,
            overwrite=True,
        )
        mufe.run_scene(scene(shape), grains, results, MPI.COMM_WORLD, quiet=True)
    run = mufe.open_run(results)
    curves = run.curves(width=0.2 * STRAIN)
    last = curves["strain"] > 0.8 * STRAIN
    found = {name: float(curves[name][last].mean()) for name in ("modulus", "K0", "void_ratio")}
    return found | {"num_grains": run.summary["num_grains"]}


def write_without_slivers(path, to):
    """Labels without what the border of the box has left of grains that it hardly cuts."""
    labels, _ = read_labels(path)
    for label, where in enumerate(scipy.ndimage.find_objects(labels), start=1):
        if where is not None and min(s.stop - s.start for s in where) < THIN:
            labels[labels == label] = 0
    tifffile.imwrite(to, labels)


def main():
    """Run all samples in both shapes, and compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="where samples and runs are written")
    parser.add_argument("--seeds", type=int, default=3, help="number of packings")
    given = parser.parse_args()
    rows = []
    for seed in range(1, given.seeds + 1):
        folder = given.folder / f"seed-{seed}"
        folder.mkdir(parents=True, exist_ok=True)
        labels = folder / "labels.tif"
        if not labels.exists():
            settings = SynthesisSettings(shape=(NUM,) * 3, voxel_size=VOXEL, d50=D50, seed=seed)
            synthesize(settings, folder / "sand", overwrite=True)
            write_without_slivers(folder / "sand" / "truth_labels.tif", labels)
        for shape in ("box", "cylinder"):
            rows.append({"seed": seed, "shape": shape, **test(folder, labels, shape)})
            print(json.dumps(rows[-1]), flush=True)
    wrong = False
    for name in ("modulus", "K0"):
        of = {s: np.array([r[name] for r in rows if r["shape"] == s]) for s in ("box", "cylinder")}
        box, difference = of["box"], of["cylinder"] - of["box"]
        error = difference.std(ddof=1) / np.sqrt(len(difference)) if len(box) > 1 else np.nan
        mean = difference.mean()
        wrong |= abs(mean) > max(2 * np.nan_to_num(error, nan=np.inf), 0.03 * box.mean())
        print(
            f"{name}: box {box.mean():.4g}, cylinder {of['cylinder'].mean():.4g}; difference "
            f"{mean / box.mean():+.1%} ± {error / box.mean():.1%}; packings scatter by "
            f"{box.std(ddof=1) / box.mean() if len(box) > 1 else np.nan:.1%}"
        )
    return int(wrong)


if __name__ == "__main__":
    sys.exit(main())
