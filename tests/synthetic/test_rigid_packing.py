"""Rigid grains are packed by the laws of contact, friction and weight, as theory has them."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.analysis.voids import Voids, inner_lengths
from mufe_fenicsx.container import BOX as BOX_OF_RUNS
from mufe_fenicsx.errors import SolverError
from mufe_fenicsx.geometry.bodies.shapes import sphere
from mufe_fenicsx.geometry.measure import tet_volumes
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.synthetic.rigid_packing import ways
from mufe_fenicsx.synthetic.rigid_packing.assembly import Assembly
from mufe_fenicsx.synthetic.rigid_packing.bodies import bodies_at
from mufe_fenicsx.synthetic.rigid_packing.contacts import DAMPING
from mufe_fenicsx.synthetic.rigid_packing.container import BOX, CYLINDER, PERIODIC, Container
from mufe_fenicsx.synthetic.rigid_packing.measures import bearing, void_ratio_inside
from mufe_fenicsx.synthetic.rigid_packing.shapes import (
    ball,
    distances,
    in_own_frame,
    make_shapes,
    spread_points,
)
from mufe_fenicsx.synthetic.rigid_packing.start import column, loose
from mufe_fenicsx.synthetic.rigid_packing.stiffness import COORDINATION, SOLID, contact_depth
from mufe_fenicsx.synthetic.rigid_packing.ways import compress, reach_void_ratio, settle
from mufe_fenicsx.synthetic.triangulated import icosphere
from mufe_fenicsx.theory.hertz import effective_modulus, hertz_force

FAR = 50.0
#: Pressure of packings that need not be near the limit of rigid grains, and are at rest sooner.
HARD = 1e-3


def ball_by_points(num_points=400):
    """A sphere that is treated as a body of any shape."""
    points, triangles = icosphere(4)
    own, moments, *_ = in_own_frame(0.5 * points, triangles)
    return make_shapes([(own, triangles, moments)], num_points)


def exact_ball():
    points, triangles = icosphere(1)
    return ball((0.5 * points, triangles))


def placed(shapes, centres, sizes=None):
    """Bodies at places, not turned, in a wide box whose floor is z = 0."""
    centres = np.array(centres, dtype=float)
    n = len(centres)
    turn = np.zeros((n, 4))
    turn[:, 0] = 1.0
    size = np.ones(n) if sizes is None else np.array(sizes, dtype=float)
    bodies = bodies_at(shapes, np.zeros(n, dtype=np.int64), size, centres, turn)
    box = Container(BOX, np.array([-FAR, -FAR, 0.0]), np.full(3, FAR), open_top=True)
    return bodies, box


def test_a_sphere_rests_on_the_floor_at_the_depth_of_its_weight():
    """k δ = m g with k = 2 E D, and nothing moves."""
    bodies, box = placed(exact_ball(), [[0, 0, 0.55]])
    assembly = Assembly(bodies, box, 0.5, 0.5, gravity=1e-4)
    assembly.drag = 0.05
    while assembly.time < 2000:
        assembly.step()
    weight = np.pi / 6 * 1e-4
    assert 0.5 - bodies.centre[0, 2] == pytest.approx(weight / 2, rel=1e-6)
    assert assembly.contacts.wall_push[0, 4] == pytest.approx(weight, rel=1e-6)
    assert bodies.kinetic_energy < 1e-12 * weight


@pytest.mark.parametrize(
    ("shapes", "tolerance"),
    # The second rolls over points 0.04 D apart, each of which takes a little.
    [(exact_ball, 0.01), (lambda: ball_by_points(2000), 0.02)],
    ids=["spheres", "surfaces"],
)
def test_a_sliding_ball_rolls_in_the_end_with_five_sevenths_of_its_speed(shapes, tolerance):
    """Whatever the friction, since the angular momentum about the floor is kept."""
    bodies, box = placed(shapes(), [[0, 0, 0.499]])
    v0, gravity, mu = 0.02, 1e-3, 0.3
    assembly = Assembly(bodies, box, 0.0, mu, gravity=gravity)
    bodies.velocity[0, 0] = v0
    end = 2 * v0 / (7 * mu * gravity)
    while assembly.time < 0.5 * end:
        assembly.step()
    # Until it rolls the friction is μ m g.
    assert bodies.velocity[0, 0] == pytest.approx(v0 - mu * gravity * assembly.time, rel=0.05)
    while assembly.time < 1.2 * end:
        assembly.step()
    assert bodies.velocity[0, 0] == pytest.approx(5 / 7 * v0, rel=tolerance)
    assert bodies.spin[0, 1] * 0.5 == pytest.approx(bodies.velocity[0, 0], rel=0.05)


def test_two_spheres_part_with_the_restitution_of_a_dashpot_that_does_not_pull(monkeypatch):
    """T. Schwager & T. Pöschel, Granular Matter 9, 2007, 465-469, eq. (21)."""
    bodies, box = placed(exact_ball(), [[0, 0, 5], [1.001, 0, 5]])
    bodies.velocity[:, 0] = 0.005, -0.005
    monkeypatch.setattr("mufe_fenicsx.synthetic.rigid_packing.assembly.STEP", 0.02)
    assembly = Assembly(bodies, box, 0.0, 0.0)
    while assembly.time < 3:  # the impact takes 1.4
        assembly.step()
    beta = DAMPING  # over the frequency without damping
    omega = math.sqrt(1 - beta**2)
    phase = math.pi - math.atan2(2 * beta * omega, omega**2 - beta**2)
    assert not assembly.contacts.push.any()
    restitution = bodies.velocity[1, 0] / 0.005
    assert restitution == pytest.approx(math.exp(-beta / omega * phase), rel=0.01)


@pytest.mark.parametrize("shapes", [exact_ball, ball_by_points], ids=["spheres", "surfaces"])
def test_contacts_keep_momentum_and_angular_momentum(shapes):
    rng = np.random.default_rng(0)
    centres = rng.uniform(0, 1.4, (6, 3)) + 5
    bodies, box = placed(shapes(), centres)
    bodies.velocity[:], bodies.spin[:] = 0.1 * rng.standard_normal((2, 6, 3))
    assembly = Assembly(bodies, box, 0.4, 0.4)
    assembly.contacts.add_loads(0.4, 0.4, True, 0.1)
    largest = np.abs(bodies.force).max()
    assert assembly.contacts.sums.num_pairs > 3
    assert np.abs(bodies.force.sum(axis=0)).max() < 1e-12 * largest
    moment = np.cross(bodies.centre - 5, bodies.force) + bodies.torque
    assert np.abs(moment.sum(axis=0)).max() < 1e-11 * largest


def test_a_surface_pressed_on_a_plane_is_a_foundation_of_springs():
    """F = 50 E/D times the volume of the cap that is behind the plane."""
    depth = 0.05
    bodies, box = placed(ball_by_points(4000), [[0, 0, 0.5 - depth]])
    assembly = Assembly(bodies, box, 0.0, 0.0)
    assembly.contacts.add_loads(0.0, 0.0, False, 0.1)
    # A point stands for the area around it on the sphere, not for its projection.
    cap = np.pi * depth**2 * 0.5  # of depth dA over a cap of area 2 pi R depth
    assert bodies.force[0, 2] == pytest.approx(50 * cap, rel=0.03)


def test_distances_on_the_grid_are_those_of_the_body():
    points, triangles = icosphere(4)
    grid, low, step = distances(0.5 * points, triangles)
    ticks = np.arange(grid.shape[0]) * step
    at = np.stack(np.meshgrid(*(low[i] + ticks for i in range(3)), indexing="ij"), axis=-1)
    # Facets of edges 0.04 D lie 0.04²/8R = 4e-4 D behind the sphere.
    assert np.abs(grid - (np.linalg.norm(at, axis=-1) - 0.5)).max() < 6e-4


def test_points_are_spread_evenly_and_carry_the_whole_area():
    points, triangles = icosphere(1)
    place, weight = spread_points(0.5 * points, triangles, 300)
    assert len(place) == 300
    edges = place[:, None] - place[None]
    nearest = np.sort(np.linalg.norm(edges, axis=-1), axis=1)[:, 1]
    assert nearest.min() > 0.5 * math.sqrt(np.pi / 300)
    x = 0.5 * points[triangles]
    area = 0.5 * np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1).sum()
    assert weight.sum() == pytest.approx(area, rel=1e-12)


def spheres_in(kind, number, friction, proportions=(1, 1, 1), spread=0.0):
    rng = np.random.default_rng(1)
    shape, size = np.zeros(number, dtype=np.int64), rng.uniform(1 - spread, 1 + spread, number)
    bodies, container = loose(exact_ball(), shape, size, rng, kind, proportions)
    return Assembly(bodies, container, friction, 0.0)


def test_stress_by_branches_is_that_on_the_walls():
    """At rest the mean stress is the force on a wall over its area."""
    assembly = spheres_in(BOX, 40, 0.3)
    compress(assembly, HARD)
    edges = assembly.container.high - assembly.container.low
    push = assembly.contacts.wall_push.sum(axis=0).reshape(3, 2).mean(axis=1)
    on_walls = push / (np.prod(edges) / edges)
    assert np.diag(assembly.stress) == pytest.approx(on_walls, rel=0.01)
    assert assembly.pressure == pytest.approx(HARD, rel=0.05)
    # No grain turns faster and faster: as little as the forces are out of balance.
    assert assembly.stress == pytest.approx(assembly.stress.T, abs=5e-4 * HARD)


def test_nothing_leaves_a_cylinder_and_its_volume_is_that_of_a_cylinder():
    assembly = spheres_in(CYLINDER, 40, 0.3, proportions=(1, 1, 1.5))
    compress(assembly, HARD)
    container = assembly.container
    edges = container.high - container.low
    assert edges[0] == pytest.approx(edges[1])
    # Walls come in by the stress on each axis: packings of 40 spheres scatter by 1.5 %.
    assert edges[2] / edges[0] == pytest.approx(1.5, rel=0.05)
    assert container.volume == pytest.approx(np.pi / 4 * edges[0] ** 2 * edges[2])
    assert container.inside(assembly.bodies.centre, 0.5 - 0.02).all()


def test_friction_keeps_spheres_apart():
    """Friction loosens a packing and lowers its coordination, below the isostatic 6.

    Some tens of equal spheres may crystallise, those of several sizes do not.
    """
    close, rough = (spheres_in(PERIODIC, 60, mu, spread=0.2) for mu in (0.0, 0.8))
    for assembly in (close, rough):
        compress(assembly, HARD)
    assert 0.61 < close.solid_fraction < 0.66
    assert rough.solid_fraction < close.solid_fraction - 0.02
    pairs, _ = rough.contacts.touching()
    assert 2 * len(pairs) / 60 < 5.3


def test_a_void_ratio_is_reached_and_one_that_cannot_be_is_an_error():
    assembly = spheres_in(PERIODIC, 24, 1.0)
    compress(assembly, HARD)
    told = set()
    assembly._progress = lambda step, a: told.add(a.doing)
    assembly = reach_void_ratio(assembly, 0.7, HARD)
    assert ", wanted 0.7, try 1 of 8" in told
    assert assembly.void_ratio == pytest.approx(0.7, abs=2e-3)
    assert assembly.unbalanced < 1e-3
    assert assembly.pressure > 0.1 * HARD
    with pytest.raises(SolverError, match=r"0.9 was not reached: .* from 0.[56]\d+ .* to 0.70?\d*"):
        reach_void_ratio(assembly, 0.9, HARD)
    assembly.friction = 0.0  # grains slide until they are as dense as they become at random
    with pytest.raises(SolverError, match=r"0.4 was not reached: .* from 0.[56]\d+ without"):
        reach_void_ratio(assembly, 0.4, HARD)


@pytest.mark.parametrize("below, falls", [(1.0012, 0.051), (1.05, 0.016)])
def test_grains_that_fall_together_are_stopped_between_tries(monkeypatch, below, falls):
    """A packing that is stopped below a void ratio falls together, by little or by much."""

    def stopped(fall, aim, told):
        fall.stopped = aim
        return SimpleNamespace(void_ratio=aim if aim > below else aim - falls, still=lambda: None)

    monkeypatch.setattr(ways._Fall, "to", stopped)
    monkeypatch.setattr(ways, "rest", lambda *_: True)
    start = SimpleNamespace(void_ratio=1.03, friction=1.0, wall_friction=0.5)
    assert reach_void_ratio(start, 1.0).void_ratio == pytest.approx(1.0, abs=ways.TOLERANCE)


def test_a_heap_rests_on_the_floor_with_its_weight():
    rng = np.random.default_rng(3)
    shape, size = np.zeros(30, dtype=np.int64), rng.uniform(0.8, 1.2, 30)
    bodies, box = column(exact_ball(), shape, size, rng, BOX, np.array([3.2, 3.2]))
    assembly = Assembly(bodies, box, 0.5, 0.0)
    settle(assembly)
    weight = assembly.gravity * bodies.mass.sum()
    assert assembly.contacts.wall_push[:, 4].sum() == pytest.approx(weight, rel=1e-3)
    assert bodies.kinetic_energy < 1e-4 * weight / 30


def test_the_void_ratio_inside_is_that_of_the_spheres_there():
    """A cubic lattice of touching spheres fills π/6 of each of its cells."""
    ticks = np.arange(6) + 0.0
    centres = np.stack(np.meshgrid(ticks, ticks, ticks), axis=-1).reshape(-1, 3)
    bodies, _ = placed(exact_ball(), centres)
    box = Container(BOX, np.zeros(3), np.full(3, 5.0))
    # Voxels of 1/24: a few per mille of a body. All parts are alike.
    found, error = void_ratio_inside(Assembly(bodies, box, 0.0, 0.0))
    assert found == pytest.approx(6 / np.pi - 1, rel=1e-2)
    assert error < 1e-12
    # A run of their meshes has the same part, and the same number but for cells that count whole.
    points, cells = sphere(0.5, 0.2)
    x = np.concatenate([points + centre for centre in centres])
    cells = np.concatenate([cells + k * len(points) for k in range(len(centres))])
    volume = tet_volumes(x, cells)
    volume *= len(centres) * np.pi / 6 / volume.sum()  # of balls, not of what is within facets
    voids = Voids(MPI.COMM_SELF, BOX_OF_RUNS, cells.astype(np.int32), volume, 1.0)
    assert voids.row(x, np.full(3, 5.0))["void_ratio_inside"] == pytest.approx(found, rel=0.03)


@pytest.mark.parametrize(
    ("lengths", "hollow", "inner"),
    [
        ((3.0, 4.0, 2.0), False, (2.0, 3.0, 1.0)),
        ((3.0, 4.0, 1.9), False, None),
        ((6.0, 2.0, 3.0), True, (5.0, 3.0, 2.0)),
        ((5.0, 2.0, 3.0), True, None),
        ((3.0, 2.0), False, (2.0, 1.0)),
    ],
)
def test_away_from_walls_is_half_a_diameter_and_one_wide(lengths, hollow, inner):
    found = inner_lengths(lengths, 1.0, hollow)
    assert found is None if inner is None else found.tolist() == list(inner)


def test_the_error_of_the_void_ratio_inside_is_that_of_its_eighths():
    """Of a lattice of two cells a direction in which one sphere lacks: s/√8 of the eight."""
    ticks = np.arange(2) + 1.0
    centres = np.stack(np.meshgrid(ticks, ticks, ticks), axis=-1).reshape(-1, 3)[1:]
    bodies, _ = placed(exact_ball(), centres)
    box = Container(BOX, np.zeros(3), np.full(3, 3.0))
    found, error = void_ratio_inside(Assembly(bodies, box, 0.0, 0.0))
    solid = 7 / 8 * np.pi / 6
    assert found == pytest.approx(1 / solid - 1, rel=1e-2)
    assert error == pytest.approx(np.pi / 6 / 8 / solid**2, rel=1e-2)


def test_each_axis_bears_its_own_stress():
    """K0 = 0.5: the sides bear half of the top, on walls as by branches."""
    assembly = spheres_in(BOX, 40, 0.3)
    wanted = HARD * np.array([0.5, 0.5, 1.0])
    compress(assembly, wanted)
    assert assembly.axial_stresses == pytest.approx(wanted, rel=0.05)
    push = assembly.contacts.wall_push.sum(axis=0)[4:].mean()
    edges = assembly.container.high - assembly.container.low
    assert push / (edges[0] * edges[1]) == pytest.approx(HARD, rel=0.06)


@pytest.mark.parametrize("last", [70e9, 50e6])
def test_springs_are_as_deep_as_true_contacts(last):
    """Of equal spheres under the mean force of a stress: Hertz, or flow at 2.8 Y where deeper."""
    E, nu, stress, D = 70e9, 0.2, 3e6, 2e-4
    force = np.pi * D**2 * stress / (SOLID * COORDINATION)
    depth = contact_depth(stress, J2(E, nu, 2650.0, ((0.0, last), (0.1, last)))) * D
    if last > 1e9:
        modulus = effective_modulus((E, nu), (E, nu))
        assert hertz_force(depth, D / 4, modulus) == pytest.approx(force)
    else:
        assert 2.8 * last * np.pi * (D / 2 * depth) == pytest.approx(force)  # a² = 2 R δ, R = D/4


def test_who_bears_is_found_from_outside_in():
    """A chain of three at a wall, of which each needs two contacts, and one that none touches."""
    pairs = np.array([[0, 1], [1, 2]])
    walls = np.array([1, 0, 0, 0])
    bears, _ = bearing(4, pairs, walls, 2)
    assert not bears.any()  # the last has one contact, then the next
    bears, contacts = bearing(4, pairs, np.array([1, 0, 1, 0]), 2)
    assert bears.tolist() == [True, True, True, False]
    assert contacts[:3].tolist() == [2, 2, 2]
