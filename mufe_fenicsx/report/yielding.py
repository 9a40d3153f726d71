"""Figure of yield initiation: when grains yield, and where in them yielding begins."""

import numpy as np

from mufe_fenicsx.analysis.yield_place import closest_on_triangles, yield_place
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.measure import boundary_triangles
from mufe_fenicsx.report import style
from mufe_fenicsx.report.axes import legends
from mufe_fenicsx.report.curves import shade
from mufe_fenicsx.report.figure import Drawing
from mufe_fenicsx.report.sample import State
from mufe_fenicsx.report.views import add_outline, colour_bar, cut_collection, polygons

#: Depth of the largest von Mises stress under a frictionless contact of spheres over its radius,
#: for ν = 0.3 (0.43 for ν = 0.15): K. L. Johnson, Contact Mechanics, 1985, ch. 3.4.
HERTZ_DEPTH = 0.48
#: Places farther from a contact than so many of its radii are counted, not drawn.
FAR = 4.0


def draw_yield(source):
    """How many grains yield, where under a contact they start, a cut through one of them."""
    source.states  # noqa: B018  there have to be some
    course, table = source.course, source.run.first_yield()
    table = table[table["state"] >= 0]
    if not len(table):
        raise InputError("no grain has yielded")
    figure, axes = style.new_figure(style.PAGE, 2.6, ncols=3)
    left, middle, right = axes
    along, over = source.over(course["strain"], course["time"])
    for k, (name, label) in enumerate((("yielded", "grains"), ("plastic_volume", "volume"))):
        look = {"color": style.SERIES[k], "markersize": 3, "label": label}
        left.plot(along, 100 * course[name], style.MARKERS[k] + style.LINES[k], **look)
    shade(source, left)
    left.set(xlabel=over, ylabel="Yielded: %", ylim=(0, 105))
    beyond = _draw_places(middle, table)
    tables = {
        "share": {
            "strain [-]": course["strain"],
            "grains that have yielded [-]": course["yielded"],
            "yielded volume [-]": course["plastic_volume"],
        },
        "place": {
            "grain": table["grain"],
            "state": table["state"],
            "strain [-]": table["strain"],
            "rank": table["rank"],
            "largest plastic strain [-]": table["plastic_strain"],
            "depth [m]": table["depth"],
            "under contact": table["under_contact"],
            "distance from the edge of contact [m]": table["edge_distance"],
            "radius of the contact [m]": table["contact_radius"],
        },
    }
    first = table[table["rank"] == table["rank"].min()]
    # Where yield has just begun shows where it began: the least plastic strain of the first.
    row = first.loc[first["plastic_strain"].idxmin()]
    tables["cut"] = _draw_cut(figure, right, source, int(row["grain"]), int(row["state"]))
    legends(left, middle)
    for i, axis in enumerate(axes):
        style.panel_letter(axis, i)
    return Drawing(
        "yield-initiation",
        figure,
        "Yield initiation: (a) share of grains and of volume that has yielded; (b) place of the "
        "largest plastic strain of each grain at its first yield; (c) plastic "
        f"strain in a cut through grain {row['grain']}, among the first, at strain "
        f"{row['strain']:.4f}",
        f"(b) Left of the dotted line lies under a contact, right beside it ({beyond} are farther "
        f"than {FAR:g} radii); the dashed line is the depth of the largest stress under a "
        "frictionless contact of spheres, 0.48 of its radius (Hertz, ν = 0.3). Places are "
        "resolved by the elements, times by the stored states. (c) The cut contains that place "
        "(cross) and the closest point of the surface.",
        tables,
        "wide",
    )


def _draw_places(axis, table):
    """Where under contacts grains yield first, in radii; number of places too far to be shown."""
    known = table[np.isfinite(table["contact_radius"])]
    depth = (known["depth"] / known["contact_radius"]).to_numpy()
    aside = (known["edge_distance"] / known["contact_radius"]).to_numpy()
    near = (aside <= FAR) & (depth <= FAR)
    for k, (under, label) in enumerate(((True, "under a contact"), (False, "beside contacts"))):
        those = (known["under_contact"] == under).to_numpy() & near
        axis.plot(
            np.where(under, -1, 1) * aside[those],
            depth[those],
            style.MARKERS[k],
            color=style.SERIES[k],
            markersize=3.5,
            markerfacecolor="none",
            markeredgewidth=0.8,
            label=f"{label}: {those.sum()}",
        )
    axis.axvline(0, color=style.GREY, linewidth=0.8, linestyle=":")
    axis.axhline(HERTZ_DEPTH, color=style.GREY, linewidth=0.8, linestyle="--")
    top = max(1.0, depth[near].max(initial=0.0))
    left = np.where(known["under_contact"], -1, 1) * aside
    right = max(1.0, left[near].max(initial=0.0))
    beyond = int((~near).sum())
    axis.set(
        xlabel="Outside contact / radius: –",
        ylabel="Depth / contact radius: –",
        xlim=(min(-1.1, 1.05 * left[near].min(initial=0.0)), 1.05 * right),
        ylim=(1.05 * top, -0.1 * top),
    )
    return beyond


def _draw_cut(figure, axis, source, grain, index):
    """Plastic strain of one grain in the plane through the place where it is largest."""
    state = State(source.run.state(index), None, source.end)
    mine = state.grain == grain
    cells, plastic = state.cells[mine], state.stored.plastic_strain[mine]
    pressure = state.stored.contact_pressure
    place = yield_place(state.points, cells, plastic, pressure)
    corners = state.points[boundary_triangles(cells)]
    nearest = closest_on_triangles(place.position, corners)
    nearest = nearest[np.argmin(np.linalg.norm(nearest - place.position, axis=1))]
    up = nearest - place.position
    up /= np.linalg.norm(up) or 1.0
    centre = state.points[np.unique(cells)].mean(axis=0)
    # The plane holds that line and the grain's middle, or any direction.
    side = centre - place.position
    side -= (side @ up) * up
    if np.linalg.norm(side) < 1e-3 * np.ptp(corners[:, 0], axis=0).max():
        side = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    side /= np.linalg.norm(side)
    normal = np.cross(up, side)
    grid = state.grid(mine, plastic_strain=state.stored.plastic_strain)
    cut = grid.slice(normal=normal, origin=place.position)
    outline = state.surface(grain).slice(normal=normal, origin=place.position)
    scale, unit = style.unit_of(np.ptp(state.points[np.unique(cells)], axis=0), "m")

    def plane(points):
        away = np.asarray(points) - place.position
        return np.column_stack([away @ side, away @ up]) / scale

    values = np.asarray(cut.cell_data["plastic_strain"])
    faces = polygons(cut.faces)
    limit = style.round_limit(max(values.max(initial=0), plastic.max()))
    shapes = [plane(cut.points[f]) for f in faces]
    axis.add_collection(cut_collection(shapes, values, limit, "magma_r"))
    add_outline(axis, [plane(outline.points[line]) for line in polygons(outline.lines)])
    axis.plot(0, 0, "x", color=style.BLUE, markersize=5)
    axis.autoscale_view()
    axis.set(
        aspect="equal", xlabel=f"along the surface: {unit}", ylabel=f"out of the surface: {unit}"
    )
    colour_bar(
        figure,
        [axis],
        limit,
        "magma_r",
        "plastic strain: –",
        "",
        ticks=[0, 0.5 * limit, limit],
        shrink=0.6,
    )
    centres = np.array([plane(cut.points[f]).mean(axis=0) for f in faces]).reshape(-1, 2) * scale
    return {
        "along the surface [m]": centres[:, 0],
        "out of the surface [m]": centres[:, 1],
        "plastic strain [-]": values,
    }
