"""Implicit and static increments: tangents, orders, equilibria, and what they refuse."""

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest

import mufe_fenicsx  # noqa: F401  first: the wheel's MPI

# isort: split
import ufl
from dolfinx import fem
from mpi4py import MPI

from mufe_fenicsx.bulk.elastic_tangent import NearTangent
from mufe_fenicsx.bulk.solid import Solid
from mufe_fenicsx.bulk.tangent import SolidTangent
from mufe_fenicsx.contact.friction import PairFriction
from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.errors import InputError, SolverError
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.implicit.simulation import ImplicitSimulation
from mufe_fenicsx.loading.gravity import Gravity
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.run.from_bodies import build, distribute
from mufe_fenicsx.solvers.generalised_alpha import GeneralisedAlpha
from mufe_fenicsx.state import initial_state
from mufe_fenicsx.verification.half_balls import ALONG, HalfBalls
from mufe_fenicsx.verification.half_balls import UP as UP_OF_HALVES
from tests.bodies import RADIUS, packed_spheres

COMM = MPI.COMM_WORLD
UP = np.array([0.0, 0.0, 1.0])
STEEL = Elastic(1e9, 0.3, 2650.0)
#: Yields at a strain of 0.001.
YIELDING = J2(1e9, 0.3, 2650.0, ((0.0, 1e6), (0.05, 2e6)))
#: Yields from the first increment on, over two lines of its table.
SOFT = J2(100.0, 0.3, 1.0, ((0.0, 5.0), (0.05, 8.0), (0.2, 9.0)))


def static(mesh, material, walls=(), **options):
    """A simulation by increments with the same material in all grains."""
    materials = [material] * mesh.num_grains
    return ImplicitSimulation(mesh, materials, walls, **{"first_step": 1.0} | options)


@pytest.mark.parametrize("cut", [False, True])
@pytest.mark.parametrize("element", ["averaged", "p1"])
def test_tangent_of_grains_is_the_derivative_of_the_forces_of_time_steps(element, cut):
    """The form of which it is the derivative gives the kernel's forces, in two increments in turn.

    Tolerances: the twin to rounding; differences over 1e-6 of the edge, of forces that are
    smooth but for elements that begin to yield, are good to about 1e-8.
    """
    rng = np.random.default_rng(1)
    mesh = distribute(MPI.COMM_SELF, [box((1.0, 1.0, 1.0), (2, 2, 2))])
    if cut:  # nodes have other numbers than degrees of freedom then
        nodes, cells = mesh.inner_facets()
        mesh = mesh.grow(cells[(mesh.x[nodes][..., 0] == 0.5).all(axis=1)])
        assert not np.array_equal(mesh.node_of_dof, np.arange(mesh.num_nodes))
    solid = Solid(mesh, [SOFT], element)
    state = initial_state(mesh.x, mesh.num_cells)
    tangent = SolidTangent(solid)
    start = state.deviator.copy(), state.plastic_strain.copy(), mesh.x.copy()

    def forces(move):
        state.deviator[:], state.plastic_strain[:] = start[:2]
        state.x[:], state.v[:] = start[2] + move, move
        state.u[:] = state.x - mesh.x
        f = np.zeros_like(mesh.x)
        assert solid.add_internal_forces(f, state, 1.0) < 0
        return f

    for _ in range(2):
        move = 0.01 * rng.standard_normal(mesh.x.shape)
        f = forces(move)
        tangent.take(state, start[2] - mesh.x, *start[:2], 1.0)
        twin = np.empty_like(f)
        twin[mesh.node_of_dof] = fem.assemble_vector(tangent.residual).array.reshape(-1, 3)
        assert abs(twin + f).max() < 1e-12 * abs(f).max()
        assert (state.plastic_strain > start[1]).mean() > 0.3
        blocks = tangent.assemble(state.x)
        after = state.deviator.copy(), state.plastic_strain.copy(), state.x.copy()
        q = rng.standard_normal(mesh.x.shape)
        slope = (forces(move - 5e-7 * q) - forces(move + 5e-7 * q)) / 1e-6
        rows = np.repeat(np.arange(mesh.num_nodes), np.diff(tangent.offset))
        product = np.zeros_like(q)
        np.add.at(product, rows, np.einsum("bij,bj->bi", blocks, q[tangent.columns]))
        assert abs(product - slope).max() < 1e-6 * abs(slope).max()
        start = after


def stacked():
    """Two cubes on each other, the upper one smaller, between z = 0 and 2; one more beside them."""
    shapes = [
        (box((1.0, 1.0, 1.0), (2, 2, 2)), (0, 0, 0)),
        (box((0.9, 0.9, 1.0), (3, 3, 3)), (0.07, 0.02, 1.0)),
        (box((0.4, 0.4, 0.4), (1, 1, 1)), (2, 0, 0.5)),
    ]
    return distribute(
        COMM, [(points + np.array(place), cells) for (points, cells), place in shapes]
    )


def sheared_cubes(friction=0.1, **options):
    """Two cubes pressed and sheared so that they begin to slip; walls set for more of that."""
    walls = [Wall("low", np.zeros(3), UP, friction=0.9), Wall("top", 2 * UP, -UP, friction=0.9)]
    sim = static(stacked(), STEEL, walls, friction=friction, stabilisation=1e-3, **options)
    for push, side, sim.dt in ((-0.01, 0.0, 1.0), (-0.01, 0.001, 0.4)):
        sim.walls.velocity[1] = [side, 0.3 * side, push]
        sim.step()
    sim.walls.velocity[1] = [0.02, 0.006, -0.001]
    return sim


def sheared_balls(friction):
    """Half balls, 1.5 elements per contact radius, that begin to slip; the top set for more."""
    bodies, walls = HalfBalls(1.0, 0.5, 0.1, 0.07, 0.35).make()
    sim = static(distribute(COMM, bodies), STEEL, walls, friction=friction, stabilisation=1e-3)
    for push, side, sim.dt in ((-0.02, 0.0, 1.0), (0.0, 0.004, 0.4)):
        sim.walls.velocity[1] = push * UP_OF_HALVES + side * ALONG
        sim.step()
    sim.walls.velocity[1] = 4e-4 * ALONG - 2e-4 * UP_OF_HALVES
    return sim


OF_PAIRS = PairFriction(0.9, "abc", {("b", "a"): (0.1, 0.095)})


@pytest.mark.parametrize(
    ("points", "friction"),
    [
        ("facets", 0.1),
        ("nodes", 0.1),
        pytest.param("facets", OF_PAIRS, marks=pytest.mark.mpi),
        ("nodes", OF_PAIRS),
        ("balls", 0.3),
    ],
)
def test_tangent_of_contact_is_the_derivative_of_its_forces(points, friction):
    """Sticking and slipping, on a wall and between grains, at an odd state in the fourth increment.

    No point passes over an edge between facets, where the spring turns: that is left out of the
    derivative. Tolerance: the target of the method. The cubes are on ranks of
    their own where there are three.
    """
    if points == "balls":
        sim = sheared_balls(friction)
    else:
        sim = sheared_cubes(friction, points=points)
        sim.dt = 1.0
        sim.step()
    sim._begin(1.0)
    guess = sim._guess(1.0)
    rng = np.random.default_rng(COMM.rank)
    size = COMM.allreduce(abs(guess).max(), op=MPI.MAX)
    base = guess + 1e-3 * size * rng.standard_normal(guess.shape)
    sim.equations.residual(base)
    slipping = sim.contact.pairs.sliding.sum() + sim.walls.pairs.sliding.sum()
    assert COMM.allreduce(int(slipping)) > 5
    assert COMM.allreduce(int(sim.contact.pairs.closed.sum())) > 5
    sim.equations.set_tangent()
    q = sim.equations.held.project(rng.standard_normal(guess.shape))
    product, vector = sim.system.vector(), sim.system.vector()
    vector.array[:] = q.ravel()
    sim.system.matrix.mult(vector, product)
    step = 1e-7 * size
    up, down = (sim.equations.residual(base + sign * step * q)[0].copy() for sign in (1, -1))
    slope = (up - down) / (2 * step)
    error = abs(product.array.reshape(-1, 3) - slope).max()
    assert COMM.allreduce(error, op=MPI.MAX) < 1e-6 * COMM.allreduce(abs(slope).max(), op=MPI.MAX)


def test_newtons_method_is_quadratic_and_finds_equilibrium():
    """The last error is of the order of the square of the one before; platens carry the same."""
    sim = sheared_cubes()
    sim.dt = 0.1
    sim.step()
    history = sim._newton.history
    assert history[-1] < 1e-6
    assert len(history) <= 8
    # Beyond rounding of the forces; 30 is the size of the second derivative here.
    assert history[-1] < max(30 * history[-2] ** 2, 1e-9)
    low, top = sim.wall_forces()
    # What the drag takes up, 1e-3 E* V^(1/3) times the motion.
    assert top == pytest.approx(low, rel=0.01)
    assert low > 0


def swinging_box(radius, dt, speed=1.0):
    """A bar that swings along its axis, strained by up to some per mille."""
    sim = build(MPI.COMM_SELF, [box((1.0, 0.2, 0.2), (5, 1, 1))], STEEL, (-9, -9, -9), (9, 9, 9))
    mesh = sim.mesh
    x = mesh.x - mesh.x.mean(axis=0)
    velocity = speed * np.sin(np.pi * x[:, :1] / 1.0) * np.array([1.0, 0.0, 0.0])
    sim = ImplicitSimulation(
        mesh, [STEEL], (), first_step=dt, largest_step=dt, smallest_step=dt, tolerance=1e-10,
        spectral_radius=radius, velocity=velocity,
    )  # fmt: skip
    return sim, sim.dt_element


@pytest.mark.parametrize("radius", [0.0, 0.8, 1.0])
def test_generalised_alpha_is_of_the_second_order(radius):
    """Errors of displacement and velocity at one time, from T/20 and T/40, against T/160.

    Tolerance: the target, 0.1 of the order.
    """
    _, limit = swinging_box(radius, 1e-4)
    # The smaller the radius, the larger the terms of higher order.
    T = (2 if radius == 0.0 else 5) * limit
    ends = []
    for n in (20, 40, 160):
        sim, _ = swinging_box(radius, T / n)
        for _ in range(n):
            sim.step()
        ends.append((sim.state.u.copy(), sim.state.v.copy()))
    for k in range(2):
        coarse, fine = (np.linalg.norm(ends[i][k] - ends[2][k]) for i in (0, 1))
        # That of the reference counts as (1/4)² of the finer one.
        ratio = coarse / fine
        order = np.log2(ratio)
        assert order == pytest.approx(np.log2((16 - 1 / 4) / (4 - 1 / 4)), abs=0.1)


@pytest.mark.parametrize("radius", [0.8, 1.0])
def test_energy_stays_bounded_at_a_hundred_explicit_steps(radius):
    """No energy beyond the first but what Newton's tolerance leaves, 1e-10 of the forces."""
    _, limit = swinging_box(radius, 1e-4)
    sim, _ = swinging_box(radius, 100 * limit, 0.01)
    first = sim.initial_kinetic
    largest = 0.0
    for _ in range(60):
        sim.step()
        e = sim.energies()
        largest = max(largest, e["kinetic"] + e["elastic"])
    # Terms of second order in the strain.
    assert largest < (1 + 1e-3) * first
    assert largest > 0.1 * first


def test_parameters_of_generalised_alpha_are_those_of_its_source():
    """At radius 1 the mean acceleration rule of both ends; at 0 αm = -1, αf = 0, γ = 3/2, β = 1."""
    one, zero = GeneralisedAlpha(1.0), GeneralisedAlpha(0.0)
    assert (one.inertia_of_start, one.force_of_start, one.gamma, one.beta) == (0.5, 0.5, 0.5, 0.25)
    found = (zero.inertia_of_start, zero.force_of_start, zero.gamma, zero.beta)
    assert found == (-1.0, 0.0, 1.5, 1.0)


def test_free_grains_are_held_and_do_not_change_the_answer():
    """A loose cube beside a loaded column of two: the force for s from 1e-8 to 1e-4.

    Tolerance: the spring of the drag, 1e-4 E* V^(1/3), takes up to some 1e-4 of the force.
    """
    forces = []
    for s in (1e-8, 1e-6, 1e-4):
        walls = [Wall("low", np.zeros(3), UP), Wall("top", 2 * UP, -UP)]
        sim = static(stacked(), STEEL, walls, stabilisation=s)
        sim.walls.velocity[1] = [0.0, 0.0, -0.01]
        while (left := sim.walls.point[1, 2] - 1.98) > 1e-9:
            sim.dt = min(sim.dt, left / 0.01)
            sim.step()
        forces.append(sim.wall_forces()[1])
    # About 1e9 Pa over 0.81 m², strain 0.01.
    assert forces[0] > 5e6
    np.testing.assert_allclose(forces, forces[0], rtol=1e-3)


@pytest.mark.parametrize("glued", [False, True])
def test_the_drag_of_a_stiff_grain_on_a_soft_one_is_small(glued):
    """E in the ratio 1000: both platens carry the same; with the stiff grain's modulus to 1e-3."""
    walls = [Wall("low", np.zeros(3), UP, bonded=glued), Wall("top", 2 * UP, -UP, bonded=glued)]
    soft = replace(STEEL, E=1e-3 * STEEL.E)
    mesh = stacked()
    materials = [(soft, STEEL, soft)[g] for g in mesh.grains]
    sim = ImplicitSimulation(mesh, materials, walls, first_step=1.0, largest_step=1.0)
    sim.walls.velocity[1] = [0.0, 0.0, -0.01]
    sim.step()
    low, top = sim.wall_forces()
    # The third cube is held by its drag, which no platen feels.
    assert top == pytest.approx(low, rel=0.0 if glued else 2e-6, abs=1e-9 * low)


@pytest.mark.parametrize("solver", ["direct", "products"])
def test_increments_leave_nothing_behind(solver):
    """What PETSc keeps has no hold on the simulation: thousands of them fit into one process."""
    mesh = distribute(MPI.COMM_SELF, [box((1.0, 1.0, 1.0), (1, 1, 1))])
    s = static(mesh, STEEL, [Wall("floor", 0 * UP, UP, bonded=True)], linear_solver=solver)
    s.add_term(Gravity(mesh, s.solid.mass, [0.0, 0.0, -9.81], s.rigid))
    s.step()
    left = weakref.ref(mesh)
    del s, mesh
    gc.collect()
    assert left() is None


def test_other_solvers_find_the_answer_of_the_direct_one():
    """The same forces within Newton's tolerance, of balls that yield."""
    forces = []
    multigrid = {"ksp_type": "gmres", "ksp_rtol": 1e-6, "pc_type": "gamg"}
    for solver, petsc in (("direct", None), ("direct", multigrid), ("products", None)):
        mesh = stacked()
        walls = [Wall("low", np.zeros(3), UP, friction=0.3), Wall("top", 2 * UP, -UP)]
        # A drag that holds the third cube well: it is not what is solved for here.
        options = {"linear_solver": solver, "petsc": petsc, "stabilisation": 1e-2}
        sim = static(mesh, YIELDING, walls, friction=0.3, **options)
        sim.walls.velocity[1] = [0.0, 0.0, -0.003]
        sim.step()
        forces.append(sim.wall_forces()[0])
        assert sim.comm.allreduce(sim.state.plastic_strain.max(initial=0.0), op=MPI.MAX) > 0
    # About the yield stress over 0.81 m².
    assert forces[0] > 5e5
    assert forces[1:] == pytest.approx(2 * forces[:1], rel=1e-4)


def test_the_near_tangent_is_linear_elasticity_of_plain_tetrahedra():
    """The same matrix from a form, to rounding."""
    mesh = distribute(MPI.COMM_SELF, [box((1.0, 2.0, 1.5), (2, 3, 2))])
    near = NearTangent(Solid(mesh, [STEEL]))
    u, v = ufl.TrialFunction(mesh.V), ufl.TestFunction(mesh.V)
    strain = ufl.sym(ufl.grad(u))
    stress = 2 * STEEL.shear_modulus * strain
    stress += (STEEL.bulk_modulus - 2 / 3 * STEEL.shear_modulus) * ufl.tr(strain) * ufl.Identity(3)
    twin = fem.assemble_matrix(fem.form(ufl.inner(stress, ufl.grad(v)) * ufl.dx)).to_dense()
    matrix = np.zeros_like(twin)
    for n in range(mesh.num_nodes):
        for s in range(near.offset[n], near.offset[n + 1]):
            m = near.columns[s]
            matrix[3 * n : 3 * n + 3, 3 * m : 3 * m + 3] = near.blocks[s]
    np.testing.assert_allclose(matrix, twin, atol=1e-13 * abs(twin).max())


def test_an_increment_that_fails_leaves_the_last_state():
    """Platens that meet inside a ball: no equilibrium, one clear error, the state of before."""
    mesh = packed_spheres(MPI.COMM_SELF, (1, 1, 1), h=0.45 * RADIUS)
    walls = [Wall("low", np.zeros(3), UP), Wall("top", 2 * RADIUS * UP, -UP)]
    sim = static(mesh, STEEL, walls, smallest_step=0.5)
    sim.walls.velocity[1] = [0.0, 0.0, -0.01 * RADIUS]
    sim.step()
    x, place = sim.state.x.copy(), sim.walls.point.copy()
    force = sim.walls.force.copy()
    sim.walls.velocity[1] = [0.0, 0.0, -1.5 * RADIUS]
    with pytest.raises(SolverError, match="explicit"):
        sim.step()
    np.testing.assert_array_equal(sim.state.x, x)
    np.testing.assert_array_equal(sim.walls.point, place)
    np.testing.assert_array_equal(sim.walls.force, force)


def test_the_kinematic_law_is_refused():
    """It has no springs to be at rest on."""
    mesh = packed_spheres(MPI.COMM_SELF, (1, 1, 1))
    with pytest.raises(InputError, match="kinematic"):
        static(mesh, STEEL, law="kinematic")
