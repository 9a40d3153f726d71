"""A computation that became unstable goes back to a sound state and on with a shorter step."""

from dataclasses import dataclass

from ..errors import SolverError
from ..machine.files import append_line
from ..output.checkpoint import Checkpoint, find_checkpoint

#: Time step of a retry over that before.
SHORTER = 0.5
LOG = "retries.log"


@dataclass(frozen=True)
class Answer:
    """Where to go on."""

    checkpoint: Checkpoint | None  #: None: from the start


class Retries:
    """Counts and logs the retries of a run. Collective.

    Args:
        comm: MPI communicator.
        folder: The run folder.
        solver: Of the scene: ``retries`` is how many there are at most.
        quiet: Print nothing.
    """

    def __init__(self, comm, folder, solver, quiet):
        self.comm, self.folder, self.quiet = comm, folder, quiet
        self.limit, self.factor = solver.retries, solver.time_step_factor
        self.done = []  #: a dict for each retry so far
        self._used = None  # checkpoint that the last retry began from; None: the start
        self._failed_at = 0.0  # time of the last failure [s]

    @property
    def shorter(self):
        """Time step over that of the scene."""
        return SHORTER ** len(self.done)

    def know(self, done):
        """Count the retries that a checkpoint tells of, unless more are known."""
        if len(done) > len(self.done):
            self.done = list(done)

    def answer(self, failure, simulation, checkpoints):
        """Where to go on after a failure, or None if there were retries enough. Collective.

        From the last checkpoint that is whole. Where the last retry came no further than the run
        before it, the trouble is older than where it began: from the checkpoint before that one, or
        from the start where there is none.
        """
        if len(self.done) >= self.limit:
            return None
        found, time = None, simulation.state.t
        again = self.done and time <= self._failed_at
        if checkpoints.last is not None and not again:
            found = find_checkpoint(self.comm, self.folder)
        elif self._used is not None:
            found = find_checkpoint(self.comm, self.folder, before=self._used)
        self._used, self._failed_at = found, max(time, self._failed_at)
        # The trouble may be older still: what lies before stays until then.
        checkpoints.hold(found)
        step = found.header["step"] if found else 0
        self.done.append(
            {
                "failed_at_step": simulation.state.num_steps,
                "cause": str(failure),
                "from_step": step,
                "time_step_factor": self.factor * self.shorter * SHORTER,
            }
        )
        line = (
            f"step {simulation.state.num_steps}: {failure}; retry {len(self.done)} of "
            f"{self.limit} from step {step} with {self.shorter:g} times the scene's time step"
        )
        append_line(self.comm, self.folder / LOG, line, not self.quiet)
        return Answer(found)

    def exhausted(self, failure):
        """The error to end with."""
        if not self.done:
            return failure
        count = f"{len(self.done)} retr{'y' if len(self.done) == 1 else 'ies'}"
        return SolverError(
            f"{failure} (after {count} down to {self.shorter:g} times the scene's time step)"
        )
