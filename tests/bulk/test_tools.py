"""Tools: told motion, loads that they hold, free turns, contact with grains alone."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.bulk.tools import Tool, ToolPath
from mufe_fenicsx.contact.laws import COMPLIANCE, edge_of_area
from mufe_fenicsx.contact.walls import Wall, rotation_of
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.run.from_bodies import build
from mufe_fenicsx.scene.stages import ToolMotion
from tests.bodies import cylinder, sphere

COMM = MPI.COMM_WORLD
ROCK = Elastic(1e9, 0.2, 2500.0)
EDGE = 1e-3
#: Mass of a plate, and its body: it stands on blocks.
SIZE = np.array([2.4e-3, 1.2e-3, 0.4e-3])
PLATE = box(SIZE, (1, 1, 1), (-0.1e-3, -0.1e-3, EDGE))
DENSITY = 8000.0
FLOOR = Wall("floor", np.zeros(3), np.eye(3)[2], friction=0.9)


def blocks(comm, tools, walls=(FLOOR,), **options):
    """Two elastic cubes beside each other on a rough floor, and tools."""
    points, cells = box((EDGE, EDGE, EDGE), (2, 2, 2))
    bodies = [(points, cells), (points + np.array([1.2 * EDGE, 0, 0]), cells)]
    return build(
        comm, bodies, ROCK, (0, 0, 0), (EDGE, EDGE, EDGE), "", walls=walls, tools=tools, **options
    )


def far(tool):
    """The body of a tool away from all grains."""
    return tool[0] + np.array([0.0, 0.0, 5 * EDGE]), tool[1]


def test_told_motion_is_followed_about_a_point():
    """V and ω about a point off the body; the splitting of turns is off by (ω Δt)² alone."""
    point, velocity, omega = (
        np.array([0.0, 0, 6e-3]),
        np.array([1.0, 2, 3]),
        np.array([50.0, 0, 400]),
    )
    s = blocks(
        COMM, [Tool("arm", *far(PLATE), velocity=velocity, angular_velocity=omega, point=point)]
    )
    for _ in range(30):
        s.step()
    t = s.state.t
    place = s.tools.places()[0]
    assert np.allclose(place[:3], velocity * t, rtol=1e-12)
    assert np.allclose(place[3:], omega * t, rtol=1e-6)
    mesh, s.state.x[:] = s.mesh, s.state.x
    own = mesh.is_tool[mesh.grain_of_node]
    wanted = (mesh.x[own] - point) @ rotation_of(omega * t).T + point + velocity * t
    assert np.allclose(s.state.x[own], wanted, rtol=0, atol=1e-9 * EDGE)
    arms = mesh.x[own] - point
    speeds = velocity + np.cross(omega, arms @ rotation_of(omega * t).T)
    assert np.allclose(s.state.v[own], speeds, rtol=0, atol=1e-5)
    energies = s.energies()
    assert abs(energies["work"]) < 1e-20 and energies["kinetic"] < 1e-15


def test_what_a_stage_leaves_out_of_a_tool_goes_on():
    """A turn had ended where the next stage gave a velocity, a force where it gave a torque."""
    free = ("x", "y", "z", "rx", "ry", "rz")
    s = blocks(
        MPI.COMM_SELF,
        [
            Tool("led", *far(PLATE), angular_velocity=(0, 0, 4)),
            Tool("free", *far(far(PLATE)), free=free, force=(0, 0, 2)),
        ],
    )
    nothing, ramp = ToolMotion(), 1e-6
    led, loose = np.argsort(s.tools.numbers)
    stages = [
        {"led": ToolMotion((1, 2, 3)), "free": ToolMotion(torque=(0, 0, 1e-6))},
        {"led": ToolMotion(angular_velocity=(0, 0, 5), ramp=ramp), "free": nothing},
        {"led": ToolMotion(velocity=(2, 2, 2)), "free": ToolMotion(force=(0, 1, 0))},
    ]
    for k, stage in enumerate(stages):  # each lasts for half of the ramp
        for name, motion in stage.items():
            s.tools.set_motion(name, 0.5 * k * ramp, motion.rates, motion.loads, motion.ramp)
        s.tools._follow_change(0.5 * (k + 1) * ramp, 0.0)
    # The turn began to change with the second stage; half of its ramp is over with the third.
    s.tools._follow_change(ramp, 0.0)
    assert s.tools.rates[led].tolist() == [1, 2, 3, 0, 0, pytest.approx(4.5)]
    s.tools._follow_change(2 * ramp, 0.0)
    assert s.tools.rates[led].tolist() == [2, 2, 2, 0, 0, 5]
    assert s.tools._applied_next[loose].tolist() == [0, 1, 0, 0, 0, 1e-6]


def test_a_path_ends_where_it_says():
    """Straight lines between rows, rest before and after; no step ends on a row."""
    end = np.array([1e-5, 0, -2e-5, 0.0, 0.2, 0.1])
    path = ToolPath([1e-7, 2e-6, 3e-6], [np.zeros(6), 0.25 * end, end])
    s = blocks(MPI.COMM_SELF, [Tool("arm", *far(PLATE), path=path)])
    while s.state.t < 4e-6:
        s.step()
        place, wanted = s.tools.places()[0], path.at(s.state.t)
        assert np.allclose(place[:3], wanted[:3], rtol=0, atol=1e-15)
        assert np.allclose(place[3:], wanted[3:], rtol=0, atol=1e-6)  # (ω Δt)³ of this step
    assert s.rigid.velocity[-1].tolist() == [0, 0, 0]


def test_a_dead_load_is_carried_and_its_work_counted():
    """A plate that is free along z lies down on both cubes and presses them with its load."""
    load, mass = 20.0, DENSITY * SIZE.prod()
    plate = Tool("plate", *PLATE, free=("z",), force=(0, 0, -load), density=DENSITY)
    s = blocks(COMM, [plate], damping=2e5)
    first = s.tools.rows.size and s.rigid.force[s.tools.rows[0]].copy()
    assert s.comm.allreduce(float(np.sum(first))) == pytest.approx(-load)
    s.step()
    assert s.comm.allreduce(float(s.rigid.velocity[:, 2].sum())) < -0.4 * load / mass * s.dt
    while s.state.t < 1.1e-4:
        s.step()
    energies = s.energies()
    assert s.tools.forces()[0, 2] == pytest.approx(load, rel=1e-2)
    assert s.wall_forces()[0] == pytest.approx(load, rel=1e-2)
    # It meets the cubes under its whole load: contacts that close cost parts of the order of Δt²,
    # 6e-4 here and 2e-4 at half the step.
    assert abs(energies["residual"]) < 1e-3 * energies["work"]
    # Its load did the work, and half of it is stored (the rest is damped).
    way = -s.tools.places()[0, 2]
    assert energies["work"] == pytest.approx(load * way, rel=1e-12)
    assert energies["elastic"] + energies["contact"] == pytest.approx(0.5 * load * way, rel=2e-2)


def test_the_account_of_damping_is_exact():
    """A dead load that begins at once on a body that falls freely, c Δt = 0.04; to rounding."""
    plate = Tool("plate", *far(PLATE), free=("z",), force=(0, 0, -20.0), density=DENSITY)
    s = blocks(MPI.COMM_SELF, [plate], walls=(), damping=2e5)
    s.dt, s.update_time_step = 2e-7, lambda **_: None
    s.contact.set_time_step(s.dt)
    for _ in range(30):
        s.step()
    energies = s.energies()
    assert abs(energies["residual"]) < 1e-13 * energies["work"]


def test_a_free_turn_has_the_moment_about_its_axis():
    """A drum beside its axis: J = m (r²/2 + d²), ω = M t/J; and gravity does nothing to it."""
    radius, height, away, torque = 0.5e-3, 1e-3, 2e-3, 1e-6
    points, cells = cylinder(radius, height, 0.2e-3)
    drum = points + np.array([away, 0, 3e-3]), cells
    point = (0.0, 0.0, 0.0)
    tool = Tool("drum", *drum, free=("rz",), torque=(0, 0, torque), point=point, density=DENSITY)
    s = blocks(MPI.COMM_SELF, [tool], gravity=(0, 0, -9.81))
    for _ in range(40):
        s.step()
    volume = np.linalg.det(np.diff(drum[0][cells], axis=1)).sum() / 6
    moment = DENSITY * abs(volume) * (radius**2 / 2 + away**2)
    # Facets of the drum leave out a part of the circle.
    assert s.rigid.spin[-1, 2] == pytest.approx(torque * s.state.t / moment, rel=3e-3)
    energies = s.energies()
    assert energies["work"] == pytest.approx(torque * s.tools.places()[0, 5], rel=1e-6, abs=0.0)
    moved = s.rigid.kinetic_energy(s.state.dt)
    assert moved == pytest.approx(energies["work"], rel=1e-3, abs=0.0)


def test_tools_meet_neither_walls_nor_each_other():
    """Two tools that cross each other and a wall carry nothing; nodes on a glued floor go along."""
    glued = Wall("floor", np.zeros(3), np.eye(3)[2], bonded=True)
    low = PLATE[0] - np.array([0, 0, EDGE]) + np.array([0, 3e-3, 0]), PLATE[1]
    tools = [
        Tool("one", *low, velocity=(0, 0, -5.0)),
        Tool("two", low[0] + 0.1e-3, low[1], velocity=(0, 0, 5.0)),
    ]
    s = blocks(COMM, tools, walls=(glued,))
    for _ in range(20):
        s.step()
    assert not s.tools.forces().any() and not s.wall_forces().any()
    assert np.allclose(s.tools.places()[:, 2], [-5.0 * s.state.t, 5.0 * s.state.t])
    assert s.num_active_grains() == 0 and s.mean_active_contacts() == 0


@pytest.mark.parametrize("increment", [None, 1e-3], ids=["steps", "increments"])
def test_friction_of_a_tool_is_its_own(increment):
    """A plate presses, then drags with its own coefficient, not with that of the grains."""
    mu, down = 0.3, 4e-7
    seconds = 1e-2 if increment else 2e-5
    path = ToolPath(
        np.array([0, 0.3, 1.0]) * seconds,
        [np.zeros(6), [0, 0, -down, 0, 0, 0], [2 * down, 0, -down, 0, 0, 0]],
    )
    plate = Tool("plate", *PLATE, path=path, friction=mu)
    s = blocks(COMM, [plate], friction=0.8, increment=increment, damping=0 if increment else 2e5)
    while s.state.t < seconds:
        s.step()
    force = s.tools.forces()[0]
    assert force[2] > 0.5
    assert -force[0] == pytest.approx(mu * force[2], rel=2e-2 if increment is None else 1e-3)
    walls, _ = s.walls.loads(s.comm)
    if increment:  # at rest: what the tool brings, the floor carries
        assert np.allclose(walls[0] + force[:3], 0, atol=2e-3 * force[2])
    energies = s.energies()
    assert abs(energies["residual"]) < (3e-3 if increment is None else 2e-2) * energies["work"]
    assert energies["friction"] > 0


def test_steps_and_increments_find_the_same_force():
    """Pressed without friction, a cube answers the same, to what damped steps still swing."""
    down, forces = 3e-7, []
    floor = [Wall("floor", np.zeros(3), np.eye(3)[2])]
    for increment, time, damping in ((None, 4e-5, 4e5), (0.5, 1.0, 0.0)):
        path = ToolPath([0, 0.5 * time, time], [np.zeros(6), *2 * [[0, 0, -down, 0, 0, 0]]])
        s = blocks(
            MPI.COMM_SELF, [Tool("plate", *PLATE, path=path)], floor, increment=increment,
            damping=damping,
        )  # fmt: skip
        while s.state.t < time:
            s.step()
        forces.append(s.tools.forces()[0, 2])
    assert forces[0] == pytest.approx(forces[1], rel=5e-3)
    # Two cubes: A δ/(L/E + 2 c h/E*), with the layer of a cube's facets at both of its ends.
    layers = 2 * COMPLIANCE * edge_of_area(EDGE**2 / 8, 1) / ROCK.contact_modulus
    # Contact acts within facets, beside the edges of the cube.
    assert forces[1] == pytest.approx(2 * EDGE**2 * down / (EDGE / ROCK.E + layers), rel=2e-3)


@pytest.mark.mpi
@pytest.mark.skipif(COMM.size == 1, reason="compares several ranks with one")
def test_an_increment_on_several_ranks_is_that_on_one():
    """A plate on one rank presses cubes of others; to what is left by Newton's method, 1e-6."""
    down, found = 3e-7, []
    for comm in (COMM, MPI.COMM_SELF):
        path = ToolPath([0, 1.0], [np.zeros(6), [0, 0, -down, 0, 0, 0]])
        s = blocks(comm, [Tool("plate", *PLATE, path=path, friction=0.3)], increment=1.0)
        s.step()
        found.append([s.tools.forces()[0, 2], s.wall_forces()[0], s.energies()["work"]])
    assert found[1][0] > 0.1
    assert found[0] == pytest.approx(found[1], rel=1e-5)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"free": ("w",)}, 'free of tool a has "w", expected some of x, y, z, rx, ry, rz'),
        ({"force": (0, 0, 1)}, "tool a, z has a load along it, expected none of what is told"),
        ({"free": ("x",), "velocity": (1, 0, 0)}, "tool a, x has a motion along it, expected none"),
        ({"free": ("rx", "ry")}, "free of tool a = rx, ry, expected one turn or all three"),
        ({"free": ("z", "rz"), "point": (0, 0, 0)}, "expected none where it is free to move"),
        ({"friction": -1.0}, "friction of tool a = -1.0, expected >= 0"),
        ({"density": 0.0}, "density of tool a = 0.0, expected > 0"),
        ({"cells": [[0, 1, 2, 3], [4, 5, 6, 7]]}, "tool a has 2 parts"),
    ],
)
def test_what_a_tool_cannot_be(more, message):
    body = {"points": PLATE[0], "cells": PLATE[1]}
    with pytest.raises(InputError, match=message):
        Tool("a", **(body | more))


def test_what_a_path_cannot_be():
    with pytest.raises(InputError, match="expected two or more that increase"):
        ToolPath([0, 1, 1], np.zeros((3, 6)))
    with pytest.raises(InputError, match="first row of a path"):
        ToolPath([0, 1], np.ones((2, 6)))


def test_what_increments_cannot_do():
    """Free tools have no equilibrium to be found; dynamic increments know no tools."""
    with pytest.raises(InputError, match="free of tool plate = z, expected none for static"):
        blocks(MPI.COMM_SELF, [Tool("plate", *PLATE, free=("z",))], increment=1.0)
    with pytest.raises(InputError, match="tools, expected none for dynamic increments"):
        blocks(MPI.COMM_SELF, [Tool("plate", *PLATE)], increment=1e-6, spectral_radius=0.5)


def test_energy_residual_falls_with_the_square_of_the_step():
    """Half the step leaves less than a third of it, of a plate that presses and drags."""
    path = ToolPath(
        np.array([0, 0.3, 1.0]) * 2e-5,
        [np.zeros(6), [0, 0, -4e-7, 0, 0, 0], [8e-7, 0, -4e-7, 0, 0, 0]],
    )
    left = []
    for factor in (0.45, 0.225):
        s = blocks(
            MPI.COMM_SELF, [Tool("plate", *PLATE, path=path, friction=0.3)], friction=0.8,
            damping=2e5, time_step_factor=factor,
        )  # fmt: skip
        while s.state.t < 2e-5:
            s.step()
        energies = s.energies()
        left.append(abs(energies["residual"]) / energies["work"])
    assert left[1] < 0.4 * left[0] < 4e-4


def test_points_stand_out_along_the_normals_of_tools():
    """As at walls; of other grains they stand over their own facets."""
    points, cells = sphere(1e-3, 0.35e-3)
    balls = [(points + np.array([0.0, 0.0, z]), cells) for z in (1.02e-3, 3.04e-3)]
    plate = box((4e-3, 4e-3, 0.5e-3), (4, 4, 1), (-2e-3, -2e-3, -0.5e-3))
    s = build(
        MPI.COMM_SELF, balls, Elastic(1e9, 0.2, 2500.0), (0, 0, 0), (1, 1, 1), "",
        tools=[Tool("plate", *plate)],
    )  # fmt: skip
    pairs, of_point = s.contact.pairs, s.contact.points.stands[s.contact.pairs.node]
    at_tool, on_tool = pairs.grain == 2, s.contact.points.grain_of_point[pairs.node] == 2
    assert at_tool.any() and (of_point[at_tool] > 0.0).any() and (~at_tool & ~on_tool).any()
    assert not pairs.stands[at_tool].any()
    vertex = s.contact.points.recess[pairs.node]
    assert np.array_equal(pairs.recess, vertex - np.where(at_tool, of_point, 0.0))
    # Of single precision.
    np.testing.assert_allclose(pairs.stands[~at_tool], of_point[~at_tool], rtol=1e-7)
