"""What a membrane costs: a sample in it beside the same sample in a rigid cylinder, by turns."""

import statistics
import tempfile
import time
from pathlib import Path

import numpy as np

from ...errors import InputError
from .interleaved import ratio
from .launch import launch, row

#: Largest time of a step with a membrane over that without.
TARGET = 1.15
#: Balls that are packed, seed of their places: of them about 200 stand in the cylinder.
PACKED, SEED = 380, 7
#: The test: the cell presses the sample together, and then the platens shear it, which is measured.
SEATING = """
[loading]
speed = "0.5 m/s"
ramp = 0.001
tolerance = 0.5

[[stage]]
rz = { stress = "20 kPa", speed = "10 m/s" }
"""
SHEAR = """
[[stage]]
name = "shear"
z = { strain = 0.02, speed = "0.3 m/s" }
"""
#: Steps at the start of shear that are not measured: what the seating has shaken comes to rest.
STILLED = 500


def in_membrane(comm, *, packed=PACKED, seed=SEED, steps=200, repeats=9, most=20000):
    """A sample of balls that carries a cell, and its grains in a cylinder, by turns. One rank.

    The grains of the second one are those of the first in their places, so that as many are near
    each other. Nothing holds them there, and their contacts open: what the first one takes more is
    an upper bound, in which contacts between grains count as well. The processor's time counts:
    other programs on the machine lengthen the clock's.

    Args:
        packed, seed: Balls that are packed, and the seed of their places.
        steps, repeats: Steps of one measurement, and measurements of each.
        most: Steps of the seating at most.

    Returns:
        dict by "with" and "without": numbers of grains, tets, contacts and searches, time step [s]
        and times of a step [s]; by "loaded": steps that it took, and the stress [Pa].

    Raises:
        InputError: The sample does not carry the cell after so many.
    """
    from ...synthetic.starter_scenes import round_packing

    packed, seed, steps, most = int(packed), int(seed), int(steps), int(most)
    with tempfile.TemporaryDirectory() as folder:
        grains = round_packing(packed, seed)
        cell = _test(comm, Path(folder) / "with", grains, True)
        _seat(*cell, most)
        simulation, loading = cell
        stress = float(min(loading.apparatus.gauges.mean_stress()))
        loaded = {"steps": simulation.state.num_steps, "stress": stress}
        moved = _in_place(simulation, grains.element_size)
        tests = {"with": cell, "without": _test(comm, Path(folder) / "without", moved, False)}
    for test in tests.values():
        for _ in range(STILLED):
            _step(*test)
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
            "time_step": s.dt,
            "seconds": spent[name],
        }
        for name, (s, _) in tests.items()
    } | {"loaded": loaded}


def _test(comm, folder, grains, in_cell):
    """Simulation and loading of a test on grains, in a membrane or in a rigid cylinder."""
    from ...geometry.grains import save_grains
    from ...loading.stages import StagedLoading
    from ...run.from_scene import (
        load_mesh,
        make_membrane,
        make_simulation,
        separate_surfaces,
        sleeve_of,
    )
    from ...run.preparation import Prepared
    from ...run.scene_file import read_scene
    from ...synthetic.starter_scenes import IN_MEMBRANE

    text, _ = IN_MEMBRANE["triaxial"]
    text = text[: text.index("[loading]")] + SEATING + SHEAR
    if not in_cell:
        text = text[: text.index("[membrane]")] + text[text.index("[walls.side]") :]
        text = text[: text.index("[[stage]]")] + SHEAR
    folder.mkdir()
    (folder / "scene.toml").write_text(text, encoding="utf-8")
    save_grains(folder / "grains", grains)
    scene = read_scene(comm, folder / "scene.toml")
    around = sleeve_of(scene)
    mesh = load_mesh(comm, folder / "grains", around=around)
    separate_surfaces(mesh, scene.sample)
    prepared = Prepared.of(scene, mesh)
    simulation = make_simulation(scene, prepared)
    measures = make_membrane(scene, simulation, prepared.bounds)
    return simulation, StagedLoading(simulation, scene.loading, scene.stages, None, measures)


def _seat(simulation, loading, most):
    while loading.index == 0:
        if simulation.state.num_steps == most:
            found = ", ".join(f"{stress:.3g}" for stress in loading.apparatus.gauges.mean_stress())
            raise InputError(
                f"stresses after {most} steps in a membrane = {found} Pa, expected them near 20 kPa"
            )
        _step(simulation, loading)


def _in_place(simulation, size):
    """The grains of a sample where they are now, `Grains` with elements of that size [m]."""
    from ...geometry.grains import Grains

    simulation.complete()
    m, bodies = simulation.mesh, []
    for grain in range(m.num_sample_grains):
        nodes, cells = np.unique(
            m.cells[slice(*m.cell_offset[grain : grain + 2])], return_inverse=True
        )
        bodies.append((simulation.state.x[nodes], cells.reshape(-1, 4)))
    return Grains.from_list(m.labels[: m.num_sample_grains], bodies, size)


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
    for of in ("steps", "stress"):
        results[f"{of}_loaded"] = {"computed": found["loaded"][of]}
    for name, one in (("with", cell), ("without", cylinder)):
        results[f"step_s_{name}"] = {"computed": statistics.median(one["seconds"])}
        for of in ("time_step", "num_contacts", "searches"):
            results[f"{of}_{name}"] = {"computed": one[of]}
    results["with_over_without"] = row(part, TARGET, part <= TARGET)
    return {
        "case": "membrane", "parameters": parameters, "results": results, "passed": part <= TARGET
    }  # fmt: skip
