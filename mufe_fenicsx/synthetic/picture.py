"""A picture to judge a synthetic scan by eye."""

import matplotlib
import numpy as np
import pyvista
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..geometry.image.picture import STYLE, length_unit
from ..report.render import cannot_render, quiet
from .packing import icosphere


def draw_scan(path, grey, labels, packing, which, voxel_size):
    """Grey slice, true labels, the grains in space, and the histogram of grey levels.

    Args:
        path: PNG file.
        grey: Grey image, (z, y, x).
        labels: True labels.
        packing: `packing.Packing`.
        which: Grains that the image shows, in the order of their labels.
        voxel_size: [m].
    """
    colours = _colours(int(labels.max()))
    failure = cannot_render()
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(8.4, 7.6), layout="constrained")
        FigureCanvasAgg(figure)
        (left, right), (space, levels) = figure.subplots(2, 2)
        middle = len(grey) // 2
        unit, name = length_unit(max(labels.shape) * voxel_size)
        rows, columns = grey.shape[1:]
        extent = (0, columns * voxel_size / unit, 0, rows * voxel_size / unit)
        shown = {"extent": extent, "origin": "lower", "interpolation": "nearest"}
        left.imshow(grey[middle], cmap="gray", **shown)
        right.imshow(colours[labels[middle]], **shown)
        height = (middle + 0.5) * voxel_size / unit
        for axis, title in ((left, "grey levels"), (right, "true labels")):
            axis.set(xlabel=f"x [{name}]", ylabel=f"y [{name}]")
            axis.set_title(f"{title}, z = {height:.3g} {name}", fontsize=9)
            axis.spines[:].set_visible(True)
        if failure:
            space.text(0.5, 0.5, failure, ha="center", wrap=True)
        else:
            space.imshow(_view(packing, which, colours))
        space.set_title(f"the {len(which)} grains of the image, whole", fontsize=9)
        space.axis("off")
        levels.hist(grey.ravel()[:: max(1, grey.size // 10**6)], bins=200, color="#33658a")
        levels.set(xlabel="grey level [-]", ylabel="voxels in a bin (subset) [-]")
        figure.savefig(path)


def _view(packing, which, colours):
    """Picture of grains in space, as RGB."""
    directions, triangles = icosphere(3)
    place = packing.grains.part(which).surface(directions)
    x = packing.centre[which, None] + np.einsum("gij,gkj->gki", packing.axes[which], place)
    m = len(directions)
    faces = (triangles[None] + m * np.arange(len(which))[:, None, None]).reshape(-1, 3)
    body = pyvista.PolyData.from_regular_faces(x.reshape(-1, 3), faces)
    body.point_data["colour"] = np.repeat(
        np.round(255 * colours[1 : len(which) + 1]).astype(np.uint8), m, axis=0
    )
    with quiet():
        plotter = pyvista.Plotter(off_screen=True, window_size=(900, 800))
        plotter.set_background("white")
        plotter.add_mesh(body, scalars="colour", rgb=True, smooth_shading=True)
        plotter.view_isometric()
        plotter.camera.zoom(1.2)
        image = plotter.screenshot(return_img=True)
        plotter.close()
    return image


def _colours(num_labels):
    """RGB of void (white) and of each grain."""
    rng = np.random.default_rng(1)
    hue = rng.permutation(num_labels + 1) / (num_labels + 1)
    saturation = 0.35 + 0.4 * rng.random(num_labels + 1)
    hsv = np.column_stack([hue, saturation, np.full(num_labels + 1, 0.85)])
    colours = matplotlib.colors.hsv_to_rgb(hsv)
    colours[0] = 1
    return colours
