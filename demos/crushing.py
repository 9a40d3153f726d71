"""How strong are grains of sand? Balls crushed between platens, of strengths that scatter.

The strength of a grain is the largest force that it bears before a fragment comes loose, over its
diameter squared. By Weibull's law the part P of the grains survives a stress σ:

    σ = F/d²,  P(σ) = exp(-(σ/σ₀)^m)  (Jaeger 1967; McDowell & Bolton 1998).

Each seed is a grain: the scene of `mufe new crushing`, one to three minutes each.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import mufe_fenicsx as mufe  # first: one BLAS thread, the wheel's MPI

# isort: split
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from mpi4py import MPI

from mufe_fenicsx.calibration.weibull import fit_weibull
from mufe_fenicsx.synthetic.starter_scenes import D50, write_new_scene

parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
parser.add_argument("folder", type=Path, help="new folder of the runs")
parser.add_argument("--seeds", type=int, default=5, help="number of grains")
parser.add_argument("--figure", help="file that a figure is saved to")
given = parser.parse_args()

write_new_scene("crushing", given.folder)
scene = mufe.load_scene(given.folder / "scene.toml")
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.2), layout="constrained")
strength = []
for seed in range(1, given.seeds + 1):
    grain = replace(scene, fracture=replace(scene.fracture, seed=seed))
    mufe.run_scene(grain, scene.sample.grains, given.folder / f"{seed}", MPI.COMM_WORLD, quiet=True)
    history = mufe.open_run(given.folder / f"{seed}").history
    stress = (0.5 * (history["force_z_min"] + history["force_z_max"]) / D50**2).to_numpy()
    whole = history["broken_grains"].to_numpy() == 0
    assert not whole[-1], f"seed {seed} has not come apart"
    strength.append(stress[whole].max())
    print(f"seed {seed}: {strength[-1] / 1e6:.1f} MPa")
    crushed = (history["stage"] == "crush").to_numpy()
    left.plot(history["strain"][crushed], stress[crushed] / 1e6, lw=0.9)

# Of n grains the k-th weakest is drawn at P = 1 - k/(n + 1); the law is that of largest likelihood.
strength = np.sort(strength)
survive = 1 - np.arange(1, given.seeds + 1) / (given.seeds + 1)
right.plot(strength / 1e6, survive, "o")
if given.seeds > 1:
    law = fit_weibull(strength * D50**2, np.full(given.seeds, D50))
    low, high = law.modulus_interval
    print(f"m = {law.modulus:.1f} ({low:.1f} to {high:.1f}) of grains; "
          f"{scene.fracture.modulus:g} of facets")  # fmt: skip
    stress = np.linspace(0.0, 1.2 * strength[-1], 200)
    right.plot(stress / 1e6, np.exp(-((stress / law.strength) ** law.modulus)))
left.set(xlabel="strain", ylabel="$F/d^2$ [MPa]")
right.set(xlabel="strength, $F/d^2$ [MPa]", ylabel="part that survives", ylim=(0, 1))
if given.figure:
    figure.savefig(given.figure, dpi=150)
