"""The oedometer test of a sand by time steps and by static increments.

A corner of the benchmark's synthetic sand, meshed coarsely, yielding and with friction: 34 grains
with those cut by the border, or 17 (--sample 8). Time steps seat the sample and compress it at two
speeds; a straight line through both stresses gives that at no speed. Static increments go on from
the same end of the seating. The page has the stress over strain, and how far apart they are.

    python demos/static_oedometer.py FOLDER --cache CACHE      a quarter of an hour of one core
    python demos/static_oedometer.py FOLDER --cache CACHE --sample 8
    python demos/static_oedometer.py FOLDER --grains GRAINS    with meshes that are there

Finished runs in FOLDER are kept, and others go on where they stopped.
"""

import argparse
import csv
import json
import shutil
from pathlib import Path

import mufe_fenicsx  # noqa: F401  first: one BLAS thread, the wheel's MPI

# isort: split
import numpy as np
from kept_runs import finished, go_on

from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.scene import Contact, Implicit, Oedometer, Output, Sample, Scene, Solver
from mufe_fenicsx.verification.family import member

#: Strain at the end, and speeds of the platen [m/s], the slowest last: far apart, since the line
#: through both adds a third of their scatter, and all of it with half the speed.
STRAIN, SPEEDS = 0.05, (2.0, 0.5)
#: Stress at the end of the seating [Pa], and the platen's speed until then [m/s].
SEATED, SEATING_SPEED = 1.5e6, 0.25
#: Strain at which the seating counts as over for static increments to go on.
SHORT = 1e-5
#: Stresses are means over this strain to both sides: waves go to and fro between the platens.
HALF_WINDOW = 1e-3
#: From this strain on they are compared: before, speeds differ by more than what is wanted.
FIRST = 0.01
#: Largest difference of static increments from time steps at no speed.
TARGET = 0.03
#: Wanted edges [m].
SIZE = 30e-6


def scene_of(grains, speed, integrator="explicit", strain=STRAIN):
    """The test at one speed; the paper's material and friction (Nadimi & Fonseca 2018)."""
    return Scene(
        title="Oedometer test by time steps and by static increments",
        sample=Sample(grains=Path(grains)),
        material=J2(100e9, 0.15, 2650.0, ((0.0, 10e6), (0.05, 110e6))),
        contact=Contact(friction=0.23),
        solver=Solver(integrator=integrator),
        implicit=Implicit(
            step=2.5e-4, largest=2e-3, stabilisation=1e-4, tolerance=1e-3, linear_solver="products"
        ),
        oedometer=Oedometer(
            strain=strain, speed=speed, ramp=0.0, seating_stress=SEATED,
            seating_speed=SEATING_SPEED,
        ),
        output=Output(fields=2, history=500, checkpoint=600.0),
    )  # fmt: skip


def run(folder, scene):
    """Run it up to its strain, or go on with what is there."""
    done = finished(folder)
    if done is None or done["strain"] < scene.oedometer.strain:
        go_on(folder, scene)


def run_all(folder, grains):
    """All runs; their folders by name."""
    folders = {f"speed-{speed:g}": folder / f"speed-{speed:g}" for speed in SPEEDS}
    for speed, path in zip(SPEEDS, folders.values(), strict=True):
        run(path, scene_of(grains, speed))
    seated, static = folder / "seated", folder / "static"
    run(seated, scene_of(grains, SPEEDS[-1], strain=SHORT))
    if not static.exists():
        shutil.copytree(seated, static)
    run(static, scene_of(grains, SPEEDS[-1], "static"))
    return folders | {"static": static}


def stress_of(folder, strains):
    """Stress at ``strains`` [Pa], mean of both platens and over a window; nan beyond the end."""
    with open(folder / "history.csv", encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["stage"] == "loading"]
    area = json.loads((folder / "run.json").read_text())["area"]
    strain = np.array([float(row["strain"]) for row in rows])
    force = np.array([[float(row[f"force_z_{end}"]) for end in ("min", "max")] for row in rows])
    window = np.linspace(-HALF_WINDOW, HALF_WINDOW, 41)
    at = strains[:, None] + window
    stress = np.interp(at, strain, force.mean(axis=1) / area, right=np.nan)
    return stress.mean(axis=1)


def at_no_speed(fast, slow, speeds=SPEEDS):
    """The straight line through the stresses at two speeds, at none."""
    return slow - (fast - slow) * speeds[1] / (speeds[0] - speeds[1])


def compare(folders):
    """Strains, stresses by name [Pa], the one at no speed among them, and differences from it."""
    strains = np.arange(0.002, STRAIN - HALF_WINDOW, 0.001)
    stress = {name: stress_of(path, strains) for name, path in folders.items()}
    stress["none"] = at_no_speed(*(stress[f"speed-{speed:g}"] for speed in SPEEDS))
    return strains, stress, stress["static"] / stress["none"] - 1


def draw(strains, stress, apart, path):
    """Stress over strain, and differences from that at no speed."""
    import matplotlib

    from mufe_fenicsx.report.style import BLUE, PAGE, RC, RED, new_figure, panel_letter

    with matplotlib.rc_context(RC):
        figure, (left, right) = new_figure(PAGE, 0.42 * PAGE, ncols=2)
        left.plot(100 * strains, stress["none"] / 1e6, color=BLUE, label="time steps, at no speed")
        left.plot(100 * strains, stress["static"] / 1e6, color=RED, linestyle="--",
                  label="static increments")  # fmt: skip
        left.set_xlabel("axial strain [%]")
        left.set_ylabel("axial stress [MPa]")
        left.legend()
        for speed, line in zip(SPEEDS, (":", "-."), strict=True):
            change = 100 * (stress[f"speed-{speed:g}"] / stress["none"] - 1)
            right.plot(100 * strains, change, color=BLUE, linestyle=line, label=f"{speed:g} m/s")
        right.plot(100 * strains, 100 * apart, color=RED, label="static increments")
        right.set_xlabel("axial strain [%]")
        right.set_ylabel("stress over that at no speed, less 1 [%]")
        right.set_ylim(-10, 10)
        right.legend()
        for k, axis in enumerate((left, right)):
            panel_letter(axis, k)
        figure.savefig(path)


def page(strains, stress, apart, summaries, note=""):
    """The page in Markdown."""
    static = summaries["static"]
    last = strains[np.isfinite(apart)][-1]
    lines = [
        "# An oedometer test by static increments",
        "",
        "Made by `python demos/static_oedometer.py FOLDER --cache CACHE`: "
        f"{static['num_grains']} grains of the benchmark's synthetic sand, {static['num_cells']} "
        "tetrahedra, yield at 10 MPa and hardening, friction 0.23. Time steps seat the sample to "
        f"{SEATED / 1e6:g} MPa; from there time steps at {SPEEDS[0]:g} and {SPEEDS[1]:g} m/s, and "
        "static increments. Stresses are means of both platens and over a strain of "
        f"{2 * HALF_WINDOW:g}; a straight line through both speeds gives that at no speed.",
        "",
        "| strain | " + " | ".join(f"{s:g} m/s [MPa]" for s in SPEEDS)
        + " | at no speed [MPa] | static [MPa] | apart |",
        "|---|" + "---|" * (len(SPEEDS) + 3),
    ]  # fmt: skip
    for k in np.flatnonzero(np.isfinite(apart)):
        if (k + 2) % 5 and k:
            continue
        speeds = " | ".join(f"{stress[f'speed-{s:g}'][k] / 1e6:.2f}" for s in SPEEDS)
        lines.append(
            f"| {strains[k]:.3f} | {speeds} | {stress['none'][k] / 1e6:.2f} | "
            f"{stress['static'][k] / 1e6:.2f} | {100 * apart[k]:+.1f} % |"
        )
    compared = (strains >= FIRST) & np.isfinite(apart)
    fast, slow = (stress[f"speed-{s:g}"] for s in SPEEDS)
    between = fast / slow - 1
    lines += [
        "",
        f"From strain {FIRST:g} to {last:.3f} they are at most "
        f"{100 * np.abs(apart[compared]).max():.1f} % apart, "
        f"{100 * np.abs(apart[compared]).mean():.1f} % in the mean. Before, the two speeds differ "
        f"by up to {100 * np.abs(between[strains < FIRST]).max():.0f} %: waves from the seating.",
        "",
        "![Stress over strain](static_oedometer.png)",
        "",
        "(a) Stress over strain. (b) How far time steps at both speeds and static increments are "
        "from the stress at no speed.",
        "",
    ]
    return "\n".join(lines + ([note, ""] if note else []))


def main(folder, grains):
    """Run what is missing and write the page, its figure and its numbers into ``folder``."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    folders = run_all(folder, grains)
    write(folder, folders)


def write(folder, folders, note=""):
    """The page of finished runs; largest difference where it counts."""
    summaries = {name: json.loads((p / "run.json").read_text()) for name, p in folders.items()}
    strains, stress, apart = compare(folders)
    draw(strains, stress, apart, folder / "static_oedometer.png")
    text = page(strains, stress, apart, summaries, note)
    (folder / "static_oedometer.md").write_text(text, encoding="utf-8")
    values = {name: values.tolist() for name, values in stress.items()}
    (folder / "static_oedometer.json").write_text(
        json.dumps({"strain": strains.tolist(), "stress": values, "apart": apart.tolist()})
    )
    worst = float(np.nanmax(np.abs(apart[strains >= FIRST])))
    print(f"at most {worst:.2%} apart from strain {FIRST:g} on")
    assert worst <= TARGET, f"{worst:.2%} apart, expected at most {TARGET:.0%}"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", help="where runs, page, figure and numbers are written")
    parser.add_argument("--cache", help="where scan, labels and meshes of the sand are kept")
    parser.add_argument("--grains", help="folder of `mufe mesh` to be used instead")
    parser.add_argument("--sample", type=int, default=20, help="member of the sand: 8 or 20")
    given = parser.parse_args()
    if (given.cache is None) == (given.grains is None):
        parser.error("expected one of --cache and --grains")
    main(given.folder, given.grains or member(given.cache, given.sample, SIZE) / "grains")
