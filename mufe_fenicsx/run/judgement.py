"""From which strain on a run can be believed, and how finely its contacts are meshed: run.json."""

from pathlib import Path

from ..analysis.checks import check_run, holds_from
from ..analysis.contact_resolution import of_patches
from ..output.history import read_history
from ..output.run_folder import on_first_rank


def judged(simulation, folder, summary):
    """What run.json says of a run that has ended. Collective.

    Args:
        simulation: At its end.
        folder: The run folder, its history complete.
        summary: What run.json has so far, with the mass of all grains and edges a diameter.

    Returns:
        dict ``contact_resolution``, as of :class:`~mufe_fenicsx.analysis.contact_resolution.
        Resolution`, None without a contact; and ``holds_from``, the strain from which on each
        check holds to the end, None where it does not.
    """
    patches = simulation.contact_patches()

    def judge():
        found = of_patches(patches)
        history = read_history(Path(folder) / "history.csv")
        which = "contacts between grains, at the end"
        contacts = found and (found, which, summary["edges_per_diameter"])
        return {
            "contact_resolution": found and found.as_dict(),
            "holds_from": holds_from(check_run(history, summary["mass"], contacts)),
        }

    return simulation.comm.bcast(on_first_rank(simulation.comm, judge))
