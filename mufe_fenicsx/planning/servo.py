"""Do servos hold their stress while other walls go at the speed that a scene states?

A wall that gives way at the speed w lacks the stress ρc w (loading.wall_servo). Grains that are
shortened at the speed v press the walls beside them outwards at about v/2.
"""

from ..analysis.check_targets import TARGETS
from ..loading.quasi_static import SIDE
from .course import SOLID, speed_under


def lagging_servos(scene):
    """A line for each stage that is too fast for the stress that it holds, as the report judges."""
    if scene.loading is None or scene.quasi_static is not None or scene.membrane is not None:
        return []
    held, lines = {}, []
    for stage in scene.stages:
        if stage.stresses is not None:
            side, vertical = stage.stresses
            held = dict.fromkeys(scene.container.kind.axes, side)
            held[scene.container.kind.axes[-1]] = vertical
        for name, axis in stage.axes.items():
            held.pop(name, None)
            if axis.stress is not None:
                held[name] = axis.stress
        held = {} if stage.undrained else held
        speeds = [abs(axis.speed or scene.loading.speed) for axis in stage.axes.values()
                  if axis.stress is None]  # fmt: skip
        beside = [stress for name, stress in held.items() if name not in stage.axes and stress > 0]
        if speeds and beside and not stage.zero:
            lines += _lag(stage.name, max(speeds), min(beside), scene)
    return lines


def _lag(name, speed, stress, scene):
    impedance = SOLID * scene.material.rho * speed_under(scene, stress)
    lag, allowed = SIDE * impedance * speed / stress, TARGETS["held"]
    if lag <= allowed:
        return []
    return [
        f'stage "{name}": at {speed:g} m/s the servo that holds {stress / 1e6:g} MPa lags by about '
        f"{lag:.0%} of it, where the report allows {allowed:.0%}: a speed of "
        f"{speed * allowed / lag:.2g} m/s would do, or [quasi_static], which keeps to it"
    ]
