"""From a grey image to grains: what each step does and what its parameters change.

    python demos/segmentation.py FOLDER                   a synthetic scan, minutes on one core
    python demos/segmentation.py FOLDER --image SCAN.tif  an image of one's own; --crop cuts it
    python demos/segmentation.py FOLDER --quick           fewer values and a smaller scan

The page shows the chain in one slice: grey levels, threshold, distance to the void, basins of
that distance, labels. Then it changes one parameter at a time and counts grains, and
compares labels: with the grains of a synthetic scan, which are known, or else with the labels
of the default parameters. `mufe verify segmentation` checks the same against tolerances.
"""

import argparse
import dataclasses
import sys
import time
from pathlib import Path

import mufe_fenicsx  # noqa: F401  first: one BLAS thread, the wheel's MPI

# isort: split
import matplotlib
import numpy as np
from matplotlib.collections import LineCollection

from mufe_fenicsx.cli.arguments import crop_ranges
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.image import threshold as thresholds
from mufe_fenicsx.geometry.image.compare_labels import (
    adjusted_rand_index,
    compare_labels,
    touching_labels,
)
from mufe_fenicsx.geometry.image.image_files import read_image
from mufe_fenicsx.geometry.image.labels import fill_pores
from mufe_fenicsx.geometry.image.picture import label_colours, outlines
from mufe_fenicsx.geometry.image.segmentation import distance_map, segment
from mufe_fenicsx.geometry.image.watershed import watershed
from mufe_fenicsx.geometry.settings import METHODS, SegmentSettings
from mufe_fenicsx.report import style
from mufe_fenicsx.report.page import write_page
from mufe_fenicsx.synthetic.settings import SynthesisSettings
from mufe_fenicsx.verification.segmentation import sliver, synthetic_scan

#: Settings that are changed one at a time: panel, name, values; a panel needs no more than these.
SWEEPS = {
    "filter": ("filter_radius", (0.0, 0.5, 0.7, 1.0, 1.5)),
    "threshold": ("threshold", (-0.2, -0.1, 0.0, 0.1, 0.2)),
    "depth": ("marker_depth", (0.05, 0.1, 0.2, 0.35, 0.5, 1.0, 2.0)),
    "level": ("watershed_level", (0.0, 0.05, 0.1, 0.2, 0.4, 0.7)),
    "T": ("watershed_threshold", (0.0, 0.04, 0.2, 0.4, 0.6)),
    "contact": ("contact_level", (0.0, 0.5, 0.6, 0.7, 0.8, 0.9)),
}
LABELS = {
    "filter": "radius of the Gaussian (voxels)",
    "threshold": "threshold, from the middle (contrast)",
    "depth": "separation = depth: depth (voxels)",
    "level": "separation = level: level",
    "T": "separation = level: threshold T",
    "contact": "contact level",
}


#: Where a value of a sweep gives no labels.
NOTHING = dict.fromkeys(("grains", "one-to-one", "ARI", "precision", "recall"), np.nan)


@dataclasses.dataclass
class Scan:
    """An image, how it is parted by default, and the truth if that is known."""

    grey: np.ndarray
    settings: SegmentSettings
    true: np.ndarray | None = None

    def __post_init__(self):
        self.labels, self.filtered, self.found = segment(self.grey, self.settings)
        if self.found["void_grey"] is None:  # sweeps are parts of the contrast
            raise InputError(self.found["warning"])

    def changed(self, panel, value):
        """Settings of a sweep."""
        name, _ = SWEEPS[panel]
        if panel == "threshold":
            contrast = self.found["solid_grey"] - self.found["void_grey"]
            value = self.found["threshold"] + value * contrast
        more = {"separation": "level"} if panel in ("level", "T") else {}
        if panel == "depth":
            more = {"relative_depth": 0.0}  # alone
        return dataclasses.replace(self.settings, **more, **{name: value})

    def judged(self, labels):
        """Numbers on labels: against the truth, or against the default labels."""
        reference = self.labels if self.true is None else self.true
        found = compare_labels(labels, reference, min_voxels=self.settings.min_grain_voxels)
        solid = (labels > 0) & (reference > 0)
        return {
            "grains": found["num_found"],
            "one-to-one": found["matched_share"],
            "ARI": adjusted_rand_index(labels[solid], reference[solid]),
            "precision": found["contact_precision"],
            "recall": found["contact_recall"],
            "diameter": found["mean_diameter_error"],
        }


def chain(scan):
    """One slice through all steps."""
    middle = len(scan.grey) // 2
    solid = fill_pores(scan.filtered > scan.found["threshold"])
    distance = distance_map(solid)
    basins, _ = watershed(-distance, solid)
    panels = [
        ("grey levels", scan.grey, None),
        ("filtered, threshold", scan.filtered, solid),
        ("distance to the void", distance, None),
        (f"{basins.max()} basins of the distance", basins, basins),
        (f"{scan.labels.max()} grains", scan.labels, scan.labels),
        ("outlines of grains", scan.grey, scan.labels),
    ]
    if scan.true is not None:
        panels[2] = (f"{scan.true.max()} true grains", scan.true, scan.true)
    figure, axes = style.new_figure(style.PAGE, 4.9, nrows=2, ncols=3)
    for k, (axis, (title, volume, edges)) in enumerate(zip(axes.ravel(), panels, strict=True)):
        shown = volume[middle]
        if volume is edges:
            colours = label_colours(int(volume.max()), touching_labels(shown[None]))
            axis.imshow(colours[shown], interpolation="nearest")
        else:
            axis.imshow(shown, cmap="gray", interpolation="nearest")
            if edges is not None:
                lines = outlines(edges[middle].astype(np.int32)) - 0.5
                axis.add_collection(LineCollection(lines, colors=style.RED, linewidths=0.6))
        axis.set(title=title, xticks=[], yticks=[])
        axis.spines[:].set_visible(True)
        style.panel_letter(axis, k)
    depth = scan.found["merge_depth"]
    return (
        figure,
        "The chain, in the middle slice.",
        f"{' × '.join(map(str, scan.grey.shape))} voxels. Basins of the distance map whose "
        f"dips are below {depth:.2g} voxels are merged; {scan.found['opened_contacts']} pairs "
        "of grains are parted because the image is too dark between them. Colours are by chance.",
        None,
    )


def levels(scan):
    """Histogram and thresholds."""
    figure, axis = style.new_figure(style.COLUMN, 2.6)
    rows = [("threshold", "grey level", "solid fraction")]
    for image, name, line in ((scan.grey, "as scanned", ":"), (scan.filtered, "filtered", "-")):
        counts, edges = np.histogram(image, bins=thresholds.NUM_BINS)
        axis.semilogy(edges[:-1], np.maximum(counts, 0.5) / counts.sum(), line,
                      color=style.BLACK, lw=0.9, label=name)  # fmt: skip
    looks = ((style.RED, "-"), (style.GREEN, "--"), (style.BLUE, "-"))
    for method, (colour, line) in zip(METHODS, looks, strict=True):
        try:
            level = thresholds.find_threshold(scan.filtered, method)
        except InputError:
            rows.append((method, "no two modes", ""))
            continue
        axis.axvline(level, color=colour, ls=line, lw=1.0, label=method)
        rows.append((method, f"{level:.4g}", f"{(scan.filtered > level).mean():.3f}"))
    axis.set(xlabel="grey level", ylabel="part of the voxels")
    axis.legend(loc="lower center", frameon=True, framealpha=1, edgecolor="none")
    return (
        figure,
        "Grey levels and thresholds.",
        "Voxels that a surface cuts fill the valley. The level in the middle of both phases "
        "leaves a blurred surface in its place; Otsu's and the lowest point between two fitted "
        "Gaussians move with the shares and the widths of the phases.",
        rows,
    )


def sweeps(scan, quick):
    """Numbers of grains and agreement against each parameter."""
    truth = "the true grains" if scan.true is not None else "the labels of the defaults"
    figure, axes = style.new_figure(style.PAGE, 4.6, nrows=2, ncols=3)
    rows = [("parameter", "value", "grains", "one-to-one", "ARI", "contacts: precision", "recall",
             "mean diameter")]  # fmt: skip
    for k, (axis, (panel, (_, values))) in enumerate(
        zip(axes.ravel(), SWEEPS.items(), strict=True)
    ):
        values = values[::2] if quick else values
        found = []
        for value in values:
            try:
                labels, _, _ = segment(scan.grey, scan.changed(panel, value))
            except InputError as error:  # a filter so wide that no two phases are left
                found.append(NOTHING)
                rows.append((LABELS[panel], f"{value:g}", str(error).partition(":")[0]))
                continue
            found.append(scan.judged(labels))
            numbers = found[-1]
            rows.append((
                LABELS[panel], f"{value:g}", f"{numbers['grains']}",
                *(f"{numbers[key]:.3f}" for key in ("one-to-one", "ARI", "precision", "recall")),
                f"{100 * numbers['diameter']:+.2f} %",
            ))  # fmt: skip
        lines = {"one-to-one": style.BLUE, "ARI": style.GREEN}
        if panel == "contact":
            lines = {"precision": style.RED, "recall": style.BLUE}
        for key, colour in lines.items():
            axis.plot(values, [n[key] for n in found], "o-", ms=3, color=colour, label=key)
        axis.set(xlabel=LABELS[panel], ylim=(0, 1.04))
        if panel == "depth":
            axis.set_xscale("log")
        if panel != "contact":
            other = axis.twinx()
            other.plot(values, [n["grains"] for n in found], "s--", ms=3, lw=0.8,
                       color=style.GREY, label="grains")  # fmt: skip
            other.set_ylim(0, 1.1 * np.nanmax([n["grains"] for n in found]))
            other.spines["right"].set_visible(True)
            if k in (2, 4):
                other.set_ylabel("grains (dashed)")
        places = {"depth": "lower left", "level": "lower left"}
        axis.legend(loc=places.get(panel, "lower right"))
        style.panel_letter(axis, k)
    return (
        figure,
        f"One parameter changed at a time, held against {truth}.",
        "One-to-one: each of two grains holds more than half of the other. ARI: adjusted Rand "
        "index. The level acts as in ITK, where it counts twice: 0.2 merges dips up to about 0.04 "
        "of the largest distance. The threshold T flattens the deepest parts only, and changes "
        "nothing until it reaches the necks.",
        rows,
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="where the page and its figures go")
    parser.add_argument("--image", type=Path, help="grey image instead of the synthetic scan")
    parser.add_argument("--crop", help="its part, z0:z1,y0:y1,x0:x1")
    parser.add_argument("--key", help="name of the array in a .npz or .h5 file")
    parser.add_argument("--min-grain-voxels", type=int, default=200, help="of an image")
    parser.add_argument("--quick", action="store_true", help="fewer values, a smaller scan")
    options = parser.parse_args()
    start = time.perf_counter()
    figures, tables = [], []
    try:
        options.folder.mkdir(parents=True, exist_ok=True)
        if options.image is not None:
            crop = crop_ranges(options.crop) if options.crop else None
            grey = read_image(options.image, key=options.key, crop=crop)
            smallest = options.min_grain_voxels
            scan = Scan(grey, SegmentSettings(voxel_size=1.0, min_grain_voxels=smallest))
            what = f"{options.image.name}: nobody knows its true grains."
        else:
            edge, d50 = (60, 150e-6) if options.quick else (110, 200e-6)
            made = SynthesisSettings(shape=(edge,) * 3, d50=d50)
            print("packing a synthetic scan ...", flush=True)
            grey, true, _ = synthetic_scan(made)
            smallest = sliver(made)
            scan = Scan(
                grey, SegmentSettings(voxel_size=1.0, min_grain_voxels=smallest), true
            )  # fmt: skip
            what = "A synthetic scan (`mufe synthesize`), whose grains are known."
        drawn = {
            "chain": (lambda: chain(scan), "wide"),
            "levels": (lambda: levels(scan), "narrow"),
            "parameters": (lambda: sweeps(scan, options.quick), "wide"),
        }
        for name, (draw, width) in drawn.items():
            print(f"{name} ...", flush=True)
            with matplotlib.rc_context(style.RC):
                figure, caption, how, rows = draw()
                path = options.folder / f"{name}.png"
                figure.savefig(path)
            figures.append((path, caption, how, width))
            if rows:
                tables.append((caption, rows))
        page = options.folder / "segmentation.html"
        write_page(
            page, "From a grey image to grains", what, [], [], figures, tables,
            f"Written by demos/segmentation.py in {time.perf_counter() - start:.0f} s.",
        )  # fmt: skip
    except (InputError, OSError) as error:
        sys.exit(f"error: {error}")
    print(page)


if __name__ == "__main__":
    main()
