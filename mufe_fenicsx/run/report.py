"""The report that a scene asks for (`output.report`), drawn when its test has ended."""

import time
from pathlib import Path

from ..errors import InputError, raise_together
from ..machine.doing import Doing
from ..machine.mpi_launcher import forget_launcher
from .run_place import say

#: Ranks that wait for the report look so often [s]: MPI's own waiting takes a core each.
PAUSE = 0.05


def draw_report(comm, folder, quiet):
    """Draw the report of a run, by rank 0 and processes that it starts. Collective.

    Args:
        comm: MPI communicator.
        folder: Run folder.
        quiet: Print nothing.

    Returns:
        Path of the page, as text.

    Raises:
        InputError: The report cannot be written; on all ranks.
    """
    message = None
    if comm.rank == 0:
        say(comm, "the test has ended; drawing its report", quiet)
        forget_launcher()
        with Doing("drawing the report", not quiet):
            # Only here: a run does without the libraries of pictures.
            from ..report import write_report

            try:
                write_report(folder, processes=0)
            except (InputError, OSError) as error:
                message = str(error)
            except KeyboardInterrupt:
                say(comm, f"the run is complete; mufe report {folder} draws its report", quiet)
                raise
    drawn = comm.Ibarrier()
    while not drawn.Test():
        time.sleep(PAUSE)
    raise_together(comm, message)
    return str(Path(folder) / "report.html")
