"""Figure of localisation: strain around each grain in a vertical section, and across a band."""

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize

from mufe_fenicsx.analysis.shear_band import FEWEST
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.report import style
from mufe_fenicsx.report.figure import Drawing
from mufe_fenicsx.report.views import add_outline, polygons
from mufe_fenicsx.results.columns import vectors
from mufe_fenicsx.results.localisation import judge

NAME = "localisation"
#: Column of the table, what it is called, factor, and whether it has both signs.
SHOWN = (
    ("strain_deviator", r"Deviatoric strain, $\varepsilon_{\mathrm{q}}$: –", 1.0, False),
    ("strain_volume", r"Volumetric strain, $\varepsilon_{\mathrm{vol}}$: –", 1.0, True),
    ("excess", "Excess rotation: °", float(np.degrees(1.0)), False),
)
#: A band below this inclination has no direction; its section is that of x and z [degrees].
LEVEL = 5.0


def too_few(num_grains):
    """Why so many grains have no such figure, None where they have."""
    if num_grains is None or num_grains >= FEWEST:
        return None
    return f"{num_grains} grains are too few to tell of a band, expected {FEWEST} or more"


def draw_localisation(source):
    """Strain, change of volume and excess rotation of grains in a section, and across a band."""
    start, end = source.start, source.end
    if start.index == end.index:
        raise InputError("there is one stored state of loading, expected two or more")
    table = source.run.localisation(end.index, start.index)
    found = judge(table)
    known = table[np.isfinite(table["strain_deviator"])]
    section = _Section.of(start, start.box(start), found.band if found.is_band else None)
    aspect = section.height / section.width
    # Three panels, their colour bars and words take so much of the page.
    top = 1.1 + 0.27 * style.PAGE * aspect
    figure = style.blank_figure(style.PAGE, top + 1.9)
    upper, lower = figure.subfigures(2, 1, height_ratios=[top, 1.9])
    axes = upper.subplots(ncols=3)
    for i, (axis, shown) in enumerate(zip(axes, SHOWN, strict=True)):
        _draw_section(upper, axis, section, table, shown)
        axis.set_ylabel(f"z: {section.unit}" if i == 0 else "")
        style.panel_letter(axis, i)
        if found.is_band:
            section.draw_band(axis, found.band)
    for i, axis in enumerate(lower.subplots(ncols=2)):
        _draw_across(axis, known, found, SHOWN[2 * i])
        style.panel_letter(axis, 3 + i)
        if found.band is not None:
            verdict = "band" if found.is_band else "no band"
            words = f"{verdict}: slab explains {100 * found.band.share:.0f} % of the variance"
            axis.set_title(words if i == 0 else "", loc="right", fontsize=7.5)
    return Drawing(
        NAME,
        figure,
        f"Localisation from strain {start.strain:.3f} to {end.strain:.3f}: (a) deviatoric strain, "
        "(b) volumetric strain and (c) rotation of the grains beyond that of their neighbours in "
        "a vertical section; (d) and (e) across the plane slab that parts the strains best",
        "Strain is logarithmic, of the Delaunay cells between centres of neighbouring grains "
        "(Bagi 1996), averaged at each grain; compression is positive. Grains stand where they "
        f"were at first; grey ones have no cell. {about(found, known)}",
        {"": _columns(table)},
        "wide",
    )


def about(found, known):
    """Words about a band, or that there is none.

    Args:
        found: :class:`~mufe_fenicsx.results.localisation.Localisation`.
        known: Rows of its table that have a strain.
    """
    text = f"The standard deviation of (a) is {found.spread:.2f} of the mean. "
    if np.isfinite(found.void_ratio).all():
        text += "The void ratio inside goes from {:.3f} to {:.3f}. ".format(*found.void_ratio)
    band = found.band
    if band is None:
        return text + "The strain is the same everywhere: no band."
    diameters = band.width / np.cbrt(6 * known["volume"].mean() / np.pi)
    return text + (
        f"The slab is {style.quantity(band.width, 'm')} ({diameters:.1f} mean diameters) thick "
        f"and inclined by {band.inclination:.0f}° to the horizontal. It explains "
        f"{100 * band.share:.0f} % of the variance, and its mean strain is "
        f"{band.contrast:.1f} times that beside it: "
        + ("a band, between the dashed lines." if found.is_band else "no band.")
    )


def _columns(table):
    """The table of grains with units."""
    units = {"center": "m", "volume": "m³", "cell_volume": "m³", "angle": "rad", "excess": "rad"}
    units |= {"rotation": "rad", "neighbours": "rad", "grain": None, "inside": None}

    def heading(name):
        unit = units.get(name, units.get(name.rsplit("_", 1)[0], "-"))
        return name.replace("_", " ") + (f" [{unit}]" if unit else "")

    return {heading(name): table[name] for name in table}


class _Section:
    """A vertical plane through the middle of a sample.

    Args:
        state: :class:`mufe_fenicsx.report.sample.State`.
        box: Corners of the space between the walls [m], shape (2, 3).
        along: Its horizontal direction, shape (3,).
    """

    def __init__(self, state, box, along):
        self.along, self.middle = along, box.mean(axis=0)
        size = np.ptp(box, axis=0)
        with np.errstate(divide="ignore"):
            chord = np.min(size[:2] / np.abs(along[:2]))
        self.width = float(chord if state.centre is None else size[0])
        self.height, self.bottom = float(size[2]), float(box[0, 2])
        self.scale, self.unit = style.unit_of([self.width, self.height], "m")
        normal = np.cross(along, (0.0, 0.0, 1.0))
        away = ((state.points - self.middle) @ normal)[state.cells]
        crossed = (away.min(axis=1) <= 0) & (away.max(axis=1) >= 0)
        if not crossed.any():
            raise InputError("no grain reaches the plane through the middle")
        plane = {"normal": normal, "origin": self.middle}
        cut = state.grid(crossed, grain=state.grain).slice(**plane)
        outline = state.surface().slice(**plane)
        self.shapes = [self.flat(cut.points[f]) for f in polygons(cut.faces)]
        self.grain = np.asarray(cut.cell_data["grain"])
        self.outline = [self.flat(outline.points[line]) for line in polygons(outline.lines)]

    @classmethod
    def of(cls, state, box, band):
        """The section that has the normal of a band in it; that of x and z without one."""
        along = np.array([1.0, 0.0, 0.0])
        if band is not None and band.inclination > LEVEL:
            along = np.append(band.normal[:2], 0.0) / np.linalg.norm(band.normal[:2])
            along = along if along[0] >= 0 else -along
        return cls(state, box, along)

    @property
    def label(self):
        """What the horizontal axis shows."""
        if self.along[0] > 0.999:
            return f"x: {self.unit}"
        angle = np.degrees(np.arctan2(self.along[1], self.along[0]))
        return f"{angle:.0f}° from x: {self.unit}".replace("-", "−")

    def flat(self, points):
        """Places in the plane, from the left wall and from the bottom, in its unit."""
        points = np.asarray(points, dtype=float)
        across = (points - self.middle) @ self.along + 0.5 * self.width
        return np.column_stack([across, points[:, 2] - self.bottom]) / self.scale

    def draw_band(self, axis, band):
        """Its two planes, dashed, cut off at the walls."""
        for side in (-0.5, 0.5):
            place = self.flat((band.middle + side * band.width * band.normal)[None])[0]
            slope = np.array([-band.normal[2], band.normal @ self.along])
            ends = place + np.outer([-1, 1], 4 * (self.width + self.height) / self.scale * slope)
            line = axis.plot(*ends.T, "--", color=style.RED, linewidth=1.0, scalex=False)
            line[0].set_in_layout(False)


def _draw_section(figure, axis, section, table, shown):
    """Grains of a section by a column of the table, with its colour bar."""
    name, label, factor, signed = shown
    values = factor * table[name].to_numpy()
    limit = style.round_limit(np.nanpercentile(np.abs(values), 98))
    colours = colormaps[style.SIGNED_MAP if signed else style.GRAIN_MAP].with_extremes(bad="0.85")
    norm = Normalize(-limit if signed else 0.0, limit)
    at = np.searchsorted(table["grain"].to_numpy(), section.grain)
    axis.add_collection(
        PolyCollection(
            section.shapes,
            array=np.ma.masked_invalid(values[at]),
            linewidths=0.05,
            cmap=colours,
            norm=norm,
            edgecolors="face",
            rasterized=True,
            antialiased=False,
            clip_on=False,
        )
    )
    add_outline(axis, section.outline)
    axis.spines[:].set(visible=True, color=style.GREY, linewidth=0.8)
    axis.tick_params(direction="out")
    axis.set(
        xlim=(0, section.width / section.scale),
        ylim=(0, section.height / section.scale),
        aspect="equal",
        xlabel=section.label,
    )
    bar = figure.colorbar(
        ScalarMappable(norm, colours),
        ax=axis,
        location="bottom",
        shrink=0.85,
        aspect=22,
        pad=0.03,
        extend="both" if signed else "max",
    )
    bar.set_label(label)
    bar.outline.set_linewidth(0.6)


def _draw_across(axis, known, found, shown):
    """A number of the grains over their distance from the middle of the slab."""
    name, label, factor, _ = shown
    band, centre = found.band, vectors(known, "center")
    if band is None:
        normal, middle, words = np.array([0.0, 0.0, 1.0]), centre.mean(axis=0), "z from the middle"
    else:
        normal, middle, words = band.normal, band.middle, "Distance across the slab"
    away = (centre - middle) @ normal
    scale, unit = style.unit_of(away, "m")
    if band is not None:
        half = 0.5 * band.width / scale
        axis.axvspan(-half, half, color="0.9", linewidth=0, zorder=0)
    axis.plot(away / scale, factor * known[name], ".", color=style.BLUE, markersize=3)
    axis.set(xlabel=f"{words}: {unit}", ylabel=label)
    axis.set_ylim(bottom=0)
