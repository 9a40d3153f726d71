"""What the stages of a scene demand of its container, walls, membrane and tools."""

from ..container import BOTTOM, BOX, CONTAINERS, SHEARED, TOP
from ..errors import InputError
from .tables import Wall
from .tools import FREEDOMS

#: Of the axes of all containers, and of directions across the vertical one.
ALL_LETTERS = {letter for each in CONTAINERS.values() for letter in (*each.axes, *each.across)}

#: Keys of stages that suppose all sides alike.
PATHS = ("undrained", "p", "q", "eta")


def check_stages(scene):
    """Raise InputError where stages ask for what the scene has not."""
    _check_axes(scene)
    if scene.membrane is not None:
        _check_stages_of_membrane(scene)
    _check_along(scene)
    _check_tools_of_stages(scene)


def _check_axes(scene):
    """Raise InputError where a stage leads or waits for what the container has not."""
    container = scene.container.kind
    for number, stage in enumerate(scene.stages, start=1):
        for axis, settings in stage.axes.items():
            if axis not in container.axes:
                raise InputError(
                    f"stage[{number}] leads {axis}, expected {' or '.join(container.axes)} with "
                    f'container.shape = "{container.shape}"'
                )
            if (
                len(container.walls_of_axis[container.axes.index(axis)]) == 1
                and settings.walls != "both"
            ):
                raise InputError(
                    f'stage[{number}].{axis}.walls = "{settings.walls}", expected "both": it '
                    "is one wall"
                )
        for key in PATHS if container.across else ():
            if getattr(stage, key) not in (None, False):
                raise InputError(
                    f"stage[{number}].{key} is given, expected none with container.shape = "
                    f'"{container.shape}": its sides may differ'
                )
        if stage.undrained and set(container.axes) <= set(stage.axes):
            raise InputError(
                f"stage[{number}].undrained = true, expected an axis that is left out: its walls "
                "keep the volume"
            )
        for name in () if stage.until is None else stage.until.given:
            *_, letter = name.split("_")
            known = (*container.axes, *container.across)
            if name[:6] in ("stress", "strain") and letter in ALL_LETTERS - {*known}:
                raise InputError(
                    f"stage[{number}].until.{name} is given, expected none with "
                    f'container.shape = "{container.shape}"'
                )


def _check_stages_of_membrane(scene):
    """Raise InputError where a stage leads more than the pressure of the cell."""
    for number, stage in enumerate(scene.stages, start=1):
        axis = stage.axes.get("r")
        if axis is not None and axis.stress is None:
            raise InputError(
                f"stage[{number}].r.stress is missing, expected one with [membrane]: the pressure "
                "of the cell, which leads no diameter"
            )
        if stage.undrained:
            raise InputError(
                f"stage[{number}].undrained = true, expected false with [membrane]: the cell "
                "presses, and keeps no volume"
            )
        if stage.follow is not None:
            raise InputError(
                f"stage[{number}].follow is given, expected none with [membrane]: the cell "
                "presses, and leads no diameter"
            )
        for key in stage.along:
            raise InputError(f"stage[{number}].{key} is given, expected none with [membrane]")


def _check_along(scene):
    """Raise InputError where walls that move along themselves cannot shear the sample."""
    container, used = scene.container.kind, set()
    for number, stage in enumerate(scene.stages, start=1):
        for key in stage.along:
            used.add(key)
            if (key == "shear") != (container is BOX):
                wanted = "a box" if key == "shear" else "a cylinder"
                raise InputError(
                    f"stage[{number}].{key} is given, expected {wanted} with container.shape = "
                    f'"{container.shape}"'
                )
    for number, stage in enumerate(scene.stages, start=1):
        for name in () if stage.until is None else stage.until.given:
            for key, names in SHEARED.items():
                if name in names and key not in used:
                    raise InputError(
                        f"stage[{number}].until.{name} is given, expected a stage with {key}"
                    )
    for name in (BOTTOM, TOP) if used else ():
        wall = scene.walls.get(name, Wall())
        if not (scene.contact.wall_friction if wall.friction is None else wall.friction):
            raise InputError(
                f"walls.{name} is smooth, expected friction > 0 of walls that shear the sample"
            )
    if "shear" in used:
        for name in container.walls[:2]:
            if scene.walls.get(name, Wall()).mirror:
                raise InputError(f"walls.{name}.mirror = true, expected false: it tilts")


def _check_tools_of_stages(scene):
    """Raise InputError where a stage leads a tool that is not there, or that cannot be led so."""
    tools = {tool.name: tool for tool in scene.tools}
    for number, stage in enumerate(scene.stages, start=1):
        for name, motion in stage.tools.items():
            where = f"stage[{number}].tools.{name}"
            if name not in tools:
                known = ", ".join(tools) or "none: there is no [[tool]]"
                raise InputError(f"{where} is no tool, expected {known}")
            tool = tools[name]
            if tool.path is not None and any(rate is not None for rate in motion.rates):
                raise InputError(f"{where} has a velocity, expected none: path leads that tool")
            for values, free, what in (
                (motion.rates, False, "a motion along {}, expected none of what is free"),
                (motion.loads, True, "a load along {}, expected none of what is told"),
            ):
                for freedom, value in zip(FREEDOMS, values, strict=True):
                    if value and (freedom in tool.freedoms) != free:
                        raise InputError(f"{where} has {what.format(freedom)}")
