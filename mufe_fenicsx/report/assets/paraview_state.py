"""Shows a run in ParaView: von Mises stress at three stages side by side, contacts over time.

In ParaView: File > Load State, or Tools > Python Shell > Run Script. For pictures without a
window: ``pvbatch paraview_state.py PICTURE.png [CONTACTS.png [FRAGMENTS.png]]``.

Layout "Stress": three stages with one colour scale and one camera, as Fig. 13 of Nadimi & Fonseca
(2018). Layout "Contacts": the fields through time, faint, and the contacts as tubes by their
normal force; the other data of both can be chosen in ParaView. Layout "Fragments", where grains
have broken: pieces through time by their number in the grain, 0 the largest.
"""

import json
import os
import sys

from paraview import simple

# Found in the run folder by `mufe paraview`.
SETTINGS = {}

VIEW_FROM = (1.0, -1.35, 0.75)
SIZE_OF_A_VIEW = (760, 820)


def folder():
    """The run folder: where this script is, or was when it was written."""
    try:
        here = os.path.dirname(os.path.abspath(__file__))
    except NameError:  # ParaView runs the text of a state, not the file
        here = ""
    return here if os.path.isdir(os.path.join(here, "fields")) else SETTINGS["folder"]


def look(view):
    """One camera for all views: parallel projection on the box between the walls."""
    low, high = SETTINGS["box"]
    middle = [0.5 * (a + b) for a, b in zip(low, high, strict=True)]
    diagonal = sum((b - a) ** 2 for a, b in zip(low, high, strict=True)) ** 0.5
    view.CameraParallelProjection = 1
    view.CameraFocalPoint = middle
    view.CameraPosition = [m + 3 * diagonal * d for m, d in zip(middle, VIEW_FROM, strict=True)]
    view.CameraViewUp = [0, 0, 1]
    view.CameraParallelScale = 0.52 * diagonal
    view.Background = [1, 1, 1]
    view.UseColorPaletteForBackground = 0
    view.OrientationAxesLabelColor = [0, 0, 0]


def new_view(text):
    """An empty view with a line of text at its top."""
    view = simple.CreateRenderView()
    view.ViewSize = list(SIZE_OF_A_VIEW)
    note = simple.Text(Text=text)
    shown = simple.Show(note, view)
    shown.Color = [0, 0, 0]
    shown.FontSize = 16
    shown.WindowLocation = "Upper Center"
    return view


def open_series(run_folder, name, reader):
    """A series of files with its times; ParaView 5.11 does not know .vtkhdf by its name.

    There a list of files is read instead, whose times are the numbers of the states.
    """
    path = os.path.join(run_folder, name)
    if simple.GetParaViewVersion() >= (5, 12):
        return simple.OpenDataFile(path)
    with open(path, encoding="utf-8") as file:
        names = [entry["name"] for entry in json.load(file)["files"]]
    return reader(FileName=[os.path.join(os.path.dirname(path), name) for name in names])


def deformed_surface(source):
    """The surface of the grains where they are now."""
    surface = simple.ExtractSurface(Input=source)
    warp = simple.WarpByVector(Input=surface, Vectors=["POINTS", "displacement"])
    warp.ScaleFactor = 1.0
    return warp


def colour(shown, array, title, high, view, bar):
    """Colour by an array from 0 to a value, in viridis."""
    simple.ColorBy(shown, array)
    table = simple.GetColorTransferFunction(array[1])
    table.ApplyPreset("Viridis (matplotlib)", True)
    table.RescaleTransferFunction(0.0, high)
    table.AutomaticRescaleRangeMode = "Never"
    if bar:
        legend = simple.GetScalarBar(table, view)
        legend.Title, legend.ComponentTitle = title, ""
        legend.TitleColor = legend.LabelColor = [0, 0, 0]
        legend.WindowLocation = "Lower Right Corner"
        legend.Visibility = 1
        shown.SetScalarBarVisibility(view, True)


def show_stress(run_folder):
    """Three stages side by side."""
    layout, stages = simple.CreateLayout("Stress"), SETTINGS["stages"]
    cells = [0]
    for rest in range(len(stages), 1, -1):  # the last cell into one view and the rest
        left = layout.SplitHorizontal(cells[-1], 1.0 / rest)
        cells[-1:] = [left, left + 1]
    for cell, stage in zip(cells, stages, strict=True):
        name = f"strain {stage['strain']:.3f}"
        view = new_view(name)
        simple.AssignViewToLayout(view=view, layout=layout, hint=cell)
        reader = simple.VTKHDFReader(FileName=[os.path.join(run_folder, stage["file"])])
        simple.RenameSource(name, reader)
        shown = simple.Show(deformed_surface(reader), view)
        limit, last = SETTINGS["stress"], stage is stages[-1]
        colour(shown, ("CELLS", "von_mises"), "von Mises stress: Pa", limit, view, last)
        look(view)
    return layout


def show_fields(run_folder, name, title, source):
    """A layout with one view of the fields through time: both, and what shows them."""
    layout = simple.CreateLayout(name)
    view = new_view(title)
    simple.AssignViewToLayout(view=view, layout=layout, hint=0)
    fields = open_series(run_folder, "fields/states.vtkhdf.series", simple.VTKHDFReader)
    simple.RenameSource(source, fields)
    return layout, view, simple.Show(deformed_surface(fields), view)


def show_contacts(run_folder):
    """Fields and contacts through time."""
    title = "contacts: width and colour by normal force"
    layout, view, shown = show_fields(run_folder, "Contacts", title, "fields")
    simple.ColorBy(shown, ("CELLS", "grain"))
    shown.Opacity = 0.12
    shown.SetScalarBarVisibility(view, False)
    series = "paraview/contacts.vtp.series"
    lines = open_series(run_folder, series, simple.XMLPolyDataReader)
    simple.RenameSource("contacts", lines)
    low, high = SETTINGS["box"]
    size = max(b - a for a, b in zip(low, high, strict=True))
    forces = simple.CellDatatoPointData(Input=lines)
    forces.PassCellData = 1
    radius = simple.Calculator(Input=forces, ResultArrayName="radius")
    radius.Function = f"max(normal_force, 0) * {0.012 * size / SETTINGS['force']:g}"
    tubes = simple.Tube(Input=radius)
    tubes.Scalars = ["POINTS", "radius"]
    tubes.VaryRadius = "By Absolute Scalar"
    tubes.NumberofSides = 8
    shown = simple.Show(tubes, view)
    array, limit = ("CELLS", "normal_force"), SETTINGS["force"]
    colour(shown, array, "Normal force: N", limit, view, True)
    look(view)
    return layout


def show_fragments(run_folder):
    """Pieces of broken grains through time."""
    title = "fragments of broken grains"
    layout, view, shown = show_fields(run_folder, "Fragments", title, "pieces")
    array = ("CELLS", "fragment")
    colour(shown, array, "Fragment, 0: the largest", SETTINGS["fragments"], view, True)
    look(view)
    return layout


def main():
    """Show the run; save pictures to the files that arguments name."""
    run_folder = folder()
    stress = show_stress(run_folder)
    contacts = show_contacts(run_folder) if SETTINGS["contacts"] else None
    fragments = show_fragments(run_folder) if SETTINGS["fragments"] else None
    times = simple.GetAnimationScene()
    times.UpdateAnimationUsingDataTimeSteps()
    times.GoToLast()
    simple.RenderAllViews()
    pictures = [name for name in sys.argv[1:] if name.endswith(".png")]
    num = len(SETTINGS["stages"])
    layouts = (stress, contacts, fragments)
    for name, layout, views in zip(pictures, layouts, (num, 1, 1), strict=False):
        if layout is not None:
            size = [SIZE_OF_A_VIEW[0] * views, SIZE_OF_A_VIEW[1]]
            simple.SaveScreenshot(name, layout, ImageResolution=size)


main()
