"""What one rank finds wrong is raised by all ranks, wherever it is found, and none waits for ever.

What is refused, and in which words, is tested beside each part, on one rank.
"""

import mufe_fenicsx  # noqa: F401, before dolfinx: it loads MPI

# isort: split
import contextlib
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple
from unittest.mock import patch

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.bulk.cracks.cracks import Cracks
from mufe_fenicsx.bulk.far_nodes import FarNodes
from mufe_fenicsx.bulk.tools import Tool, tool_solids
from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.errors import InputError, UnstableError
from mufe_fenicsx.explicit.simulation import Simulation
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.geometry.grains import Grains, save_grains
from mufe_fenicsx.loading.pressure import Pressure
from mufe_fenicsx.machine.files import append_line
from mufe_fenicsx.machine.ranks import on_first_rank
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.materials.fracture import Fracture
from mufe_fenicsx.mesh import create_grain_mesh
from mufe_fenicsx.output import checkpoint, run_folder
from mufe_fenicsx.output.contacts import ContactWriter
from mufe_fenicsx.output.fields import FieldWriter
from mufe_fenicsx.output.history import HistoryWriter
from mufe_fenicsx.output.run_lock import LostFolder, RunLock
from mufe_fenicsx.output.tools import ToolWriter
from mufe_fenicsx.planning.run import make_plan, plan_within, present
from mufe_fenicsx.run import from_scene, resume_check, scene_file, scene_tools
from mufe_fenicsx.run.from_bodies import build
from mufe_fenicsx.run.report import draw_report
from mufe_fenicsx.run.run import run_scene
from mufe_fenicsx.run.snapshot import restore_mesh
from mufe_fenicsx.scene import load_scene
from mufe_fenicsx.state import ForceTerm
from tests.bodies import simulation_of
from tests.ranks import failing, on_first, refused, sites

COMM = MPI.COMM_WORLD
FIRST, LAST = 0, COMM.size - 1
ROCK = Elastic(1e9, 0.2, 2500.0)
WRONG = "something is wrong here"
#: What functions of the package raise or return where they fail.
ERROR, FULL = InputError(WRONG), OSError(28, WRONG)

SCENE = """
[material]
model = "elastic"
E = "1 GPa"
nu = 0.2
rho = 2500
[contact]
friction = 0.3
[loading]
speed = "1 m/s"
[[stage]]
until = { time = "1 us" }
[output]
fields = 2
history = 3
"""


def cube(number, divisions=1):
    """Points and cells of the grain of a rank."""
    return box((1e-3,) * 3, (divisions,) * 3, (3e-3 * number, 0.0, 0.0))


def cubes(change=None, tools=()):
    """A mesh with one cube a rank, and tools on the last one; ``change(points)`` of its cube."""
    points, cells = cube(COMM.rank)
    grain, ranks = np.full(len(cells), COMM.rank), list(range(COMM.size))
    if change is not None and COMM.rank == LAST:
        points = change(points)
    for number, tool in enumerate(tools, start=COMM.size):
        ranks.append(LAST)
        if COMM.rank == LAST:
            cells = np.vstack([cells, tool.cells + len(points)])
            points = np.vstack([points, tool.points])
            grain = np.append(grain, np.full(len(tool.cells), number))
    labels = np.arange(1, len(ranks) + 1)
    names = [tool.name for tool in tools]
    return create_grain_mesh(
        COMM, points, cells, grain, labels, np.array(ranks, dtype=np.int32), tools=names
    )


def lid():
    return Tool("lid", *box((1e-3,) * 3, (1, 1, 1), (0.0, 0.0, 3e-3)))


class Lost(ForceTerm):
    """A force that is not finite on the last rank."""

    name = "lost"

    def add_forces(self, f, state, dt):
        f[:] = np.nan if COMM.rank == LAST else 0.0


def unknown_on_the_last(*_):
    """A user's own function that knows nothing of what the last rank has."""
    if COMM.rank == LAST:
        raise LookupError("not here")
    return 0.0


class Soft(Elastic):
    """Carries no contact."""

    contact_modulus = 0.0


def far_nodes(grain, number):
    """A node that the last rank asks for."""
    wanted = ([grain], [number]) if COMM.rank == LAST else ([], [])
    return FarNodes(cubes(), *wanted)


def wall_at(x):
    """A plane across the row of cubes."""
    return Wall("right", np.array([x, 0.0, 0.0]), np.array([-1.0, 0.0, 0.0]))


def glued_walls():
    """Planes below all cubes and beside the last one, which is on both along an edge."""
    beside = 3e-3 * LAST + 1e-3
    return [
        Wall("low", np.zeros(3), np.eye(3)[2], bonded=True),
        Wall("right", np.array([beside, 0.0, 0.0]), -np.eye(3)[0], bonded=True),
    ]


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    """A folder that all ranks share: a scene, its grains, one a rank, and a run that stopped."""

    def made():
        path = tmp_path_factory.mktemp("refusals")
        bodies = [cube(number) for number in range(COMM.size)]
        save_grains(path / "grains", Grains.from_list(range(1, COMM.size + 1), bodies, 1e-3))
        (path / "scene.toml").write_text(SCENE)
        return path

    path = on_first(COMM, made)
    run(path, "stopped")
    return path


@pytest.fixture
def folder(tmp_path):
    """A new folder of all ranks."""
    return COMM.bcast(tmp_path)


def run(shared, name, **options):
    scene = load_scene(shared / "scene.toml")
    return run_scene(
        scene, shared / "grains", shared / name, COMM, quiet=True, max_steps=1, **options
    )


# --- one case for each place ----------------------------------------------------------------------


def states(folder, **options):
    """A writer of the states of one tetrahedron a rank."""
    return FieldWriter(COMM, folder, np.eye(4)[:, :3], np.arange(4)[None], np.array([1]), **options)


def write_state(folder, **options):
    states(folder, **options).write(0, 0.0, 0.0, "loading", {}, {"pressure": np.zeros(1)})


#: What a rank has of its own in a checkpoint.
OWN = {"damped": np.zeros(1)}


def write_checkpoint(folder):
    ranks = list(range(COMM.size))
    tables = {"nodes": {"grain": np.array([COMM.rank])}}
    checkpoint.CheckpointWriter(COMM, folder).write(1, tables, OWN, {"written_by": ranks})


def read_checkpoint(folder):
    write_checkpoint(folder)
    found = checkpoint.find_checkpoint(COMM, folder)
    checkpoint.read_tables(COMM, found, np.array([COMM.rank]), np.arange(COMM.size))


def remove_checkpoints(folder):
    write_checkpoint(folder)
    checkpoint.CheckpointWriter(COMM, folder).remove_after(None)


def on_the_first_ranks(centre, normal):
    """All facets; what the last rank has is not known."""
    unknown_on_the_last()
    return np.ones(len(centre), dtype=bool)


def moving_cubes(_):
    """A cube a rank with velocities that the last rank cannot tell."""
    bodies = [cube(number) for number in range(COMM.size)]
    return build(COMM, bodies, ROCK, np.zeros(3), np.ones(3), "", velocity=unknown_on_the_last)


def plan_in_time(_):
    """The plan within a time, as if its steps were measured."""
    names = {"make_plan": (None, None), "follow": None, "benchmark": None}
    with contextlib.ExitStack() as stack:
        for name, value in names.items():
            stack.enter_context(patch(f"mufe_fenicsx.planning.run.{name}", return_value=value))
        plan_within(None, None, COMM, 1.0)


def write_tools(folder):
    writer, mesh = ToolWriter(cubes(tools=[lid()]), folder), cubes(tools=[lid()])
    writer.write(0, 0.0, mesh.x, np.zeros((1, 6)))


def tool_without_a_file(folder):
    table = SimpleNamespace(name="lid", surface=folder / "none", path=None)
    scene_tools.checksums_of_files(COMM, SimpleNamespace(tools=[table]))


def opened_elsewhere(_):
    """A facet of the last rank's checkpoint between cells that there are not."""
    here = np.full(int(COMM.rank == LAST), 10**6)
    columns = {"grain": 0 * here + LAST, "cell": here, "across": here, "version": here}
    mesh = cubes()
    nodes = mesh.named_nodes
    nodes = {"grain": mesh.grains[mesh.grain_of_node[nodes]], "reference": mesh.x[nodes]}
    restore_mesh(mesh, {"nodes": nodes, "topology": columns})


def create_folder(folder, name="run"):
    run_folder.create_run_folder(COMM, folder / name, RunLock(COMM, folder / name))


def below_a_file(folder):
    (folder / "file").write_text("")
    create_folder(folder, "file/run")


def check_origin(folder):
    """Of a scene with another coefficient."""
    old, new = ("[solver]\n[contact]\nfriction = 0.3\n" for _ in range(2))
    new = new.replace("0.3", "0.4")
    kinds = {str: "", dict: {}, list: []}
    header = {name: kinds.get(kind, 0) for name, kind in resume_check.ENTRIES.items()}
    header |= {"scene": old, "separation": None}
    found = checkpoint.Checkpoint(folder, COMM.size, header)
    resume_check.check_origin(COMM, found, {"scene": new}, folder, True)


def check_results(folder):
    found = checkpoint.Checkpoint(folder, COMM.size, {"recorder": {}})
    resume_check.check_results(COMM, found, folder, False, True)


def new_run(shared):
    run(shared, f"run-{len(list(shared.iterdir()))}")


def resumed_run(shared):
    run(shared, "stopped", resume=True)


class Case(NamedTuple):
    """What one rank alone cannot do, and what all do meanwhile."""

    rank: int
    action: Callable[[Path], object]  #: of a folder
    fails: str = ""  #: function of the package that fails on that rank; else the action does
    how: object = None  #: what it raises or returns
    says: str = WRONG
    before: int = 0  #: number of calls of the function that go well before


#: Where all ranks raise what one of them found -> a case.
CASES = {
    "bulk/solid.py _compile_once": Case(
        FIRST, lambda _: simulation_of(cubes(), ROCK), "bulk.solid.load", ERROR),
    "bulk/tools.py tool_solids": Case(
        LAST, lambda _: tool_solids(COMM, cubes(), [lid()] if COMM.rank == LAST else [], [ROCK]),
        says="tools = lid, expected"),
    "loading/pressure.py Pressure.__init__": Case(
        LAST, lambda _: Pressure(cubes(), 1e4, where=on_the_first_ranks), says="where of the pr"),
    "loading/stages.py StagedLoading._read_motions": Case(
        FIRST, new_run, "loading.stages.read_motions", ERROR),
    "mesh.py _check_bodies": Case(
        LAST, lambda _: cubes(), "mesh.body_defect", WRONG),
    "mesh.py _check_elements": Case(
        LAST, lambda _: cubes(lambda x: x * [1, 1, 0]), says="volume of an element of grain"),
    "mesh.py GrainMesh.grow": Case(
        LAST, lambda _: cubes().grow([[0, 0]] if COMM.rank == LAST else []), says="facet to open"),
    "explicit/growth.py grown_mesh": Case(
        LAST, lambda _: simulation_of(cubes(), ROCK).grow([]),
        "explicit.growth.what_cannot_grow", WRONG),
    "run/snapshot.py restore_mesh": Case(LAST, opened_elsewhere, says="a facet that opened is"),
    "output/checkpoint.py CheckpointWriter.write 1": Case(
        FIRST, write_checkpoint, "output.checkpoint._new_folder", FULL),
    "output/checkpoint.py CheckpointWriter.write 2": Case(
        LAST, write_checkpoint, "output.checkpoint._write_tables", FULL),
    "output/checkpoint.py CheckpointWriter.write 3": Case(
        FIRST, write_checkpoint, "output.checkpoint.CheckpointWriter._finish", FULL),
    "output/checkpoint.py CheckpointWriter.remove_after": Case(
        FIRST, remove_checkpoints, "output.checkpoint._remove", FULL),
    "output/checkpoint.py find_checkpoint": Case(
        FIRST, lambda folder: checkpoint.find_checkpoint(COMM, folder), says="no checkpoint in"),
    "output/checkpoint.py read_tables": Case(
        LAST, read_checkpoint, "output.checkpoint._read_part", FULL),
    "output/contacts.py ContactWriter.__init__": Case(
        FIRST, lambda folder: ContactWriter(COMM, folder),
        "output.contacts.remove_states_after", WRONG),
    "output/contacts.py ContactWriter._on_first_rank": Case(
        FIRST, lambda folder: ContactWriter(COMM, folder).write(0, 0.0, None),
        "output.contacts.ContactWriter._write", FULL),
    "output/fields.py FieldWriter.__init__ 1": Case(
        FIRST, lambda folder: states(folder, kept={"mesh": "mesh.h5", "states": []}),
        "output.fields.remove_states_after", WRONG),
    "output/fields.py FieldWriter.__init__ 2": Case(
        FIRST, lambda folder: states(folder / "none"), says="fields cannot be created"),
    "output/fields.py FieldWriter.write": Case(
        FIRST, write_state, "output.fields.write_atomically", ERROR),
    "output/fields.py FieldWriter._write_file": Case(
        LAST, write_state, "output.fields._wrong_shape", WRONG),
    "output/fields.py FieldWriter._raise_together": Case(
        LAST, write_state, "output.fields._write_rows", FULL),
    "output/history.py HistoryWriter._together": Case(
        FIRST, lambda folder: HistoryWriter(folder / "none" / "history.csv", comm=COMM),
        says="none/history.csv cannot be written"),
    "machine/files.py append_line": Case(
        FIRST, lambda folder: append_line(COMM, folder / "none" / "log", "line"),
        says="none/log cannot be written"),
    "output/run_folder.py check_run_folder": Case(
        FIRST, create_folder, "output.run_folder._obstacle", WRONG),
    "output/run_folder.py create_run_folder 1": Case(
        FIRST, below_a_file, "output.run_folder._obstacle", None, "run cannot be created"),
    "output/run_folder.py create_run_folder 2": Case(
        FIRST, create_folder, "output.run_folder._prepare", WRONG),
    "machine/ranks.py on_first_rank": Case(
        FIRST,
        lambda folder: on_first_rank(COMM, lambda: run_folder.check_inside(folder)),
        "output.run_folder.check_inside", ERROR),
    "output/run_lock.py RunLock.look": Case(
        FIRST, lambda folder: RunLock(COMM, folder).look(), "output.run_lock.free_to_write", WRONG),
    "output/run_lock.py RunLock.take": Case(
        FIRST, lambda folder: RunLock(COMM, folder).take(),
        "output.run_lock.RunLock._acquire", FULL),
    "output/tools.py ToolWriter.__init__": Case(
        FIRST, write_tools, "output.tools.remove_states_after", WRONG),
    "output/tools.py ToolWriter.write": Case(
        FIRST, write_tools, "output.tools.ToolWriter._write", FULL),
    "planning/run.py make_plan": Case(
        FIRST, lambda _: make_plan(None, None, COMM), "planning.run.read_sample", ERROR),
    "planning/run.py plan_within": Case(FIRST, plan_in_time, "planning.run.read_sample", ERROR),
    "planning/run.py present": Case(
        FIRST, lambda _: present(None, None, COMM), "planning.run.read_sample", ERROR),
    "run/scene_file.py read_scene": Case(
        FIRST, lambda folder: scene_file.read_scene(COMM, folder / "none.toml"), says="none.toml"),
    "run/from_bodies.py _velocities": Case(
        LAST, moving_cubes, says="velocity.*LookupError: not here"),
    "run/from_scene.py load_mesh": Case(
        FIRST, lambda folder: from_scene.load_mesh(COMM, folder / "none"), says="none"),
    "run/from_scene.py _together": Case(LAST, new_run, "run.from_scene.load_grains", ERROR),
    "run/judgement.py judged": Case(FIRST, new_run, "run.judgement.read_history", ERROR),
    "run/recorder.py Recorder._note": Case(FIRST, new_run, "output.record.ResultRecord.add", ERROR),
    "run/report.py draw_report": Case(
        FIRST, lambda folder: draw_report(COMM, folder, True), "report.write_report", ERROR),
    "run/resume_check.py grains_checksum": Case(
        FIRST, lambda folder: resume_check.grains_checksum(COMM, folder / "none"), says="none"),
    "run/resume_check.py check_origin": Case(
        FIRST, check_origin, says="contact.friction = 0.4, was 0.3"),
    "run/resume_check.py check_results": Case(
        FIRST, check_results, "run.resume_check.lost_results", ([WRONG], 0.1, None)),
    "run/preparation.py find_start": Case(
        FIRST, resumed_run, "run.preparation.check_inside", ERROR),
    "run/restart.py restore_test": Case(LAST, resumed_run, "run.restart.wrong_number", WRONG),
    "run/run.py TestRun.run": Case(FIRST, new_run, "run.run.write_run_json", ERROR),
    "output/checkpoint.py CheckpointWriter.check_room": Case(
        FIRST, new_run, "output.checkpoint._free_room", ERROR),
    "run/run.py TestRun._end": Case(FIRST, new_run, "run.run.write_run_json", ERROR, before=1),
    "run/run_place.py RunPlace.open": Case(
        FIRST, new_run, "run.run_place.RunPlace._write_inputs", ERROR),
    "run/run_place.py RunPlace.failed_grains": Case(
        FIRST, new_run, "run.run_place._failed_grains", ERROR),
    "run/scene_tools.py make_tools": Case(FIRST, new_run, "run.scene_tools.read_tools", ERROR),
    "run/scene_tools.py checksums_of_files": Case(
        FIRST, tool_without_a_file, says="tool lid: .*none"),
    "bulk/cracks/cracks.py Cracks.__init__": Case(
        LAST, lambda _: Cracks(simulation_of(cubes(), ROCK).specimen, Fracture(1e6, 1.0)),
        "bulk.cracks.cracks._what_cannot_break", WRONG),
    "bulk/far_nodes.py FarNodes._ranks": Case(
        LAST, lambda _: far_nodes(9, 0), says="node 0 of grain 9, expected"),
    "bulk/far_nodes.py FarNodes.__init__": Case(
        LAST, lambda _: far_nodes(0, 10**6), says="node 1000000 of grain 0, expected"),
    "specimen.py Specimen.__init__": Case(
        LAST, lambda _: simulation_of(cubes(), ROCK), "specimen._what_is_wrong", WRONG),
    "specimen.py Specimen.add_term": Case(
        LAST, lambda _: simulation_of(cubes(), ROCK).add_term(Lost()),
        says="force term lost adds forces that are not finite"),
}  # fmt: skip


def test_each_place_that_raises_together_has_a_case():
    assert sorted(sites()) == sorted(CASES)


@pytest.mark.mpi
@pytest.mark.parametrize("name", CASES)
def test_what_one_rank_cannot_do_is_refused_by_all(name, folder, request, monkeypatch):
    """The same error, from the same place: not from one that the others come to later."""
    case = CASES[name]
    if case.action in (new_run, resumed_run):
        folder = request.getfixturevalue("shared")
    if case.fails:
        function = f"mufe_fenicsx.{case.fails}"
        failing(monkeypatch, function, case.how, case.rank, COMM, case.before)
    traceback = refused(COMM, lambda: case.action(folder), InputError, case.says)
    assert sites()[name].is_in(traceback)


# --- what ranks agree on in other ways ------------------------------------------------------------


def fast(s, velocity):
    """One node of the last rank gets a velocity."""
    if COMM.rank == LAST:
        s.state.v[0] = velocity
    for _ in range(200):
        s.step()


#: What is wrong on one rank -> the error, what it says and how it comes about.
GRAIN = LAST + 1
OTHERS = {
    "soft": (
        InputError, f"contact modulus of grain {GRAIN} = 0.0 Pa",
        lambda: Simulation(cubes(), [Soft(1e9, 0.2, 2500.0) if COMM.rank == LAST else ROCK])),
    "behind a wall": (
        InputError, "wall right is 0.002 m inside the sample",
        lambda: simulation_of(cubes(), ROCK, [wall_at(3e-3 * LAST - 1e-3)])),
    "glued twice": (
        InputError, "nodes glued to two bonded walls = 2",
        lambda: simulation_of(cubes(), ROCK, glued_walls())),
    "a folder that is gone": (
        LostFolder, "is gone, deleted or moved", lambda: RunLock(COMM, "/nowhere").check()),
    "inside out": (
        UnstableError, f"element of grain {GRAIN} .*lost its volume",
        lambda: fast(simulation_of(cubes(), ROCK), [3e3, 3e3, 3e3])),
}  # fmt: skip


@pytest.mark.mpi
@pytest.mark.parametrize("what", OTHERS)
def test_what_is_wrong_on_one_rank_is_said_by_all(what):
    kind, message, action = OTHERS[what]
    refused(COMM, action, kind, message)
