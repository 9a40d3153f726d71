"""From which strain on a run can be believed, and how finely its contacts are meshed: run.json."""

from pathlib import Path

from ..analysis.checks import check_run, holds_from
from ..analysis.contact_resolution import of_patches
from ..output.history import read_history
from ..output.run_folder import on_first_rank
from .coarse_meshes import mean_edge_and_radius


def judged(simulation, folder, mass):
    """What run.json says of a run that has ended. Collective.

    Args:
        simulation: At its end.
        folder: The run folder, its history complete.
        mass: Of all grains [kg].

    Returns:
        dict ``contact_resolution``, as of :class:`~mufe_fenicsx.analysis.contact_resolution.
        Resolution`, None without a contact; ``edges_per_diameter`` of grains; and ``holds_from``,
        the strain from which on each check holds to the end, None where it does not.
    """
    patches = simulation.contact_patches()
    edge, radius = mean_edge_and_radius(simulation)
    edges = 2 * radius / edge

    def judge():
        found = of_patches(patches)
        history = read_history(Path(folder) / "history.csv")
        contacts = found and (found, "contacts between grains, at the end", edges)
        return {
            "contact_resolution": found and found.as_dict(),
            "edges_per_diameter": edges,
            "holds_from": holds_from(check_run(history, mass, contacts)),
        }

    return simulation.comm.bcast(on_first_rank(simulation.comm, judge))
