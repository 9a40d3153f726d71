"""The 3D view as parts of the page: its markup, style, program and data in one place."""

from dataclasses import dataclass
from html import escape
from importlib.resources import files

from mufe_fenicsx.report.view_data import view_data

#: Parts of the program, in order; none of them uses names of a later one when it is read.
PROGRAM = ("decode.js", "camera.js", "draw.js", "words.js", "pointers.js", "view.js")


@dataclass(frozen=True)
class View:
    """What the page takes over: a style sheet, a section, and what follows it."""

    css: str
    section: str
    program: str


def make_view(run, known=None):
    """The view of a run.

    Args:
        run: :class:`mufe_fenicsx.results.Run`.
        known: Of :func:`~mufe_fenicsx.report.view_data.view_data`.

    Returns:
        :class:`View`, or None where no state can be shown, and a list of sentences about what
        it lacks.
    """
    data, missing = view_data(run, known=known)
    return (parts_of(data) if data else None), missing


def parts_of(data):
    """Parts of the page that show packed data.

    Args:
        data: :class:`mufe_fenicsx.report.view_data.ViewData`.
    """
    section = _asset("view.html").replace("DESCRIPTION", escape(data.description))
    program = "\n".join(_asset(name) for name in PROGRAM)
    return View(
        _asset("view.css"),
        f'{section}<script type="application/json" id="view-header">{data.header}</script>\n'
        f'<script type="text/plain" id="view-data">{data.data}</script>',
        f'<script>\n(() => {{\n"use strict";\n{program}}})();\n</script>',
    )


def _asset(name):
    return (files("mufe_fenicsx.report") / "assets" / name).read_text(encoding="utf-8")
