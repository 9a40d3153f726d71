"""Figure of the contact network: where contacts point, how forces are spread, compression."""

import numpy as np

from mufe_fenicsx.analysis.contact_forces import force_distribution
from mufe_fenicsx.analysis.fabric import rose
from mufe_fenicsx.analysis.macro import oedometer_curves
from mufe_fenicsx.geometry.measure import tet_volumes
from mufe_fenicsx.report import style

#: Bins of the rose, and of f/<f> up to the largest that is drawn.
NUM_BINS, LARGEST = 24, 5.0


def draw_network(contacts, history, reference, cells):
    """Rose of the contacts, distribution of their forces, void ratio over stress.

    Args:
        contacts: Table of the contacts of one state, dict column -> array.
        history: dict column -> array.
        reference: Nodes in the reference configuration [m], shape (num_nodes, 3).
        cells: Nodes of the tetrahedra, shape (num_cells, 4).
    """
    inner = (contacts["num_points"] > 0) & (contacts["wall"] == "")
    normals = np.column_stack([contacts[f"normal_{a}"][inner] for a in "xyz"])
    force = contacts["normal_force"][inner]
    figure, axes = style.new_figure(style.PAGE, 2.5, ncols=3)
    axes[0].remove()
    polar = figure.add_subplot(axes[0].get_subplotspec(), projection="polar")
    _draw_rose(polar, normals, np.maximum(force, 0.0))
    _draw_forces(axes[1], force)
    _draw_compression(axes[2], history, reference, cells)
    # A title of its own would be put above the letter of the axis, beyond the figure.
    polar.set_title("(a)", loc="left", fontweight="bold", y=0.97)
    for i in (1, 2):
        style.panel_letter(axes[i], i)
    return figure


def _draw_rose(axis, normals, force):
    """Two vertical planes together: directions from the horizontal ones to z."""
    angle = np.linspace(0, 2 * np.pi, NUM_BINS * 20)  # steps round the circle
    for weights, colour, label in (
        (None, style.BLUE, "contacts"),
        (force, style.RED, "by force"),
    ):
        density = 0.5 * sum(
            np.nan_to_num(rose(normals, plane, NUM_BINS, weights).density) for plane in ("xz", "yz")
        )
        steps = np.repeat(density, 20)
        axis.plot(
            np.append(angle, 0), np.append(steps, steps[0]), color=colour, linewidth=1, label=label
        )
    even = np.full(angle.shape, 1 / (2 * np.pi))
    axis.plot(angle, even, ":", color=style.GREY, linewidth=1, label="isotropic")
    axis.set_yticks([])
    axis.set_xticks(np.radians([0, 90, 180, 270]), ["x, y", "z", "", ""])
    axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.02), ncols=3, handlelength=1.2)


def _draw_forces(axis, force):
    found = force_distribution(force, 20, LARGEST)
    axis.stairs(found.density, found.edges, fill=True, color=style.SKY, alpha=0.7)
    x = np.linspace(0, LARGEST, 60)
    axis.plot(x, np.exp(-x), "--", color=style.BLACK, linewidth=0.9, label="exp(−f/⟨f⟩)")
    axis.axvline(1, color=style.GREY, linestyle=":", linewidth=0.9)
    axis.set(xlabel="Normal force over its mean, f/⟨f⟩", ylabel="Probability density")
    axis.set_title(f"mean {style.quantity(found.mean, 'N')}", fontsize=7, loc="right")
    axis.legend(loc="upper right")


def _draw_compression(axis, history, reference, cells):
    if "length_x" in history:
        lengths = np.column_stack([history["length_x"], history["length_y"]])
    else:  # of an earlier version: the box at the start
        lengths = np.tile(np.ptp(reference, axis=0)[:2], (len(history["step"]), 1))
    curves = oedometer_curves(history, lengths, tet_volumes(reference, cells).sum())
    loading = (history["stage"] != "seating") & (curves["stress"] > 0)
    factor, unit = style.unit_of(curves["stress"][loading], "Pa")
    axis.semilogx(
        curves["stress"][loading] / factor, curves["void_ratio"][loading], color=style.BLUE
    )
    style.plain_log_ticks(axis.xaxis)
    axis.set(
        xlabel=rf"Vertical stress, $\sigma_{{\mathrm{{v}}}}$: {unit}", ylabel="Void ratio, $e$"
    )
