"""Rigid cylinders and spheres, from inside and outside, at rest, moved, grown and pressed."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.contact.mark import ContactMark
from mufe_fenicsx.contact.stiffness.tangent import ContactTangent
from mufe_fenicsx.contact.walls import Wall, rotation_of
from mufe_fenicsx.errors import InputError, SolverError
from mufe_fenicsx.kernels.contact.walls import gaps_to_walls
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.run.from_bodies import build, distribute, simulate
from tests.bodies import RADIUS, cylinder, packed_spheres, sphere

COMM = MPI.COMM_WORLD
SOFT = Elastic(1e9, 0.15, 2650.0)
UP = np.array([0.0, 0.0, 1.0])
#: Middle of a row of three balls along x.
ROW = np.array([3.0, 1.0, 1.0]) * RADIUS


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("axis", [np.array([2.0, -1.0, 2.0]) / 3.0, np.zeros(3)])
def test_gap_and_normal(axis, side):
    """Of cylinder and sphere they are the distance to the surface and its gradient."""
    rng = np.random.default_rng(1)
    x, middle, radius = rng.normal(size=(20, 3)), rng.normal(size=3), 2.5
    gap, normal = np.empty(20), np.empty((20, 3))
    walls = middle[None], axis[None], np.array([side * radius])
    gaps_to_walls(gap, normal, x, np.zeros(20, np.int32), *walls)
    away = (x - middle) @ (np.eye(3) - np.outer(axis, axis))
    distance = np.linalg.norm(away, axis=1)
    np.testing.assert_allclose(gap, side * (radius - distance), atol=1e-14)
    np.testing.assert_allclose(normal, -side * away / distance[:, None], atol=1e-14)
    # Along the normal the gap grows by the same length.
    gaps_to_walls(gap, normal, x + 0.1 * normal, np.zeros(20, np.int32), *walls)
    np.testing.assert_allclose(gap, side * (radius - distance) + 0.1, atol=1e-14)


PLANES = (
    {"name": "low", "point": np.zeros(3), "normal": UP},
    {"name": "top", "point": 2 * RADIUS * UP, "normal": -UP},
)


def turned(turn, wall):
    """A wall of the scene after it was turned about the origin."""
    vectors = {name: turn @ wall[name] for name in ("point", "normal", "velocity") if name in wall}
    return Wall(**(wall | vectors))


def row_of_balls(walls, turn=None, **options):
    """Three soft balls in a row that touch, between walls, all turned about the origin."""
    turn = np.eye(3) if turn is None else turn
    mesh = packed_spheres(COMM, (3, 1, 1))
    mesh.x[:] = mesh.x @ turn.T
    walls = [turned(turn, wall) for wall in walls]
    return simulate(mesh, [SOFT] * mesh.num_grains, walls, **options)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_wall_with_little_curvature_is_a_plane(side):
    """A radius of 1e7 balls changes the gap by R/1e7 over a ball, 1e-5 of the depth."""
    far = 1e7 * RADIUS
    floor = PLANES[0] | {"velocity": 0.03 * RADIUS * UP}
    forces = []
    for shape in (
        {},
        {"point": side * far * UP, "normal": np.zeros(3), "radius": side * far},
        {"point": side * far * UP, "normal": np.array([0.0, 1.0, 0.0]), "radius": side * far},
    ):
        s = row_of_balls([floor | shape, PLANES[1]], increment=1.0)
        s.step()
        forces.append(s.wall_forces())
    assert forces[0].min() > 1.0
    # Rounding of 1e7 R in the depth, 3e-2 R, is 1e-7; Newton's method ends at 1e-6.
    np.testing.assert_allclose(forces[1:], [forces[0]] * 2, rtol=3e-5)


def test_a_turned_scene_has_the_same_forces_and_balance():
    """A ring that shrinks around three balls, between planes that approach, however it lies."""
    ring = {"name": "ring", "point": ROW, "normal": UP, "radius": 3 * RADIUS, "growth_rate": -0.5}
    planes = [plane | {"velocity": 0.2 * plane["normal"]} for plane in PLANES]
    forces = []
    for turn in (np.eye(3), rotation_of(np.array([0.4, -1.1, 0.7]))):
        s = row_of_balls([ring, *planes], turn, friction=0.3, damping=2e4, time_step_factor=0.4)
        while s.state.t < 4e-4:
            s.step()
        forces.append(s.wall_forces())
        energies = s.energies()
        # A wave of 1 % of the load has 1e-4 of its energy.
        assert abs(energies["residual"]) < 1e-3 * energies["work"]
    assert forces[0].min() > 1.0
    # The time step looks at a box around the points near a wall, which turns with the scene: steps
    # differ by 0.1 %, and with them what of the load has arrived, 2e-4 of the forces.
    np.testing.assert_allclose(forces[1], forces[0], rtol=2e-3)


def test_a_ring_under_a_servo_holds_its_force():
    ring = {"name": "ring", "point": ROW, "normal": UP, "radius": 3.1 * RADIUS,
            "target": 20.0, "speed": 0.5}  # fmt: skip
    s = row_of_balls([ring, *PLANES], friction=0.3, damping=2e4)
    while s.state.t < 1.5e-3:
        s.step()
    # As of a plane: it approaches exponentially, 1 % are left at 1.2e-3 s.
    assert s.wall_forces()[0] == pytest.approx(20.0, rel=0.01)
    energies = s.energies()
    assert abs(energies["residual"]) < 1e-3 * energies["work"]


def test_a_ring_that_spins_presses_alike_and_drags():
    """Without friction nothing changes; with it the torque is at most μ N R, against the spin."""
    forces, torque = [], []
    for spin, friction in ((0.0, 0.0), (200.0, 0.0), (200.0, 0.2)):
        ring = {"name": "ring", "point": ROW, "normal": UP, "radius": 3 * RADIUS,
                "growth_rate": -0.5, "angular_velocity": spin * UP,
                "friction": friction}  # fmt: skip
        s = row_of_balls([ring, *PLANES], friction=friction, damping=2e4)
        while s.state.t < 4e-4:
            s.step()
        forces.append(s.wall_forces()[0])
        torque.append(s.walls.loads(COMM)[1][0] @ UP)
    # A wall that turns is looked at in each step, and steps differ a little.
    assert forces[1] == pytest.approx(forces[0], rel=0.01)
    assert abs(torque[1]) < 1e-9 * forces[1] * RADIUS
    assert 0.0 < -torque[2] <= 0.2 * forces[2] * s.walls.curved.radius[0] * (1 + 1e-6)


def test_increments_are_steps_at_rest():
    """A ring that shrank around a cylinder between planes: both ways give the same forces."""
    forces = []
    for options in ({"damping": 2e4}, {"increment": 1e-3}):
        s = cylinder_in_a_ring(growth_rate=-10.0 * RADIUS, **options)
        while s.state.t < 0.9999e-3:
            s.step()
        s.walls.curved.growth_rate[:] = 0.0
        for _ in range(1000 if "damping" in options else 1):
            s.step()
        forces.append(s.wall_forces())
    assert forces[1].min() > 1.0
    # Damping leaves exp(-2π) of what swings.
    np.testing.assert_allclose(forces[0], forces[1], rtol=3e-3)


@pytest.mark.parametrize("friction", [0.002, 0.9])
@pytest.mark.parametrize(("axis", "side"), [(UP, 1.0), (np.zeros(3), 1.0), (UP, -1.0)])
def test_tangent_of_a_curved_wall_is_the_derivative_of_its_forces(axis, side, friction):
    """A ball that was pressed to a wall and turns, slipping and stuck: friction turns with it.

    Tolerance: differences over 1e-7 of the radius, of depths 0.01 of it; by how much the depth
    grew since, over the radius, where the spring of before is not known after a slip.
    """
    middle = np.array([1.0 - side, 0.0, 0.0]) * RADIUS
    wall = Wall("wall", middle, axis, friction, radius=side * RADIUS)
    mesh = distribute(MPI.COMM_SELF, [sphere(RADIUS, 0.45 * RADIUS)])
    contact = simulate(mesh, [SOFT], [wall], friction=friction).contact
    f, rng = np.zeros_like(mesh.x), np.random.default_rng(1)

    def forces(x):
        f[:] = 0.0
        contact.begin_step(x)
        contact.add_forces(f, x)
        return f.copy()

    x = mesh.x + 0.15 * RADIUS * np.array([1.0, 0.2, 0.1])
    forces(x)
    closed, mark = contact.walls.pairs.closed.copy(), ContactMark(contact)
    x = x @ rotation_of(2e-3 * UP).T + 1e-6 * RADIUS * rng.normal(size=x.shape)

    def after(x):
        mark.restore()
        return forces(x)

    after(x)
    pairs = contact.walls.pairs
    assert closed.sum() > 1 and np.array_equal(pairs.closed, closed)
    assert np.all(pairs.sliding[closed]) == (friction == 0.002)
    rows, columns, blocks = ContactTangent(contact, mesh)(mark)
    q, step = rng.standard_normal(x.shape), 1e-7 * RADIUS
    nodes, product = contact.own.nodes, np.zeros_like(x)
    np.add.at(product, nodes[rows], np.einsum("bij,bj->bi", blocks, q[nodes[columns]]))
    slope = -(after(x + step * q) - after(x - step * q)) / (2 * step)
    assert abs(product - slope).max() < (1e-5 if friction == 0.002 else 1e-6) * abs(slope).max()
    # A tip that begins to flow has no depth.
    tip = closed & (pairs.softer > 0.0)
    pairs.gap[tip] = pairs.offset[tip]
    assert tip.any() and np.isfinite(ContactTangent(contact, mesh)(mark)[2]).all()


def cylinder_in_a_ring(growth_rate, **options):
    """An elastic cylinder in a ring of its size, between planes."""
    body = cylinder(RADIUS, 0.5 * RADIUS, 0.3 * RADIUS)
    ring = Wall("ring", np.zeros(3), UP, radius=RADIUS, growth_rate=growth_rate)
    ends = [Wall("low", np.zeros(3), UP), Wall("top", 0.5 * RADIUS * UP, -UP)]
    return build(
        MPI.COMM_SELF, [body], SOFT, [0, 0, 0], [1, 1, 1], "", walls=[ring, *ends], **options
    )


def test_facets_on_the_wall_are_part_of_it():
    """A cylinder in a ring of its size meets it all around at once, though facets are chords."""
    s = cylinder_in_a_ring(growth_rate=-1e-6 * RADIUS, increment=1.0)
    s.step()
    pairs = s.walls.pairs
    near = (pairs.wall == 0) & (pairs.gap < 1e-3 * RADIUS)  # not those inside the end faces
    assert near.sum() > 50 and pairs.closed[near].all()
    # In-plane strain of 1e-6 between planes: σ = 2 (λ + G) (ε - l σ/R), l the layer of the facets
    # on the ring. Those of the ends take up to a per cent more.
    E, nu, points = SOFT.E, SOFT.nu, pairs.node[pairs.wall == 0]
    layer = np.average(s.contact.points.layer[points], weights=s.contact.points.area[points])
    modulus = E / ((1 + nu) * (1 - 2 * nu))
    force = 1e-6 / (1 / modulus + layer / RADIUS) * np.pi * RADIUS**2
    assert s.wall_forces()[0] == pytest.approx(force, rel=0.015)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"radius": np.nan}, "radius of wall ring = nan, expected a finite number"),
        ({"normal": [0, 0, 2]}, "length of the normal of wall ring = 2.0, expected 1"),
        (
            {"radius": 0.0, "growth_rate": 1.0},
            "growth_rate of wall ring = 1.0, expected none of a plane or a glued wall",
        ),
        (
            {"mirror": True},
            "radius of the mirror ring = 0.001, expected none: a plane of symmetry is smooth and "
            "at rest",
        ),
    ],
)
def test_what_is_no_wall_is_named(changed, message):
    with pytest.raises(InputError) as caught:
        Wall(**{"name": "ring", "point": [0, 0, 0], "normal": [0, 0, 1], "radius": 1e-3} | changed)
    assert str(caught.value) == message


@pytest.mark.parametrize("axis", [UP, np.zeros(3)])
def test_increments_hold_a_force_on_a_curved_wall(axis):
    """A ring around a cylinder, and a hollow sphere around a ball, find their radius."""
    body = (
        cylinder(RADIUS, 0.5 * RADIUS, 0.3 * RADIUS) if axis.any() else sphere(RADIUS, RADIUS / 2)
    )
    middle = np.zeros(3)
    wall = Wall("wall", middle, axis, radius=1.001 * RADIUS, target=5.0, speed=0.01 * RADIUS)
    ends = [Wall("low", middle, UP), Wall("top", 0.5 * RADIUS * UP, -UP)] if axis.any() else []
    s = build(MPI.COMM_SELF, [body], SOFT, [0] * 3, [1] * 3, "", walls=[wall, *ends], increment=1.0)
    for _ in range(6):
        s.step()
    # Walls under a force are found to 1e-3 of it.
    assert s.wall_forces()[0] == pytest.approx(5.0, rel=2e-3)
    assert s.walls.point[0] == pytest.approx(middle)
    assert s.walls.curved.radius[0] < 1.0 * RADIUS


def test_a_wall_that_shrinks_to_nothing_is_an_error():
    s = cylinder_in_a_ring(growth_rate=-0.3 * RADIUS, increment=1.0)
    s.walls.move(3.0)
    with pytest.raises(SolverError, match="radius of a wall has shrunk to nothing"):
        s.walls.move(1.0)
