"""The pictures of docs/gallery.md: each is made anew by its name.

    python demos/gallery.py                       all of them, some minutes on two cores
    python demos/gallery.py chains animation      these

Tests are run by the commands that a user would type, which are printed; their results stay in the
folder of ``--runs`` and are used again while they are there. Pictures are drawn from those by
`run.plot`, which draws the figures of `mufe report`; only the two that show meshes are drawn here.
"""

import argparse
import re
import shlex
import subprocess
import sys
import time
from pathlib import Path

import mufe_fenicsx as mufe  # first: one BLAS thread, the wheel's MPI

# isort: split
import numpy as np
import pyvista
import tifffile
from matplotlib.collections import PolyCollection
from matplotlib.colors import ListedColormap
from PIL import Image

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.image.compare_labels import touching_labels
from mufe_fenicsx.geometry.image.image_files import read_image
from mufe_fenicsx.geometry.image.picture import label_colours
from mufe_fenicsx.machine.mpi_launcher import find_mpirun
from mufe_fenicsx.output.fields import VTK_TETRA
from mufe_fenicsx.report import style
from mufe_fenicsx.report.animation import NAME as ANIMATION
from mufe_fenicsx.report.animation import draw_animation
from mufe_fenicsx.report.render import Camera, Layer, render
from mufe_fenicsx.report.sample import boundary_faces, box_corners, state_at
from mufe_fenicsx.report.source import Source
from mufe_fenicsx.report.views import FROM, colour_bar, polygons
from mufe_fenicsx.run.demo import demo_commands, demo_scene, num_ranks

ROOT = Path(__file__).resolve().parents[1]
SCENE = ROOT / "docs" / "gallery" / "ball.toml"
#: Widths that pictures may have [pixels], and the most that one and an animation may take [bytes].
WIDTHS, LARGEST, LARGEST_ANIMATION = (1100, 1000, 900, 800, 700), 150_000, 600_000
#: Stored states of the demonstration's test, so that it moves smoothly.
STATES = 17
PLASTIC = "magma_r"  #: map of plastic strain
RADIUS, EDGE = 0.5e-3, 55e-6  # of the crushed ball, and of its tetrahedra [m]


# --- runs -----------------------------------------------------------------------------------------


def mufe_command(*arguments, ranks=1):
    """Run a command of `mufe` as a program of its own, on so many ranks."""
    launch = [find_mpirun(), "-n", str(ranks)] if ranks > 1 else []
    words = [str(word) for word in arguments]
    print(
        "$", shlex.join([*(["mpirun", *launch[1:]] if launch else []), "mufe", *words]), flush=True
    )
    command = [*launch, sys.executable, "-m", "mufe_fenicsx", *words]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def finished(folder):
    """Whether a test was run to its end in a folder."""
    try:
        return mufe.open_run(folder).finished
    except InputError:
        return False


def snow(runs):
    """Folder of the demonstration, but for its report: labels.tif, grains and run."""
    folder = runs / "snow"
    if not finished(folder / "run"):
        folder.mkdir(parents=True, exist_ok=True)
        text = demo_scene().read_text(encoding="utf-8")
        scene = folder / "scene.toml"
        scene.write_text(re.sub(r"(?m)^fields = \d+", f"fields = {STATES}", text), encoding="utf-8")
        for command in demo_commands(scene, folder, overwrite=True)[:3]:
            mufe_command(*command, ranks=num_ranks() if command[0] == "run" else 1)
    return folder


def triaxial_test(runs):
    """Run folder of the test that `mufe new triaxial` writes."""
    folder = runs / "triaxial"
    if not finished(folder / "results"):
        mufe_command("new", "triaxial", "-o", folder, "--overwrite")
        # On one rank: few grains take another path where sums have another order.
        mufe_command("run", folder / "scene.toml", "-o", folder / "results", "--overwrite")
    return folder / "results"


def crushed_ball(runs):
    """Run folder of one ball between rough platens."""
    folder = runs / "ball"
    if not finished(folder / "results"):
        grains = mufe.Grains.from_list([1], [mufe.sphere(RADIUS, EDGE)], EDGE)
        (folder / "grains").mkdir(parents=True, exist_ok=True)
        mufe.save_grains(folder / "grains", grains)
        words = ["--grains", folder / "grains", "-o", folder / "results", "--overwrite"]
        mufe_command("run", SCENE, *words)
    return folder / "results"


# --- pictures -------------------------------------------------------------------------------------


def draw_scan(runs, path):
    """What `mufe synthesize` draws of a scan that it made."""
    folder = runs / "scan"
    mufe_command("synthesize", "-o", folder, "--seed", 3, "--set", "d50=180 um", "--overwrite")
    save_small(Image.open(folder / "synthetic.png"), path)


def draw_snow(runs, path):
    """A real scan: grey levels, labels and tetrahedra in one plane, and the meshes in space."""
    folder = snow(runs)
    scene = mufe.load_scene(folder / "scene.toml")
    labels = tifffile.imread(folder / "labels.tif")
    grains = mufe.load_grains(folder / "grains")
    grey = read_image(scene.image.path)[tuple(slice(*ends) for ends in scene.image.crop)]
    size = 1e3 * grains.box[1, 0]  # of the cube [mm]
    colours = label_colours(int(labels.max()), touching_labels(labels))
    figure, axes = style.new_figure(0.8 * style.PAGE, 0.82 * style.PAGE, nrows=2, ncols=2)
    (scan, parted), (meshed, space) = axes
    shown = {"extent": (0, size, 0, size), "origin": "lower", "interpolation": "nearest"}
    scan.imshow(grey[len(grey) // 2], cmap="gray", **shown)
    parted.imshow(colours[labels[len(labels) // 2]], **shown)
    grid = pyvista.UnstructuredGrid({VTK_TETRA: grains.cells}, 1e3 * grains.points)
    grid.cell_data["label"] = grains.cell_label
    cut = grid.slice(normal="z", origin=(0, 0, 0.505 * size))
    faces = [np.asarray(cut.points)[face, :2] for face in polygons(cut.faces)]
    meshed.add_collection(
        PolyCollection(
            faces, facecolors=colours[cut.cell_data["label"]], edgecolors="#303030", lw=0.3
        )
    )
    faces, cell = boundary_faces(grains.cells)
    surface = pyvista.PolyData.from_regular_faces(1e3 * grains.points, faces)
    surface.cell_data["label"] = grains.cell_label[cell]
    look, limits = ListedColormap(colours), (-0.5, len(colours) - 0.5)
    options = {"n_colors": len(colours)}
    layer = Layer(surface, None, "label", look, limits, edges=True, options=options)
    box = 1e3 * grains.box
    space.imshow(render([layer], Camera.around(box_corners(box), FROM, 1.0), (700, 700), box=box))
    space.set_axis_off()
    titles = (f"scan, z = {0.505 * size:.3g} mm", "grains told apart", "their tetrahedra, cut", "")
    for k, (axis, title) in enumerate(zip(axes.ravel(), titles, strict=True)):
        style.panel_letter(axis, k)
        axis.set_title(title)
        if axis is not space:
            axis.set(xlim=(0, size), ylim=(0, size), aspect="equal", xlabel="x: mm", ylabel="y: mm")
            axis.spines[:].set_visible(True)
    space.set_title(f"{grains.num_grains} grains, {style.number(len(grains.cells))} tetrahedra")
    save_small(figure, path)


def draw_ball(runs, path):
    """A crushed ball cut open in three states, and the force on its platen."""
    run = mufe.open_run(crushed_ball(runs))
    states = [state_at(run, listed, None) for listed in run.stored_states]
    crush = [state for state in states if state.stage == "crush"]
    chosen = [min(crush, key=lambda s: abs(s.strain - e)) for e in (0.1, 0.2, 0.4)]
    aspect, limit = 1.2, 0.8
    seen = np.concatenate([state.points for state in chosen])
    camera = Camera.around(seen, (0.35, -1.0, 0.2), aspect, margin=1.12)
    figure = style.blank_figure(style.PAGE, 1.85)
    left, right = figure.subfigures(1, 2, width_ratios=[3.2, 1])
    axes, curve = left.subplots(ncols=3), right.subplots()
    for k, (axis, state) in enumerate(zip(axes, chosen, strict=True)):
        axis.imshow(render(open_ball(state, limit), camera, (576, 480)))
        axis.set_axis_off()
        style.panel_letter(axis, k)
        style.heading(axis, rf"$\delta/D$ = {100 * state.strain:.0f} %")
    style.scale_bar(axes[2], 2 * camera.half_height * aspect)
    colour_bar(left, list(axes), limit, PLASTIC, "plastic strain: –", "", "max",
               location="bottom", shrink=0.5, aspect=30, pad=0.08)  # fmt: skip
    history = run.history
    history = history[history["stage"] == "crush"]
    curve.plot(100 * history["strain"], history["force_z_max"], color=style.BLUE)
    curve.set(xlabel=r"Approach, $\delta/D$: %", ylabel="Force: N", xlim=(0, 42), ylim=(0, None))
    style.panel_letter(curve, 3)
    save_small(figure, path)


def open_ball(state, limit):
    """The half of a ball behind its middle, and of the platens that press it."""
    strain, middle = state.stored.plastic_strain, state.points.mean(axis=0)
    surface, grid = state.surface(), state.grid(strain >= 0, plastic=strain)
    surface.cell_data["plastic"] = strain[state.faces[1]]
    plane = {"normal": "y", "origin": middle}
    parts = surface.clip(**plane, invert=False), grid.slice(**plane)
    layers = [Layer(part, None, "plastic", PLASTIC, (0, limit), edges=True) for part in parts]
    low, high = state.points[:, 2].min(), state.points[:, 2].max()
    for bottom, top in ((low - 0.05 * RADIUS, low), (high, high + 0.05 * RADIUS)):
        x, y = middle[0] + 1.1 * RADIUS * np.array([-1, 1]), middle[1] + np.array([0, 1.1 * RADIUS])
        layers.append(Layer(pyvista.Box((*x, *y, bottom, top)), "#b0b4bc"))
    return layers


def drawn(name, folder_of, **options):
    """What draws a figure of the report of a run."""

    def draw(runs, path):
        figure = mufe.open_run(folder_of(runs)).plot(name, **options)
        save_small(figure, path)

    return draw


def draw_moving(runs, path):
    """The animation of the report, as it is."""
    (image,) = {draw_animation(Source(snow(runs) / "run"), runs).image}
    image.replace(path)


def save_small(picture, path):
    """Save a figure or an image as a PNG of 256 colours, as wide as its size allows."""
    if not isinstance(picture, Image.Image):
        picture.savefig(path)
        picture = Image.open(path)
    picture = picture.convert("RGB")
    for width in WIDTHS:
        height = round(picture.height * width / picture.width)
        few_colours(picture.resize((width, height), Image.LANCZOS)).save(path, optimize=True)
        if path.stat().st_size <= LARGEST:
            return


def few_colours(picture):
    """An image in 256 of its colours.

    They are chosen by the root of the area that they have: those of a colour bar count beside
    those of large bodies.
    """
    each, area = np.unique(np.asarray(picture).reshape(-1, 3), axis=0, return_counts=True)
    chosen = np.repeat(each, np.minimum(np.sqrt(area).astype(int), 30), axis=0)
    palette = Image.fromarray(chosen[None]).quantize(256, kmeans=3)
    colours = np.reshape(palette.getpalette(), (-1, 3))
    colours[(colours >= 245).all(axis=1)] = 255  # white stays white
    palette.putpalette(colours.ravel().tolist())
    return picture.quantize(palette=palette, dither=Image.Dither.NONE)


def run_of_snow(runs):
    """Run folder of the demonstration."""
    return snow(runs) / "run"


#: What draws each picture, by the name of its file without ending.
PARTS = {
    "snow": draw_snow,
    "cut": drawn("stress-cut", run_of_snow),
    "pressure": drawn("chosen-grains", run_of_snow, grains=[25, 18, 44]),  # away from the walls
    "chains": drawn("force-chains", run_of_snow),
    ANIMATION: draw_moving,
    "ball": draw_ball,
    "triaxial": drawn("triaxial", triaxial_test),
    "scan": draw_scan,
}


def main(parts, output, runs):
    """Draw the pictures of these names; returns their sizes [bytes] by name."""
    runs.mkdir(parents=True, exist_ok=True)
    output.mkdir(parents=True, exist_ok=True)
    sizes = {}
    for name in parts:
        started = time.perf_counter()
        path = output / f"{name}.{'gif' if name == ANIMATION else 'png'}"
        with style.look():
            PARTS[name](runs, path)
        sizes[name] = path.stat().st_size
        print(
            f"{path}: {sizes[name] / 1e3:.0f} kB, {time.perf_counter() - started:.0f} s", flush=True
        )
        limit = LARGEST_ANIMATION if name == ANIMATION else LARGEST
        assert sizes[name] <= limit, f"{path} has {sizes[name]} bytes, expected at most {limit}"
    return sizes


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "docs" / "gallery")
    parser.add_argument("--runs", type=Path, default=ROOT / "build" / "gallery")
    given = parser.parse_args()
    for name in given.parts:
        if name not in PARTS:
            parser.error(f"part {name}, expected one of {', '.join(PARTS)}")
    try:
        main(given.parts or list(PARTS), given.output, given.runs)
    except (InputError, subprocess.CalledProcessError) as error:
        sys.exit(f"error: {error}")
