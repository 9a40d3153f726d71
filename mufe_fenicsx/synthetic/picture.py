"""A picture to judge a synthetic scan by eye."""

import matplotlib
import numpy as np
import pyvista
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from ..geometry.image.compare_labels import touching_labels
from ..geometry.image.picture import STYLE, label_colours, length_unit
from ..report.render import Camera, Layer, cannot_render, render
from ..report.views import FROM
from .triangulated import icosphere


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
    colours = label_colours(int(labels.max()), touching_labels(labels))
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
            axis.set(xlabel=f"x: {name}", ylabel=f"y: {name}")
            axis.set_title(f"{title}, z = {height:.3g} {name}", fontsize=9)
            axis.spines[:].set_visible(True)
        if failure:
            space.text(0.5, 0.5, failure, ha="center", wrap=True)
        else:
            space.imshow(_view(packing, which, colours))
        space.set_title(f"the {len(which)} grains of the image, whole", fontsize=9)
        space.axis("off")
        levels.hist(grey.ravel()[:: max(1, grey.size // 10**6)], bins=200, color="#33658a")
        levels.set(xlabel="grey level: –", ylabel="voxels in a bin (subset): –")
        figure.savefig(path)


def _view(packing, which, colours):
    """Picture of grains in space, as RGB."""
    directions, triangles = icosphere(3)
    place = packing.grains.part(which).surface(directions)
    x = packing.centre[which, None] + np.einsum("gij,gkj->gki", packing.axes[which], place)
    x, m = x.reshape(-1, 3), len(directions)
    faces = (triangles[None] + m * np.arange(len(which))[:, None, None]).reshape(-1, 3)
    body = pyvista.PolyData.from_regular_faces(x, faces)
    body.point_data["label"] = np.repeat(np.arange(1, len(which) + 1), m)
    look, limits = ListedColormap(colours), (-0.5, len(colours) - 0.5)
    options = {"n_colors": len(colours), "smooth_shading": True}
    layer = Layer(body, None, "label", look, limits, options=options)
    return render([layer], Camera.around(x, FROM, 1.2), (900, 750))
