"""Report of a run, or of several together: figures, their data, and one HTML page."""

from pathlib import Path

import matplotlib
import numpy as np

import mufe_fenicsx
from mufe_fenicsx.analysis.checks import worst_of
from mufe_fenicsx.analysis.cycles import find_cycles
from mufe_fenicsx.analysis.probes import find_cells
from mufe_fenicsx.analysis.rows import branches, tool_load, tool_names
from mufe_fenicsx.errors import InputError, nearest_name
from mufe_fenicsx.machine.files import own_folder, reason
from mufe_fenicsx.output.run_folder import PROFILE
from mufe_fenicsx.report import (
    breakage,
    compare,
    cyclic,
    localisation,
    profile,
    reference,
    shearing,
    style,
    tools,
    triaxial,
)
from mufe_fenicsx.report.figure import remove_listed, save, save_tables, write_index
from mufe_fenicsx.report.page import write_page
from mufe_fenicsx.report.parts import FIGURES, NAMES, TABLES, VIEW, draw_parts, num_processes
from mufe_fenicsx.report.run_names import name_runs
from mufe_fenicsx.report.source import Source
from mufe_fenicsx.results import Run

#: So many sentences about states without contacts are given one by one.
FEW = 2
FOOTER = (
    f"Written by mufe_fenicsx {mufe_fenicsx.__version__}, a micro finite-element model of "
    "sand after Nadimi & Fonseca (2018), Géotechnique 68(4), 290–302, "
    "doi 10.1680/jgeot.16.p.147."
)


def write_report(
    runs,
    output=None,
    grains=None,
    points=None,
    only=None,
    skip=None,
    *,
    processes=1,
    chain_angle=45.0,
    overlays=(),
    tables=(),
):
    """Write ``report.html``, and ``figures`` as PNG, PDF and CSV.

    Of one run: what happened in it. Of several: their curves over each other. A run that stopped
    early, or lacks files, gives a report of what is there, which says what is not.

    Args:
        runs: Folder that ``mufe run`` wrote, or a list of them; or a dict of folders with the
            settings of their packings, dict name -> value, which tell runs apart too.
        output: Folder of the report; None: the run's own, or ``comparison`` beside the first.
        grains: Labels of the grains that are shown one by one; None: three by their stress.
        points: Places [m] whose course is shown, shape (num_points, 3); None: two by stress.
        only, skip: Names of the figures to draw, or not to draw, of :data:`~.parts.NAMES`, of
            several runs of :data:`~.compare.NAMES`; None: all.
        processes: That draw one run's figures together; 0: as many as there are cores and
            memory for. A script that gives another number than 1 has to do so below
            ``if __name__ == "__main__":``.
        chain_angle: Between force chains and the major stress of their grains at most [degrees].
        overlays: CSV files of measured curves, drawn beside those of the runs, and compared; those
            that scenes name come before them.
        tables: To begin those of the page with: (heading, rows, names of the columns) each.

    Returns:
        dict of plain values: ``report`` (path), ``figures`` (paths of the pictures), ``missing``
        (sentences), ``checks`` (a dict name, target, largest, mean, passed, grade, since each, the
        strain from which on it is met, and its stage; the first, named "all", is the verdict),
        ``passed`` (all checks), ``differences`` (from measured curves: a dict each, fields of
        :class:`~mufe_fenicsx.results.reference_curves.Difference` and the ``run``).

    Raises:
        InputError: There is no run in a folder, a grain or point is not in it, the same run is
            given twice, an overlay cannot be read, has the name of another one or is out of the
            range of all runs, or the report cannot be written.
    """
    names = [Path(path).stem for path in overlays]
    if len(set(names)) < len(names):
        raise InputError(f"overlays are named {', '.join(names)}, expected names that differ")
    folders = [Path(runs)] if isinstance(runs, str | Path) else [Path(run) for run in runs]
    if len(folders) == 1:
        wanted = _wanted(only, skip, NAMES)
        report = _RunReport(
            folders[0], output, (grains, points, chain_angle, overlays), wanted, only, processes
        )
    else:
        if grains or points:
            raise InputError("grains or points chosen for several runs, expected one run")
        wanted = _wanted(only, skip, compare.NAMES)
        twice = [f for k, f in enumerate(folders) if f.resolve() in _resolved(folders[:k])]
        if twice:
            raise InputError(f"run folder {twice[0]} is given twice, expected different runs")
        packings = list(runs.values()) if isinstance(runs, dict) else [{}] * len(folders)
        report = _Comparison(dict(zip(folders, packings, strict=True)), output, wanted, overlays)
    report.more_tables = list(tables)
    return report.write()


def _wanted(only, skip, names):
    """Those of the names of figures that are to be drawn."""
    for name in (*(only or ()), *(skip or ())):
        if name not in names:
            others = compare.NAMES if names is NAMES else NAMES
            why = f"one of {'several runs' if names is NAMES else 'a single run'}"
            why = why if name in others else "not known"
            raise InputError(f"figure {name} is {why}, expected {nearest_name(name, names)}")
    return [name for name in only or names if name not in (skip or ())]


def _resolved(folders):
    return [folder.resolve() for folder in folders]


class _Report:
    """What is common to both: a folder, pictures, and sentences about what is missing."""

    def __init__(self, output):
        self.output = Path(output)
        self.missing, self.pictures, self.lacking = [], [], {}
        self.differences, self.more_tables = [], []

    def write(self):
        try:
            self.output.mkdir(parents=True, exist_ok=True)
            self.figures = own_folder(self.output / "figures")
            remove_listed(self.figures)
            with matplotlib.rc_context(style.RC):
                self._draw()
            for why, what in self.lacking.items():
                self.missing.append(f"No picture of {_listed(what)}: {why}.")
            write_index(self.figures, self.pictures)
            checks = self._write_page()
        except OSError as error:
            raise InputError(
                f"report in {self.output} cannot be written "
                f"({error.filename or 'a file'}: {reason(error)})"
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
                    "grade": c.grade,
                    "since": _plain(c.since),
                    "stage": c.stage,
                    "text": c.text,
                }
                for c in checks
            ],
            "passed": bool(checks) and all(c.passed for c in checks),
            "differences": self.differences,
        }

    def _compare(self, sources, names):
        """Compare runs with measured curves, and see that each overlay is in the range of one.

        Raises:
            InputError: An overlay cannot be read, or is out of the range of all runs.
        """
        outside = {}
        for source, name in zip(sources, names, strict=True):
            found, lines = reference.compared(source)
            self.differences += [{"run": name} | row for row in found]
            self.missing += source.unreadable_references
            for label, line in lines.items():
                outside.setdefault(label, []).append(line)
        for label, lines in outside.items():
            if label in {Path(path).stem for path in sources[0].overlays}:
                if len(lines) == len(sources):
                    raise InputError(lines[0])
            self.missing += [f"No difference from {label}: {line}." for line in lines]
        self.missing += reference.left_out(self.differences)

    def _difference_tables(self):
        """Table of the differences from measured curves, and its file; none without any."""
        path = self.figures / f"{reference.NAME}.csv"
        if not self.differences:
            path.unlink(missing_ok=True)  # of an earlier report
            return []
        save_tables(reference.NAME, {"": reference.columns_of(self.differences)}, self.figures)
        return [reference.table_of(self.differences)]

    def _page(self, title, lead, checks, tables, view=None, more=()):
        write_page(
            self.output / "report.html",
            title,
            lead,
            checks,
            self.missing,
            [*(picture.row for picture in self.pictures), *more],
            [*self.more_tables, *self._difference_tables(), *tables],
            FOOTER,
            view,
        )


class _RunReport(_Report):
    """The report of one run."""

    def __init__(self, folder, output, asked, wanted, only, processes):
        self.source, (grains, points, angle, _) = Source(folder, *asked), asked
        if not 0 < angle <= 90:
            raise InputError(f"chain_angle = {angle} degrees, expected 0 < angle <= 90")
        absent = _not_of_this_test(self.source)  # unless asked for, not said to lack
        wanted = [name for name in wanted if name not in absent or name in (only or ())]
        super().__init__(folder if output is None else output)
        self.folder, self.wanted, self.processes = folder, wanted, processes
        self.missing += missing_of(self.source)
        self._compare([self.source], [folder.resolve().name])
        if grains:
            self.source.chosen  # noqa: B018  an unknown one is refused before anything is written
        if points is not None and len(points):
            state = self.source.start
            find_cells(state.reference, state.cells, points)

    def _draw(self):
        processes = self.processes or num_processes(self.source.summary.get("num_cells"))
        parts = draw_parts(self.source, self.wanted, self.figures, processes)
        for name, what, _ in FIGURES:
            if name not in self.wanted:
                continue
            if parts[name].content is None:
                self.lacking.setdefault(parts[name].missing[0], []).append(what)
            else:
                self.pictures.append(parts[name].content)
        self.view, self.tables = parts[VIEW], parts[TABLES]

    def _write_page(self):
        run, history = self.source.summary, self.source.get("history")
        checks = self.source.checks
        try:
            self.source.resolution  # noqa: B018
        except InputError as error:
            self.missing.append(f"No check of contacts: {error}.")
        self.missing += [*self.tables.missing, *self.view.missing]
        title = run.get("title") or f"Test in {self.folder.resolve().name}"
        lead = self._lead(run, history)
        tables = self.tables.content or []
        if run.get("unusual"):
            lines = [(line,) for line in run["unusual"]]
            tables = [
                ("Unusual values", lines, ("What the scene says, and what is usual",)),
                *tables,
            ]
        # One verdict, the strictest, before all else.
        verdict = checks[0].text if checks else ""
        lead = f"{lead} {verdict}".rstrip()
        self._page(title, lead, checks, tables, self.view.content, _scan(self.folder))
        return checks

    def _lead(self, run, history):
        stages = [] if history is None else [part.stage for part in branches(history)]
        test = "Oedometer test"
        if history is not None and "strain_z" in history:
            test = f"Test by stages ({style.listed(stages)})" if stages else "Test by stages"
        parts = [f"{test} on deformable grains"]
        if run.get("num_grains") and run.get("num_cells"):
            parts = [
                f"{test} on {style.number(run['num_grains'])} deformable grains of "
                f"{style.number(run['num_cells'])} tetrahedra"
            ]
        if history is not None:
            parts.append(f"vertical strain {history['strain'][-1]:.4g}")
            parts.append(f"vertical stress {style.quantity(history['stress'][-1], 'Pa', 4)}")
        return "; ".join(parts) + " at the end."


def _scan(folder):
    """The picture of scan and labels that `mufe segment` drew, as rows of the page."""
    picture = folder / "labels.png"
    if not picture.is_file():
        return []
    about = "Slices of the image, and grains as they were told apart. File: labels.png."
    return [(picture, "Scan and labels", about, "wide")]


def _not_of_this_test(source):
    """Names of figures that a test of this kind does not have."""
    history = source.get("history")
    absent = set() if history is not None and "strain_z" in history else {triaxial.NAME}
    if history is None or shearing.shear_of(history) is None:
        absent.add(shearing.NAME)
    if history is None or not tool_names(history):
        absent.add(tools.NAME)
    if history is not None and tool_load(history) is not None:
        absent |= {"stress-strain", "compression", triaxial.NAME}
    loading = source.get("loading")
    if loading is None or not find_cycles(loading["strain"], loading["stress"]):
        absent.add(cyclic.NAME)
    pieces = () if history is None else history.get("num_fragments", ())
    if not np.any(pieces):
        absent.add(breakage.SIZES)
    events = source.get("events") if len(pieces) else {}
    if events is not None and not len(events.get("time", ())):
        absent.add(breakage.NAME)  # nothing opened
    if localisation.too_few(source.summary.get("num_grains")):
        absent.add(localisation.NAME)  # a row of the page says so
    if not (source.folder / PROFILE).exists():
        absent.add(profile.NAME)
    return absent


class _Comparison(_Report):
    """The report of several runs."""

    def __init__(self, packings, output, wanted, overlays):
        super().__init__(next(iter(packings)).parent / "comparison" if output is None else output)
        self.sources, self.wanted = [], wanted
        for folder, packing in packings.items():
            source = Source(folder, overlays=overlays, packing=packing)
            name = source.folder.resolve().name
            self.missing += [f"{name}: {sentence}" for sentence in missing_of(source)]
            try:
                source.loading  # noqa: B018  what all figures need
                self.sources.append(source)
            except InputError as error:
                self.missing.append(f"{name} is in no figure: {error}.")
        if not self.sources:
            raise InputError("no run has a history of loading, expected one at least")
        self.names = name_runs(self.sources)
        self._compare(self.sources, self.names)

    def _draw(self):
        for name, draw in compare.FIGURES:
            if name not in self.wanted:
                continue
            what = draw.__name__.removeprefix("draw_").replace("_", " ")
            try:
                self.pictures.append(save(draw(self.sources, self.names), self.figures))
            except InputError as error:
                self.lacking.setdefault(str(error), []).append(f"{what} compared")

    def _write_page(self):
        checks = [source.checks for source in self.sources]
        checks = worst_of(checks, self.names)
        folders = ", ".join(source.folder.resolve().name for source in self.sources)
        self._page(
            f"{len(self.sources)} tests compared",
            f"Runs in the folders {folders}.",
            checks,
            compare.tables(self.sources, self.names),
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


def _listed(words):
    """Words with commas, and "and" before the last."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def _plain(value):
    """A JSON number, None instead of nan."""
    return float(value) if np.isfinite(value) else None
