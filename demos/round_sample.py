"""A cylindrical sample from a scan: in a mould, whose grains are whole, and cut out of a scan.

    python demos/round_sample.py FOLDER       a few minutes on one core

Synthetic sand is scanned twice: in a mould, with the grains that fit into it, and as a part of a
larger sample. The wall of the mould is recognised, and the grains in it are told apart; from the
larger one a cylinder is cut, and its grains are meshed. It draws `round_scan.png`, the figure of
the page on cylindrical samples, and ends in a check: the wall is found within half a voxel,
95 % of the grains in the mould are found, and no node of the cut grains is beyond the cylinder.
"""

import argparse
import sys
from pathlib import Path

import mufe_fenicsx as mufe

# isort: split
import numpy as np
import pyvista
import scipy.ndimage
import tifffile
from matplotlib.colors import ListedColormap
from matplotlib.patches import Circle

from mufe_fenicsx.geometry.image.compare_labels import touching_labels
from mufe_fenicsx.geometry.image.cylinder import Cylinder
from mufe_fenicsx.geometry.image.label_files import read_labels
from mufe_fenicsx.geometry.image.picture import label_colours
from mufe_fenicsx.geometry.pipeline import mesh_labels, segment_image
from mufe_fenicsx.geometry.settings import MeshSettings, SegmentSettings
from mufe_fenicsx.report import style
from mufe_fenicsx.report.render import Camera, Layer, render
from mufe_fenicsx.report.sample import boundary_faces, box_corners
from mufe_fenicsx.synthetic.pipeline import synthesize
from mufe_fenicsx.synthetic.settings import SynthesisSettings

VOXEL, SHAPE = 5e-6, (40, 120, 120)
#: Axis of the mould and its inner radius, its thickness, and the radius that is cut out [voxels].
X, Y, RADIUS, WALL, CUT_RADIUS = 61.0, 58.5, 48.0, 7.0, 42.0
#: Grey levels of void, solid and mould, and the noise.
VOID, SOLID, MOULD, NOISE = 90.0, 150.0, 190.0, 5.0


def grey_of(labels, ring=None):
    """A grey image of labels, with a mould where ``ring`` is true."""
    grey = np.where(labels > 0, SOLID, VOID)
    if ring is not None:
        grey = np.where(ring, MOULD, grey)
    grey = scipy.ndimage.gaussian_filter(grey, 0.8)
    grey += np.random.default_rng(1).normal(0, NOISE, grey.shape)
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8)


def scans(folder):
    """Write both scans; returns the true labels in the mould."""
    settings = SynthesisSettings(shape=SHAPE, voxel_size=VOXEL, d50=1e-4)
    synthesize(settings, folder / "sand", overwrite=True)
    labels, _ = read_labels(folder / "sand" / "truth_labels.tif")
    tifffile.imwrite(folder / "part.tif", grey_of(labels))
    cylinder = Cylinder(X, Y, RADIUS)
    beyond = np.unique(labels[~cylinder.inside(SHAPE)])
    within = np.where(np.isin(labels, beyond), 0, labels)
    distance = np.broadcast_to(cylinder.distance(SHAPE), SHAPE)
    ring = (distance > RADIUS) & (distance < RADIUS + WALL)
    tifffile.imwrite(folder / "mould.tif", grey_of(within, ring))
    return within


def meshes(folder, labels):
    """Grains of the labels in a folder, coarse."""
    mesh_labels(labels, MeshSettings(size=2.2e-5), folder / "grains", overwrite=True)
    return mufe.load_grains(folder / "grains")


def draw(folder, found, grains, path):
    """Grey levels with outlines, labels, and the meshes of the cut sample."""
    figure, axes = style.new_figure(style.PAGE, 0.36 * style.PAGE, ncols=3)
    k = SHAPE[0] // 2
    for axis, name in zip(axes, ("mould", "part"), strict=False):
        grey = tifffile.imread(folder / f"{name}.tif")[k]
        labels = tifffile.imread(folder / f"{name}_labels.tif")
        mm = 1e3 * VOXEL
        extent = (0, SHAPE[2] * mm, 0, SHAPE[1] * mm)
        axis.imshow(grey, cmap="gray", extent=extent, origin="lower")
        colours = label_colours(int(labels.max()), touching_labels(labels[k][None]))
        colours = np.column_stack([colours, np.full(len(colours), 0.45)])
        colours[0] = 0
        axis.imshow(colours[labels[k]], extent=extent, origin="lower", interpolation="nearest")
        numbers = found[name]
        place = 1e3 * numbers["cylinder_x_m"], 1e3 * numbers["cylinder_y_m"]
        axis.add_patch(Circle(place, 1e3 * numbers["cylinder_radius_m"], fill=False,
                              color="#00b7c7", lw=1.3, ls=(0, (4, 2))))  # fmt: skip
        axis.set(xlabel="x: mm", ylabel="y: mm", aspect="equal")
    faces, cell = boundary_faces(grains.cells)
    surface = pyvista.PolyData.from_regular_faces(1e3 * grains.points, faces)
    surface.cell_data["label"] = grains.cell_label[cell]
    num = int(grains.labels.max())
    colours = label_colours(num, touching_labels(tifffile.imread(folder / "part_labels.tif")))
    look, limits = ListedColormap(colours), (-0.5, num + 0.5)
    layer = Layer(surface, None, "label", look, limits, edges=True, options={"n_colors": num + 1})
    corners = 1e3 * np.array([grains.points.min(axis=0), grains.points.max(axis=0)])
    camera = Camera.around(box_corners(corners), (1.0, -1.2, 0.7), 1.0, margin=1.0)
    axes[2].imshow(render([layer], camera, (700, 700)))
    axes[2].set_axis_off()
    titles = ("in a mould", "cut out", "grains of (b)")
    for number, (axis, title) in enumerate(zip(axes, titles, strict=True)):
        style.panel_letter(axis, number)
        axis.set_title(title)
    figure.savefig(path, dpi=200)


def main():
    """Make the scans, segment and mesh them, and check what comes out."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="where scans, labels and the figure are written")
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    true = scans(folder)
    ways = {
        "mould": {"cylinder": "mould"},
        "part": {"cylinder": "given", "cylinder_radius": CUT_RADIUS * VOXEL},
    }
    found = {}
    for name, more in ways.items():
        settings = SegmentSettings(voxel_size=VOXEL, threshold=(VOID + SOLID) / 2, **more)
        found[name] = segment_image(
            folder / f"{name}.tif", settings, folder / f"{name}_labels.tif", overwrite=True
        )
        print(*found[name]["notices"], sep="\n")
    grains = meshes(folder, folder / "part_labels.tif")
    draw(folder, found, grains, folder / "round_scan.png")
    wall = found["mould"]
    place = np.array([wall[f"cylinder_{name}_m"] for name in ("x", "y", "radius")]) / VOXEL
    off = np.abs(place - [X, Y, RADIUS]).max()
    num_true = np.count_nonzero(np.bincount(true.ravel())[1:] >= 200)
    x, y, radius = grains.cylinder
    far = np.hypot(grains.points[:, 0] - x, grains.points[:, 1] - y) / radius - 1
    print(f"wall: off by {off:.2f} voxels; grains: {wall['num_grains']} of {num_true}")
    print(f"nodes on the cylinder: {np.count_nonzero(np.abs(far) < 1e-12)}, "
          f"beyond it: {np.count_nonzero(far > 1e-12)}")  # fmt: skip
    good = off < 0.5 and abs(wall["num_grains"] - num_true) <= 0.05 * num_true
    return 0 if good and far.max() < 1e-12 else 1


if __name__ == "__main__":
    sys.exit(main())
