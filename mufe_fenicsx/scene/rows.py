"""A scene in a few rows of words, as notebooks show it."""

from dataclasses import fields

from ..container import TOP
from ..materials.elastic import IsotropicSolid
from ..units import keys_of, with_unit
from .tables import Oedometer, Wall


def scene_rows(scene) -> list[tuple[str, str | None]]:
    """(name, words) of what a test is: loading, grains, material, contact, walls and accuracy.

    Args:
        scene: :class:`~mufe_fenicsx.scene.Scene`.
    """
    groups = {name: group.material for name, group in scene.materials.items()}
    contact, solver = scene.contact, scene.solver
    between = f"friction {contact.friction:g} between grains, {contact.law} law"
    return [
        ("test", _test(scene)),
        ("grains", None if scene.sample.grains is None else str(scene.sample.grains)),
        ("material", _material(scene.material)),
        *((f"material of {name}", _material(material)) for name, material in groups.items()),
        ("contact", between),
        ("walls", _walls(scene)),
        ("tools", ", ".join(tool.name for tool in scene.tools) or None),
        ("solver", f"{solver.integrator}, {solver.element} elements"),
        ("accuracy", None if scene.accuracy is None else f"{100 * scene.accuracy:g} %"),
    ]


def _test(scene) -> str:
    if isinstance(scene.oedometer, Oedometer):
        test = scene.oedometer
        return (
            f"oedometer to strain {test.strain:g} at {with_unit(test.speed, 'm/s')}, "
            f"seated at {with_unit(test.seating_stress, 'Pa')}"
        )
    return f"stages: {', '.join(stage.name for stage in scene.stages)}"


def _material(material: IsotropicSolid) -> str:
    """Its class, and the numbers that have a unit."""
    words: list[str] = []
    cls: type = type(material)
    for field in fields(material):
        symbol, value = keys_of(cls)[field.name].symbol, getattr(material, field.name)
        if isinstance(symbol, str) and isinstance(value, int | float):
            words.append(f"{field.name} = {with_unit(value, symbol)}")
    if hasattr(material, "yield_stress"):
        words.append(f"yields at {with_unit(material.yield_stress[0][1], 'Pa')}")
    return f"{cls.__name__}: {', '.join(words)}"


def _walls(scene) -> str:
    """What each wall does that is not at rest; friction where it is not the same for all."""
    walls = {name: _wall(wall) for name, wall in scene.walls.items()}
    if scene.oedometer is not None:
        walls[TOP] = "the platen"
    moving = [f"{name} {what}" for name, what in walls.items() if what]
    friction = sorted({wall.friction or 0.0 for wall in scene.walls.values()})
    rest = "led by the stages" if scene.stages else "others at rest" if moving else "at rest"
    return ", ".join([*moving, rest, f"friction {' to '.join(f'{f:g}' for f in friction)}"])


def _wall(wall: Wall) -> str:
    if wall.mirror:
        return "a mirror"
    if wall.stress is not None:
        return f"held at {with_unit(wall.stress, 'Pa')}"
    return f"moving at {with_unit(wall.velocity, 'm/s')}" if wall.velocity else ""
