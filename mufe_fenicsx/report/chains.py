"""Figure of force chains: contact forces as tubes inside pale grains."""

import numpy as np
import pyvista

from mufe_fenicsx.analysis.by_grain import index_grains
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.report import style
from mufe_fenicsx.report.figure import Drawing
from mufe_fenicsx.report.render import Camera, Layer, over, render
from mufe_fenicsx.report.views import FROM, colour_bar, three_in_a_row
from mufe_fenicsx.results.columns import vectors

#: Sides of a tube, and its radius at the mean force over the mean radius of the grains.
SIDES, RADIUS = 8, 0.055
#: f/<f> at the end of the colours; thicker tubes are cut there too.
LARGEST = 4.0


def tubes(start, end, radius, sides=SIDES):
    """Straight tubes as one surface.

    Args:
        start, end: Ends of their axes [m], shape (num_tubes, 3).
        radius: [m], shape (num_tubes,).
        sides: Facets round each.

    Returns:
        points, shape (2 sides num_tubes, 3), and quadrilaterals, shape (sides num_tubes, 4).
    """
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    along = end - start
    # Any direction that is not along the tube.
    other = np.eye(3)[np.argmin(np.abs(along), axis=1)]
    u = np.cross(along, other)
    u /= np.linalg.norm(u, axis=1)[:, None]
    v = np.cross(along, u)
    v /= np.linalg.norm(v, axis=1)[:, None]
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.cos(angle)[:, None] * u[:, None] + np.sin(angle)[:, None] * v[:, None]
    ring = ring * np.asarray(radius)[:, None, None]
    points = np.stack([start[:, None] + ring, end[:, None] + ring], axis=1).reshape(-1, 3)
    k = np.arange(sides)
    quad = np.column_stack([k, (k + 1) % sides, sides + (k + 1) % sides, sides + k])
    quads = quad + 2 * sides * np.arange(len(start))[:, None, None]
    return points, quads.reshape(-1, 4)


def draw_force_chains(source):
    """Forces at the start and at the end, force chains at the end."""
    states = {s.index: s for s in source.states}
    shown = [i for i in source.contact_states if i in states]
    shown = [shown[0], shown[-1]] if len(shown) > 1 else shown
    shown = [i for i in dict.fromkeys(shown) if len(source.active_contacts(i))]
    if not shown:
        raise InputError("no stored state has both fields and active contacts")
    source.need_rendering()
    corners = np.concatenate([states[i].corners(source.start) for i in shown])
    aspect, pixels, height = three_in_a_row(corners)
    camera = Camera.around(corners, FROM, aspect)
    chains = source.active_contacts(shown[-1])["chain"]
    num_chains = int(chains[chains >= 0].nunique())
    panels = [*shown, shown[-1]] if num_chains else shown  # none, and no panel of them
    figure, axes = style.new_figure(style.PAGE, height, ncols=len(panels), squeeze=False)
    axes, tables = axes[0], {}
    volume = np.bincount(index_grains(source.end.grain)[1], source.end.volume)
    mean_radius = np.cbrt(3 * volume.mean() / (4 * np.pi))
    for k, index in enumerate(panels):
        state, table = states[index], source.active_contacts(index)
        only_chains = k == len(shown)
        ghost = _ghost(state, camera, pixels, state.outline(source.start))
        start, end = _ends(table, source.run.grains(index))
        ratio = table["ratio"].to_numpy(dtype=float)
        if not only_chains:
            tables[f"state{index}"] = _columns(table, start, end)
        kept = np.nan_to_num(ratio) > 0
        if only_chains:
            kept &= table["chain"].to_numpy() >= 0
        image = ghost
        if kept.any():
            lines = start[kept], vectors(table, "centroid")[kept], end[kept]
            body = _tubes_of(*lines, ratio[kept], mean_radius)
            layer = Layer(body, None, "ratio", style.CHAIN_MAP, (0, LARGEST))
            image = over(render([layer], camera, pixels), ghost)
        axes[k].imshow(image)
        axes[k].set_axis_off()
        style.panel_letter(axes[k], k)
        strain = rf"$\varepsilon$ = {style.strain(state.strain)}"
        style.heading(axes[k], f"{strain}, chains" if only_chains else strain)
    style.scale_bar(axes[0], 2 * camera.half_height * aspect)
    colour_bar(figure, axes, LARGEST, style.CHAIN_MAP, "Normal force over its mean, f/⟨f⟩: –", "",
               "max")  # fmt: skip
    of_chains = f"; ({'abc'[len(shown)]}) those within force chains only" if num_chains else ""
    found = f"{num_chains or 'none here,'} of at least three grains whose major stress is above "
    found += f"the mean and within {source.run.chain_angle:g}° of the contact force"
    return Drawing(
        "force-chains",
        figure,
        "Contact forces inside the grains, from centre to contact to centre, or to the wall"
        f"{of_chains}",
        "Thickness grows with the square root of the normal force over the mean of those between "
        f"grains. Force chains as defined by Peters et al. (2005): {found}. Tubes are drawn over "
        "the grains.",
        tables,
        "wide",
        vector=False,
    )


def _tubes_of(start, place, end, ratio, mean_radius):
    """Tubes from ``start`` to ``end`` by the place of contact, (num_contacts, 3) [m] each.

    From centre to centre a tube may leave its grains.
    """
    radius = RADIUS * mean_radius * np.sqrt(np.minimum(ratio, LARGEST))
    halves = (start, place, radius), (place, end, radius)
    ends = [np.concatenate(each) for each in zip(*halves, strict=True)]
    longer = np.linalg.norm(ends[1] - ends[0], axis=1) > 1e-6 * mean_radius  # not on walls
    body = pyvista.PolyData.from_regular_faces(*tubes(*(each[longer] for each in ends)))
    body.cell_data["ratio"] = np.repeat(np.tile(ratio, 2)[longer], SIDES)
    return body


def _ghost(state, camera, pixels, outline):
    """The grains, pale, with darker rims."""
    layer = Layer(state.surface(), "#c8ccd4", options={"ambient": 0.25, "diffuse": 0.8})
    grey = render([layer], camera, pixels, outline, headlight=True)
    return over(np.full_like(grey, 255), grey, fade=0.4)


def _ends(table, grains):
    """Ends of the lines: centre of the second grain, or the place on the wall, to the first."""
    labels, centres = grains["grain"].to_numpy(), vectors(grains, "center")
    end = centres[np.searchsorted(labels, table["grain_a"].to_numpy())]
    return end - vectors(table, "branch"), end


def _columns(table, start, end):
    columns = {"grain a": table["grain_a"], "grain b (0: wall)": table["grain_b"]}
    columns["wall"] = table["wall"]
    for name, places in (("from", start), ("to", end)):
        columns |= {f"{name} {a} [m]": places[:, i] for i, a in enumerate("xyz")}
    return columns | {
        "normal force [N]": table["normal_force"],
        "f/<f> [-]": table["ratio"],
        "chain (-1: none)": table["chain"],
    }
