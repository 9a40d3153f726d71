"""Compiled loops against slow twins."""

import math
import platform

import mufe_fenicsx  # noqa: F401, before dolfinx: it loads MPI

# isort: split
import numba
import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from scipy.spatial.transform import Rotation

from mufe_fenicsx.bulk.solid import ELEMENTS, Solid, von_mises
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.kernels.build import native
from mufe_fenicsx.kernels.build.native import load
from mufe_fenicsx.kernels.bulk import solid as kernels
from mufe_fenicsx.kernels.bulk.hardening import plastic_increment, yield_stress_at
from mufe_fenicsx.kernels.contact.search import find_candidates, sort_into_cells
from mufe_fenicsx.kernels.geometry.closest import closest_point, pseudo_normal
from mufe_fenicsx.kernels.geometry.rings import neighbours, nodes_around, rings
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.mesh import create_grain_mesh
from mufe_fenicsx.state import initial_state
from tests.bodies import sphere

STEEL = Elastic(200e9, 0.3, 7800.0)

#: Components xx yy zz xy yz xz of a matrix.
ROWS, COLUMNS = [0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]


def one_body(points, cells):
    """Mesh of a single grain on this rank alone."""
    zero = np.zeros(len(cells), dtype=int)
    return create_grain_mesh(MPI.COMM_SELF, points, cells, zero, np.array([1]), np.array([0]))


def internal_forces(solid, state, dt):
    f = np.zeros_like(state.x)
    assert solid.add_internal_forces(f, state, dt) == -1
    return f


def move(state, x_new, dt):
    """Put the nodes at ``x_new``, with the velocity that leads there."""
    state.v[:] = (x_new - state.x) / dt
    state.x[:] = x_new


# --- solid ------------------------------------------------------------------------------------


@pytest.mark.skipif(platform.machine() != "x86_64", reason="four lanes are forced by its options")
@pytest.mark.parametrize("element", ELEMENTS)
@pytest.mark.parametrize("change", ["lanes", "law"])
def test_kernel_with_four_lanes_and_with_a_law_from_outside(element, change, monkeypatch):
    """Both are the same arithmetic: forces, stress and plastic work to round-off.

    Elements shrink to half of their volume, beyond the series of ln J; their number is no
    multiple of the lanes, and some yield across both segments of the table.
    """
    points, cells = box((1.0, 1.0, 1.0), (3, 3, 1))
    material = J2(1e9, 0.15, 2650.0, ((0.0, 1e6), (0.02, 2e6), (0.1, 2.5e6)))
    found = []
    for other in (False, True):
        if other and change == "lanes":
            monkeypatch.setattr(kernels, "load", lambda name: load(name, "-mno-avx512f"))
        mesh = one_body(points, cells[:-4])
        solid = Solid(mesh, [material], element)
        if other and change == "law":
            solid.laws = [
                (numba.njit(plastic_increment.py_func), grains) for _, grains in solid.laws
            ]
        state = initial_state(mesh.x, mesh.num_cells)
        rng = np.random.default_rng(5)
        for _ in range(4):
            # Well below half a turn, at which elements are flat in the middle of a step.
            turn = Rotation.from_rotvec(0.5 * rng.normal(size=3)).as_matrix()
            new = 0.84 * state.x @ turn
            move(state, new + 0.003 * rng.normal(size=new.shape), 1.0)
            forces = internal_forces(solid, state, 1.0)
        found.append((forces, state.deviator, state.plastic_strain, state.plastic_work))
    assert 0.02 < found[0][2].max() and found[0][2].min() < found[0][2].max()
    for one, two in zip(*found, strict=True):
        assert np.abs(one - two).max() < 1e-11 * np.abs(one).max()


def test_without_a_compiler_there_is_one_clear_line(monkeypatch, tmp_path):
    monkeypatch.setenv("CC", "no-such-compiler")
    monkeypatch.setattr(native, "cache_folder", lambda: tmp_path)
    native.load.cache_clear()
    with pytest.raises(InputError, match="C compiler = none in PATH, expected GCC or clang"):
        Solid(one_body(*box((1.0, 1.0, 1.0), (1, 1, 1))), [STEEL])
    native.load.cache_clear()


def test_elastic_forces_are_those_of_a_ufl_form():
    """Plain linear elements, small displacements: f = -∫ σ(u):ε(w) dx."""
    mesh = one_body(*sphere(1.0, 0.6))
    solid = Solid(mesh, [STEEL], "p1")
    state = initial_state(mesh.x, mesh.num_cells)
    size = 1e-7
    u = size * np.sin(np.outer(mesh.x @ [1.0, 2.0, -1.5], [1.0, 1.3, 0.7]))
    move(state, mesh.x + u, 1.0)
    f = internal_forces(solid, state, 1.0)

    displacement = fem.Function(mesh.V)
    displacement.x.array[:] = u.ravel()
    w = ufl.TestFunction(mesh.V)
    strain, lame = ufl.sym(ufl.grad(displacement)), STEEL.bulk_modulus - 2 / 3 * STEEL.shear_modulus
    stress = 2 * STEEL.shear_modulus * strain + lame * ufl.tr(strain) * ufl.Identity(3)
    form = fem.form(ufl.inner(stress, ufl.sym(ufl.grad(w))) * ufl.dx)
    twin = fem.assemble_vector(form).array.reshape(-1, 3)
    # What small strain neglects is of the order of the strain; positions are rounded to eps/size.
    assert np.abs(f + twin).max() < 20 * size * np.abs(twin).max()


@pytest.mark.parametrize("element", ELEMENTS)
def test_stiffness_is_the_derivative_of_the_forces(element):
    mesh = one_body(*sphere(1.0, 0.7))
    solid = Solid(mesh, [STEEL], element)
    rng = np.random.default_rng(0)
    q = rng.standard_normal(mesh.x.shape)
    y = np.zeros_like(q)
    solid.add_stiffness(y, q, mesh.x)
    step, forces = 1e-6, []
    for sign in (1, -1):
        state = initial_state(mesh.x, mesh.num_cells)
        move(state, mesh.x + sign * step * q, 1.0)
        forces.append(internal_forces(solid, state, 1.0))
    # Central differences: error (strain)² of about (5 step)², and rounding eps/step.
    assert np.abs(y + (forces[0] - forces[1]) / (2 * step)).max() < 1e-8 * np.abs(y).max()


@pytest.mark.parametrize("element", ELEMENTS)
def test_even_deformation_gives_even_stress_and_no_force_inside(element):
    """The patch test, at a strain of 0.1."""
    mesh = one_body(*sphere(1.0, 0.5))
    solid = Solid(mesh, [STEEL], element)
    state = initial_state(mesh.x, mesh.num_cells)
    F = np.eye(3) + 0.1 * np.array([[0.5, 0.3, 0.0], [-0.2, -0.4, 0.6], [0.1, 0.7, 0.9]])
    move(state, mesh.x @ F.T, 1.0)
    f = internal_forces(solid, state, 1.0)
    stress = solid.stress(state)
    # Rounding: some eps of E, and of E h² for the forces.
    assert np.abs(stress - stress[0]).max() < 1e-13 * STEEL.E
    mean = STEEL.bulk_modulus * np.log(np.linalg.det(F))
    np.testing.assert_allclose(solid.mean_stress(state), mean, rtol=1e-12)
    inside = np.setdiff1d(np.arange(mesh.num_nodes), mesh.facets)
    assert inside.size > 5
    assert np.abs(f[inside]).max() < 1e-13 * STEEL.E * 0.5**2


@pytest.mark.parametrize("element", ELEMENTS)
def test_rigid_rotation_leaves_no_stress_and_turns_the_one_there_is(element):
    """Hughes-Winget: any rotation, in one step, of any angle below a half turn."""
    mesh = one_body(*sphere(1.0, 0.7))
    solid = Solid(mesh, [STEEL], element)
    axis, angle = np.array([2.0, -1.0, 2.0]) / 3, 1.5
    K = np.cross(np.eye(3), -axis)
    R = np.eye(3) + math.sin(angle) * K + (1 - math.cos(angle)) * K @ K
    state = initial_state(mesh.x, mesh.num_cells)
    move(state, mesh.x @ R.T, 0.1)
    internal_forces(solid, state, 0.1)
    # Rounding of strains, some eps.
    assert np.abs(solid.stress(state)).max() < 1e-13 * STEEL.E

    state = initial_state(mesh.x, mesh.num_cells)
    before = np.array([[3.0, 1.0, -2.0], [1.0, -4.0, 0.5], [-2.0, 0.5, 1.0]]) * 1e6
    state.deviator[:] = before[ROWS, COLUMNS]
    move(state, mesh.x @ R.T, 0.1)
    internal_forces(solid, state, 0.1)
    after = R @ before @ R.T
    expected = np.tile(after[ROWS, COLUMNS], (mesh.num_cells, 1))
    np.testing.assert_allclose(state.deviator, expected, atol=0.1)  # of E = 2e11: rounding


@pytest.mark.parametrize("angle", [0.5e-4, 0.99e-4, 1.01e-4])
def test_small_spins_turn_the_stress_to_the_third_order(angle):
    """Below 1e-4 in a step by a series; its next term is 4/3 angle³ of the stress at most."""
    mesh = one_body(*sphere(1.0, 0.7))
    solid = Solid(mesh, [Elastic(1.0, 0.3, 7800.0)])
    R = Rotation.from_rotvec(angle * np.array([2.0, -1.0, 2.0]) / 3).as_matrix()
    before = np.array([[3.0, 1.0, -2.0], [1.0, -4.0, 0.5], [-2.0, 0.5, 1.0]])
    state = initial_state(mesh.x, mesh.num_cells)
    state.deviator[:] = before[ROWS, COLUMNS]
    move(state, mesh.x @ R.T, 1.0)
    internal_forces(solid, state, 1.0)
    error = np.abs(state.deviator - (R @ before @ R.T)[ROWS, COLUMNS]).max()
    # Rounding of positions over the edges, some eps, turns the rest.
    assert error < (4 / 3 * angle**3 + 2e-15) * np.linalg.norm(before)
    # No stress grows by turning: 2 angle⁴ in a step.
    length = von_mises(state.deviator) / von_mises(before[ROWS, COLUMNS][None])
    assert np.abs(length - 1).max() < 2 * angle**4 + 2e-15


def test_strain_increments_turn_with_the_body():
    """Stretched while it turns, the body carries the turned stress of the stretch alone.

    A second order in the angle of a step: an increment that were not turned from the
    middle of its step to the end would leave the stress half a step's angle behind, and
    a vibrating, turning grain would gain energy for ever.
    """
    mesh = one_body(*box((1.0, 1.0, 1.0), (1, 1, 1)))
    solid = Solid(mesh, [STEEL])
    stretch, total, errors = 1e-5, 1.0, []
    for num_steps in (10, 20):
        state = initial_state(mesh.x, mesh.num_cells)
        for k in range(1, num_steps + 1):
            angle, part = total * k / num_steps, stretch * k / num_steps
            R = np.eye(3)
            R[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
            F = R @ np.diag([1 + part, 1 - part, 1.0])
            move(state, mesh.x @ F.T, 1.0)
            internal_forces(solid, state, 1.0)
        size = 2 * STEEL.shear_modulus * stretch
        expected = size * (R @ np.diag([1.0, -1.0, 0.0]) @ R.T)[ROWS, COLUMNS]
        errors.append(np.abs(state.deviator - expected).max() / size)
    # Half a step's angle would be 0.05 and 0.025.
    assert errors[0] < 0.01
    assert errors[1] < errors[0] / 3.5


def test_mean_pressure_derives_from_its_energy():
    """f = -dU/dx of U = Σ V K (J ln J - J + 1) + Σ V G (e⁴/4 + e⁵/5 + ...).

    The first sum is over nodes, the other over elements, with e = 1 - 1/J. By differences of U.
    """
    mesh = one_body(*box((1.0, 1.0, 1.0), (1, 1, 1)))
    material = J2(1.0, -0.5, 1.0, ((0.0, 1.0),))
    solid = Solid(mesh, [material])
    rng = np.random.default_rng(1)
    x = mesh.x + 0.02 * rng.standard_normal(mesh.x.shape)
    state = initial_state(mesh.x, mesh.num_cells)
    state.x[:] = x  # without velocity: the deviator stays zero
    f = internal_forces(solid, state, 0.0)

    def energy(x):
        volume = np.linalg.det(x[mesh.cells[:, 1:]] - x[mesh.cells[:, :1]]) / 6
        now = np.bincount(mesh.cells.ravel(), np.repeat(volume / 4, 4), mesh.num_nodes)
        before = solid.kernel.node_volume0
        J, e = now / before, 1 - solid.volume0 / volume
        own = -np.log(1 - e) - e - e**2 / 2 - e**3 / 3
        of_means = (before * material.bulk_modulus * (J * np.log(J) - J + 1)).sum()
        return of_means + (solid.volume0 * material.shear_modulus * own).sum()

    numeric, step = np.zeros_like(x), 1e-5
    for i in np.ndindex(x.shape):
        d = np.zeros_like(x)
        d[i] = step
        numeric[i] = -(energy(x + d) - energy(x - d)) / (2 * step)
    # Central differences: step² and eps/step.
    np.testing.assert_allclose(f, numeric, atol=1e-8 * np.abs(f).max())
    assert solid.elastic_energy(state).sum() == pytest.approx(energy(x), rel=1e-12)


def test_plastic_return_is_the_limit_of_fine_steps():
    """Along a straight path radial return is exact: one step equals a thousand, and the ODE."""
    G, strain, stress = 40e9, np.array([0.0, 0.01, 0.05]), np.array([10e6, 50e6, 110e6])
    table = np.concatenate([[stress[0], strain.size], strain, stress])
    total = 0.03  # deviatoric strain times sqrt(2/3): q grows by 3 G of it
    for elastic_limit_steps in (1, 1000):
        q = alpha = 0.0
        for _ in range(elastic_limit_steps):
            q += 3 * G * total / elastic_limit_steps
            dp = plastic_increment(q, 0.0, alpha, 1.0, G, table)
            assert (dp > 0) == (q > yield_stress_at(alpha, table))
            q, alpha = q - 3 * G * dp, alpha + dp
        # On the yield surface, and elastic + plastic = total strain.
        assert q == pytest.approx(np.interp(alpha, strain, stress), rel=1e-9)
        assert q / (3 * G) + alpha == pytest.approx(total, rel=1e-12)
    assert yield_stress_at(1.0, table) == 110e6


def test_yielding_elements_stay_on_the_yield_surface_and_flow_without_volume():
    """Simple shear of a cube to a strain of 0.07 in 2000 steps: q = Y(alpha), tr s = 0."""
    material = J2(100e9, 0.15, 2650.0, ((0.0, 10e6), (0.05, 110e6)))
    mesh = one_body(*box((1.0, 1.0, 1.0), (1, 1, 1)))
    solid = Solid(mesh, [material])
    state = initial_state(mesh.x, mesh.num_cells)
    num_steps, gamma = 2000, 0.07
    for k in range(1, num_steps + 1):
        x = mesh.x.copy()
        x[:, 0] += gamma * k / num_steps * mesh.x[:, 2]
        move(state, x, 1.0)
        internal_forces(solid, state, 1.0)
    q, alpha = von_mises(state.deviator), state.plastic_strain
    np.testing.assert_allclose(q, np.interp(alpha, [0, 0.05], [10e6, 110e6]), rtol=1e-9)
    np.testing.assert_allclose(state.deviator[:, :3].sum(axis=1), 0, atol=1e-6 * q.max())
    # γ/√3 = q/3G + alpha where rotation is neglected, of the order γ²/12.
    np.testing.assert_allclose(q / (3 * material.shear_modulus) + alpha, gamma / 3**0.5, rtol=2e-3)
    # Its work is ∫ Y dalpha; the rule is of the first order in the step, or better.
    work = 10e6 * alpha + 0.5 * (110e6 - 10e6) / 0.05 * alpha**2
    np.testing.assert_allclose(state.plastic_work / solid.volume0, work, rtol=2e-3)


# --- closest features -------------------------------------------------------------------------


def test_closest_point_against_sampling():
    rng = np.random.default_rng(2)
    i, j = np.meshgrid(np.arange(121), np.arange(121))
    keep = i + j <= 120
    b, c = i[keep] / 120, j[keep] / 120
    weights = np.column_stack([1 - b - c, b, c])
    seen = set()
    for _ in range(300):
        x = rng.standard_normal((3, 3))
        p = 2 * rng.standard_normal(3)
        *w, feature = closest_point(*p, x, 0, 1, 2)
        seen.add(feature)
        distance = np.linalg.norm(p - w @ x)
        sampled = np.linalg.norm(p - weights @ x, axis=1).min()
        spacing = np.linalg.norm(x[[1, 2, 0]] - x, axis=1).max() / 120
        assert min(w) >= 0 and sum(w) == pytest.approx(1, abs=1e-14)
        # No sample is nearer, and one is within a spacing.
        assert distance <= sampled * (1 + 1e-12) <= distance + spacing
    assert seen == set(range(7))


def l_shape():
    """Surface of a concave body: three cubes in an L, from their tetrahedra."""
    points, cells = box((2.0, 2.0, 1.0), (2, 2, 1))
    centre = points[cells].mean(axis=1)
    cells = cells[~((centre[:, 0] > 1) & (centre[:, 1] > 1))]
    mesh = one_body(*_used(points, cells))
    return (
        mesh.x,
        mesh.facets,
        lambda p: np.all((p >= 0) & (p <= [2, 2, 1])) and not (p[0] > 1 and p[1] > 1),
    )


def cube():
    mesh = one_body(*box((1.0, 1.0, 1.0), (1, 1, 1)))
    return mesh.x, mesh.facets, lambda p: np.all((p >= 0) & (p <= 1))


def _used(points, cells):
    nodes, cells = np.unique(cells, return_inverse=True)
    return points[nodes], cells.reshape(-1, 4)


def test_what_is_around_nodes_and_across_edges():
    """By brute force on an octahedron whose last facet is missing."""
    facets = np.array(
        [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5]], np.int32
    )
    offset, ring = rings(facets, 6)
    for n in range(6):
        around = np.flatnonzero((facets == n).any(axis=1))
        assert ring[offset[n] : offset[n + 1]].tolist() == around.tolist()
    across = neighbours(facets, offset, ring)
    edges = [[(f[i], f[(i + 1) % 3]) for i in range(3)] for f in facets.tolist()]
    for f, i in np.ndindex(facets.shape):
        beyond = [g for g, of in enumerate(edges) if edges[f][i][::-1] in of]
        assert across[f, i] == (beyond[0] if beyond else -1)
    assert (across < 0).sum() == 3
    nodes = np.array([5, 0, 4])
    found, of = nodes_around(facets, offset, ring, nodes)
    for n, (first, count) in zip(nodes, of, strict=True):
        ends = np.setdiff1d(facets[(facets == n).any(axis=1)], n)
        assert found[first : first + count].tolist() == ends.tolist()


@pytest.mark.parametrize("body", [cube, l_shape])
def test_sign_of_the_pseudo_normal(body):
    """Points near edges and corners, convex and concave: inside or outside is always right."""
    x, facets, inside = body()
    ring_offset, ring = rings(facets, len(x))
    neighbour = neighbours(facets, ring_offset, ring)
    assert neighbour.min() >= 0
    rng = np.random.default_rng(3)
    edges = x[facets[:, [0, 1]]]
    along = rng.random((len(edges), 1))
    places = np.concatenate([x, edges[:, 0] + along * (edges[:, 1] - edges[:, 0])])
    counts = {True: 0, False: 0}
    for place in places:
        for p in place + 0.05 * rng.standard_normal((40, 3)):
            best = min(
                (np.linalg.norm(p - np.array(w) @ x[f]), k, feature)
                for k, f in enumerate(facets)
                for *w, feature in [closest_point(*p, x, *f)]
            )
            distance, k, feature = best
            *w, _ = closest_point(*p, x, *facets[k])
            n = np.array(pseudo_normal(x, facets, k, feature, neighbour, ring_offset, ring))
            outward = (p - np.array(w) @ x[facets[k]]) @ n
            assert distance > 0
            assert (outward < 0) == inside(p)
            counts[bool(inside(p))] += 1
    assert min(counts.values()) > 100


# --- search -----------------------------------------------------------------------------------


def test_candidates_against_all_pairs():
    rng = np.random.default_rng(4)
    num_nodes, num_facets, reach = 200, 150, 0.15
    x = rng.random((num_nodes + 3 * num_facets, 3))
    first = x[num_nodes::3]
    x[num_nodes + 1 :: 3] = first + 0.1 * rng.standard_normal(first.shape)
    x[num_nodes + 2 :: 3] = first + 0.1 * rng.standard_normal(first.shape)
    facets = (num_nodes + np.arange(3 * num_facets).reshape(-1, 3)).astype(np.int32)
    grain_of_node = rng.integers(0, 4, num_nodes).astype(np.int32)
    grain_of_facet = rng.integers(0, 4, num_facets).astype(np.int32)
    use = rng.random(num_facets) < 0.8
    stands = np.where(rng.random(num_nodes) < 0.5, 0.0, 0.05)

    low, size = x[:num_nodes].min(axis=0), 0.21
    shape = tuple((np.ptp(x[:num_nodes], axis=0) / size).astype(np.int64) + 1)
    cell_offset, cell_nodes = sort_into_cells(x, num_nodes, low, size, shape)
    np.testing.assert_array_equal(np.sort(cell_nodes), np.arange(num_nodes))
    offset, found = find_candidates(
        x, grain_of_node, facets, grain_of_facet, use, np.full(len(facets), reach), stands, low,
        size, shape, cell_offset, cell_nodes,
    )  # fmt: skip

    twin = set()
    for n in range(num_nodes):
        for f in np.flatnonzero(use & (grain_of_facet != grain_of_node[n])):
            *w, _ = closest_point(*x[n], x, *facets[f])
            if np.linalg.norm(x[n] - np.array(w) @ x[facets[f]]) <= reach + stands[n]:
                twin.add((n, int(f)))
    pairs = {(n, int(f)) for n in range(num_nodes) for f in found[offset[n] : offset[n + 1]]}
    assert pairs == twin and found.size == len(pairs) > 100
    for n in range(num_nodes):
        assert np.all(np.diff(grain_of_facet[found[offset[n] : offset[n + 1]]]) >= 0)
