"""When does sand yield? An oedometer test of grains that break, its void ratio beside the load.

Spheres whose strengths scatter from grain to grain are packed and compressed. Sand yields where its
grains begin to break; beyond, the void ratio e falls along a line (de Bono & McDowell 2018)

    log e = const - log(σ) / (2 b),  b = 3/m,

where a grain of diameter d is as strong as d^(-b), m of Weibull's law. The grains are of 0.7 mm, as
coarse Ottawa sand. The same command goes on with a run that was stopped.
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

SCENE = """
title = "Sand whose grains break"
[sample]
grains = "grains"
[material]
model = "elastic"
E = "70 GPa"
nu = 0.17
rho = "2650 kg/m^3"
[fracture]
strength = "{strength} MPa"
energy = "10 J/m^2"
friction = 0.6
modulus = {modulus}
scatter = "grain"
reference_volume = "0.19 mm^3"
seed = {seed}
lower_strength = true
[contact]
friction = 0.4
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
fields = 6
history = 200
[[stage]]
name = "seating"
zero = true
xyz = {{ stress = "1 MPa", speed = "2 m/s" }}
[[stage]]
name = "compression"
z = {{ speed = "{speed} m/s" }}
xy = {{ strain = 0.0 }}
until = {{ stress_z = "{stress} MPa", strain_z = {strain} }}
"""


def pack(folder, given):
    """Pack and mesh spheres, unless it is done."""
    if not (folder / "grains").is_dir():
        call("pack", "--spheres", "--count", given.count, "--d50", "0.7 mm", "--uniformity", 1.2,
             "--friction", 0.4, "--seed", given.seed, "--element-size",
             f"{0.7 / given.edges} mm", "-o", folder, "--overwrite")  # fmt: skip


def yield_point(stress, void_ratio):
    """Stress and slope -d log e / d log σ of the line beyond the sharpest bend of the curve.

    Two lines through log e over log σ, the first and the last points, that fit best together.
    """
    x, y = np.log(stress), np.log(void_ratio)
    fits = []
    for split in range(len(x) // 4, len(x) - len(x) // 8):
        lines = [np.polyfit(x[part], y[part], 1) for part in (slice(split), slice(split, None))]
        misses = [y[:split] - np.polyval(lines[0], x[:split]),
                  y[split:] - np.polyval(lines[1], x[split:])]  # fmt: skip
        fits.append((sum(np.sum(miss**2) for miss in misses), lines))
    (first, offset), (last, end) = min(fits, key=lambda fit: fit[0])[1]
    return np.exp((end - offset) / (first - last)), -last


def compress(folder):
    """Run the test, or go on with it where it was stopped."""
    run = folder / "run"
    if run.is_dir() and mufe.open_run(run).finished:
        return
    more = ["--resume"] if (run / "checkpoints").is_dir() else []
    call("run", folder / "crushing.toml", "-o", run, *more)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__.partition("\n\n")[0],
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument("folder", type=Path, help="folder of the packing and the run")
    parser.add_argument("--count", type=int, default=60, help="number of grains")
    parser.add_argument("--edges", type=float, default=5.5, help="edges a diameter")
    parser.add_argument("--strength", type=float, default=30.0, help="of facets [MPa]")
    parser.add_argument("--modulus", type=float, default=5.0, help="m of Weibull's law")
    parser.add_argument("--stress", type=float, default=50.0, help="largest stress [MPa]")
    parser.add_argument("--strain", type=float, default=0.2, help="largest strain")
    parser.add_argument("--speed", type=float, default=1.0, help="of a pair of walls [m/s]")
    parser.add_argument("--seed", type=int, default=1, help="of packing and strengths")
    parser.add_argument("--figure", help="file that a figure is saved to")
    given = parser.parse_args()

    pack(given.folder, given)
    (given.folder / "crushing.toml").write_text(SCENE.format(**vars(given)), encoding="utf-8")
    compress(given.folder)
    history = mufe.open_run(given.folder / "run").history
    history = history[(history["stage"] == "compression") & (history["stress_z"] > 1e6)]
    stress, void_ratio = history["stress_z"].to_numpy(), history["void_ratio"].to_numpy()
    at, slope = yield_point(stress, void_ratio)
    yields = stress[0] < at < stress.max() and slope > 0.0
    if yields:
        print(f"yields at {at / 1e6:.1f} MPa, then -d log e / d log sigma = {slope:.3f}; "
              f"m / 6 = {given.modulus / 6:.3f}")  # fmt: skip
    else:
        print("no yield point in this test: no bend beyond which the void ratio falls along a line")
    print(f"largest stress {stress.max() / 1e6:.1f} MPa; at the end "
          f"{history['broken_grains'].iloc[-1]} of {given.count} grains are broken")  # fmt: skip
    figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.3), layout="constrained")
    left.semilogx(stress / 1e6, void_ratio, lw=0.9)
    if yields:
        left.axvline(at / 1e6, color="0.6", lw=0.8)
    left.set(xlabel="axial stress [MPa]", ylabel="void ratio")
    right.plot(100 * history["strain"], stress / 1e6, lw=0.9)
    broken = right.twinx()
    broken.plot(100 * history["strain"], history["broken_grains"] / given.count, "C3", lw=0.9)
    broken.set_ylabel("part of grains broken", color="C3")
    right.set(xlabel="axial strain [%]", ylabel="axial stress [MPa]")
    if given.figure:
        figure.savefig(given.figure, dpi=150)
