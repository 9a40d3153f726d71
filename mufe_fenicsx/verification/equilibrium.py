"""Static equilibrium of a simulation without friction, found directly.

The unknown is the displacement at which the very forces that the time steps use
(tetrahedra and contact) vanish at all free nodes. Newton's method with the set of closed
contacts of the last iterate; linear systems by conjugate gradients, preconditioned by
algebraic multigrid (PETSc GAMG) of the plain linear tetrahedra, each rank for its own bodies.
Explicit dynamics with damping ends in the same state some hundred times slower.
"""

import math

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem.petsc import assemble_matrix
from petsc4py import PETSc

from ..errors import SolverError

#: Tangential over normal stiffness of the contact springs: without friction they carry nothing,
#: and they must not count in the tangent.
RATIO = 1e-9
#: Stiffness of a held degree of freedom over that of the stiffest node, in the preconditioner.
STIFF = 1.0


class Equilibrium:
    """Newton's method on the forces of a simulation. Collective.

    Args:
        simulation: :class:`~mufe_fenicsx.simulation.Simulation` without friction; its time
            does not advance and its tangential contact stiffness is taken away.
        held: Pairs (nodes of this rank, unit vector (3,)): displacements along the vector are
            prescribed at these nodes. They must keep every body from moving as a whole, without
            the help of contacts: the preconditioner knows nothing of these.
    """

    def __init__(self, simulation, held):
        self.simulation, self.comm = simulation, simulation.comm
        self.held = [(np.asarray(nodes), np.asarray(d, float)) for nodes, d in held]
        simulation.contact.ratio[:] = RATIO
        self.num_products = 0  #: products with the tangent so far
        self._multigrid = self._make_multigrid()

    def move(self, shift, wall_move=0.0, tolerance=1e-4, max_iterations=40):
        """Bring the bodies to rest. Collective.

        Args:
            shift: First guess of the displacement from the present state [m], shape
                (num_nodes, 3); where displacements are held, the prescribed one.
            wall_move: Largest distance that a wall was moved since the last call [m].
            tolerance: Energy norm of the last correction over that of the deformation.
            max_iterations: Newton iterations at most.

        Returns:
            Number of iterations.

        Raises:
            SolverError: The iterations do not converge; on all ranks.
        """
        s = self.simulation
        start = s.state.x.copy(), s.state.deviator.copy()
        move = np.array(shift, dtype=float)
        for k in range(max_iterations):
            residual = self.hold(self._forces(start, move, 0.0 if k else wall_move))
            energy = s.energies()
            norm = self._dot(residual, self._precondition(residual))
            error = math.sqrt(norm / (2 * (energy["elastic"] + energy["contact"])))
            s.state.num_steps += 1
            if error <= tolerance:
                s.state.u[:] = s.state.x - s.mesh.x
                s.state.v[:] = 0.0
                s.state.a[:] = 0.0
                return k
            move += self.solve(residual, 1e-2)
        raise SolverError(
            f"equilibrium not found in {max_iterations} iterations: error = {error:g}"
        )

    def reaction(self, nodes, direction):
        """Force of the bodies on what holds ``nodes`` of this rank along ``direction`` [N]."""
        forces = self.simulation.force.x.array.reshape(-1, 3)[nodes]
        return self.comm.allreduce(float((forces @ direction).sum()))

    def _forces(self, start, move, wall_move):
        """All nodal forces [N] after ``move`` in one step from ``start``, stresses included."""
        s = self.simulation
        state, f = s.state, s.force.x.array.reshape(-1, 3)
        state.x[:], state.deviator[:] = start[0] + move, start[1]
        state.v[:] = move  # in one unit of time
        f[:] = 0.0
        s.contact.begin(state.x, wall_move)
        inverted = s.solid.add_internal_forces(f, state, 1.0)
        if self.comm.allreduce(int(inverted >= 0)):
            raise SolverError("equilibrium not found: an element lost its volume")
        s.contact.add_forces(f, state.x)
        state.v[:] = 0.0
        return f.copy()

    def hold(self, values):
        """Set the held directions of nodal vectors, shape (num_nodes, 3), to zero, in place."""
        for nodes, d in self.held:
            values[nodes] -= np.outer(values[nodes] @ d, d)
        return values

    def _tangent(self, q):
        y = np.zeros_like(q)
        self.simulation.solid.add_stiffness(y, q, self.simulation.state.x)
        self.simulation.contact.add_stiffness(y, q, 0.0)
        self.num_products += 1
        return self.hold(y)

    def solve(self, load, reduction, max_products=400):
        """Displacements [m] by ``load`` [N] at the present tangent. Collective.

        Conjugate gradients until the energy norm of the residual is the part ``reduction``
        of the first one.
        """
        x, r = np.zeros_like(load), self.hold(load.copy())
        p = self._precondition(r)
        rz = self._dot(r, p)
        goal = reduction**2 * rz
        for _ in range(max_products):
            q = self._tangent(p)
            step = rz / self._dot(p, q)
            x += step * p
            r -= step * q
            z = self._precondition(r)
            before, rz = rz, self._dot(r, z)
            if rz <= goal:
                break
            p = z + (rz / before) * p
        return x

    def _dot(self, a, b):
        return self.comm.allreduce(float(np.vdot(a, b)))

    def _precondition(self, r):
        pc, right, left = self._multigrid
        right.array[:] = r.ravel()
        pc.apply(right, left)
        return self.hold(left.array.reshape(-1, 3).copy())

    def _make_multigrid(self):
        """Multigrid of this rank's bodies; no body spans ranks, so nothing is left out."""
        m, solid = self.simulation.mesh, self.simulation.solid
        u, v = ufl.TrialFunction(m.V), ufl.TestFunction(m.V)
        G = m.cell_function(solid.shear[m.grain_of_cell])
        lame = m.cell_function((solid.bulk - 2 / 3 * solid.shear)[m.grain_of_cell])

        def strain(w):
            return ufl.sym(ufl.grad(w))

        energy = 2 * G * ufl.inner(strain(u), strain(v)) + lame * ufl.div(u) * ufl.div(v)
        whole = assemble_matrix(fem.form(energy * ufl.dx))
        whole.assemble()
        A = whole.getDiagonalBlock()
        stiffness = STIFF * A.getDiagonal().max()[1]
        for nodes, d in self.held:
            dyad = stiffness * np.outer(d, d)
            for node in nodes:
                rows = (3 * node + np.arange(3)).astype(PETSc.IntType)
                A.setValues(rows, rows, dyad, addv=PETSc.InsertMode.ADD)
        A.assemble()
        A.setBlockSize(3)
        A.setOption(PETSc.Mat.Option.SPD, True)
        places = PETSc.Vec().createWithArray(m.x.ravel().copy(), bsize=3, comm=PETSc.COMM_SELF)
        A.setNearNullSpace(PETSc.NullSpace().createRigidBody(places))
        pc = PETSc.PC().create(PETSc.COMM_SELF)
        pc.setOperators(A)
        pc.setType("gamg")
        pc.setOptionsPrefix("equilibrium_")
        # Held directions are not aligned with axes: smooth by blocks of a node.
        PETSc.Options("equilibrium_")["mg_levels_pc_type"] = "pbjacobi"
        pc.setFromOptions()
        pc.setUp()
        right, left = A.createVecs()
        return pc, right, left
