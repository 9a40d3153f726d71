"""Does packed sand follow the shapes of laboratory curves? Nothing is fitted.

Angular grains of quartz are packed with little, some and much friction: dense, medium and loose.
Each sample is compressed in an oedometer, from two isotropic stresses, and sheared at a constant
side stress. Beside it stand numbers of Karlsruhe fine sand. Orders, ratios and powers may be
compared, not values: shapes of its grains are not known, and a box of some tens of grains is small.

Before an oedometer grains are parted, since those that overlap as packed touch with flats.

Grains are rigid, since nothing asks for stress inside them. Their contacts have the stiffness
of Hertz's law at one size; in the triaxial test they are softer, for longer time steps.

    python demos/sand.py FOLDER --figure sand.png           hours of a processor
    python demos/sand.py FOLDER --seed 1 2 3                more packings of each density
    python demos/sand.py FOLDER --reversal                  stiffness at small strains, alone

The same command goes on where it was stopped, and FOLDER/sand.csv has a row a test.
"""

import argparse
import csv
import itertools
import sys
from dataclasses import replace
from pathlib import Path

import mufe_fenicsx as mufe  # first: one BLAS thread, the wheel's MPI

# isort: split
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from command import call
from matplotlib.ticker import NullFormatter, ScalarFormatter

#: Karlsruhe fine sand, numbers from Wichtmann & Triantafyllidis, Acta Geotechnica 11, 2016,
#: 739-761. Void ratio at the start, at 100 and at 407 kPa, and modulus from 200 to 400 kPa [MPa].
OEDOMETER = np.array([
    [1.039, 0.982, 0.960, 36.0],
    [0.908, 0.882, 0.869, 55.0],
    [0.833, 0.813, 0.802, 62.0],
    [0.722, 0.708, 0.703, 113.0],
])  # fmt: skip
#: Drained at 100 kPa: void ratio, peak of q/p, strain there, volumetric strain at the end.
TRIAXIAL = np.array(
    [[1.0, 1.36, 0.22, 0.004], [0.86, 1.52, 0.14, -0.047], [0.71, 1.73, 0.059, -0.1]]
)

#: Of quartz: Young's modulus [Pa], Poisson's ratio.
YOUNG, POISSON = 95e9, 0.08

SCENE = """
title = "Sand, {test}"
[sample]
grains = "{grains}"
[material]
model = "{model}"
E = "{young:g} GPa"
nu = {poisson}
rho = "2650 kg/m^3"
{more}
[contact]
friction = {friction}
wall_friction = 0.0
[solver]
damping = "200 ms^-1"
[loading]
speed = "{speed} m/s"
ramp = 0.0005
tolerance = 0.03
largest_strain = 0.4
[output]
fields = {fields}
history = 1000
[[stage]]
name = "isotropic"
zero = true
xyz = {{ stress = "{stress} MPa", speed = "0.3 m/s" }}
[[stage]]
name = "test"
{last}
"""
COMPRESSION = """xy = {{ strain = 0.0 }}
z = {{ speed = "{speed} m/s" }}
until = {{ stress_z = "{largest} MPa", strain_z = 0.2 }}"""
SHEAR = "z = {{ strain = {strain} }}"
#: Of the oedometer to a stress, and back by a fifth.
REVERSAL = """xy = {{ strain = 0.0 }}
z = {{ speed = "{speed} m/s" }}
until = {{ stress_z = "{largest} MPa" }}
hold = "10 us"
[[stage]]
name = "back"
xy = {{ strain = 0.0 }}
z = {{ speed = "-{speed} m/s" }}
until = {{ stress_z = "{back} MPa" }}"""

#: Stresses whose modulus and K0 are told [Pa]. A modulus is the slope over a factor of two.
TOLD = (0.28e6, 0.5e6, 1e6, 2.7e6)
#: Stress after which --reversal slows down, rests and turns back [MPa].
REVERSES_AT = 0.28


def keep(path, text, made):
    """Write what something is made of, unless it was made of something else before."""
    if made.exists() and path.is_file() and path.read_text(encoding="utf-8") != text:
        sys.exit(f"{made} was made with other options, expected another FOLDER for these")
    path.write_text(text, encoding="utf-8")


def pack(folder, friction, seed, fine, given):
    """Pack and mesh grains, fine at contacts if it is wanted, unless it is done."""
    size = ["--contact-size", f"{140 / given.edges_at_contacts} um"] if fine else []
    words = ["pack", "--count", given.count, "--d50", "140 um", "--uniformity", 1.5,
             "--friction", friction, "--seed", seed, "--element-size", f"{140 / given.edges} um",
             *size, "-o", folder]  # fmt: skip
    grains = folder / "grains"
    if not grains.is_dir():
        call(*words, "--overwrite")
    keep(folder / "packed.txt", " ".join(map(str, words[:-2])), grains)


def parted(folder, apart):
    """Name of a folder of the grains farther apart by a part of their distances.

    Packed grains overlap a little. Runs flatten meshes there, and a flat contact is a stiff one
    from the first touch.
    """
    if not apart:
        return "grains"
    path = folder / f"grains-apart-{apart:g}"
    if not (path / "grains.h5").is_file():
        grains = mufe.load_grains(folder / "grains")
        shift = apart * np.repeat(grains.centroids, np.diff(grains.node_offset), axis=0)
        moved = replace(grains, points=grains.points + shift, box=(1 + apart) * grains.box)
        mufe.save_grains(path, moved)
    return path.name


def scene_of(name, grains, stress, given):
    """The scene of a test from an isotropic stress [MPa]."""
    shear = name == "triaxial"
    speed = given.shear_speed if shear else given.speed
    size = given.soft_contact if shear else given.contact
    more = f"contact_radius = {size}" if given.model == "rigid" else "[mass_scaling]\nadded = 0.2"
    last = {"triaxial": SHEAR, "oedometer": COMPRESSION, "reversal": REVERSAL}[name].format(
        speed=speed, largest=given.largest, back=0.8 * given.largest, strain=given.strain
    )
    return SCENE.format(
        test=name, grains=grains, model=given.model, more=more, friction=given.friction,
        speed=speed, stress=stress, last=last,
        young=YOUNG / 1e9, poisson=POISSON, fields=9 if name == "reversal" else 3,
    )  # fmt: skip


def test(folder, name, stress, given):
    """Run a test from an isotropic stress [MPa], or go on with it; returns the run."""
    # Shear moves grains past what was flat, and its contacts are soft.
    grains = parted(folder, 0.0 if name == "triaxial" else given.apart)
    text = scene_of(name, grains, stress, given)
    name = f"{name}-{stress:g}-MPa"
    scene, run = folder / f"{name}.toml", folder / name
    keep(scene, text, run)
    if not (run.is_dir() and mufe.open_run(run).finished):
        call("run", scene, "-o", run, *(["--resume"] if (run / "checkpoints").is_dir() else []))
    return mufe.open_run(run)


def moduli(strain, stress):
    """Stresses [Pa], and slopes of the curve over a factor of two around each [Pa]."""
    at = np.geomspace(1.45 * stress[0], stress[-1] / 1.45, 24)
    slopes = np.full(len(at), np.nan)
    for i, middle in enumerate(at):
        near = (stress > middle / 2**0.5) & (stress < middle * 2**0.5)
        if near.sum() > 2:
            slopes[i] = np.polyfit(strain[near], stress[near], 1)[0]
    return at, slopes


def at_contacts(history):
    """Neighbours that press on a grain, and elements that resolve contacts, at the start."""
    first = history.iloc[0]
    return {
        "contacts": first["num_active_contacts"],
        "elements_per_radius": first["elements_per_radius"],
    }


def springs(contacts, void_ratio, pressure):
    """Constrained modulus [Pa] of rough balls that do not slide, by their contacts a ball.

    Source: K. Walton, Journal of the Mechanics and Physics of Solids 35, 1987, 213-226.
    """
    modulus, r = YOUNG / (1 - POISSON**2), POISSON / (1 - POISSON)
    density = contacts / (1 + void_ratio)
    bulk = (3 * density**2 * modulus**2 * pressure / np.pi**2) ** (1 / 3) / 6
    return bulk * (1 + 4 / 3 * 3 / 5 * (5 + r) / (2 + r))


def small_strains_of_laboratory(void_ratio, pressure, uniformity=1.5):
    """Constrained modulus [Pa] of quartz sand at small strains.

    Source: T. Wichtmann, T. Triantafyllidis, Soil Dynamics and Earthquake Engineering 30, 2010,
    757-766.
    """
    a, n = 2.16 * np.exp(-0.055 * uniformity), 0.344 * uniformity**0.126
    factor = 3655 + 26.7 * uniformity**2.42
    return factor * (a - void_ratio) ** 2 / (1 + void_ratio) * 1e5 * (pressure / 1e5) ** n


def slope(history, rows):
    """Of axial stress over strain in some rows [MPa]."""
    some = history.iloc[rows]
    return np.polyfit(some["strain_z"], some["stress_z"], 1)[0] / 1e6


def of_reversal(run):
    """Moduli [MPa] from 0.20 to 0.35 MPa, and over a tenth and a fiftieth after a reversal.

    Beside them those of springs with the contacts then, and of the laboratory at small strains.
    """
    history, network = run.history, run.network()
    stress = history["stress_z"].to_numpy()
    test, back = (np.flatnonzero(history["stage"] == name) for name in ("test", "back"))
    top, side = history.iloc[back[0]], ["stress_x", "stress_y", "stress_z"]
    there = history.iloc[test[np.argmax(stress[test] > 1e6 * REVERSES_AT)]]
    state = network.iloc[(network["time"] - there["time"]).abs().argmin()]
    contacts = state["N_cA"] * (1 + state["num_wall_contacts"] / (2 * state["num_contacts"]))
    after = {part: back[stress[back] > part * top["stress_z"]] for part in (0.9, 0.98)}
    moving = test[(stress[test] > 0.2e6) & (stress[test] < 0.35e6)]
    return {
        "void_ratio": there["void_ratio"],
        "loading": slope(history, moving),
        "unloading": slope(history, after[0.9]),
        "unloading_at_first": slope(history, after[0.98]),
        "contacts": contacts,  # with walls, each a contact of its grain
        "sliding": state["sliding"],
        "springs": springs(contacts, there["void_ratio"], there[side].mean()) / 1e6,
        "laboratory": small_strains_of_laboratory(top["void_ratio"], top[side].mean()) / 1e6,
    }, None


def up_to(history, largest):
    """Rows of a test up to a stress [MPa]: beyond it walls still brake."""
    beyond = np.flatnonzero(history["stress_z"] > 1e6 * largest)
    return history.iloc[: beyond[0]] if beyond.size else history


def of_compression(history):
    """Numbers of an oedometer test, by name, and its curves."""
    columns = ["strain_z", "stress_z", "void_ratio", "stress_x", "stress_y"]
    strain, stress, void_ratio, x, y = history[columns].to_numpy().T
    at, slopes = moduli(strain, stress)
    told = np.isfinite(slopes) & (slopes > 0)
    power = np.polyfit(np.log(at[told]), np.log(slopes[told]), 1)[0]
    k0 = (x + y) / 2 / stress
    numbers = {"void_ratio": void_ratio[0], "power": power}
    for level in TOLD:
        near = (stress > level / 2**0.5) & (stress < level * 2**0.5)
        name = f"{level / 1e6:g}_MPa"
        numbers[f"modulus_{name}"] = (
            np.interp(level, at[told], slopes[told], left=np.nan, right=np.nan) / 1e6
        )
        numbers[f"k0_{name}"] = k0[near].mean() if near.any() else np.nan
    return numbers, {"stress": stress, "e": void_ratio, "k0": k0, "at": at, "slopes": slopes}


def means(strain, values, width):
    """Of values over a width of strain, on an even grid; some tens of grains bear unevenly."""
    grid = np.linspace(width / 2, strain[-1] - width / 2, 200)
    return grid, np.array([values[np.abs(strain - at) <= width / 2].mean() for at in grid])


def of_shear(history):
    """Numbers of a triaxial test, by name, and its curves; contraction is positive."""
    columns = ["strain_x", "strain_y", "strain_z", "stress_x", "stress_y", "stress_z", "void_ratio"]
    ex, ey, ez, x, y, z, void_ratio = history[columns].to_numpy().T
    ratio = 3 * (z - (x + y) / 2) / (x + y + z)
    volume = 1 - (1 - ex) * (1 - ey) * (1 - ez)
    width = 0.1 * ez[-1]
    strain, ratio = means(ez, ratio, width)
    near = (np.abs(ez - at) <= width / 2 for at in strain)
    dilation = max(-np.polyfit(ez[rows], volume[rows], 1)[0] for rows in near)
    peak = np.argmax(ratio)
    numbers = {
        "void_ratio": void_ratio[0], "peak": ratio[peak], "strain_at_peak": strain[peak],
        "end": ratio[-40:].mean(), "volume_at_end": volume[-1],
        "dilation": dilation,
    }  # fmt: skip
    return numbers, {"strain": strain, "ratio": ratio, "whole": ez, "volume": volume}


def powers_of_laboratory():
    """Of stress in the modulus, where strains from zero grow as stress to the power 1 - n."""
    start, low, high, _ = OEDOMETER.T
    return 1 - np.log((start - low) / (start - high)) / np.log(100 / 407)


def draw(curves, rows, path):
    """Three figures of the oedometer above three of the triaxial test; a colour a density."""
    figure, ((e, modulus, k0), (ratio, volume, peak)) = plt.subplots(
        2, 3, figsize=(10.5, 6.0), layout="constrained"
    )
    frictions = sorted({friction for friction, *_ in curves})
    for (friction, _seed, name, stress), c in curves.items():
        first = name == "oedometer" and stress == min(s for *_, n, s in curves if n == name)
        look = {"color": f"C{frictions.index(friction)}", "lw": 1, "ls": "-" if first else "--"}
        label = f"packed with friction {friction:g}"
        if name == "triaxial":
            look["ls"] = "-"
            ratio.plot(100 * c["strain"], c["ratio"], label=label, **look)
            volume.plot(100 * c["whole"], 100 * c["volume"], **look)
            continue
        e.semilogx(c["stress"] / 1e6, c["e"], label=label if first else None, **look)
        modulus.loglog(c["at"] / 1e6, c["slopes"] / 1e6, **look)
        grid, smooth = means(np.log(c["stress"] / c["stress"][0]), c["k0"], 0.2)
        k0.semilogx(c["stress"][0] * np.exp(grid) / 1e6, smooth, **look)
    for start, low, high, slope in OEDOMETER:
        e.plot([0.1, 0.407], [low, high], "k.-", ms=4, lw=0.6)
        modulus.plot(0.283, slope, "k.", ms=4 + 6 * (1.1 - start))
    for start, top, strain, _end in TRIAXIAL:
        ratio.plot(100 * strain, top, "k.")
        peak.plot(start, top, "k.")
    volume.plot(
        np.full(len(TRIAXIAL), 20.0), 100 * TRIAXIAL[:, 3], "k.", label="laboratory, whole test"
    )
    volume.legend(frameon=False)
    for axes in (e, ratio):
        if axes.get_legend_handles_labels()[0]:
            axes.legend(frameon=False, loc="lower right", fontsize="small")
    for row in rows:
        if row["test"] == "triaxial":
            color = f"C{frictions.index(row['packing_friction'])}"
            peak.plot(row["void_ratio"], row["peak"], "o", color=color, mfc="none")
    e.set(xlabel="axial stress [MPa]", ylabel="void ratio")
    modulus.set(xlabel="axial stress [MPa]", ylabel="tangent modulus [MPa]")
    k0.set(xlabel="axial stress [MPa]", ylabel="side over axial stress", ylim=(0.0, 1.1))
    ratio.set(xlabel="axial strain [%]", ylabel="q/p", ylim=(0.0, None))
    volume.set(xlabel="axial strain [%]", ylabel="volumetric strain [%]")
    peak.set(xlabel="void ratio", ylabel="peak of q/p")
    for axes in (e, modulus, k0):
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.xaxis.set_major_formatter(ScalarFormatter())
    figure.savefig(path, dpi=110)


def parsed(arguments=None):
    """What the command line says."""
    parser = argparse.ArgumentParser(
        description=__doc__.partition("\n\n")[0],
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    add = parser.add_argument
    add("folder", type=Path, help="folder of packings and runs")
    add("--packing-friction", type=float, nargs="+", default=[0.05, 0.3, 1.0],
        help="while grains are packed: a density each")  # fmt: skip
    add("--seed", type=int, nargs="+", default=[1], help="of the packings")
    add("--count", type=int, default=80, help="number of grains")
    add("--edges", type=float, default=5.0, help="edges a diameter")
    add("--edges-at-contacts", type=float, default=28.0, help="the same there, oedometer")
    add("--apart", type=float, default=0.015,
        help="part of their distances by which grains are parted before an oedometer")  # fmt: skip
    add("--friction", type=float, default=0.5, help="of the grains in the tests")
    add("--model", choices=["rigid", "elastic"], default="rigid", help="of the grains")
    add("--contact", type=float, default=0.05,
        help="contact over grain radius at which force is Hertz's, oedometer")  # fmt: skip
    add("--soft-contact", type=float, default=0.3, help="the same, triaxial test")
    add("--start", type=float, nargs="*", default=[0.1, 0.5],
        help="isotropic stresses before the oedometer [MPa]")  # fmt: skip
    add("--largest", type=float, default=4.0, help="stress of the oedometer [MPa]")
    add("--pressure", type=float, nargs="*", default=[1.0], help="on sides, triaxial test [MPa]")
    add("--strain", type=float, default=0.2, help="of the triaxial test")
    add("--speed", type=float, default=0.04, help="of walls, oedometer [m/s]")
    add("--shear-speed", type=float, default=0.1, help="of walls, triaxial test [m/s]")
    add("--reversal", action="store_true",
        help=f"turn back the oedometer after {REVERSES_AT} MPa, alone")  # fmt: skip
    add("--figure", help="file that a figure is saved to")
    given = parser.parse_args(arguments)
    given.largest = REVERSES_AT if given.reversal else given.largest
    for name, value, wanted, holds in (
        ("count", given.count, "> 3", given.count > 3),
        ("edges", given.edges, "> 0", given.edges > 0),
        ("edges-at-contacts", given.edges_at_contacts, "> 0", given.edges_at_contacts > 0),
        ("apart", given.apart, "0 to 0.2", 0 <= given.apart <= 0.2),
        ("start", max(given.start, default=0.0), f"less than the largest stress, {given.largest:g}",
         max(given.start, default=0.0) < given.largest),
        ("pressure", min(given.pressure, default=1.0), "> 0", min(given.pressure, default=1.0) > 0),
        ("strain", given.strain, "0 to 0.4", 0 < given.strain <= 0.4),
    ):  # fmt: skip
        if not holds:
            parser.error(f"--{name} = {value:g}, expected {wanted}")
    if given.figure and Path(given.figure).suffix not in (".png", ".pdf", ".svg"):
        parser.error(f"--figure = {given.figure}, expected a name ending in .png, .pdf or .svg")
    return given


if __name__ == "__main__":
    given = parsed()
    curves, rows = {}, []
    kinds = [("oedometer", given.start), ("triaxial", given.pressure)]
    if given.reversal:
        kinds = [("reversal", given.start)]
    tests = [(name, stress) for name, stresses in kinds for stress in stresses]
    samples = itertools.product(tests, given.packing_friction, given.seed)
    for (name, stress), friction, seed in samples:
        shear = name == "triaxial"  # grains move far, and contacts with them
        kind = "triaxial" if shear else "oedometer"
        folder = given.folder / f"{kind}-{friction:g}-seed-{seed}"
        pack(folder, friction, seed, not shear, given)
        run = test(folder, name, stress, given)
        if name == "reversal":
            numbers, curve = of_reversal(run)
        else:
            rows_of_test = run.history[run.history["stage"] == "test"]
            if not shear:
                rows_of_test = up_to(rows_of_test, given.largest)
            numbers, curve = (of_shear if shear else of_compression)(rows_of_test)
            numbers |= at_contacts(rows_of_test)
        head = {"packing_friction": friction, "seed": seed, "test": name, "start_MPa": stress}
        rows.append(head | {key: float(f"{value:.4g}") for key, value in numbers.items()})
        if curve:
            curves[friction, seed, name, stress] = curve
        print(" ".join(f"{key}={value}" for key, value in rows[-1].items()), flush=True)
    print("laboratory, powers of stress:", *np.round(powers_of_laboratory(), 2))
    with open(given.folder / "sand.csv", "w", newline="", encoding="utf-8") as table:
        writer = csv.DictWriter(table, list(dict.fromkeys(itertools.chain(*rows))))
        writer.writeheader()
        writer.writerows(rows)
    if given.figure:
        draw(curves, rows, given.figure)
