"""`mufe watch`: a run that is going on, in the terminal."""

import time
from pathlib import Path
from typing import Annotated

import typer

from .app import Json, app
from .terminal import Printer

#: Rows of the table: name, what it is called, unit and factor, format.
ROWS = (
    ("strain", "strain", "", 1, ".4f"),
    ("stress", "vertical stress", "MPa", 1e-6, ".4g"),
    ("force_z_max", "force on the top platen", "N", 1, ".4g"),
    ("force_z_min", "force on the bottom", "N", 1, ".4g"),
    ("force_difference", "unbalanced force / load", "%", 100, ".2f"),
    ("kinetic_ratio", "kinetic / internal energy", "%", 100, ".2f"),
    ("residual_ratio", "energy residual / work", "%", 100, ".4f"),
    ("elastic_share", "elastic energy / work", "%", 100, ".1f"),
    ("plastic_share", "plastic dissipation / work", "%", 100, ".1f"),
    ("friction_share", "frictional dissipation / work", "%", 100, ".1f"),
    ("num_contacts", "points in contact", "", 1, ".0f"),
    ("num_active_contacts", "contacts of a grain, mean", "", 1, ".2f"),
    ("elements_per_radius", "elements per contact radius, median by force", "", 1, ".2f"),
    ("elements_per_radius_tenth", "the same, a tenth of the force has fewer", "", 1, ".2f"),
    ("overlap", "overlap / volume of the grains", "%", 100, ".3f"),
    ("speed", "speed of the platen", "m/s", 1, ".3g"),
    ("dt", "time step", "ns", 1e9, ".3g"),
    ("step", "steps", "", 1, ".0f"),
)


@app.command()
def watch(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder that `mufe run` writes.")],
    once: Annotated[bool, typer.Option("--once", help="Print once and end.")] = False,
    interval: Annotated[float, typer.Option(min=0.1, help="Seconds between two looks.")] = 2.0,
    json: Json = None,
):
    """Follow a run as it goes on: strain, forces, energies, speed, time left.

    A folder that is not there yet is waited for, but with --once.
    """
    printer = Printer(json)
    from rich.console import Console
    from rich.live import Live

    from ..results.watch import Watch

    watched = Watch(folder, wait=not once)
    now = watched.look()
    # A pipe or a file has no width: lines as long as they need to be.
    width = None if printer.stream.isatty() else 200
    console = Console(file=printer.stream, highlight=False, width=width)
    if once or now.ended or not console.is_terminal:
        while not (once or now.ended):  # no terminal: one line a look
            printer.say(_line(now))
            time.sleep(interval)
            now = watched.look()
        console.print(_panel(now))
    else:
        with Live(_panel(now), console=console, refresh_per_second=4) as live:
            while not now.ended:
                time.sleep(interval)
                now = watched.look()
                live.update(_panel(now))
    printer.write_json(now.as_dict())


def _panel(now):
    """What a look found, as rich draws it."""
    from rich.console import Group
    from rich.panel import Panel
    from rich.progress_bar import ProgressBar
    from rich.table import Table
    from rich.text import Text

    grid = Table.grid(padding=(0, 2))
    grid.add_column()
    grid.add_column(justify="right")
    grid.add_column()
    for name, title, unit, factor, form in ROWS:
        value = now.values.get(name)
        if value is not None:
            grid.add_row(title, format(factor * value + 0.0, form), unit)
    if now.steps_per_second is not None:
        grid.add_row("steps a second", f"{now.steps_per_second:.4g}", "")
    if now.cells_per_second is not None:
        grid.add_row("element-steps a second", f"{1e-6 * now.cells_per_second:.3g}", "million")
    if now.seconds_since_row is not None and not now.ended:
        grid.add_row("last row", duration(now.seconds_since_row), "ago")
    parts = [grid]
    target = now.values.get("target_strain")
    if target:
        bar = Table.grid()  # a bar by itself does not end its line
        bar.add_row(ProgressBar(target, max(now.values["strain"], 0.0), width=60))
        parts.append(bar)
    parts.append(Text(_line(now)))
    return Panel(Group(*parts), title=Text(now.title), expand=False)


def _line(now):
    """What a look found in one line."""
    text = f"{now.state}: {now.why}"
    if now.values:
        text += f"; {now.values['stage']}, strain {now.values['strain']:.4f}"
        if now.values.get("target_strain"):
            text += f" of {now.values['target_strain']:g}"
        if now.values["stage"] == "seating":  # the strain says nothing yet
            text += f", step {now.values['step']:.0f}"
            if now.values.get("stress") is not None:
                text += f", vertical stress {1e-6 * now.values['stress'] + 0.0:.4g} MPa"
        if now.values.get("num_opened"):
            text += (
                "; {num_opened:.0f} facets opened, {num_fragments:.0f} fragments of "
                "{broken_grains:.0f} grains".format(**now.values)
            )
            text += f", fracture work {1e6 * now.values['cracks_fracture']:.4g} µJ"
    if now.seconds_left is not None:
        text += f"; about {duration(now.seconds_left)} left, {now.rests_on}"
    elif not now.ended and now.values:
        text += "; time left is not known yet"
    return text


def duration(seconds):
    """Seconds in words, e.g. "1 h 5 min"."""
    hours, rest = divmod(round(seconds), 3600)
    minutes, seconds = divmod(rest, 60)
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {seconds} s" if minutes else f"{seconds} s"
