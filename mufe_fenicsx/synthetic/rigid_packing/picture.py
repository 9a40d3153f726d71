"""A picture to judge a packing by eye."""

import matplotlib
import numpy as np
import pyvista
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from ...geometry.image.picture import BLUE, PALETTE, RED, STYLE, length_unit
from ...kernels.packing.packed_surfaces import label_voxels
from ...report.render import Camera, Layer, cannot_render, render
from ...report.views import FROM

#: Layers of the profile in a mean diameter.
LAYERS = 12


def draw_packing(path, assembly, unit):
    """Grains in space, the solid fraction over the height, and numbers of contacts.

    Args:
        path: PNG file.
        assembly: `assembly.Assembly`.
        unit: Mean diameter [m].
    """
    failure = cannot_render()
    pairs, _ = assembly.contacts.touching()
    count = np.bincount(pairs.ravel(), minlength=assembly.bodies.num_bodies)
    length, name = length_unit(np.ptp(assembly.bodies.centre, axis=0).max() * unit)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(10.2, 3.6), layout="constrained")
        FigureCanvasAgg(figure)
        space, profile, contacts = figure.subplots(1, 3, width_ratios=(1.25, 1, 1))
        if failure:
            space.text(0.5, 0.5, failure, ha="center", wrap=True)
        else:
            space.imshow(_view(assembly))
        space.axis("off")
        height, solid = solid_over_height(assembly)
        profile.plot(solid, height * unit / length, color=BLUE)
        profile.axvline(assembly.solid_fraction, color=RED, lw=0.9, ls="--")
        profile.text(assembly.solid_fraction, 1.02, "mean", color=RED, ha="center",
                     transform=profile.get_xaxis_transform())  # fmt: skip
        profile.set(xlabel="solid fraction: –", ylabel=f"height z: {name}", xlim=(0, 1))
        bins = np.arange(count.max() + 2) - 0.5
        contacts.hist(count, bins=bins, color=BLUE, edgecolor="white", linewidth=0.5)
        contacts.set(xlabel="contacts with other grains: –", ylabel="grains: –")
        for axis in (contacts.xaxis, contacts.yaxis):
            axis.get_major_locator().set_params(integer=True)
        figure.savefig(path)


def solid_over_height(assembly):
    """Heights above the bottom [mean diameters] and the solid fraction of the layers there."""
    bodies, container, s = assembly.bodies, assembly.container, assembly.bodies.shapes
    edges = container.high - container.low
    shape = np.maximum((edges * LAYERS).astype(int), 2)
    labels = np.zeros(shape[::-1], dtype=np.int32)
    voxel = float((edges / shape).min())
    label_voxels(
        labels, np.zeros(labels.shape), container.low, voxel, s.spheres, bodies.centre, bodies.axes,
        bodies.size, bodies.reach, bodies.shape, s.grid, s.low, s.step,
    )  # fmt: skip
    part = container.volume / np.prod(edges)
    height = (np.arange(shape[2]) + 0.5) * voxel
    return height, (labels > 0).mean(axis=(1, 2)) / part


def _view(assembly):
    """Picture of the grains, as RGB; neighbours in number differ in colour."""
    bodies = assembly.bodies
    x, faces, colour, first = [], [], [], 0
    for b in range(bodies.num_bodies):
        points, triangles = bodies.shapes.surfaces[bodies.shape[b]]
        x.append(bodies.centre[b] + bodies.size[b] * points @ bodies.axes[b].T)
        faces.append(triangles + first)
        colour.append(np.full(len(points), b % len(PALETTE)))
        first += len(points)
    x = np.concatenate(x)
    body = pyvista.PolyData.from_regular_faces(x, np.concatenate(faces))
    body.point_data["colour"] = np.concatenate(colour)
    look, limits = ListedColormap(PALETTE), (-0.5, len(PALETTE) - 0.5)
    options = {"n_colors": len(PALETTE), "smooth_shading": True}
    return render([Layer(body, None, "colour", look, limits, options=options)],
                  Camera.around(x, FROM, 1.0), (900, 900))  # fmt: skip
