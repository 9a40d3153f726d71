"""The figure of a test with tools: force and torque of the grains on each over time."""

import h5py
import pyvista

from mufe_fenicsx.analysis.rows import tool_names
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.report import style
from mufe_fenicsx.report.axes import shared_legend
from mufe_fenicsx.report.figure import Drawing

NAME = "tools"


def tool_surfaces(folder, index):
    """Triangles of the tools at a stored state, pyvista.PolyData; None where there are none."""
    path = folder / "tools" / f"{index:04d}.vtkhdf"
    if not path.is_file():
        return None
    with h5py.File(path) as file:
        group = file["VTKHDF"]
        points, facets = group["Points"][:], group["Polygons/Connectivity"][:]
    return pyvista.PolyData.from_regular_faces(points, facets.reshape(-1, 3))


def draw_tools(source):
    """Components of force and torque over time, a colour each tool."""
    history = source.history
    names = tool_names(history)
    if not names:
        raise InputError("the test has no tools, expected one")
    figure, axes = style.new_figure(style.PAGE, 3.9, nrows=2, ncols=3, sharex=True, sharey="row")
    time, data = history["time"], {"time [s]": history["time"]}
    factor, unit = style.unit_of(time, "s")
    for row, (what, symbol, si) in enumerate((("force", "F", "N"), ("torque", "M", "N m"))):
        table = {(n, a): history[f"{what}_{n}_{a}"] for n in names for a in "xyz"}
        data |= {f"{what} {n} {a} [{si}]": values for (n, a), values in table.items()}
        largest = max((abs(values).max() for values in table.values()), default=0.0)
        size, shown = style.unit_of([largest], si)
        for column, a in enumerate("xyz"):
            axis = axes[row, column]
            for number, n in enumerate(names):
                colour = style.SERIES[number % len(style.SERIES)]
                line = style.LINES[number // len(style.SERIES) % len(style.LINES)]
                axis.plot(time / factor, table[n, a] / size, line, color=colour, label=n)
            axis.axhline(0, color=style.GREY, linewidth=0.5, zorder=0)
            axis.set_ylabel(f"{what.capitalize()}, ${symbol}_{a}$: {shown}")
            style.panel_letter(axis, 3 * row + column)
            if row:
                axis.set_xlabel(f"Time, $t$: {unit}")
    shared_legend(axes[0, 0], 6)
    return Drawing(
        NAME,
        figure,
        "Tools: (a) to (c) force of the grains, (d) to (f) its torque about the point of the tool",
        "What the grains do to each tool, along and about the axes of the test. A tool that holds "
        "a load and rests carries the opposite of it.",
        {"": data},
        "wide",
    )
