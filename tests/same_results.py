"""Whether two source trees compute the same: `python tests/same_results.py BEFORE AFTER`.

An oedometer test of 3000 steps with rigid grains and a wall held at a force, the same stopped and
resumed, stages of a triaxial test, and static increments are run by both trees, on one rank and on
two. Every number of `history.csv` and of the fields' files is compared. Exit status 1 where one
differs by more than 1e-9 of the largest of its column; differences of rounding are printed.
"""

import csv
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np

ALLOWED = 1e-9

MAKE_GRAINS = """
from mufe_fenicsx.geometry.grains import save_grains
from tests.bodies import RADIUS, packed_grains
save_grains("grains", packed_grains((2, 2, 2), h=0.7 * RADIUS))
save_grains("column", packed_grains((1, 1, 3), h=0.7 * RADIUS))
"""
MATERIAL = """
[material]
model = "j2"
E = 100e9
nu = 0.15
rho = 2650.0
yield_stress = [[0.0, 10e6], [0.05, 110e6]]

[contact]
friction = 0.4
friction_kinetic = 0.3
wall_friction = 0.2
"""
RIGID = """
[materials.hard]
labels = [2]
model = "rigid"
E = 100e9
nu = 0.15
rho = 2650.0

[materials.late]
labels = [3, 5]
model = "auto"
E = 100e9
nu = 0.15
rho = 2650.0
yield_stress = [[0.0, 10e6], [0.05, 110e6]]
margin = 0.05

[walls.x_max]
stress = 2e5
speed = 1.0
"""
OEDOMETER = """
[oedometer]
strain = 0.05
speed = 20.0
seating_stress = 1e4

[output]
fields = 3
history = 41
checkpoint_steps = 500
"""
STAGES = """
[loading]
speed = 0.5
ramp = 2e-4
tolerance = 0.05

[[stage]]
zero = true
xyz.stress = 1e6

[[stage]]
name = "shear"
z.strain = 0.01

[solver]
damping = 2e5
"""
STATIC = """
[solver]
integrator = "static"

[implicit]
step = 1e-3
"""
#: Scene, its grains, and the numbers of steps after which it is stopped.
SCENES = {
    "oedometer": (MATERIAL + RIGID + OEDOMETER, "grains", [3000]),
    "resumed": (MATERIAL + RIGID + OEDOMETER, "grains", [700, 1400]),
    "stages": (MATERIAL + STAGES, "column", [2000]),
    "static": (MATERIAL + OEDOMETER.replace("0.05", "0.02") + STATIC, "column", [12]),
}


def run(tree, folder, name, ranks):
    """The run folder of one scene by one source tree."""
    text, grains, stops = SCENES[name]
    out = folder / f"{name}-{ranks}"
    scene = folder / f"{name}.toml"
    scene.write_text(text, encoding="utf-8")
    for number, steps in enumerate(stops):
        words = [sys.executable, "-m", "mufe_fenicsx", "run", str(scene), "-o", str(out), "--quiet"]
        words += ["--grains", str(folder.parent / grains), "--max-steps", str(steps)]
        words += ["--resume"] if number else []
        if ranks > 1:
            words = [str(Path(sys.executable).parent / "mpirun"), "-n", str(ranks), *words]
        by_tree(tree, words, folder)
    return out


def by_tree(tree, words, folder):
    environment = {**os.environ, "PYTHONPATH": str(Path(tree).resolve()), "OMP_NUM_THREADS": "1"}
    done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(words)} by {tree} failed: {done.stderr[-2000:]}")


def columns(out):
    """All numbers of a run: {file and name: array}."""
    with (out / "history.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    found = {
        f"history {name}": np.array([row[name] for row in rows])
        for name in (rows[0] if rows else {})
    }
    for path in sorted((out / "fields").glob("*.h5")):
        with h5py.File(path) as file:

            def add(name, item, path=path):
                if isinstance(item, h5py.Dataset):
                    found[f"{path.name} {name}"] = item[()]

            file.visititems(add)
    return found


def largest_difference(before, after):
    """Over the largest of the column; nan where they cannot be compared."""
    if before.shape != after.shape:
        return np.nan
    if np.array_equal(before, after):
        return 0.0
    try:
        a, b = before.astype(float), after.astype(float)
    except ValueError:
        return np.nan
    return float(np.nanmax(np.abs(a - b)) / (np.nanmax(np.abs(a)) or 1.0))


def main(before, after):
    """Compare, tell, and return the exit status."""
    worst = 0.0
    with tempfile.TemporaryDirectory() as scratch:
        folders = [Path(scratch, "before"), Path(scratch, "after")]
        for folder in folders:
            folder.mkdir()
        by_tree(before, [sys.executable, "-c", MAKE_GRAINS], Path(scratch))
        for name in SCENES:
            for ranks in (1, 2):
                one, two = (
                    columns(run(tree, folder, name, ranks))
                    for tree, folder in zip((before, after), folders, strict=True)
                )
                parted = {
                    key: largest_difference(one[key], two[key]) for key in one.keys() & two.keys()
                }
                parted = {key: value for key, value in parted.items() if value != 0.0}
                only = sorted(one.keys() ^ two.keys())
                print(f"{name} on {ranks}: {len(one)} columns, {len(parted)} differ", flush=True)
                for key, value in sorted(parted.items()):
                    print(f"    {key}: {value:.2g}")
                print(*(f"    {key}: in one of them only\n" for key in only), end="")
                worst = max([worst, *(np.nan_to_num(v, nan=1.0) for v in parted.values())])
    return int(worst > ALLOWED)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:3]))
