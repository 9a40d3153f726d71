"""What Python may give to public names: numbers of any kind count, nonsense is told in a line."""

import numpy as np
import pytest

import mufe_fenicsx as mufe
from mufe_fenicsx.contact.laws import kinetic_of
from mufe_fenicsx.state import ForceTerm

from mpi4py import MPI  # isort: skip  (after the package, which may bring MPI)

UP = np.array([0.0, 0.0, 1.0])
GLASS = mufe.Elastic(70e9, 0.22, 2500.0)
CUBE = mufe.box((1e-3, 1e-3, 1e-3), (1, 1, 1))
POINTS, CELLS = CUBE


def wall(**given):
    return mufe.Wall(**({"name": "w", "point": np.zeros(3), "normal": UP} | given))


def tool(**given):
    return mufe.Tool(**({"name": "t", "points": POINTS, "cells": CELLS} | given))


def build(bodies=(CUBE,), material=GLASS, low=(0, 0, 0), high=(1e-3, 1e-3, 1e-3), **given):
    return mufe.build(given.pop("comm", MPI.COMM_SELF), bodies, material, low, high, **given)


@pytest.fixture(scope="module")
def cube():
    return build()


#: A call with a simulation of one cube, and the beginning of what is said.
NONSENSE = [
    (lambda s: wall(target=np.nan, speed=1.0), "target of wall w = nan, expected a finite number"),
    (lambda s: wall(target=0, speed=1), "target of wall w = 0.0, expected > 0 N"),
    (lambda s: wall(name=UP), "name of wall"),
    (lambda s: wall(point=[10**400, 0, 0]), "point of wall w = [a number of 400 digits, 0, 0]"),
    (lambda s: wall(friction=10**400), "friction of wall w = a number of 400 digits, expected a"),
    (lambda s: wall(friction=UP), "friction of wall w = [0. 0. 1.], expected a finite number"),
    (lambda s: wall(friction=True), "friction of wall w"),
    (lambda s: wall(velocity=[0, 0, 1e300]), "velocity of wall w = [0, 0, 1e+300], expected fin"),
    (lambda s: wall(mirror=3), "mirror of wall w = 3, expected True or False"),
    (lambda s: wall(bonded="x"), 'bonded of wall w = "x", expected True or False or a list'),
    (lambda s: tool(name=3), "name of tool 3 = 3, expected a text"),
    (lambda s: tool(cells=None), "shapes of tool t = (8, 3) and (), expected a pair of nodes"),
    (lambda s: tool(velocity="x"), 'velocity of tool t = "x", expected a list'),
    (lambda s: tool(path=3), "path of tool t = 3, expected a ToolPath"),
    (lambda s: mufe.ToolPath(3, 4), "time of a path = 3, expected finite numbers of shape (1,)"),
    (lambda s: build(()), "bodies = [], expected a list of pairs"),
    (lambda s: build([1, 2]), "body 1 = 1, expected a pair of nodes"),
    (lambda s: build([(POINTS, CELLS + 1)]), "node of a tetrahedron of body 1 = 8, expected 0 to"),
    (lambda s: build([(POINTS, CELLS * 1.0)]), "tetrahedra of body 1 = 6 of float64, expected wh"),
    (lambda s: build([(POINTS * np.nan, CELLS)]), "nodes of body 1 = array of shape (8, 3), 24"),
    (lambda s: build(material="steel"), 'material = "steel", expected a'),
    (lambda s: build(material=[GLASS] * 2), "materials = 2, expected one, or one of each body"),
    (lambda s: build(comm=None), "comm = None, expected an Intracomm"),
    (lambda s: build(walls=[3]), "wall = 3, expected a Wall"),
    (lambda s: build(tools=[3]), "tool = 3, expected a Tool"),
    (lambda s: build(velocity=3), "velocity = 3, expected a function"),
    (lambda s: build(axes=5), "axes = 5, expected a text"),
    (lambda s: build(wall_friction=3), "wall_friction = 3, expected a table by names"),
    (lambda s: build(friction="x"), 'friction = "x", expected a finite number'),
    (lambda s: build(time_step_factor=2), "time_step_factor = 2.0, expected > 0 and <= 1"),
    (lambda s: build(refresh=1.5), "refresh = 1.5, expected a whole number"),
    (lambda s: build(compliance=1e-300), "compliance = 1e-300, expected > 0, from 1e-12"),
    (lambda s: build(element=np.zeros((2, 3))), "element = [["),
    (lambda s: build(increment=np.nan), "increment = nan, expected a finite number"),
    (lambda s: mufe.drive(s, {"z_max": [0, 0, np.nan]}, 1e-6), "move of wall z_max = [0, 0, nan]"),
    (lambda s: mufe.drive(s, {"z_max": UP}, 0), "duration = 0.0, expected > 0 s"),
    (lambda s: mufe.drive(s, [1], 1e-6), "moves = [1], expected a table by names"),
    (lambda s: mufe.settle(s, "x"), 'ratio = "x", expected a finite number'),
    (lambda s: mufe.settle(None, 1), "simulation = None, expected a Simulation or an Implicit"),
    (lambda s: mufe.Pressure(None, 1e4), "mesh = None, expected a GrainMesh"),
    (lambda s: mufe.Pressure(s.mesh, 1e4, where=3), "where = 3, expected a function"),
    (
        lambda s: mufe.Pressure(s.mesh, 1e4, where=lambda c, n: np.ones(len(c))),
        "where of the pressure pressure gives float64 of shape (12,), expected true or false",
    ),
    (lambda s: mufe.Pressure(s.mesh, 1e4, labels=3), "labels = 3, expected a list"),
    (lambda s: mufe.Membrane(None, 7), "simulation = None, expected one such as of build"),
    (lambda s: mufe.run_scene("scene.toml", "a", "b", MPI.COMM_SELF), 'scene = "scene.toml", exp'),
    (lambda s: mufe.Elastic("a", 0.2, 1), 'E = "a", expected a finite number'),
    (lambda s: mufe.J2(1e9, 0.2, 2500, 3), "yield_stress = 3, expected a list"),
    (lambda s: mufe.J2(1e9, 0.2, 2500, [[0, "a"]]), 'yield_stress[0][1] = "a", expected a finite'),
    (lambda s: mufe.box((1, 1), (1, 1, 1)), "lengths of box = [1.0, 1.0], expected finite num"),
    (
        lambda s: mufe.box((1, 1, 1), (1, 1, 10**12)),
        "divisions of box = 1e+12, expected 1e-12 to",
    ),
    (lambda s: mufe.sphere("a", 1), 'radius = "a", expected a finite number'),
    (lambda s: mufe.load_scene(3), "path = 3, expected a text or a path"),
    (lambda s: mufe.save_grains("x", 3), "grains = 3, expected a Grains"),
    (lambda s: s.add_term(None), "force term = None, expected a state.ForceTerm"),
]


@pytest.mark.parametrize(("call", "said"), NONSENSE, ids=range(len(NONSENSE)))
def test_nonsense_is_told_in_a_line(cube, call, said):
    """Argument, value and what was expected; nothing of the inside."""
    with pytest.raises(mufe.InputError) as error:
        call(cube)
    assert str(error.value).startswith(said) and len(str(error.value).splitlines()) == 1


def test_whole_numbers_count_as_fractions():
    """Kernels read doubles: friction of 1 on a wall is that of 1.0, and of 0 that of 0.0."""
    for friction in (0, 1, np.int32(1), np.float32(1)):
        s = build(walls=[wall(friction=friction, velocity=[0, 0, 0])])
        for of_walls in (s.walls.friction, s.walls.friction_kinetic):
            assert of_walls.dtype == float and of_walls[-1] == float(friction)
    assert type(kinetic_of(1, None, "")) is float
    solid = mufe.Elastic(70 * 10**9, 0, 2500)
    assert [type(x) for x in (solid.E, solid.nu, solid.rho)] == [float] * 3
    body = tool(friction=1, density=10, velocity=[0, 0, 1])
    assert [type(x) for x in (body.friction, body.density, *body.velocity)] == [float] * 5


def test_a_term_for_another_mesh_is_refused(cube):
    """Its nodes are others: they would be written out of bounds."""
    fine = build([mufe.box((1e-3, 1e-3, 1e-3), (4, 4, 4))])
    for mesh in (fine.mesh, build().mesh):  # of as many nodes, too
        before = cube.specimen.f.copy()
        with pytest.raises(mufe.InputError, match="is made for another mesh"):
            cube.add_term(mufe.Pressure(mesh, 1e4))
        assert np.array_equal(cube.specimen.f, before) and not cube.specimen.added_terms


class Broken(ForceTerm):
    name = "mine"

    def __init__(self, **doing):
        self.doing = doing

    def add_forces(self, f, state, dt):
        f += self.doing.get("force", 0.0)

    def stiffness(self, state):
        return self.doing.get("stiffness")


@pytest.mark.parametrize(
    "doing",
    [
        {"force": np.ones((5, 3))},
        {"force": np.nan},
        {"stiffness": ([0, 99], [0, 1], np.zeros((2, 3, 3)))},
        {"stiffness": ([0], [0], np.zeros((1, 3)))},
        {"stiffness": 3},
    ],
)
def test_a_term_that_fails_is_named(cube, doing):
    """And left out: the simulation goes on without it."""
    with pytest.raises(mufe.InputError, match=r"^force term mine "):
        cube.add_term(Broken(**doing))
    cube.step()
    assert np.isfinite(cube.specimen.f).all() and not cube.specimen.added_terms


def test_a_term_that_fails_in_a_step_is_named():
    """The error is that of the user's own line; the note says whose it is."""
    simulation, doing = build(), {}
    simulation.add_term(Broken(**doing))
    simulation.specimen.added_terms[0].doing["force"] = "none"
    with pytest.raises(Exception) as caught:
        simulation.step()
    assert any("force term mine (Broken) fails" in note for note in caught.value.__notes__)
