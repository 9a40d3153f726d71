"""A run folder with its figures: what `mufe_fenicsx.open_run` gives."""

from pathlib import Path

from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from mufe_fenicsx import results
from mufe_fenicsx.errors import InputError, shown
from mufe_fenicsx.report import style
from mufe_fenicsx.report.parts import DAMAGE, FIGURES, damaged
from mufe_fenicsx.report.source import Source

#: What draws a figure from a Source, by its name; the animation is no figure.
DRAWS = {name: draw for name, _, draw in FIGURES if draw is not None}


class Run(results.Run):
    """A run folder: finished, still running, or killed.

    Files are read when they are asked for. :attr:`missing` says what is not there; what needs it
    raises an InputError of one line. Lengths are in m, stresses in Pa, all else in SI units.

    Args:
        path: Folder that `mufe run` wrote.

    Raises:
        InputError: It is no such folder.
    """

    def plot(
        self,
        name: str = "stress-strain",
        grains: list[int] | None = None,
        points: ArrayLike | None = None,
    ) -> Figure:
        """A figure of the report, which notebooks show.

        Args:
            name: As of `mufe report --only`: "stress-strain", "energies", "force-chains" …
            grains: Labels of the grains that are shown one by one; None: three by their stress.
            points: Places [m] whose course is shown, shape (num_points, 3); None: two by stress.

        Returns:
            A matplotlib Figure, which no window holds; ``figure.savefig(path)`` keeps it.

        Raises:
            InputError: There is no figure of that name, or the run lacks what it needs.
        """
        if name not in DRAWS:
            raise InputError(f"figure {shown(name)}, expected one of {', '.join(DRAWS)}")
        with style.look():
            try:
                return DRAWS[name](Source(self.path, grains, points)).figure
            except InputError:
                raise
            except DAMAGE as error:
                raise InputError(f"figure {name}: {damaged(error)}") from error


def open_run(path: str | Path) -> Run:
    """What a run folder holds, as arrays, tables and figures; finished, running or killed.

    Args:
        path: Folder that `mufe run` wrote.

    Returns:
        :class:`mufe_fenicsx.report.run.Run`.

    Raises:
        InputError: It is no such folder.
    """
    return Run(path)
