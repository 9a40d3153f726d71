"""Simulations that benchmarks measure: a box, two blocks, a sample, one that a run left."""

import time
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...run.from_bodies import build


def box(comm, *, divisions=40, model="j2"):
    """The unit box of 40³ cubes of six tets, no contact, one block a rank. Collective.

    Args:
        divisions: Cubes along an edge.
        model: "j2" (all of it yields) or "elastic".
    """
    from ...explicit.simulation import Simulation
    from ...geometry.bodies.shapes import box as box_shape
    from ...materials.elastic import Elastic
    from ...materials.j2 import J2
    from ...mesh import create_grain_mesh

    divisions = int(divisions)
    # One block a rank, side by side with a gap: the same work in all.
    thickness = max(1, round(divisions / comm.size))
    points, cells = box_shape((1.0, 1.0, thickness / divisions), (divisions, divisions, thickness))
    place = np.array([0.0, 0.0, 1.5 * comm.rank])
    points = points + place
    ranks = np.arange(comm.size)
    cell_grain = np.full(len(cells), comm.rank)
    mesh = create_grain_mesh(comm, points, cells, cell_grain, ranks + 1, ranks)
    if model == "j2":
        material = J2(1e9, 0.15, 2650.0, ((0.0, 1e3), (0.05, 1e6)))
    elif model == "elastic":
        material = Elastic(1e9, 0.15, 2650.0)
    else:
        raise InputError(f'model = "{model}", expected "j2" or "elastic"')
    # A strain of about 1e-5 in each step, ten times that of first yield; no block is faster.
    velocity = 1.0 * (mesh.x - place)[:, [1, 2, 0]]
    return Simulation(mesh, [material], velocity=velocity)


def blocks(comm, *, divisions=32):
    """Two unlike J2 boxes, one a rank where there are two, pressed together. Collective.

    Args:
        divisions: Cubes along an edge of the lower one; the upper one has one more.
    """
    from ...geometry.bodies.shapes import box as box_shape
    from ...materials.j2 import J2

    divisions = int(divisions)
    bodies = [
        box_shape((1.0, 1.0, 1.0), (m,) * 3, (0.0, 0.0, z))
        for m, z in ((divisions, 0.0), (divisions + 1, 1.0))
    ]
    material = J2(100e9, 0.15, 2650.0, ((0.0, 10e6), (0.05, 110e6)))
    simulation = build(
        comm, bodies, material, np.zeros(3), np.array([1.0, 1.0, 2.0]), friction=0.23
    )
    simulation.walls.velocity[5, 2] = -10.0
    while simulation.state.t * 10.0 < 2e-3:
        simulation.step()
    return simulation


def demo(comm, *, grains, scene=None):
    """A sample between its walls; by default the demonstration's. Collective.

    Args:
        grains: Folder that `mufe mesh` wrote.
        scene: Scene file of its material and contact.
    """
    from ...contact.separation import separate
    from ...explicit.simulation import Simulation
    from ...run.demo import demo_scene
    from ...run.from_scene import load_mesh
    from ...run.preparation import Prepared
    from ...run.scene_file import read_scene

    scene = read_scene(comm, scene or demo_scene())
    mesh = load_mesh(comm, grains)
    separate(mesh, scene.sample.max_shift)
    return Simulation(
        mesh,
        [scene.material] * mesh.num_grains,
        Prepared.of(scene, mesh).walls,
        friction=scene.contact.friction,
        friction_kinetic=scene.contact.friction_kinetic,
        compliance=scene.contact.compliance,
        points=scene.contact.points,
        law=scene.contact.law,
        self_contact=scene.contact.self_contact,
    )


def resumed(comm, *, run):
    """The sample that a run left, going on at rest of its walls. Collective.

    Args:
        run: Run folder with a checkpoint.
    """
    from ...output.checkpoint import find_checkpoint, read_tables
    from ...run.from_scene import load_mesh, make_simulation
    from ...run.preparation import Prepared
    from ...run.restart import partition_of
    from ...run.scene_file import read_scene
    from ...run.snapshot import restore, restore_mesh

    scene = read_scene(comm, Path(run) / "scene.toml")
    checkpoint = find_checkpoint(comm, Path(run))
    mesh = load_mesh(comm, scene.sample.grains, partition_of(checkpoint, comm))
    kept = read_tables(comm, checkpoint, mesh.grains, mesh.rank_of_grain)
    mesh = restore_mesh(mesh, kept[0])
    simulation = make_simulation(scene, Prepared.of(scene, mesh))
    restore(simulation, *kept, checkpoint.header["state"])
    return simulation


SCENES = {"box": box, "demo": demo, "resumed": resumed}


def prepare(comm, *, kind, strain=0.0, speed=20.0, **parameters):
    """One of ``SCENES`` by its name, loaded. Collective.

    Args:
        kind: Name.
        strain: Approach of the top wall over the height that it is brought to, 0 for none.
        speed: Speed of that wall, kept afterwards [m/s].
        parameters: Of the scene.

    Returns:
        (:class:`~.Simulation`, seconds that it took before the loading).
    """
    start = time.perf_counter()
    simulation = SCENES[kind](comm, **parameters)
    seconds = time.perf_counter() - start
    if strain:
        bottom, top = simulation.walls.point[4:, 2]
        simulation.walls.velocity[5, 2] = -speed
        while simulation.state.t < strain * (top - bottom) / speed:
            simulation.step()
    return simulation, seconds
