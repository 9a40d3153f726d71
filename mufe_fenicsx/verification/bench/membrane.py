"""What a membrane costs: a sample in it beside the same sample in a rigid cylinder, by turns."""

import shutil
import statistics
import tempfile
import time
from pathlib import Path

from ...errors import InputError
from .interleaved import ratio
from .launch import launch, row

#: Largest time of a step with a membrane over that without.
TARGET = 1.15
#: Balls that are packed, seed of their places: of them about 200 stand in the cylinder.
PACKED, SEED = 380, 7
#: Speed at which the diameter shrinks onto the grains, as a scene has it.
SPEED = "10 m/s"
#: Mean stress that the sample is to carry before it is measured [Pa].
CARRIED = 20e3


def in_membrane(comm, *, packed=PACKED, seed=SEED, steps=200, repeats=9, most=20000):
    """Two samples of balls that carry a cell or a cylinder, stepped by turns. Collective.

    The processor's time counts: other programs on the machine lengthen the clock's.

    Args:
        packed, seed: Balls that are packed, and the seed of their places.
        steps, repeats: Steps of one measurement, and measurements of each.
        most: Steps until they carry it at most.

    Returns:
        dict by "with" and "without": numbers of grains, tets, contacts and searches, steps until it
        carried, stress that it carries [Pa], time step [s] and times of a step [s].

    Raises:
        InputError: One does not carry after the most steps.
    """
    packed, seed, steps, most = int(packed), int(seed), int(steps), int(most)
    folder = Path(tempfile.mkdtemp())
    try:
        tests = {name: _led(comm, folder, name, packed, seed, most) for name in ("with", "without")}
    finally:
        shutil.rmtree(folder)
    before = {name: s.state.num_steps for name, (s, _) in tests.items()}
    searches = {name: s.contact.num_searches for name, (s, _) in tests.items()}
    spent = {name: [] for name in tests}
    for _ in range(int(repeats)):
        for name, test in tests.items():
            start = time.process_time()
            for _ in range(steps):
                _step(*test)
            spent[name].append((time.process_time() - start) / steps)
    for s, _ in tests.values():
        s.energies()  # which counts the contacts
    return {
        name: {
            "num_grains": s.mesh.num_sample_grains,
            "num_cells": s.mesh.num_cells,
            "num_contacts": s.num_contacts,
            "searches": s.contact.num_searches - searches[name],
            "loaded_in": before[name],
            "stress": float(min(loading.gauges.mean_stress())),
            "time_step": s.dt,
            "seconds": spent[name],
        }
        for name, (s, loading) in tests.items()
    }


def _led(comm, folder, name, packed, seed, most):
    """Simulation and loading of the test with or without a membrane, once it carries."""
    from ...geometry.grains import save_grains
    from ...loading.stages import StagedLoading
    from ...run.from_scene import (
        find_bounds,
        load_mesh,
        make_membrane,
        make_simulation,
        read_scene,
        separate_surfaces,
        sleeve_of,
    )
    from ...synthetic.starter_scenes import IN_MEMBRANE, TALL, ball_packing

    text, _ = IN_MEMBRANE["triaxial"]
    begin, end = text.index("[membrane]"), text.index("[walls.side]")
    text = text if name == "with" else text[:begin] + text[end:]
    scene_file, grains = folder / f"{name}.toml", folder / "grains"
    if comm.rank == 0:
        scene_file.write_text(text.replace('speed = "5 m/s"', f'speed = "{SPEED}"'), "utf-8")
        if not grains.exists():
            save_grains(grains, ball_packing(packed, seed, TALL, True))
    comm.Barrier()
    scene = read_scene(comm, scene_file)
    mesh = load_mesh(comm, grains, scene.solver.element, around=sleeve_of(scene))
    separate_surfaces(mesh, scene.sample)
    bounds = find_bounds(scene, mesh)
    simulation = make_simulation(scene, mesh, bounds)
    measures = make_membrane(scene, simulation, bounds)
    loading = StagedLoading(simulation, scene.loading, scene.stages, None, measures)
    while min(loading.gauges.mean_stress()) < CARRIED:
        if simulation.state.num_steps == most:
            raise InputError(
                f"stress after {most} steps {name} a membrane = "
                f"{min(loading.gauges.mean_stress()):.3g} Pa, expected {CARRIED:g} Pa"
            )
        _step(simulation, loading)
    return simulation, loading


def _step(simulation, loading):
    loading.before_step()
    simulation.step(everywhere=False)


def membrane(parameters):
    """A step of about 200 balls in a membrane over one in a rigid cylinder, on one rank.

    Parameters: ``packed``, ``seed``, ``steps``, ``repeats``, ``most``.
    """
    found = launch("in_membrane", parameters, 1)
    cell, cylinder = found["with"], found["without"]
    part = ratio(cell["seconds"], cylinder["seconds"])
    results = {
        "num_grains": {"computed": cell["num_grains"]},
        "num_cells": {"computed": cylinder["num_cells"]},
        "num_cells_of_membrane": {"computed": cell["num_cells"] - cylinder["num_cells"]},
    }
    for name, one in found.items():
        results[f"step_s_{name}"] = {"computed": statistics.median(one["seconds"])}
        for of in ("time_step", "num_contacts", "searches", "loaded_in", "stress"):
            results[f"{of}_{name}"] = {"computed": one[of]}
    results["with_over_without"] = row(part, TARGET, part <= TARGET)
    return {
        "case": "membrane", "parameters": parameters, "results": results, "passed": part <= TARGET
    }  # fmt: skip
