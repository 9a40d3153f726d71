"""What nobody means of a test, beyond single values (scene.usual): a line each as a run starts.

A line names the quantity, its value and what is usual. The bounds are wide, so that no sound test
comes near them.
"""

import math

import numpy as np
from mpi4py import MPI

from ..scene import Scene
from ..units import with_unit

#: Kind -> least and largest usual value, unit, and a reason.
USUAL = {
    "nu": (-0.5, 0.45, "-", "elements lock near 0.5"),
    "friction": (0.0, 1.5, "-", "above, contacts hold like glue"),
    "stress": (1.0, 1e9, "Pa", "below, servos follow noise; above, grains flow as a whole"),
    "strain": (-0.5, 0.5, "-", "beyond, grains flow into each other"),
    "diameter": (1e-6, 0.1, "m", "that of grains of sand and stones"),
    "ratio": (1e-3, 1e3, "-", "the stiffest contact sets the time step, the softest the test"),
    "ramp": (0.0, 0.5, "-", "beyond, the test is nowhere at its speed"),
    "speed": (0.0, 0.05, "-", "beyond, a test is an impact"),
    "damping": (0.0, 0.1, "-", "beyond, the sample moves as in honey"),
    "fracture": (0.0, 1.0, "-", "above, grains flow before they crack"),
    "membrane": (0.0, 1.0, "-", "that of rubber, softer than grains"),
    "container": (1.0, 3.0, "-", "grains have to reach the side"),
}


def relations(scene: Scene, diameter: float, height: float, radius: float) -> list[str]:
    """A line for each unusual value, ratio or size.

    Args:
        scene: The test.
        diameter: Mean of the grains' [m].
        height: Of the sample [m].
        radius: As of :func:`reach`.
    """
    found = []
    for kind, name, value in _values(scene, diameter, height, radius):
        least, most, unit, why = USUAL[kind]
        if value is not None and value != 0.0 and not least <= value <= most:
            bounds = f"{with_unit(least, unit)} to {with_unit(most, unit)}"
            found.append(f"{name} = {with_unit(value, unit)}, usual is {bounds}: {why}")
    return found


def reach(bounds, mesh):
    """Radius of the container over that of the outermost nodes; 1 of a box. Collective."""
    if not bounds.radius:
        return 1.0
    x = mesh.x[mesh.sample_nodes, :2] - bounds.centre
    farthest = float(np.linalg.norm(x, axis=1).max(initial=0.0))
    return bounds.radius / mesh.comm.allreduce(farthest, op=MPI.MAX)


def _values(scene, diameter, height, radius):
    """(kind, name, value) of all that is judged."""
    materials = {"material": scene.material}
    materials |= {f"materials.{name}": group.material for name, group in scene.materials.items()}
    for name, material in materials.items():
        if material.yield_table() is not None:
            yield "nu", f"{name}.nu, with plasticity,", material.nu
            if scene.fracture is not None:
                over = scene.fracture.strength / material.yield_table()[1].max()
                yield "fracture", f"fracture.strength over the last yield stress of {name}", over
    for name, material in list(materials.items())[1:]:
        yield "ratio", f"{name}.E over material.E", material.E / scene.material.E
    if scene.membrane is not None:
        softest = min(material.E for material in materials.values())
        yield "membrane", "membrane.E over the least of grains", scene.membrane.E / softest
    yield from _frictions(scene)
    yield "diameter", "mean diameter of the grains", diameter
    yield "container", "container.radius over that of the sample", radius
    wave = min(material.wave_speed for material in materials.values())
    yield (
        "damping",
        "solver.damping times the travel time of a wave through the sample",
        (scene.solver.damping * height / wave),
    )
    yield from _loads(scene, wave)


def _frictions(scene):
    contact = scene.contact
    yield "friction", "contact.friction", contact.friction
    yield "friction", "contact.wall_friction", contact.wall_friction
    for name, pair in contact.pairs.items():
        yield "friction", f"contact.pairs.{name}.friction", pair.friction
    of_all = contact.wall_friction
    for kind, things in (("walls", scene.walls.items()), ("tool", _named(scene.tools))):
        for name, thing in things:
            if thing.friction != of_all:
                yield "friction", f"{kind}.{name}.friction", thing.friction


def _named(tools):
    return [(tool.name, tool) for tool in tools]


def _loads(scene, wave):
    """Stresses, strains and speeds."""
    for name, wall in scene.walls.items():
        yield "stress", f"walls.{name}.stress", wall.stress
        for word in ("velocity", "speed"):
            speed = getattr(wall, word)
            yield "speed", f"walls.{name}.{word} over that of waves", speed and abs(speed) / wave
    test = scene.oedometer
    if test is not None:
        yield "strain", "oedometer.strain", test.strain
        yield "ramp", "oedometer.ramp over oedometer.strain", test.ramp / test.strain
        yield "stress", "oedometer.seating_stress", test.seating_stress
        yield "speed", "oedometer.speed over that of waves", test.speed / wave
        yield "speed", "oedometer.seating_speed over that of waves", test.seating_speed / wave
        return
    yield "speed", "loading.speed over that of waves", scene.loading.speed / wave
    strains = []
    for stage in scene.stages:
        for word in ("x", "y", "z", "r", "o", "i"):
            axis = getattr(stage, word, None)
            if axis is not None:
                yield "stress", f"stage {stage.name}, {word}.stress", axis.stress
                yield "strain", f"stage {stage.name}, {word}.strain", axis.strain
                speed = axis.speed and abs(axis.speed) / wave
                yield "speed", f"stage {stage.name}, {word}.speed over that of waves", speed
                strains.append(abs(axis.strain or 0.0))
    longest = max(strains, default=0.0) or math.inf
    yield "ramp", "loading.ramp over the largest strain of a stage", scene.loading.ramp / longest
