"""From where on a run can be believed, who carries its load and its voids: run.json."""

from dataclasses import asdict
from pathlib import Path

import numpy as np

from ..analysis.carriers import find_carriers
from ..analysis.checks import check_run, holds_from
from ..analysis.contact_resolution import of_patches
from ..geometry.form.proportions import median_diameter
from ..machine.ranks import on_first_rank
from ..output.history import VOIDS, read_history
from ..results import Run


def judged(simulation, folder, summary, volumes):
    """What run.json says of a run that has ended. Collective.

    Args:
        simulation: At its end.
        folder: The run folder, its history complete.
        summary: What run.json has so far, with the mass of all grains and edges a diameter.
        volumes: Of all grains [m³], shape (num_grains,).

    Returns:
        dict ``contact_resolution``, as of :class:`~mufe_fenicsx.analysis.contact_resolution.
        Resolution`, None without a contact; ``carriers``, as of
        :class:`~mufe_fenicsx.analysis.carriers.Carriers`, None without a load; ``diameters``, the
        height at strain 0 in median diameters; ``holds_from``, where each check begins to hold to
        the end, None where it does not; ``void_ratio`` and ``porosity`` at the end, and
        ``voids``, at the start and end of each stage.
    """
    patches = simulation.contact_patches()

    def judge():
        found = of_patches(patches)
        history = read_history(Path(folder) / "history.csv")
        which = "contacts between grains, at the end"
        contacts = found and (found, which, summary["edges_per_diameter"])
        carriers = _carriers(Run(folder))
        diameters = summary["reference_height"] / median_diameter(volumes)
        sample = carriers and (carriers, diameters)
        mass = summary["mass"] + summary["added_mass"]
        checks = check_run(history, mass, contacts, sample)
        return {
            "contact_resolution": found and found.as_dict(),
            "carriers": carriers and asdict(carriers),
            "diameters": diameters,
            "holds_from": holds_from(checks, history),
            **_voids(history),
        }

    return simulation.comm.bcast(on_first_rank(simulation.comm, judge))


def _carriers(run):
    """Who carries the load in the last stored state; None where nobody does."""
    stored = run.with_contacts().index
    if not len(stored):
        return None
    return find_carriers(run.contacts(stored[-1]), run.grains(stored[-1]), run.doubted)


def _voids(history):
    """Void ratios of the last row, and of the first and the last one of each stage."""
    stage = history["stage"]
    if not len(stage):
        return {}
    starts = np.flatnonzero(np.append(True, stage[1:] != stage[:-1]))
    ends = np.append(starts[1:], len(stage)) - 1

    def at(row):
        return {name: float(history[name][row]) for name in VOIDS}

    rows = zip(starts, ends, strict=True)
    stages = [{"stage": str(stage[a]), "start": at(a), "end": at(b)} for a, b in rows]
    return at(-1) | {"voids": stages}
