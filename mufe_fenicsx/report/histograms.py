"""Figure 9: quality of the mesh before and after the test."""

import numpy as np
from matplotlib.ticker import MaxNLocator

from mufe_fenicsx.report import style


def draw_mesh_quality(reference, end, cells_per_grain):
    """Histograms of smallest dihedral angles and altitudes, and of tets a grain.

    Args:
        reference: MeshQuality of the mesh as built.
        end: MeshQuality of the last stored state.
        cells_per_grain: Number of tetrahedra of each grain.
    """
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
        axis.hist(before, bins, color=style.SKY, alpha=0.7, label="as built")
        axis.hist(after, bins, histtype="step", color=style.RED, linewidth=1, label="at the end")
        axis.set(xlabel=label, ylabel="Tetrahedra", xlim=(0, bins[-1]))
        axis.set_title(
            f"smallest {before.min():.3g} → {after.min():.3g} {short}", fontsize=7, loc="right"
        )
        axis.ticklabel_format(axis="y", style="sci", scilimits=(0, 3), useMathText=True)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    num_bins = int(np.clip(len(cells_per_grain) // 4, 5, 30))
    axes[2].hist(cells_per_grain, num_bins, color=style.SKY, edgecolor="white", linewidth=0.4)
    axes[2].set(xlabel="Tetrahedra in a grain", ylabel="Grains")
    axes[2].set_title(f"mean {style.number(np.mean(cells_per_grain))}", fontsize=7, loc="right")
    axes[2].xaxis.set_major_locator(MaxNLocator(5, integer=True))
    axes[2].yaxis.get_major_locator().set_params(integer=True)
    for i, axis in enumerate(axes):
        style.panel_letter(axis, i)
    return figure
