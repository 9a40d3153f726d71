"""Report of a run, or of several together: figures, their data, and one HTML page."""

import difflib
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np

import mufe_fenicsx
from mufe_fenicsx.analysis.probes import find_cells
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.output.run_folder import reason
from mufe_fenicsx.report import (
    animation,
    chains,
    compare,
    curves,
    grains,
    histograms,
    motion,
    network,
    style,
    views,
    yielding,
)
from mufe_fenicsx.report.checks import check_run
from mufe_fenicsx.report.figure import remove_listed, save, save_tables, write_index
from mufe_fenicsx.report.page import write_page
from mufe_fenicsx.report.source import Source
from mufe_fenicsx.report.summary import failed_grains, largest_values, run_rows, sample_rows
from mufe_fenicsx.report.view import make_view
from mufe_fenicsx.results import Run

#: Name of each figure, what it shows, and what draws it from a Source, in the page's order.
FIGURES = (
    ("stress-strain", "stress against strain", curves.draw_stress_strain),
    ("forces", "forces on the walls", curves.draw_forces),
    ("compression", "compression", curves.draw_compression),
    ("energies", "energy balance", curves.draw_energies),
    ("dissipation", "dissipation", curves.draw_dissipation),
    ("energies-of-a-grain", "energies of a grain", grains.draw_energies),
    ("quasi-static", "quasi-static monitors", curves.draw_monitors),
    ("stress-3d", "stress in the sample", views.draw_stress_3d),
    ("stress-cut", "stress in a cut", views.draw_cut),
    ("chosen-grains", "chosen grains", grains.draw_chosen),
    ("course", "course of points and grains", grains.draw_course),
    ("yield-initiation", "yield initiation", yielding.draw_yield),
    ("force-chains", "force chains", chains.draw_force_chains),
    ("fabric-rose", "directions of contacts", network.draw_rose),
    ("force-distribution", "distribution of forces", network.draw_force_distribution),
    ("active-contacts", "active contacts", network.draw_active_contacts),
    ("displacement-arrows", "displacement of grains", motion.draw_arrows),
    ("displacement-split", "translation, rotation and strain of grains", motion.draw_split),
    ("mesh-quality", "quality of the mesh", histograms.draw_mesh_quality),
)
#: All that may be chosen, or left out.
NAMES = (*(name for name, _, _ in FIGURES), animation.NAME)
#: So many sentences about states without contacts are given one by one.
FEW = 2
FOOTER = (
    f"Written by mufe_fenicsx {mufe_fenicsx.__version__}, a micro finite-element model of "
    "sand after Nadimi & Fonseca (2018), Géotechnique 68(4), 290–302, "
    "doi 10.1680/jgeot.16.p.147."
)


def write_report(runs, output=None, grains=None, points=None, only=None, skip=None):
    """Write ``report.html``, and ``figures`` as PNG, PDF and CSV.

    Of one run: what happened in it. Of several: their curves over each other. A run that stopped
    early, or lacks files, gives a report of what is there, which says what is not.

    Args:
        runs: Folder that ``mufe run`` wrote, or a list of them.
        output: Folder of the report; None: the run's own, or ``comparison`` beside the first.
        grains: Labels of the grains that are shown one by one; None: three by their stress.
        points: Places [m] whose course is shown, shape (num_points, 3); None: two by stress.
        only, skip: Names of the figures to draw, or not to draw, of :data:`NAMES`; None: all.

    Returns:
        dict of plain values: ``report`` (path), ``figures`` (paths of the pictures), ``missing``
        (sentences), ``checks`` (a dict name, target, largest, mean, passed each), ``passed``
        (all checks).

    Raises:
        InputError: There is no run in a folder, a grain or point is not in it, the same run is
            given twice, or the report cannot be written.
    """
    folders = [Path(runs)] if isinstance(runs, str | Path) else [Path(run) for run in runs]
    if len(folders) == 1:
        report = _RunReport(folders[0], output, grains, points, _wanted(only, skip))
    else:
        if grains or points or only or skip:
            raise InputError("grains, points or figures chosen for several runs, expected one run")
        twice = [f for k, f in enumerate(folders) if f.resolve() in _resolved(folders[:k])]
        if twice:
            raise InputError(f"run folder {twice[0]} is given twice, expected different runs")
        report = _Comparison(folders, output)
    return report.write()


def _wanted(only, skip):
    """Names of the figures to draw."""
    for name in (*(only or ()), *(skip or ())):
        if name not in NAMES:
            near = difflib.get_close_matches(name, NAMES, n=1, cutoff=0.0)
            raise InputError(f"figure {name} is not known, expected {near[0]} or another name")
    return [name for name in only or NAMES if name not in (skip or ())]


def _resolved(folders):
    return [folder.resolve() for folder in folders]


class _Report:
    """What is common to both: a folder, pictures, and sentences about what is missing."""

    def __init__(self, output):
        self.output = Path(output)
        self.missing, self.pictures, self.lacking = [], [], {}

    def write(self):
        try:
            self.output.mkdir(parents=True, exist_ok=True)
            self.figures = self.output / "figures"
            self.figures.mkdir(exist_ok=True)
            remove_listed(self.figures)
            with matplotlib.rc_context(style.RC):
                self._draw()
            for why, what in self.lacking.items():
                self.missing.append(f"No picture of {_listed(what)}: {why}.")
            write_index(self.figures, self.pictures)
            checks = self._write_page()
        except OSError as error:
            raise InputError(
                f"report in {self.output} cannot be written ({reason(error)})"
            ) from error
        return {
            "report": str(self.output / "report.html"),
            "figures": [str(picture.image) for picture in self.pictures],
            "missing": self.missing,
            "checks": [
                {
                    "name": c.name,
                    "target": c.target,
                    "largest": _plain(c.largest),
                    "mean": _plain(c.mean),
                    "passed": c.passed,
                }
                for c in checks
            ],
            "passed": bool(checks) and all(c.passed for c in checks),
        }

    def _try(self, what, draw, *arguments):
        """Draw and save one figure, or note why it is missing."""
        try:
            drawing = draw(*arguments)
        except InputError as error:
            self.lacking.setdefault(str(error), []).append(what)
            return
        self.pictures.append(save(drawing, self.figures))

    def _page(self, title, lead, checks, tables, view=None):
        write_page(
            self.output / "report.html",
            title,
            lead,
            checks,
            self.missing,
            [picture.row for picture in self.pictures],
            tables,
            FOOTER,
            view,
        )


class _RunReport(_Report):
    """The report of one run."""

    def __init__(self, folder, output, grains, points, wanted):
        self.source = Source(folder, grains, points)
        super().__init__(folder if output is None else output)
        self.folder, self.wanted = folder, wanted
        self.missing += missing_of(self.source)
        if grains:
            self.source.chosen  # noqa: B018  an unknown one is refused before anything is written
        if points is not None and len(points):
            state = self.source.start
            find_cells(state.reference, state.cells, points)

    def _draw(self):
        source = self.source
        if source.run._states:
            source.start_probe()
        for name, what, draw in FIGURES:
            if name in self.wanted:
                self._try(what, draw, source)
        if animation.NAME in self.wanted:
            try:
                self.pictures.append(animation.draw_animation(source, self.figures))
            except InputError as error:
                self.lacking.setdefault(str(error), []).append("the test in motion")
        source.end_probe()

    def _write_page(self):
        run = self.source.summary
        history, states = _or_none(self.source, "history"), _or_none(self.source, "states")
        checks = check_run(history) if history is not None else []
        last = states[-1] if states else None
        if run and run.get("failed_grains") is None:
            run["failed_grains"] = failed_grains(self.folder / "quality.csv")
        about = run_rows(run)
        if last is not None and history is not None:
            about += sample_rows(states[0], last, run, history)
        tables = [("Largest values of the loading stage", largest_values(history, last))]
        tables += self._table_of_inertia()
        tables.append(("Run", about))
        title = run.get("title") or f"Oedometer test in {self.folder.resolve().name}"
        view, missing = make_view(self.source.run, states[0] if states else None)
        self.missing += missing
        self._page(title, self._lead(run, history), checks, tables, view)
        return checks

    def _table_of_inertia(self):
        """Table 1 of the paper, and its CSV file."""
        try:
            columns = grains.table_of_inertia(self.source)
        except InputError as error:
            self.missing.append(f"No table of inertia: {error}.")
            (self.figures / "table-1-inertia.csv").unlink(missing_ok=True)  # of an earlier report
            return []
        save_tables("table-1-inertia", {"": columns}, self.figures)
        heading = "Inertia of chosen grains (Table 1 of Nadimi & Fonseca)"
        return [(heading, grains.inertia_rows(columns))]

    def _lead(self, run, history):
        parts = []
        if run.get("num_grains") and run.get("num_cells"):
            parts.append(
                f"Oedometer test on {style.number(run['num_grains'])} deformable grains of "
                f"{style.number(run['num_cells'])} tetrahedra"
            )
        else:
            parts.append("Oedometer test on deformable grains")
        if history is not None:
            parts.append(f"vertical strain {history['strain'][-1]:.4g}")
            parts.append(f"vertical stress {style.quantity(history['stress'][-1], 'Pa', 4)}")
        return "; ".join(parts) + " at the end."


class _Comparison(_Report):
    """The report of several runs."""

    def __init__(self, folders, output):
        super().__init__(folders[0].parent / "comparison" if output is None else output)
        self.sources = []
        for source in map(Source, folders):
            name = source.folder.resolve().name
            self.missing += [f"{name}: {sentence}" for sentence in missing_of(source)]
            try:
                source.loading  # noqa: B018  what all figures need
                self.sources.append(source)
            except InputError as error:
                self.missing.append(f"{name} is in no figure: {error}.")
        if not self.sources:
            raise InputError("no run has a history of loading, expected one at least")
        self.names = compare.name_runs(self.sources)

    def _draw(self):
        for draw in compare.FIGURES:
            what = draw.__name__.removeprefix("draw_").replace("_", " ")
            self._try(f"{what} compared", draw, self.sources, self.names)

    def _write_page(self):
        checks = [
            replace(check, text=f"{name}. {check.text}")
            for source, name in zip(self.sources, self.names, strict=True)
            for check in check_run(source.history)
        ]
        folders = ", ".join(source.folder.resolve().name for source in self.sources)
        self._page(
            f"{len(self.sources)} oedometer tests compared",
            f"Runs in the folders {folders}.",
            checks,
            [("Runs", compare.rows(self.sources, self.names))],
        )
        return checks


def missing_of(source):
    """Sentences about what a run folder lacks; a few for many states without contacts."""
    sentences, contacts = Run(source.folder).missing, []
    for sentence in sentences:
        if sentence.startswith("contacts of state "):
            contacts.append(sentence)
    if len(contacts) > FEW:
        sentences = [s for s in sentences if s not in contacts[FEW:]]
        sentences.append(f"The contacts of {len(contacts) - FEW} more states.")
    return sentences


def _or_none(source, name):
    """What a source has, or None; that it is missing was said with the files."""
    try:
        return getattr(source, name)
    except InputError:
        return None


def _listed(words):
    """Words with commas, and "and" before the last."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def _plain(value):
    """A JSON number, None instead of nan."""
    return float(value) if np.isfinite(value) else None
