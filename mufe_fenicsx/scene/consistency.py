"""What the tables of a scene demand of each other."""

from ..container import INNER, SIDE, TOP
from ..errors import InputError
from ..materials.auto import Auto
from ..materials.rigid import Rigid
from .pairs import MEMBRANE, by_materials
from .stage_consistency import check_stages
from .tables import Wall


def check(scene):
    """Raise InputError where tables of a scene contradict each other."""
    _check_test(scene)
    _check_groups(scene)
    by_materials(scene.contact.pairs, scene.materials)
    if scene.membrane is not None:
        _check_membrane(scene)
    _check_container(scene)
    if scene.tools:
        _check_tools(scene)
    check_stages(scene)
    if scene.fracture is not None:
        _check_fracture(scene)
    if scene.mass_scaling is not None:
        _check_mass_scaling(scene)
    if scene.solver.integrator != "explicit":
        _check_implicit(scene)
    _check_mirrors(scene)
    _check_rigid(scene)
    _check_walls(scene)
    _check_speeds(scene)


def _check_speeds(scene):
    """Raise InputError where walls are as fast as waves in the grains: no sample follows."""
    materials = [scene.material, *(group.material for group in scene.materials.values())]
    wave = min(material.wave_speed for material in materials)
    speeds = [(f"walls.{name}.{word}", getattr(wall, word))
              for name, wall in scene.walls.items() for word in ("velocity", "speed")]  # fmt: skip
    for table, names in (("oedometer", ("speed", "seating_speed")), ("loading", ("speed",))):
        settings = getattr(scene, table)
        speeds += [(f"{table}.{word}", getattr(settings, word)) for word in names if settings]
    for name, speed in speeds:
        if speed is not None and abs(speed) >= wave:
            raise InputError(
                f"{name} = {speed:g} m/s, expected less than the speed of waves in the grains, "
                f"{wave:.3g} m/s"
            )


def _check_test(scene):
    """Raise InputError unless there is one test."""
    if scene.oedometer is not None:
        for name, given in (("[loading]", scene.loading), ("[[stage]]", scene.stages)):
            if given:
                raise InputError(f"{name} is given, expected none beside [oedometer]")
        led = scene.solver.integrator == "explicit" and scene.contact.law == "matched"
        if scene.oedometer.seating_at_rest and not led:
            raise InputError(
                "oedometer.seating_at_rest = true, expected false with increments and with "
                'contact.law = "kinematic", where no servo holds a stress'
            )
        return
    if scene.loading is None:
        raise InputError("[oedometer] is missing, expected it, or [loading] with [[stage]]")
    if not scene.stages:
        raise InputError("[[stage]] is missing, expected at least one with [loading]")
    if scene.solver.integrator != "explicit":
        raise InputError(
            "[loading] is given, expected [oedometer] for solver.integrator = "
            f'"{scene.solver.integrator}": a servo follows the force after an increment'
        )
    if scene.contact.law == "kinematic":
        raise InputError('contact.law = "kinematic", expected "matched" with [loading]')


def _check_container(scene):
    """Raise InputError where walls are not those of the container."""
    container = scene.container.kind
    for name in scene.walls:
        if name not in container.walls:
            raise InputError(
                f"walls.{name} is not a wall of a {container.shape}, expected one of "
                f"{', '.join(container.walls)}"
            )


def _check_membrane(scene):
    """Raise InputError where there cannot be a membrane."""
    shape = scene.container.shape
    if shape != "cylinder":
        raise InputError(f'container.shape = "{shape}", expected "cylinder" with [membrane]')
    for name in ("oedometer", "quasi_static"):
        if getattr(scene, name) is not None:
            raise InputError(f"[{name}] is given, expected none beside [membrane]")
    if MEMBRANE in scene.materials:
        raise InputError(f"materials.{MEMBRANE} is given, expected another name with [membrane]")


def _check_groups(scene):
    """Raise InputError where a grain is in two groups."""
    group_of = {}
    for name, group in scene.materials.items():
        for label in group.labels:
            if group_of.setdefault(label, name) != name:
                raise InputError(
                    f"materials.{name}.labels has {label}, expected each label in one group: "
                    f"it is in materials.{group_of[label]} too"
                )


def _first_rigid(scene):
    """Name of the first table whose grains do not deform, or not always; None without one."""
    models = {"material": scene.material}
    models |= {f"materials.{name}": group.material for name, group in scene.materials.items()}
    return next((name for name, model in models.items() if isinstance(model, Rigid | Auto)), None)


def _check_rigid(scene):
    """Raise InputError where rigid grains cannot do what the scene wants."""
    if _first_rigid(scene) is None:
        return
    if scene.contact.law == "kinematic":
        raise InputError('contact.law = "kinematic", expected "matched" for rigid grains')
    if scene.solver.time_step == "element":
        raise InputError('solver.time_step = "element", expected "assembled" for rigid grains')


def _check_tools(scene):
    """Raise InputError where tools cannot do what the scene wants."""
    names = [tool.name for tool in scene.tools]
    for number, tool in enumerate(scene.tools, start=1):
        if tool.name in names[: number - 1]:
            raise InputError(f'tool[{number}].name = "{tool.name}", expected names that differ')
        if tool.free and scene.solver.integrator == "static":
            raise InputError(
                f'tool[{number}].free = "{tool.free}", expected "" for solver.integrator = '
                '"static", which knows no inertia'
            )
    for key, value, wanted in (
        ("contact.law", scene.contact.law, "matched"),
        ("solver.time_step", scene.solver.time_step, "assembled"),
    ):
        if value != wanted:
            raise InputError(f'{key} = "{value}", expected "{wanted}" with [[tool]]')
    if scene.solver.integrator == "implicit":
        raise InputError('solver.integrator = "implicit", expected another one with [[tool]]')
    if scene.mass_scaling is not None:
        raise InputError("[mass_scaling] is given, expected none with [[tool]]")
    for name, wall in scene.walls.items():
        if wall.mirror:
            raise InputError(f"walls.{name}.mirror = true, expected false with [[tool]]")


def _check_walls(scene):
    """Raise InputError where a wall is moved by its own table and by the test."""
    moved, by = (TOP,), "[oedometer] moves the top platen"
    if scene.loading is not None:
        moved, by = scene.container.kind.walls, "[[stage]] moves the walls"
    for name in moved:
        wall = scene.walls.get(name, Wall())
        for key, rest in (("velocity", 0), ("stress", None)):
            if getattr(wall, key) != rest:
                raise InputError(f"walls.{name}.{key} = {getattr(wall, key)}, expected none: {by}")


def _check_mass_scaling(scene):
    """Raise InputError where mass must not be added: laws that depend on it, bodies."""
    rigid = _first_rigid(scene)
    if rigid is not None:
        raise InputError(f"[mass_scaling] is given, expected none for {rigid}, which is rigid")
    for key, value, wanted in (
        ("contact.law", scene.contact.law, "matched"),
        ("solver.time_step", scene.solver.time_step, "assembled"),
    ):
        if value != wanted:
            raise InputError(f'{key} = "{value}", expected "{wanted}" with [mass_scaling]')


def _check_fracture(scene):
    """Raise InputError where grains cannot break."""
    rigid = _first_rigid(scene)
    if rigid is not None:
        raise InputError(f"[fracture] is given, expected none for {rigid}, which is rigid")
    if scene.membrane is not None:
        raise InputError("[fracture] is given, expected none beside [membrane]")
    for key, value, wanted in (
        ("solver.integrator", scene.solver.integrator, "explicit"),
        ("solver.time_step", scene.solver.time_step, "assembled"),
        ("contact.law", scene.contact.law, "matched"),
    ):
        if value != wanted:
            raise InputError(f'{key} = "{value}", expected "{wanted}" with [fracture]')
    if scene.contact.self_contact:
        raise InputError(
            "contact.self_contact = true, expected false with [fracture]: the faces of a crack "
            "have pairs of their own"
        )


def _check_implicit(scene):
    """Raise InputError where an implicit or static solver cannot do what the scene wants."""
    wanted = f'for solver.integrator = "{scene.solver.integrator}"'
    rigid = _first_rigid(scene)
    if rigid is not None:
        raise InputError(f"{rigid} is rigid, expected grains that deform {wanted}")
    for name, wall in scene.walls.items():
        # Dynamics have no state to iterate for: over long increments a servo would overshoot.
        if wall.stress is not None and scene.solver.integrator == "implicit":
            raise InputError(f"walls.{name}.stress = {wall.stress}, expected none {wanted}")
    if scene.contact.law == "kinematic":
        raise InputError(f'contact.law = "kinematic", expected "matched" {wanted}')
    for name, table in (
        ("mass_scaling", scene.mass_scaling),
        ("quasi_static", scene.quasi_static),
    ):
        if table is not None:
            raise InputError(f"[{name}] is given, expected none {wanted}")


def _check_mirrors(scene):
    """Raise InputError where a plane of symmetry cannot be."""
    name = next((name for name in scene.walls if scene.walls[name].mirror), None)
    if name is None:
        return
    if scene.walls.get(TOP, Wall()).mirror:
        raise InputError(
            f"walls.{TOP}.mirror = true, expected none: [oedometer] moves the top platen"
        )
    if name in (SIDE, INNER):
        raise InputError(f"walls.{name}.mirror = true, expected none: no plane, but a cylinder")
    if scene.contact.law == "kinematic":
        raise InputError(f'contact.law = "kinematic", expected "matched" with walls.{name}.mirror')
    if scene.sample.separation:
        # Nodes on the plane would be moved off it.
        raise InputError(f"sample.separation = true, expected false with walls.{name}.mirror")
    if _first_rigid(scene) is not None:
        raise InputError(
            f"walls.{name}.mirror = true, expected false with rigid grains, or grains that deform"
        )
