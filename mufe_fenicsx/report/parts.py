"""Parts of the report of a run: figures, view and tables, drawn by one process or by several."""

import contextlib
import os
from dataclasses import dataclass
from functools import lru_cache

import matplotlib

from mufe_fenicsx.errors import InputError, shortened
from mufe_fenicsx.geometry.tets.workers import WorkerError, load_ahead, run_jobs
from mufe_fenicsx.machine.doing import Doing
from mufe_fenicsx.machine.memory import free_memory
from mufe_fenicsx.output.run_folder import write_atomically
from mufe_fenicsx.report import (
    animation,
    breakage,
    chains,
    curves,
    cyclic,
    grains,
    histograms,
    localisation,
    motion,
    network,
    parameters,
    profile,
    shearing,
    style,
    tools,
    triaxial,
    views,
    yielding,
)
from mufe_fenicsx.report.figure import save, save_tables
from mufe_fenicsx.report.source import Source
from mufe_fenicsx.report.summary import (
    contact_rows,
    failed_grains,
    largest_values,
    run_rows,
    sample_rows,
)
from mufe_fenicsx.report.view import make_view

#: Name of each figure, what it shows, and what draws it from a Source, in the page's order.
FIGURES = (
    ("stress-strain", "stress against strain", curves.draw_stress_strain),
    ("forces", "forces on the walls", curves.draw_forces),
    ("compression", "compression", curves.draw_compression),
    (triaxial.NAME, "deviator, mean stress and volume", triaxial.draw_triaxial),
    (shearing.NAME, "shear stress, shear strain and volume", shearing.draw_shear),
    (cyclic.NAME, "cycles of loading", cyclic.draw_cycles),
    (tools.NAME, "forces and torques on tools", tools.draw_tools),
    (breakage.NAME, "breakage", breakage.draw_breakage),
    (breakage.SIZES, "sizes of fragments", breakage.draw_fragments),
    ("energies", "energy balance", curves.draw_energies),
    ("dissipation", "dissipation", curves.draw_dissipation),
    ("energies-of-a-grain", "energies of a grain", grains.draw_energies),
    ("quasi-static", "quasi-static monitors", curves.draw_monitors),
    ("stress-3d", "stress in the sample", views.draw_stress_3d),
    ("stress-cut", "stress in a cut", views.draw_cut),
    ("chosen-grains", "selected grains", grains.draw_chosen),
    ("course", "evolution of points and grains", grains.draw_course),
    ("yield-initiation", "yield initiation", yielding.draw_yield),
    ("force-chains", "force chains", chains.draw_force_chains),
    ("fabric-rose", "fabric", network.draw_rose),
    ("force-distribution", "force distribution", network.draw_force_distribution),
    ("active-contacts", "coordination number", network.draw_active_contacts),
    ("contact-age", "age of contacts", network.draw_ages),
    ("displacement-arrows", "displacement of grains", motion.draw_arrows),
    ("displacement-split", "translation, rotation and strain of grains", motion.draw_split),
    (localisation.NAME, "localisation of strain", localisation.draw_localisation),
    ("mesh-quality", "mesh quality", histograms.draw_mesh_quality),
    (profile.NAME, "time by parts", profile.draw_profile),
    (animation.NAME, "animation", None),
)
#: All that may be chosen, or left out.
NAMES = tuple(name for name, _, _ in FIGURES)
#: What is no figure: the bodies that the page turns, and its tables.
VIEW, TABLES = "view", "tables"

#: Heading of the table of parameters, with the files for a paper.
PARAMETERS = "Parameters (figures/parameters.csv, figures/parameters.tex)"

#: What several processes take one by one: parts that need the same data, the longest first.
GROUPS = (
    (VIEW,),
    ("energies-of-a-grain", "course", "yield-initiation"),
    ("displacement-arrows", "displacement-split", localisation.NAME),
    ("stress-3d", "stress-cut", "chosen-grains", animation.NAME),
    ("force-chains", "fabric-rose", "force-distribution", "active-contacts", "contact-age"),
    ("mesh-quality", TABLES),
    ("stress-strain", "forces", "compression", triaxial.NAME, shearing.NAME, cyclic.NAME),
    (tools.NAME, breakage.NAME, breakage.SIZES),
    ("energies", "dissipation", "quasi-static", profile.NAME),
)
#: Figures that show bodies in space.
RENDERED = {"stress-3d", "chosen-grains", "force-chains", "displacement-split", animation.NAME}
#: Memory of a process beside a run, and for each of its tetrahedra [bytes].
EMPTY, A_CELL = 0.6e9, 700.0


#: What a file of a run that was damaged, and not seen to be so, leads to.
DAMAGE = (ArithmeticError, IndexError, KeyError, TypeError, ValueError, AttributeError, MemoryError)


def damaged(error):
    """Why something cannot be drawn, in words."""
    return (
        f"what the folder holds is damaged or was changed ({type(error).__name__}: "
        f"{shortened(error)})"
    )


@dataclass(frozen=True)
class Job:
    """Parts of a report that one process draws."""

    names: tuple
    run: object  #: folder
    figures: object  #: folder
    grains: tuple | None  #: as of `write_report`
    points: tuple | None
    chain_angle: float  #: [degrees]
    overlays: tuple  #: files of measured curves
    no_pictures: str | None  #: why nothing in space can be drawn
    states: list | None = None  #: that can be read; None: to be found out by reading them


@dataclass(frozen=True)
class Part:
    """A part of a report."""

    name: str
    content: object  #: Picture, View or list of (heading, rows); None: there is none
    missing: tuple = ()  #: sentences; of a figure: why there is none


def num_processes(num_cells):
    """Number of processes that may draw at once: one a core, if they find memory for half of it."""
    fit = int(0.5 * free_memory() / (EMPTY + A_CELL * (num_cells or 0)))
    return max(1, min(len(os.sched_getaffinity(0)), fit, len(GROUPS)))


def draw_parts(source, wanted, figures, processes):
    """Draw figures of a run, its view and its tables.

    Args:
        source: :class:`~mufe_fenicsx.report.source.Source`.
        wanted: Names of figures.
        figures: Folder of their files.
        processes: Number of processes; 1: this one.

    Returns:
        dict name -> :class:`Part`.
    """
    wanted = {*wanted, VIEW, TABLES}
    groups = [names for group in GROUPS if (names := tuple(n for n in group if n in wanted))]
    if RENDERED & wanted and source.run.stored_states:
        source.start_probe()

    def jobs():
        for names in groups:
            # Not before: whether pictures can be drawn is found out beside the first jobs.
            why = source.no_pictures if RENDERED & set(names) else None
            states = source.run.stored_states
            yield Job(names, source.folder, figures, *source.asked, why, states)

    try:
        if processes == 1:
            found = [_draw_all(source, job) for job in jobs()]
        else:
            load_ahead("mufe_fenicsx.report.ahead")
            found = run_jobs(draw_job, jobs(), min(processes, len(groups)), _told(len(groups)))
    finally:
        source.end_probe()
    parts = {}
    for names, result in zip(groups, found, strict=True):
        if isinstance(result, WorkerError):
            result = [Part(name, None, (str(result),)) for name in names]
        parts |= {part.name: part for part in result}
    return parts


def _told(number):
    """What says in the lines of a report how many of so many parts are drawn; None without them."""
    doing = Doing.innermost()
    if doing is None:
        return None

    def tell(done):
        doing.what = f"drawing the report, {done} of {number} parts"

    return tell


def draw_job(job):
    """Draw what a job names, in a process of its own; list of :class:`Part`."""
    source = _source(job.run, job.grains, job.points, job.chain_angle, job.overlays)
    source.no_pictures = job.no_pictures
    if job.states is not None:
        source.run.stored_states = job.states
    with matplotlib.rc_context(style.RC):
        return _draw_all(source, job)


@lru_cache(maxsize=1)
def _source(*arguments):
    """What the jobs of one process draw from."""
    return Source(*arguments)


def _draw_all(source, job):
    special = {VIEW: _view, TABLES: _tables, animation.NAME: _animation}
    return [special.get(name, _figure)(name, source, job.figures) for name in job.names]


def _figure(name, source, figures):
    draw = next(draw for known, _, draw in FIGURES if known == name)
    try:
        return Part(name, save(draw(source), figures))
    except InputError as error:
        return Part(name, None, (str(error),))
    except DAMAGE as error:
        return Part(name, None, (damaged(error),))


def _animation(name, source, figures):
    try:
        return Part(name, animation.draw_animation(source, figures))
    except InputError as error:
        return Part(name, None, (str(error),))
    except DAMAGE as error:
        return Part(name, None, (damaged(error),))


def _view(name, source, figures):
    states = source.get("states")
    try:
        return Part(name, *make_view(source.run, states[0] if states else None))
    except DAMAGE as error:
        return Part(name, None, (f"No view of the bodies: {damaged(error)}.",))


def _tables(name, source, figures):
    """Tables of the page, as `page.write_page` takes them, and the CSV file of one."""
    run, missing = source.summary, []
    history, states = source.get("history"), source.get("states")
    last = states[-1] if states else None
    if run and run.get("failed_grains") is None:
        run["failed_grains"] = failed_grains(source.folder / "quality.csv")
    about = run_rows(run)
    if last is not None and history is not None:
        with contextlib.suppress(*DAMAGE):  # largest values say it
            about += sample_rows(states[0], last, run, history)
    if last is not None and (why := localisation.too_few(len(last.grain_means[0]))):
        about.append(("Localisation", f"not drawn: {why}"))
    try:
        tables = [
            (
                "Largest values of the loading stage",
                largest_values(history, last, last and source.get("at_zero")),
            )
        ]
    except DAMAGE as error:
        missing.append(f"No table of largest values: {damaged(error)}.")
        tables = []
    if source.get("classes"):
        tables.append(contact_rows(source))
    if history is not None and "num_fragments" in history:
        try:
            tables.append(("Breakage", breakage.breakage_rows(source)))
        except (InputError, *DAMAGE) as error:
            why = error if isinstance(error, InputError) else damaged(error)
            missing.append(f"No table of breakage: {why}.")
    about_test = []
    try:
        about_test = parameters.parameter_rows(source)
        if history is not None and "void_ratio" in history:
            tables.append(parameters.void_rows(history))
    except DAMAGE as error:
        missing.append(f"No table of parameters: {damaged(error)}.")
    if about_test:
        save_tables(parameters.NAME, {"": parameters.to_csv(about_test)}, figures)
        write_atomically(figures / f"{parameters.NAME}.tex", parameters.to_latex(about_test))
        tables.insert(0, (PARAMETERS, about_test))
    try:
        columns = grains.table_of_inertia(source)
    except DAMAGE as error:
        why = error if isinstance(error, InputError) else damaged(error)
        missing.append(f"No table of inertia: {why}.")
        (figures / "table-1-inertia.csv").unlink(missing_ok=True)  # of an earlier report
    else:
        save_tables("table-1-inertia", {"": columns}, figures)
        heading = "Inertia of selected grains (Table 1 of Nadimi & Fonseca)"
        tables.append((heading, *grains.inertia_rows(columns)))
    return Part(name, [*tables, ("Run", about)], tuple(missing))
