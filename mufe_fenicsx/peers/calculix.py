"""The test of a scene as a deck of CalculiX.

Same meshes, moved apart as a run moves them, same materials, walls and coefficients of friction.
Contact is CalculiX's own: its penalty is a multiple of one over the sum of the layers c h/E* of
both sides where they face each other, its stick slope that times 2(1-ν)/(2-ν). The layers take out
the stiffness that gaps enforced at points of facets have too much; CalculiX integrates pressure
over the parts of facets that overlap and has no such excess, so that with the layers themselves it
would be too soft. What a deck cannot say is told in notes.
"""

import math
from pathlib import Path

import numpy as np

from ..container import TOP
from ..errors import InputError
from ..geometry.measure import tet_volumes
from ..machine.files import new_files
from ..materials.elastic import Elastic
from ..materials.j2 import FAR, J2
from ..run.from_scene import load_mesh, separate_surfaces
from ..run.preparation import Prepared
from .deck import UNITS, Deck, Grain, Material, Pair, Plane, Step, write_deck
from .touching import surfaces_of, touching_grains, touching_planes

PROCEDURES = ("static", "dynamic")
#: Planes reach beyond the sample by this part of its longest edge.
OVERHANG = 0.2
#: Penalty over one over the sum of the layers.
PENALTY = 4.0
#: Points of the motion while the platen gets its speed.
RAMP_POINTS = 20


def export_calculix(
    path,
    scene,
    grains,
    comm,
    *,
    units="um",
    procedure=None,
    reach=None,
    penalty=PENALTY,
    overwrite=False,
):
    """Write the deck of a scene.

    Args:
        path: File to write, .inp.
        scene: :class:`~mufe_fenicsx.scene.Scene`.
        grains: Folder that `mufe mesh` wrote.
        comm: MPI communicator of one rank.
        units: One of `deck.UNITS`. CalculiX first takes 0.01 for the mean force that residuals
            are compared with: forces of grains should be larger numbers, as they are in um.
        procedure: One of `PROCEDURES`; None: "static" where the scene's integrator is, else
            "dynamic", which is implicit.
        reach: Grains with a gap of at most this are contact pairs [m]; None: the way of the top
            platen and the length of edges.
        penalty: Stiffness of contact over that of the layers of a run.
        overwrite: Replace the file.

    Returns:
        Summary, a dict; ``notes`` are lines on what differs from the scene.

    Raises:
        InputError: a material, wall or option that a deck has no words for, or a file or folder
            that cannot be used.
    """
    path = Path(path)
    if procedure is None:
        procedure = "static" if scene.solver.integrator == "static" else "dynamic"
    _check_options(path, units, procedure, reach, penalty)
    _check_scene(scene)
    mesh = load_mesh(comm, grains)
    labels = mesh.labels[mesh.grains]
    materials = [_material(m) for m in scene.materials_of(labels, mesh.labels)]
    apart = separate_surfaces(mesh, scene.sample)
    prepared = Prepared.of(scene, mesh)
    travel = scene.oedometer.strain * prepared.bounds.height
    surfaces = surfaces_of(
        mesh.x,
        mesh.facets,
        mesh.grain_of_node,
        scene.contact.compliance / penalty,
        np.array([m.E / (1 - m.nu**2) for m in materials]),
    )
    if reach is None:
        reach = travel + 2 * math.sqrt(surfaces.area.mean())
    bodies = _bodies(mesh, materials, scene, procedure)
    step = _step(scene, travel, procedure)
    planes = [_plane(wall, prepared.bounds, scene, step) for wall in prepared.walls]
    near = min(travel, reach)
    pairs = _grain_pairs(scene.friction_of(mesh.labels), surfaces, materials, bodies, reach, near)
    num_grain_pairs = len(pairs)
    for plane, wall in zip(planes, prepared.walls, strict=True):
        pairs += _wall_pairs(plane, wall, surfaces, materials, bodies, reach, near)
    notes = _notes(scene, procedure, apart)
    deck = Deck(scene.title or path.stem, bodies, planes, pairs, step, units, notes)
    with new_files(path, overwrite=overwrite) as folder:
        with (folder / path.name).open("w", encoding="ascii") as file:
            write_deck(file, deck)
    return {
        "deck": str(path),
        "procedure": procedure,
        "units": UNITS[units][-1],
        "num_grains": len(bodies),
        "num_nodes": len(mesh.x),
        "num_cells": len(mesh.cells),
        "num_grain_pairs": num_grain_pairs,
        "num_wall_pairs": len(pairs) - num_grain_pairs,
        "reach_m": float(reach),
        "travel_m": float(travel),
        "time_s": step.time,
        "notes": notes,
    }


def _check_options(path, units, procedure, reach, penalty):
    """Raise an InputError for what :func:`export_calculix` cannot use."""
    if path.suffix.lower() != ".inp":
        raise InputError(f"output {path}, expected a name that ends with .inp")
    if units not in UNITS:
        raise InputError(f'--units = "{units}", expected {", ".join(UNITS)}')
    if procedure not in PROCEDURES:
        raise InputError(f'--procedure = "{procedure}", expected {" or ".join(PROCEDURES)}')
    if reach is not None and not 0 < reach < math.inf:
        raise InputError(f"--reach = {reach} m, expected a length > 0")
    if not 0 < penalty < math.inf:
        raise InputError(f"--penalty = {penalty}, expected a factor > 0")


def _check_scene(scene):
    """Raise an InputError for a scene whose walls a deck cannot lead."""
    if scene.oedometer is None:
        raise InputError("[oedometer] is missing, expected it: a deck drives the top platen alone")
    if scene.container.shape != "box":
        raise InputError(
            f'container.shape = "{scene.container.shape}", expected "box": walls of a deck are '
            "planes"
        )
    if scene.tools:
        raise InputError("[[tool]] is given, expected none: a deck has walls alone")
    for name, wall in scene.walls.items():
        if wall.stress is not None:
            raise InputError(
                f"walls.{name}.stress = {wall.stress:g}, expected none: walls of a deck are driven"
            )


def _material(model):
    """What a deck can say of a material."""
    if type(model) is Elastic:
        return Material(model.E, model.nu, model.rho)
    if type(model) is not J2:
        raise InputError(
            f"material {type(model).__name__}, expected elastic or j2 for all grains of a deck"
        )
    points = [tuple(map(float, point)) for point in model.yield_stress]
    if model.beyond == "slope":
        (strain, stress), (last_strain, last_stress) = points[-2:]
        slope = (last_stress - stress) / (last_strain - strain)
        points.append((FAR, last_stress + slope * (FAR - last_strain)))
    return Material(model.E, model.nu, model.rho, tuple(points))


def _bodies(mesh, materials, scene, procedure):
    """Grains in the order of their labels, with nodes and cells as they were given."""
    found = []
    order, cells = mesh.named_nodes, mesh.cells[mesh.named_cells]
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    held = scene.implicit.stabilisation if procedure == "static" else 0.0
    for g, label in enumerate(mesh.labels[mesh.grains]):
        nodes = order[mesh.node_offset[g] : mesh.node_offset[g + 1]]
        part = cells[mesh.cell_offset[g] : mesh.cell_offset[g + 1]]
        points, local = mesh.x[nodes], place[part] - mesh.node_offset[g]
        size = tet_volumes(points, local).sum() ** (1 / 3)
        spring = held * materials[g].E * size
        found.append(Grain(f"GRAIN_{label}", points, local, materials[g], spring))
    return found


def _step(scene, travel, procedure):
    """The one step: the way of the platen at the speed of the scene."""
    oedometer, settings = scene.oedometer, scene.implicit
    ramp = _ramp_time(scene, travel) if procedure == "dynamic" else 0.0
    # Over a ramp the platen makes half the way.
    time = travel / oedometer.speed + 0.5 * ramp
    second = travel / oedometer.strain / oedometer.speed  # for a strain of one
    first = settings.step * second
    smallest = 1e-4 * first if settings.smallest is None else settings.smallest * second
    largest = 4 * first if settings.largest is None else settings.largest * second
    rho = settings.spectral_radius
    alpha = -(1 - rho) / (1 + rho) if procedure == "dynamic" else None
    if alpha is not None:
        alpha = max(alpha, -1 / 3)
    return Step(float(time), *map(float, (min(first, time), smallest, largest)), alpha)


def _ramp_time(scene, travel):
    oedometer = scene.oedometer
    return oedometer.ramp * travel / oedometer.strain / oedometer.speed


def _plane(wall, bounds, scene, step):
    """The part of a wall that a deck draws, and how it moves."""
    axis, low, high = int(np.argmax(np.abs(wall.normal))), bounds.low, bounds.high
    margin = OVERHANG * (high - low).max()
    a, b = (axis + 1) % 3, (axis + 2) % 3
    if wall.normal[axis] < 0:
        a, b = b, a
    corners = np.tile(wall.point, (4, 1)).astype(float)
    for k, (along, across) in enumerate(((low, low), (high, low), (high, high), (low, high))):
        corners[k, a] = along[a] + (margin if along is high else -margin)
        corners[k, b] = across[b] + (margin if across is high else -margin)
    speed = float(wall.velocity @ wall.normal)
    motion = ()
    if wall.name == TOP:
        ramp = 2 * (step.time - scene.oedometer.strain * (high - low)[2] / scene.oedometer.speed)
        motion = _platen(scene.oedometer.speed, ramp, step.time)
    elif speed:
        motion = ((0.0, 0.0), (step.time, speed * step.time))
    return Plane(f"WALL_{wall.name.upper()}", corners, wall.normal, motion)


def _platen(speed, ramp, time):
    """Points (time, way) of a platen that gets its speed over the time ``ramp``, as in a run.

    The speed rises with 10 s³ - 15 s⁴ + 6 s⁵, s = t/ramp, of which the way is the integral.
    """
    points = [(0.0, 0.0)]
    if ramp > 1e-9 * time:
        for s in np.arange(1, RAMP_POINTS + 1) / RAMP_POINTS:
            points.append((float(s) * ramp, speed * ramp * float(s**4 * (2.5 - 3 * s + s * s))))
    start, way = points[-1]
    points.append((time, way + speed * (time - start)))
    return tuple(points)


def _grain_pairs(friction, surfaces, materials, bodies, reach, near):
    pairs = []
    for i, j, layer, layer2, area, area2 in touching_grains(surfaces, reach, near):
        # The finer surface is the slave: its facets are where pressure is integrated.
        slave, master = (i, j) if area <= area2 else (j, i)
        stiffness = 1 / (layer + layer2)
        ratio = 0.5 * (_stick_ratio(materials[i]) + _stick_ratio(materials[j]))
        names = bodies[slave].name, bodies[master].name
        pairs.append(Pair(*names, stiffness, friction.static(i, j), ratio * stiffness))
    return pairs


def _wall_pairs(plane, wall, surfaces, materials, bodies, reach, near):
    pairs = []
    for grain, layer in touching_planes(surfaces, wall.point, wall.normal, reach, near):
        stick = _stick_ratio(materials[grain]) / layer
        pairs.append(Pair(bodies[grain].name, plane.name, 1 / layer, wall.friction, stick))
    return pairs


def _stick_ratio(material):
    return 2 * (1 - material.nu) / (2 - material.nu)


def _notes(scene, procedure, apart):
    """What the deck does otherwise than a run of the scene."""
    notes = []
    contact, solver = scene.contact, scene.solver
    if solver.element != "p1":
        notes.append(
            f'element: C3D4, as element = "p1"; the scene has "{solver.element}", which does not '
            "lock in plastic flow"
        )
    if procedure == "dynamic" and solver.integrator == "explicit":
        notes.append("time: implicit increments, the scene has explicit time steps")
    notes.append("loading: the platen goes its whole way from its first place, without seating")
    tables = [contact, *contact.pairs.values(), *scene.walls.values()]
    if any(t.friction_kinetic not in (None, t.friction) for t in tables):
        notes.append("friction: the static coefficient; kinetic ones are left out")
    for value, text in (
        (solver.damping, "damping: solver.damping is left out"),
        (contact.self_contact, "contact: grains do not meet themselves"),
        (contact.law == "kinematic", "contact: linear pressure-overclosure, not kinematic"),
        (scene.mass_scaling, "mass: no mass is added"),
        (scene.quasi_static, "speed: constant, not after [quasi_static]"),
    ):
        if value:
            notes.append(text)
    models = [scene.material, *(group.material for group in scene.materials.values())]
    if any(getattr(model, "beyond", "") == "stop" for model in models):
        notes.append('yield stress: flat beyond the table, the scene has beyond = "stop"')
    if apart is not None and apart.remaining_nodes:
        notes.append(
            f"overlap: {apart.remaining_nodes} nodes lie up to {apart.remaining_depth:.3g} m "
            "inside another grain, which pushes from the start"
        )
    return notes
