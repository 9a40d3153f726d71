"""How a test is run, beside the scene: what the command line or a script chooses."""

from collections.abc import Callable
from dataclasses import dataclass, fields


@dataclass(frozen=True)
class RunOptions:
    """Options of :func:`~mufe_fenicsx.run.run.run_scene`."""

    overwrite: bool = False  #: replace an earlier run in the folder
    max_steps: int | None = None  #: stop at this step, counted from the start of the test
    quiet: bool = False  #: print nothing
    command: tuple = ()  #: the command line, to be kept with the run
    #: Go on from the last checkpoint in the folder, with the same scene and grains, on any number
    #: of ranks; a finished test too, where the scene's strain is larger now.
    resume: bool = False
    #: Go on, too, where results before the checkpoint are gone or changed.
    accept_loss: bool = False
    profile: bool = False  #: keep the time of the parts of a step; "profile" in the result
    #: Function of the last summary; what it returns, a dict, is added to it.
    after: Callable | None = None

    def says(self, comm):
        """Whether this rank prints how the run goes on."""
        return comm.rank == 0 and not self.quiet

    @classmethod
    def of(cls, **options):
        """The options of these names.

        Raises:
            TypeError: There is no such option.
        """
        names = [field.name for field in fields(cls)]
        for name in options:
            if name not in names:
                raise TypeError(f"option of a run = {name}, expected one of {', '.join(names)}")
        return cls(**options)
