"""Walls that follow measured motions: from columns of a file to lengths along the axes.

Of an axis a file has one of these, and only changes since the first row of the stage count:

    strain_z        shortening over the length at strain 0
    displacement_z  shortening [m]
    z_min, z_max    places of one wall or both [m]; of the side of a cylinder its radius

Its time is stretched until the fastest axis moves at `loading.speed`: no law depends on time.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..errors import InputError
from .measured import TIME, Measured, curve_through, read_measured, steepest

#: Prefixes of columns for a whole axis, with their SI units.
OF_AXIS = {"strain": "", "displacement": "m"}


@dataclass(frozen=True)
class MeasuredLengths:
    """Lengths along curves over s: one of the shortening, or one of each of two walls."""

    first: float  #: length at the start [m]
    curves: tuple  #: shortening, or how far each wall comes in, since then [m]

    @cached_property
    def way(self):
        """Largest change of the length over that of s, of walls if each has its own [m]."""
        return sum(steepest(curve) for curve in self.curves)

    def length(self, s):
        """Length at s [m]."""
        return self.first - float(sum(curve(s) for curve in self.curves))

    def places(self, s):
        """As :meth:`~.tasks.StraightLengths.places`."""
        if len(self.curves) == 1:
            return None
        return np.array([float(curve(s)) for curve in self.curves])


def columns_of(container):
    """Columns that a file may have: name -> SI unit."""
    found = {TIME: "s"}
    found |= {f"{kind}_{a}": unit for kind, unit in OF_AXIS.items() for a in container.axes}
    return found | dict.fromkeys(container.walls, "m")


def read_motions(stages, container) -> dict[int, Measured]:
    """The files that stages follow, by the numbers of the stages from 0 on; each read once. Local.

    Args:
        stages: Of :class:`~mufe_fenicsx.scene.stages.Stage`.
        container: :class:`~mufe_fenicsx.container.Container`.

    Raises:
        InputError: One is no such file, or leads an axis twice, or one that its stage leads.
    """
    files, found = {}, {}
    for number, stage in enumerate(stages):
        if stage.follow is None:
            continue
        if stage.follow not in files:
            files[stage.follow] = read_measured(stage.follow, columns_of(container))
        _check(files[stage.follow], stage, container)
        whole = files[stage.follow]
        found[number] = whole if stage.row is None else _step_of(stage, whole)
    return found


def _step_of(stage, measured):
    """The part of a file up to the row that a stage names."""
    try:
        return measured.step_to(stage.row)
    except InputError as error:
        raise InputError(f'stage "{stage.name}": {error}') from None


def _check(measured, stage, container):
    """Raise InputError where a file and its stage contradict each other."""
    path = measured.path
    led = {container.axes[a]: names for a, names in _columns_by_axis(measured, container).items()}
    for axis, names in led.items():
        if axis in stage.axes:
            raise InputError(
                f'stage "{stage.name}": {axis} is given, expected none beside {names[0]} of {path}'
            )
    others = [a for a in container.axes if a not in led and a not in stage.axes]
    if stage.undrained and not others:
        raise InputError(
            f"{path} leads {', '.join(led)}, expected an axis that it leaves out: with undrained = "
            "true its walls keep the volume"
        )
    if (stage.p is not None or stage.eta is not None) and set(led) | set(stage.axes) != {"z"}:
        raise InputError(f"{path} leads {', '.join(led)}, expected z alone beside p or eta")


def _columns_by_axis(measured, container):
    """Columns that lead each axis: number of the axis -> names.

    Raises:
        InputError: Two kinds of columns lead the same axis.
    """
    found = {}
    for a, axis in enumerate(container.axes):
        walls = [container.walls[w] for w in container.walls_of_axis[a]]
        kinds = [[f"{kind}_{axis}"] for kind in OF_AXIS] + [walls]
        given = [[name for name in kind if name in measured.columns] for kind in kinds]
        given = [names for names in given if names]
        if len(given) > 1:
            raise InputError(
                f"{measured.path} has {given[0][0]} and {given[1][0]}, expected one of them for "
                f"{axis}"
            )
        if given:
            found[a] = given[0]
    return found


def measured_paths(measured, container, lengths, reference):
    """Axis number -> :class:`MeasuredLengths`.

    Args:
        measured: Of :func:`read_motions`; None: no axis follows any.
        container: :class:`~mufe_fenicsx.container.Container`.
        lengths: Along the axes at the start of the stage [m].
        reference: Those at strain 0 [m].

    Raises:
        InputError: Walls would meet.
    """
    if measured is None:
        return {}
    found = {}
    for a, names in _columns_by_axis(measured, container).items():
        motion = _motion(measured, names, container, a, reference[a])
        most = sum(motion).max()
        if most >= lengths[a]:
            raise InputError(
                f"{measured.path} shortens {container.axes[a]} by {most:.4g} m, expected less "
                f"than its length, {lengths[a]:.4g} m"
            )
        curves = tuple(curve_through(measured.part, values) for values in motion)
        found[a] = MeasuredLengths(lengths[a], curves)
    return found


def _motion(measured, names, container, a, reference):
    """Shortening of an axis at each row since the first one [m], or how far its walls come in."""
    values = {name: measured.columns[name] - measured.columns[name][0] for name in names}
    axis = container.axes[a]
    if f"strain_{axis}" in values:
        return [reference * values[f"strain_{axis}"]]
    if f"displacement_{axis}" in values:
        return [values[f"displacement_{axis}"]]
    walls = [container.walls[w] for w in container.walls_of_axis[a]]
    if len(walls) == 1:  # its radius
        return [-container.shortening[a] * values[walls[0]]]
    low, high = (values.get(name, 0.0 * measured.time) for name in walls)
    return [low, -high]
