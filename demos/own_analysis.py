"""An analysis of one's own: do the grains of force chains turn less, and yield more?

    python demos/own_analysis.py FOLDER         presses 9 balls first, some seconds
    python demos/own_analysis.py FOLDER RUN     takes a folder that `mufe run` wrote

Any run folder opens as arrays and tables, finished, still running, or killed:

    run = mufe_fenicsx.open_run(path)
    run.missing                            what is not there
    run.history, run.states                tables (pandas)
    run.contacts(), run.grains()           of the last stored state; contacts(3): of state 3
    run.state(3).stress, .points, .cells   arrays of a state (NumPy)
    run.curves(), run.stresses(), run.network(), run.active_contacts(), run.grain_table(),
    run.first_yield(), run.probe(grains=[1, 2])          what follows from them

Before a result, the check that the run can be believed: contacts and walls must agree on the
stress. Love and Weber's mean stress of a sample of volume V,

    σ = Σ f ⊗ l / V,    f force of a contact, l line between the centres of its grains,

is that of the walls where the test is quasi-static. Then the question: force chains are
those of Peters and others (2005), the turn of a grain is that of the rigid motion which fits its
nodes best (Kabsch 1976). Written: FOLDER/own_analysis.csv, a row a grain, and .png.
"""

import argparse
import sys
from pathlib import Path

import mufe_fenicsx  # first: one BLAS thread, the wheel's MPI

# isort: split
import matplotlib
import numpy as np
from mpi4py import MPI

from mufe_fenicsx.analysis.fabric import rose
from mufe_fenicsx.analysis.quasi_static import kinetic_ratio
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.shapes import sphere
from mufe_fenicsx.geometry.grains import Grains, save_grains
from mufe_fenicsx.materials.sand import SAND
from mufe_fenicsx.report import style
from mufe_fenicsx.results.columns import vectors
from mufe_fenicsx.run.run import run_scene
from mufe_fenicsx.scene import Contact, Oedometer, Output, Scene, Solver

R = 1e-4  # radius of the balls [m]


def press_balls(folder):
    """An oedometer test on 9 balls: two layers of 2 x 2 and one ball in the hollow between."""
    points, cells = sphere(R, 0.5 * R)
    rng = np.random.default_rng(5)
    bodies = []
    for layer in range(3):
        flat = [(1, 1), (1, 3), (3, 1), (3, 3)] if layer % 2 == 0 else [(2, 2)]
        for x, y in flat:
            centre = R * np.array([x, y, 1 + layer * np.sqrt(2)])
            bodies.append((points * rng.uniform(1.0, 1.03) + centre, cells))
    labels = np.arange(1, len(bodies) + 1)
    save_grains(folder / "grains", Grains.from_list(labels, bodies, 0.5 * R))
    scene = Scene(
        title="9 balls",
        material=SAND,
        contact=Contact(friction=0.23),
        oedometer=Oedometer(strain=0.06, speed=1.0, seating_stress=0.5e6),
        solver=Solver(damping=2e5),
        output=Output(fields=5, history=101),
    )
    run_scene(scene, folder / "grains", folder / "run", MPI.COMM_WORLD, quiet=True, overwrite=True)
    return folder / "run"


def check(run):
    """Stress of contacts against walls at the stored states; the worst where it is quasi-static."""
    table = run.stresses()
    print("vertical stress of the contacts over that of the walls, less 1")
    print(f"{'strain':>8} {'walls':>10} {'contacts':>10} {'kinetic/internal':>17}")
    for row in table.itertuples():
        print(f"{row.strain:8.4f} {row.wall_zz / 1e6:6.3f} MPa {100 * row.difference_zz:+8.2f} % "
              f"{100 * row.kinetic:15.2f} %")  # fmt: skip
    quiet = table["kinetic"] <= 0.01
    return table["difference_zz"][quiet].abs().max() if quiet.any() else np.nan


def compare(run):
    """A row a grain, with `in_chain`: whether force chains pass through it at the end."""
    grains = run.grain_table()
    contacts = run.active_contacts()
    chain = contacts[contacts["chain"] >= 0]
    grains["in_chain"] = grains["grain"].isin([*chain["grain_a"], *chain["grain_b"]])
    grains["turn"] = np.degrees(grains["rotation_angle"])
    return grains


COLUMNS = {
    "turn": ("mean turn [degrees]", 1),
    "von_mises_mean": ("mean von Mises stress [MPa]", 1e6),
    "yielded_volume_fraction": ("volume that has yielded [%]", 0.01),
    "num_active_contacts": ("active contacts", 1),
}


def show(grains):
    """Print the means of both groups, by volume."""
    groups = [grains[grains["in_chain"]], grains[~grains["in_chain"]]]
    print(f"\n{'':32}{'in force chains':>18}{'others':>18}")
    print(f"{'grains':32}{len(groups[0]):18d}{len(groups[1]):18d}")
    for column, (name, unit) in COLUMNS.items():
        means = [
            np.average(g[column], weights=g["volume"]) / unit if len(g) else np.nan for g in groups
        ]
        print(f"{name:32}{means[0]:18.3g}{means[1]:18.3g}")


def draw(run, grains, path):
    """The compression curve, where contacts point, how forces are spread, and the answer."""
    contacts = run.active_contacts()
    inner = contacts[contacts["wall"] == ""]
    curves = run.curves()
    curves = curves[curves["stage"] == "loading"]
    normals, force = vectors(inner, "normal"), inner["normal_force"].to_numpy()
    with matplotlib.rc_context(style.RC):
        figure, axes = style.new_figure(style.PAGE, 0.75 * style.PAGE, nrows=2, ncols=2)
        (compression, place), (spread, answer) = axes
        compression.semilogx(curves["stress"] / 1e6, curves["void_ratio"], color=style.BLUE)
        style.plain_log_ticks(compression.xaxis)
        compression.set(xlabel="Vertical stress: MPa", ylabel="Void ratio, $e$")
        place.remove()
        polar = figure.add_subplot(place.get_subplotspec(), projection="polar")
        for weights, colour, label in (
            (None, style.BLUE, "contacts"),
            (np.maximum(force, 0), style.RED, "weighted by force"),
        ):
            found = rose(normals, "xz", 24, weights)
            angle = np.linspace(0, 2 * np.pi, 24 * 20)  # steps round the circle
            steps = np.repeat(found.density, 20)
            polar.plot(np.append(angle, 0), np.append(steps, steps[0]), color=colour, label=label)
        polar.plot(np.linspace(0, 2 * np.pi, 100), np.full(100, 0.5 / np.pi), ":", color="grey")
        polar.set_yticks([])
        polar.legend(loc="upper left", bbox_to_anchor=(0.9, 1.1))
        spread.hist(inner["ratio"], np.linspace(0, 4, 17), density=True, color=style.SKY)
        x = np.linspace(0, 4, 50)
        spread.plot(x, np.exp(-x), "--", color=style.BLACK, label="exp(−f/⟨f⟩)")
        spread.set(xlabel="Normal force over its mean, f/⟨f⟩", ylabel="Probability density")
        spread.legend()
        for chosen, colour, label in (
            (True, style.RED, "in chains"),
            (False, style.GREY, "others"),
        ):
            group = grains[grains["in_chain"] == chosen]
            answer.plot(
                group["von_mises_mean"] / 1e6, group["turn"], "o", color=colour, ms=3.5, label=label
            )
        answer.set(xlabel="Mean von Mises stress: MPa", ylabel="Turn of the grain: degrees")
        answer.legend()
        for index, axis in enumerate((compression, polar, spread, answer)):
            style.panel_letter(axis, index)
        figure.savefig(path)


def main(folder, run_folder=None):
    """Analyse a run, or press balls first; returns the worst difference of the check."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    run = mufe_fenicsx.open_run(run_folder or press_balls(folder))
    for sentence in run.missing:
        print(f"missing: {sentence}")
    worst = check(run)
    grains = compare(run)
    show(grains)
    grains.to_csv(folder / "own_analysis.csv", index=False)
    draw(run, grains, folder / "own_analysis.png")
    print(f"\n{folder / 'own_analysis.csv'}, {folder / 'own_analysis.png'}")
    # Where kinetic energy is below 1 % of the internal one, inertia is small in the stress too.
    assert not worst > 0.02, f"contacts and walls differ by {worst:.1%}"
    assert np.asarray(kinetic_ratio(run.history))[-1] < 0.05
    return worst


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", help="where own_analysis.csv and .png are written")
    parser.add_argument("run", nargs="?", help="folder that `mufe run` wrote")
    given = parser.parse_args()
    try:
        main(given.folder, given.run)
    except InputError as error:
        sys.exit(f"error: {error}")
