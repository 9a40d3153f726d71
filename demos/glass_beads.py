"""Glass beads in an oedometer beside a curve of a laboratory, nothing fitted.

Spheres are packed, a sample is cut from the packing away from its walls, brought to the first
stresses of the curve along a straight path, and then compressed, unloaded and reloaded between the
strains at which the laboratory turned. Modulus and friction are those of glass in the literature.

The curve is a table of strain, stress and side_stress as `[[reference]]` reads it; its first row is
the start:

    python demos/glass_beads.py CURVE.csv FOLDER                        ten minutes of a processor
    python demos/glass_beads.py CURVE.csv FOLDER --void-ratio 0.655 --packing-friction 1
    python demos/glass_beads.py CURVE.csv FOLDER --friction 0.1 0.25 0.4 --figure beads.png
"""

import argparse
from pathlib import Path

import mufe_fenicsx as mufe  # first: one BLAS thread, the wheel's MPI

# isort: split
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from command import call
from mpi4py import MPI

from mufe_fenicsx.results.reference_curves import (
    branches_of,
    curves_of_run,
    differences,
    read_reference,
)
from mufe_fenicsx.scene.reference import Reference

#: Soda-lime glass; the diameter changes nothing, as long as all is quasi-static.
SCENE = """
title = "Glass beads in an oedometer"
[sample]
grains = "grains"
[material]
model = "elastic"
E = "{modulus} GPa"
nu = 0.22
rho = "2500 kg/m^3"
[contact]
friction = {friction}
wall_friction = 0.0
[solver]
damping = "20 ms^-1"
[loading]
speed = "{speed} m/s"
ramp = 0.0005
tolerance = 0.03
[mass_scaling]
added = 0.2
[output]
fields = 3
history = 200
[[reference]]
file = "{curve}"
name = "laboratory"
[[stage]]
name = "start"
zero = true
z = {{ stress = {axial}, speed = "2 m/s" }}
xy = {{ stress = {lateral}, speed = "2 m/s" }}
"""
STAGE = """
[[stage]]
name = "{name}"
z = {{ strain = {strain} }}
{sides}
"""


def sample(folder, given):
    """Mesh the middle of a packing of spheres in a folder, unless it is there."""
    if (folder / "grains").is_dir():
        return
    call("pack", "--spheres", "--count", given.count, "--d50", "1 mm", "--uniformity", 1.1,
         "--friction", given.packing_friction, "--void-ratio", given.void_ratio,
         "--seed", given.seed, "--voxel-size", "25 um", "--cut", 1,
         "-o", folder / "packing", "--overwrite")  # fmt: skip
    call("mesh", folder / "packing" / "labels.tif", "--size", f"{1 / given.edges} mm",
         "-o", folder / "grains")  # fmt: skip


def run(folder, name, friction, lab, given):
    """Run the test with a friction; returns what is left of it, to be read."""
    of_lab = lab.columns
    lateral = of_lab.get("side_stress", of_lab["k0"] * of_lab["stress"])
    text = SCENE.format(
        friction=friction, modulus=given.modulus, speed=given.speed, curve=lab.path.resolve(),
        axial=of_lab["stress"][0], lateral=lateral[0],
    )  # fmt: skip
    for number, branch in enumerate(lab.branches):
        sides = "" if number else "xy = { strain = 0.0 }"
        strain = of_lab["strain"][branch][-1]
        text += STAGE.format(name=f"branch {number + 1}", strain=strain, sides=sides)
    path = folder / f"{name}.toml"
    path.write_text(text, encoding="utf-8")
    scene = mufe.load_scene(path)
    mufe.run_scene(scene, folder / "grains", folder / name, MPI.COMM_WORLD, quiet=True)
    return mufe.open_run(folder / name)


def tell(lab, curves):
    """Print how far stress, K0 and modulus of each branch are from those of the laboratory."""
    for d in differences(lab, curves):
        if d.quantity in ("stress", "k0") and d.num_points:
            form = "+.1%" if d.relative else "+.3f"
            mean, most = f"{d.mean:{form}}", f"{d.largest:{form}}"
            print(f"  {d.quantity}, {d.branch}: {mean} in the mean, {most} at most")
    for branch, own in zip(lab.branches, branches_of(curves), strict=False):
        moduli = [
            np.polyfit(columns["strain"][rows], columns["stress"][rows], 1)[0] / 1e9
            for columns, rows in ((lab.columns, branch), (curves, own))
        ]
        print(f"  modulus {moduli[1]:.2f} GPa, of the laboratory {moduli[0]:.2f}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__.partition("\n\n")[0],
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument(
        "curve", type=Path, help="table of the laboratory: strain, stress, and side_stress or k0"
    )
    parser.add_argument("folder", type=Path, help="folder of packing, meshes and runs")
    parser.add_argument("--friction", type=float, nargs="+", default=[0.25], help="of the beads")
    parser.add_argument("--modulus", type=float, default=65.0, help="of the beads [GPa]")
    parser.add_argument("--packing-friction", type=float, default=0.5, help="while they are packed")
    parser.add_argument("--void-ratio", type=float, default=0.61, help="of the packing")
    parser.add_argument("--count", type=int, default=500, help="beads of the packing")
    parser.add_argument("--edges", type=float, default=7.0, help="edges a diameter of the meshes")
    parser.add_argument("--speed", type=float, default=1.0, help="of a pair of walls [m/s]")
    parser.add_argument("--seed", type=int, default=1, help="of the packing")
    parser.add_argument("--figure", help="file that a figure is saved to")
    given = parser.parse_args()

    try:
        lab = read_reference(Reference(file=given.curve))
    except mufe.InputError as error:
        parser.error(str(error))
    for name in ("strain", "stress", "k0"):
        if name not in lab.columns:
            parser.error(f"{given.curve} has no {name}, expected strain, stress, side_stress or k0")
    sample(given.folder, given)
    figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.4), layout="constrained")
    strain, stress, k0 = (lab.columns[name] for name in ("strain", "stress", "k0"))
    left.plot(100 * strain, stress / 1e6, "k.", ms=3, label="laboratory")
    right.plot(stress / 1e6, k0, "k.", ms=3)
    for friction in given.friction:
        result = run(given.folder, f"friction-{friction:g}", friction, lab, given)
        curves = curves_of_run(result)
        print(f"friction {friction:g}, void ratio {curves['void_ratio'][0]:.3f} at the start:")
        tell(lab, curves)
        left.plot(
            100 * curves["strain"], curves["stress"] / 1e6, lw=1, label=f"friction {friction:g}"
        )
        right.plot(curves["stress"] / 1e6, curves["k0"], lw=1)
    left.set(xlabel="axial strain [%]", ylabel="axial stress [MPa]")
    left.legend(frameon=False)
    right.set(xlabel="axial stress [MPa]", ylabel="$K_0$", ylim=(0.0, 1.0))
    if given.figure:
        figure.savefig(given.figure, dpi=150)
