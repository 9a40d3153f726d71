"""The tasks of all axes in a stage, from its settings and from what the stage begins with."""

from dataclasses import dataclass

from ..errors import SolverError
from .tasks import (
    Carry,
    Drive,
    KeepVolume,
    MeanStress,
    Ratio,
    Rest,
    Straight,
    StraightLengths,
    Travel,
)


@dataclass(frozen=True)
class Start:
    """What a stage begins with."""

    container: object  #: :class:`~mufe_fenicsx.container.Container`
    held: list  #: stress that each axis holds [Pa], or None
    stress: list  #: that of each axis [Pa], that it holds or that its walls have
    lengths: list  #: along the axes [m]
    reference: list  #: those at strain 0 [m]
    speed: float  #: `loading.speed` [m/s]

    def moved(self, a, which="both"):
        """Axis, walls that move, speed of each over that of the length, and all its walls."""
        walls, across = _walls(self.container, a, which), _walls(self.container, a, "both")
        return a, walls, 1.0 / (self.container.shortening[a] * len(walls)), across

    @property
    def sides(self):
        """Stresses of the sides, along directions across the vertical one [Pa]."""
        return self.container.three_stresses(self.stress, self.lengths)[:-1]


def walls_moved(stage, container, a):
    """Numbers of the walls of an axis that a stage moves."""
    axis = stage.axes.get(container.axes[a])
    return _walls(container, a, "both" if axis is None else axis.walls)


def _walls(container, a, which):
    walls = container.walls_of_axis[a]
    return {"both": walls, "min": walls[:1], "max": walls[-1:]}[which]


def tasks_of(stage, paths, start):
    """Tasks of the axes, in their order.

    Args:
        stage: :class:`~mufe_fenicsx.scene.stages.Stage`.
        paths: Lengths along the axes that a file gives, axis number -> path.
        start: :class:`Start`.

    Raises:
        SolverError: A ratio of stresses has nothing to begin from.
    """
    found, axes = [], stage.axes
    following = _following(stage, paths, start.container)
    for a, name in enumerate(start.container.axes):
        axis = axes.get(name)
        if a in paths:
            found.append(Travel(*start.moved(a), paths[a], start.lengths[a], start.speed))
        elif axis is not None:
            found.append(_stated(axis, a, start))
        elif stage.stresses is not None:
            side, vertical = stage.stresses
            is_vertical = a == len(start.container.axes) - 1
            law = Straight(start.stress[a], vertical if is_vertical else side)
            found.append(Carry(*start.moved(a), law, start.speed, goes=True, ends=True))
        elif stage.p is not None or stage.eta is not None:
            law = _mean_stress(stage.p, a, start) if stage.eta is None else _ratio(stage, a, start)
            found.append(Carry(*start.moved(a), law, start.speed, goes=True))
        elif a in following:
            three = start.container.three
            led = tuple(b for b in three if b not in following)
            num = len(three) - len(led)
            found.append(KeepVolume(*start.moved(a), tuple(start.lengths), led, num))
        elif start.held[a] is None:
            found.append(Rest(*start.moved(a)))
        else:
            found.append(Carry(*start.moved(a), Straight(start.stress[a], start.stress[a])))
    return found


def _following(stage, paths, container):
    """Axes of which the walls keep the volume."""
    if not stage.undrained:
        return ()
    axes = enumerate(container.axes)
    return tuple(a for a, name in axes if a not in paths and name not in stage.axes)


def _stated(axis, a, start):
    """The task of an axis that the stage states."""
    moved = start.moved(a, axis.walls)
    speed = start.speed if axis.speed is None else axis.speed
    if axis.stress is not None:
        law = Straight(start.stress[a], axis.stress)
        return Carry(*moved, law, speed, goes=True, ends=True)
    if axis.strain is None:
        return Drive(*moved, axis.speed)
    last = start.reference[a] * (1.0 - axis.strain)
    return Travel(*moved, StraightLengths(start.lengths[a], last), start.lengths[a], speed)


def _mean_stress(p, a, start):
    first = float(sum(start.container.three_stresses(start.stress, start.lengths))) / 3.0
    return MeanStress(first, p, start.stress[a] - float(start.sides.mean()))


def _ratio(stage, a, start):
    vertical = start.stress[-1]
    if not vertical > 0.0:
        raise SolverError(
            f'stage "{stage.name}": stress_z = {vertical:g} Pa at its start, expected > 0 Pa for '
            "eta to begin with: reach a stress before"
        )
    return Ratio(start.stress[a] / vertical, (3.0 - stage.eta) / (3.0 + 2.0 * stage.eta))
