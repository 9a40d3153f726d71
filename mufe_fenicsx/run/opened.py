"""A run folder with its figures: what `mufe_fenicsx.open_run` gives."""

from pathlib import Path
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from .. import results
from ..arguments import checked
from ..errors import InputError, shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Run(results.Run):
    """A :class:`mufe_fenicsx.results.Run` that draws the figures of the report, too."""

    def plot(
        self,
        name: str = "stress-strain",
        grains: list[int] | None = None,
        points: ArrayLike | None = None,
    ) -> "Figure":
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
        # Only here: tables and arrays do without the libraries of pictures.
        from ..report import style
        from ..report.parts import DAMAGE, FIGURES, damaged
        from ..report.source import Source

        # The animation is no figure.
        draws = {known: draw for known, _, draw in FIGURES if draw is not None}
        if name not in draws:
            raise InputError(f"figure {shown(name)}, expected one of {', '.join(draws)}")
        with style.look():
            try:
                return draws[name](Source(self.path, grains, points)).figure
            except InputError:
                raise
            except DAMAGE as error:
                raise InputError(f"figure {name}: {damaged(error)}") from error


@checked
def open_run(path: str | Path) -> Run:
    """What a run folder holds; finished, running or killed. ``path``: that of `mufe run -o`."""
    return Run(path)
