"""Figure of the quality of the mesh before and after the test."""

import numpy as np
from matplotlib.ticker import FuncFormatter, MaxNLocator

from mufe_fenicsx.analysis.mesh_quality import mesh_quality
from mufe_fenicsx.report import style
from mufe_fenicsx.report.axes import shared_legend
from mufe_fenicsx.report.figure import Drawing


def draw_mesh_quality(source):
    """Histograms of smallest dihedral angles and altitudes, and of tets a grain."""
    last = source.end
    reference, end = mesh_quality(last.reference, last.cells), last.quality
    labels, cells_per_grain = np.unique(last.grain, return_counts=True)
    tables = {"grains": {"grain": labels, "tetrahedra": cells_per_grain}}
    figure, axes = style.new_figure(style.PAGE, 2.5, ncols=3)
    factor, unit = style.unit_of([np.median(reference.altitude)], "m")
    for axis, before, after, label, short in (
        (axes[0], reference.angle, end.angle, "Smallest dihedral angle: °", "°"),
        (
            axes[1],
            reference.altitude / factor,
            end.altitude / factor,
            f"Smallest altitude: {unit}",
            unit,
        ),
    ):
        both = np.concatenate([before, after])
        bins = np.linspace(0, np.percentile(both, 99.95), 41)
        counts = [axis.hist(before, bins, color=style.SKY, alpha=0.7, label="initial")[0]]
        look = {"histtype": "step", "color": style.RED, "linewidth": 1, "label": "final"}
        counts.append(axis.hist(after, bins, **look)[0])
        tables[label.split(":")[0].replace(" ", "-").lower()] = {
            f"from [{short}]": bins[:-1],
            f"to [{short}]": bins[1:],
            "tetrahedra as built": counts[0],
            "tetrahedra at the end": counts[1],
        }
        axis.set(xlabel=label, ylabel="Tetrahedra: thousands", xlim=(0, bins[-1]))
        axis.set_title(
            f"smallest {before.min():.3g} → {after.min():.3g} {short}", fontsize=7, loc="right"
        )
        axis.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y / 1000:g}"))
    shared_legend(axes[0])
    num_bins = int(np.clip(len(cells_per_grain) // 4, 5, 30))
    few = max(np.ptp(cells_per_grain), num_bins)  # where all are alike: ticks at whole numbers
    middle = 0.5 * (cells_per_grain.min() + cells_per_grain.max())
    bins = np.linspace(middle - 0.5 * few, middle + 0.5 * few, num_bins + 1)
    axes[2].hist(cells_per_grain, bins, color=style.SKY, edgecolor="white", linewidth=0.4)
    axes[2].set(xlabel="Tetrahedra per grain", ylabel="Grains")
    axes[2].set_title(f"mean {style.number(np.mean(cells_per_grain))}", fontsize=7, loc="right")
    axes[2].xaxis.set_major_locator(MaxNLocator(5, integer=True))
    axes[2].yaxis.get_major_locator().set_params(integer=True)
    for i, axis in enumerate(axes):
        style.panel_letter(axis, i)
    return Drawing(
        "mesh-quality",
        figure,
        "Mesh quality before and after the test: (a) smallest dihedral angles, (b) "
        "smallest altitudes of tetrahedra, (c) tetrahedra per grain",
        "Small dihedral angles reduce accuracy; the smallest altitude bounds the time step. Where "
        "the red line reaches zero, tetrahedra were flattened in the test.",
        tables,
        "wide",
    )
