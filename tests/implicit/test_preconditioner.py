"""The preconditioner of products: elasticity near the tangent, and rigid pieces under it."""

import numpy as np

import mufe_fenicsx  # noqa: F401  first: the wheel's MPI

# isort: split
from mpi4py import MPI
from petsc4py import PETSc

import mufe_fenicsx.implicit.coarse_space as coarse_space
from mufe_fenicsx.bulk.elastic_tangent import NearTangent
from mufe_fenicsx.bulk.solid import Solid
from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.implicit.coarse_space import CoarseSpace
from mufe_fenicsx.implicit.simulation import ImplicitSimulation
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.run.from_bodies import distribute

UP = np.array([0.0, 0.0, 1.0])
STEEL = Elastic(1e9, 0.3, 2650.0)


def test_galerkin_product_of_pieces(monkeypatch):
    """P^T K P of the dense matrices, to rounding; a grain that nothing holds moves for nothing."""
    monkeypatch.setattr(coarse_space, "NODES_OF_PIECE", 9)
    mesh = distribute(MPI.COMM_SELF, [box((1.0, 2.0, 1.5), (2, 3, 2))])
    near = NearTangent(Solid(mesh, [STEEL]))
    held = np.zeros(mesh.num_nodes, dtype=bool)

    def project(values):
        values[held] = 0.0
        return values

    def both(rows, columns, values):
        space = CoarseSpace(mesh, project, near.offset, near.columns, near.blocks)
        K = np.zeros((mesh.num_nodes, 3, mesh.num_nodes, 3))
        row = np.repeat(np.arange(mesh.num_nodes), np.diff(near.offset))
        K[row, :, near.columns, :] = near.blocks
        K = K.reshape(2 * [3 * mesh.num_nodes])
        np.add.at(K, (rows, columns), values)
        P = space.prolongation.convert("dense").getDenseArray()
        more = PETSc.Mat().createAIJ(K.shape, nnz=2)
        for row, column, value in zip(rows, columns, values, strict=True):
            more.setValue(row, column, value)
        more.assemble()
        coarse = space.with_more(more).convert("dense").getDenseArray()
        return P, P.T @ K @ P, coarse, abs(K).max()

    none = np.empty(0, dtype=int)
    P, expected, coarse, largest = both(none, none, np.empty(0))
    assert P.shape[1] == 24
    np.testing.assert_allclose(coarse, expected, rtol=0, atol=1e-10 * largest)
    turn = np.cross(UP, mesh.x).ravel()
    motion = np.linalg.lstsq(P, turn, rcond=None)[0]
    assert abs(P @ motion - turn).max() < 1e-12
    assert abs(coarse @ motion).max() < 1e-10 * largest
    held[mesh.x[:, 2] == 0.0] = True
    rows, columns = np.array([5, 5, 40]), np.array([5, 40, 8])
    _, expected, coarse, largest = both(rows, columns, np.array([3e9, -1e9, 2e9]))
    np.testing.assert_allclose(coarse, expected, rtol=0, atol=1e-10 * largest)


def iterations(length):
    """Of the solver of products, for a bar that stands on its base and bends under its end."""
    mesh = distribute(MPI.COMM_SELF, [box((1.0, 1.0, length), (2, 2, 2 * length))])
    walls = [Wall("base", np.zeros(3), UP, bonded=True)]
    sim = ImplicitSimulation(
        mesh, [STEEL], walls, first_step=1.0, linear_solver="products", petsc={"ksp_rtol": 1e-6}
    )
    sim._begin(1.0)
    sim._newton.set_tangent(sim.system.vector(), 0.0)
    ksp, push = sim._newton.snes.getKSP(), sim.system.vector()
    push.array.reshape(-1, 3)[mesh.x[:, 2] == length, 0] = 1.0
    ksp.setOperators(sim.system.matrix)
    with sim.system.options():
        ksp.solve(push, push.duplicate())
    return ksp.getIterationNumber()


def test_iterations_do_not_grow_with_the_length_of_a_body(monkeypatch):
    """Twice as many elements in a row, as many iterations; with one piece for all 61 and 200."""
    monkeypatch.setattr(coarse_space, "NODES_OF_PIECE", 36)
    short, long = iterations(12), iterations(24)
    assert long <= 1.2 * short
    monkeypatch.setattr(coarse_space, "NODES_OF_PIECE", 100_000)
    assert iterations(24) > 4 * long
