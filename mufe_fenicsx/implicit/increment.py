"""What an increment has to bring into balance: the residual of the forces, and its tangent."""

import math

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from ..bulk.elastic_tangent import NearTangent
from ..bulk.tangent import SolidTangent
from ..contact.stiffness.tangent import ContactTangent
from ..solvers.jacobian_products import Products
from .linear_system import LinearSystem
from .preconditioner import NearSystem
from .prescribed_nodes import HeldNodes

#: Largest motion of a node within an increment, over the mean facet edge.
LARGEST_MOVE = 0.5
#: Motion of nodes in differences of forces, over the mean facet edge.
DIFFERENCE = 1e-7


class IncrementEquations:
    """Residual and tangent of an increment, for :class:`~.integrators.newton.Newton`. Collective.

    Args:
        simulation: :class:`~.implicit.ImplicitSimulation`.
        solver: One of linear_system.SOLVERS.
        petsc: Further options of PETSc, without the prefix ``mufe_``.

    Attributes:
        system: :class:`~.linear_system.LinearSystem` that the tangent goes to.
        products: :class:`~.integrators.products.Products`, or None where the tangent is assembled.
        held: :class:`~.held_nodes.HeldNodes`.
        drag: Of static increments, force over velocity of each node [N s/m], shape (num_nodes,).
        start: :class:`~.increment_start.IncrementStart`.
        mark: :class:`~.contact.rewind.ContactMark` at the start.
        wall_move: Largest motion of a wall in the increment [m].
        reach: Reading of the contacts' clock up to which the last search is good [m].
        too_far: Largest motion that it was not good for [m].
    """

    def __init__(self, simulation, solver, petsc):
        s = self._simulation = simulation
        self.comm, self.method, mesh = s.comm, s.method, s.mesh
        self._contact_tangent = ContactTangent(s.contact, mesh)
        self.held = HeldNodes(mesh, s.held, s.bonded.nodes, self._contact_tangent)
        self._u0 = fem.Function(mesh.V)
        part = 1.0 - self.method.force_of_start if self.method else 1.0
        if solver == "products":
            self._tangent, near = None, NearTangent(s.solid)
            self.system = NearSystem(mesh, near, self.held, "mufe_", petsc, part)
            way = DIFFERENCE * s.contact.edge
            self.products = Products(
                self.system, self._forces_of_grains, mesh, self.held.project, way, part
            )
        else:
            self.products = None
            self._tangent = own = SolidTangent(s.solid, s.u, self._u0)
            self.system = LinearSystem(mesh, own.offset, own.columns, "mufe_", solver, petsc)
        self._stiffness = self._share_of_stiffness()
        self.drag = s.stabilisation * s.first_step * self._stiffness
        self.start = self.mark = self._dt = None
        self.wall_move = self.reach = self.too_far = 0.0

    def begin(self, start, dt):
        """Be those of an increment of length ``dt`` from ``start`` on. Local."""
        self.start, self._dt = start, dt
        self._u0.x.array[:] = self._simulation.state.u.ravel()

    def residual(self, du):
        """Minus the sum of all forces after the displacement ``du``, and the internal ones' size.

        r is None, on all ranks, where a node goes too far or an element turns inside out.
        """
        sim, start, dt = self._simulation, self.start.state, self._dt
        s, contact, f, method = sim.state, sim.contact, sim._f, self.method
        move = float(np.abs(du).max(initial=0.0)) if np.isfinite(du).all() else math.inf
        move = self.comm.allreduce(max(math.sqrt(3.0) * move, self.wall_move), op=MPI.MAX)
        if not move < LARGEST_MOVE * contact.edge:
            return None, 0.0
        self.mark.restore()
        contact.advance(2.0 * move)
        if contact.clock > self.reach:
            self.too_far = max(self.too_far, move)
            return None, 0.0
        self._place(du)
        contact.place(s.x)
        inverted = sim.solid.add_internal_forces(f, s, dt)
        if self.products:
            self.products.take(du, f)
        if self.comm.allreduce(int(inverted >= 0)):
            contact.receive()
            return None, 0.0
        size = float(np.vdot(f, f))
        contact.receive()
        contact.evaluate(f)
        sim.bonded.take_forces(f, s.v, s.x)
        sim.mirrors.take_forces(f, s.x)
        if method:
            a1 = method.acceleration(du, start["v"], start["a"], dt)
            v1 = method.velocity(a1, start["v"], start["a"], dt)
            ma, mf = method.inertia_of_start, method.force_of_start
            mass = sim.solid.mass[:, None]
            r = mass * ((1 - ma) * a1 + ma * start["a"])
            size += float(np.vdot(r, r))
            r -= (1 - mf) * (f - sim.damping * mass * v1)
            r -= mf * (self.start.force - sim.damping * mass * start["v"])
        else:
            drag = (self.drag / dt)[:, None] * du
            r = drag - f
        return self.held.project(r), math.sqrt(self.comm.allreduce(size))

    def _place(self, du):
        """The state at the start of the increment, nodes moved by ``du``, no forces. Local."""
        sim, start = self._simulation, self.start.state
        s = sim.state
        s.x[:] = start["x"] + du
        s.u[:] = s.x - sim.mesh.x
        s.v[:] = du / self._dt
        for name in ("deviator", "plastic_strain", "plastic_work"):
            getattr(s, name)[:] = start[name]
        sim._f[:] = 0.0

    def _forces_of_grains(self, du):
        """Their own forces after the displacement ``du``; None where one turns inside out."""
        sim = self._simulation
        self._place(du)
        inverted = sim.solid.add_internal_forces(sim._f, sim.state, self._dt)
        return None if self.comm.allreduce(int(inverted >= 0)) else sim._f

    def set_tangent(self, regularisation=0.0):
        """The derivative of :meth:`residual` at its last argument, into the linear system.

        ``regularisation`` times the share of each node in its grain's stiffness is added.
        """
        sim, start, method, dt = self._simulation, self.start.state, self.method, self._dt
        rows, columns, contact = self._contact_tangent(self.mark)
        nodes = self._contact_tangent.global_nodes()
        factor = 1.0
        if method:
            factor = 1.0 - method.force_of_start
            slope = method.inertia_slope(dt)
            slope += factor * sim.damping * method.velocity_slope(dt)
            diagonal = slope * sim.solid.mass
        else:
            diagonal = self.drag / dt
        diagonal = diagonal + regularisation * self._stiffness
        contact *= factor
        tangent = self._tangent
        if tangent is None:
            self.held.project_contact(rows, columns, contact)
            self.system.put(diagonal, nodes[rows], nodes[columns], contact)
            return
        tangent.take(sim.state, start["deviator"], start["plastic_strain"], dt)
        blocks = factor * tangent.assemble(sim.state.x)
        blocks[tangent.diagonal] += diagonal[:, None, None] * np.eye(3)
        self.held.project_tangent(tangent, blocks, rows, columns, contact)
        self.system.set(blocks, nodes[rows], nodes[columns], contact)

    def _share_of_stiffness(self):
        """E* V^(1/3) m/M of each node [N/m], shape (num_nodes,)."""
        mesh, solid = self._simulation.mesh, self._simulation.solid
        volume = np.add.reduceat(solid.volume0, mesh.cell_offset[:-1])
        mass = np.bincount(mesh.grain_of_node, solid.mass, mesh.num_grains)
        stiffness = solid.contact_modulus * np.cbrt(volume)
        return (stiffness / mass)[mesh.grain_of_node] * solid.mass
