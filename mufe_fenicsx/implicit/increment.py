"""What an increment has to bring into balance: the residual of the forces, and its tangent."""

import math

import numpy as np
from mpi4py import MPI

from ..bulk.elastic_tangent import NearTangent
from ..bulk.tangent import SolidTangent
from ..contact.stiffness.tangent import ContactTangent
from ..errors import InputError
from ..solvers.jacobian_products import Products
from .linear_system import LinearSystem
from .preconditioner import ElasticPreconditioner
from .prescribed_nodes import HeldNodes

#: Largest motion of a node within an increment, over the mean facet edge.
LARGEST_MOVE = 0.5
#: Motion of nodes in differences of forces, over the mean facet edge.
DIFFERENCE = 1e-7


def check_increments(specimen, method):
    """What increments cannot do, said on all ranks together. Collective.

    Args:
        specimen: :class:`~mufe_fenicsx.specimen.Specimen`.
        method: Of dynamic increments; None: static.

    Raises:
        InputError: Rigid grains; tools that are free, or tools in dynamic increments.
    """
    rigid, tools = specimen.rigid, specimen.tools
    if specimen.comm.allreduce(rigid.num_grains - tools.rows.size):
        raise InputError("rigid grains, expected deformable ones for an implicit solver")
    if tools.any and method:
        raise InputError("tools, expected none for dynamic increments: use static ones or steps")
    for tool in tools.tools:
        if tool.free:
            raise InputError(
                f"free of tool {tool.name} = {', '.join(tool.free)}, expected none for static "
                "increments, which know no inertia: tell its motion"
            )


class IncrementEquations:
    """Residual and tangent of an increment, for :mod:`~mufe_fenicsx.solvers.newton`. Collective.

    Args:
        specimen: :class:`~mufe_fenicsx.specimen.Specimen`, the term of contact first.
        method: :class:`~mufe_fenicsx.solvers.generalised_alpha.GeneralisedAlpha`; None: static.
        drag_time: Of static increments: stabilisation times the length of the first [s].
        held: Pairs (nodes, unit vector) of what is prescribed.
        solver: One of linear_system.SOLVERS.
        petsc: Further options of PETSc, without the prefix ``mufe_``.

    Attributes:
        system: :class:`~.linear_system.LinearSystem` that the tangent goes to.
        products: :class:`~mufe_fenicsx.solvers.jacobian_products.Products`; None where the tangent
            is assembled.
        held: :class:`~.held_nodes.HeldNodes`.
        drag: Of static increments, force over velocity of each node [N s/m], shape (num_nodes,).
        start: :class:`~.increment_start.IncrementStart`.
        mark: :class:`~.contact.rewind.ContactMark` at the start.
        wall_move: Largest motion of a wall in the increment [m].
        reach: Bound of relative motion up to which the last search is good [m].
        too_far: Largest motion that it was not good for [m].
    """

    def __init__(self, specimen, method, drag_time, held, solver, petsc):
        s = self._specimen = specimen
        self.comm, self.method, mesh = s.comm, method, s.mesh
        self._contact_tangent = ContactTangent(s.contact, mesh)
        led = s.rigid.lists.nodes  # of tools, the only rigid bodies here
        fixed = np.concatenate([s.glued.nodes, led])
        self.held = HeldNodes(mesh, held, fixed, self._contact_tangent)
        part = 1.0 - self.method.force_of_start if self.method else 1.0
        if solver == "products":
            self._tangent, near = None, NearTangent(s.solid)
            self.system = ElasticPreconditioner(mesh, near, self.held, "mufe_", petsc, part)
            way = DIFFERENCE * s.contact.edge
            self.products = Products(
                self.system, self._forces_of_grains, mesh, self.held.project, way, part
            )
        else:
            self.products = None
            self._tangent = own = SolidTangent(s.solid)
            self.system = LinearSystem(mesh, own.offset, own.columns, "mufe_", solver, petsc)
        self._stiffness = self._share_of_stiffness()
        self.drag = drag_time * self._share_of_hold()
        self.drag[led] = 0.0
        self.start = self.mark = self._dt = None
        self.wall_move = self.reach = self.too_far = 0.0

    def begin(self, start, dt):
        """Be those of an increment of length ``dt`` from ``start`` on. Local."""
        self.start, self._dt = start, dt

    def residual(self, du):
        """Minus the sum of all forces after the displacement ``du``, and the internal ones' size.

        r is None, on all ranks, where a node goes too far or an element turns inside out.
        """
        specimen, start, dt = self._specimen, self.start.state, self._dt
        s, contact, f, method = specimen.state, specimen.contact, specimen.f, self.method
        move = float(np.abs(du).max(initial=0.0)) if np.isfinite(du).all() else math.inf
        move = self.comm.allreduce(max(math.sqrt(3.0) * move, self.wall_move), op=MPI.MAX)
        if not move < LARGEST_MOVE * contact.edge:
            return None, 0.0
        self.mark.restore()
        contact.motion.advance(2.0 * move)
        if contact.motion.bound > self.reach:
            self.too_far = max(self.too_far, move)
            return None, 0.0
        self._place(du)
        specimen.solid.inverted = -1
        for term in specimen.terms:
            term.begin_forces(f, s, dt)
        if self.products:
            self.products.take(du, f)
        if self.comm.allreduce(int(specimen.solid.inverted >= 0)):
            specimen.solid.inverted = -1
            contact.ghosts.receive()
            return None, 0.0
        size = float(np.vdot(f, f))
        for term in specimen.terms:
            term.add_forces(f, s, dt)
        if method:
            a1 = method.acceleration(du, start["v"], start["a"], dt)
            v1 = method.velocity(a1, start["v"], start["a"], dt)
            ma, mf = method.inertia_of_start, method.force_of_start
            mass = specimen.solid.mass[:, None]
            r = mass * ((1 - ma) * a1 + ma * start["a"])
            size += float(np.vdot(r, r))
            r -= (1 - mf) * (f - specimen.damping * mass * v1)
            r -= mf * (self.start.force - specimen.damping * mass * start["v"])
        else:
            drag = (self.drag / dt)[:, None] * du
            r = drag - f
        return self.held.project(r), math.sqrt(self.comm.allreduce(size))

    def _place(self, du):
        """The state at the start of the increment, nodes moved by ``du``, no forces. Local."""
        specimen, start = self._specimen, self.start.state
        s = specimen.state
        s.x[:] = start["x"] + du
        s.u[:] = s.x - specimen.mesh.x
        s.v[:] = du / self._dt
        for name in ("deviator", "plastic_strain", "plastic_work"):
            getattr(s, name)[:] = start[name]
        specimen.f[:] = 0.0

    def _forces_of_grains(self, du):
        """Their own forces after the displacement ``du``; None where one turns inside out."""
        specimen = self._specimen
        self._place(du)
        inverted = specimen.solid.add_internal_forces(specimen.f, specimen.state, self._dt)
        return None if self.comm.allreduce(int(inverted >= 0)) else specimen.f

    def set_tangent(self, regularisation=0.0):
        """The derivative of :meth:`residual` at its last argument, into the linear system.

        ``regularisation`` times the share of each node in its grain's stiffness is added.
        """
        specimen, start, method, dt = self._specimen, self.start.state, self.method, self._dt
        rows, columns, contact = self._contact_tangent(self.mark)
        nodes = self._contact_tangent.global_nodes()
        factor = 1.0
        if method:
            factor = 1.0 - method.force_of_start
            slope = method.inertia_slope(dt)
            slope += factor * specimen.damping * method.velocity_slope(dt)
            diagonal = slope * specimen.solid.mass
        else:
            diagonal = self.drag / dt
        diagonal = diagonal + regularisation * self._stiffness
        contact *= factor
        tangent = self._tangent
        if tangent is None:
            self.held.project_contact(rows, columns, contact)
            more = self._with_terms(nodes[rows], nodes[columns], contact, factor)
            self.system.put(diagonal, *more)
            return
        before = (start[name] for name in ("u", "deviator", "plastic_strain"))
        tangent.take(specimen.state, *before, dt)
        blocks = factor * tangent.assemble(specimen.state.x)
        blocks[tangent.diagonal] += diagonal[:, None, None] * np.eye(3)
        self.held.project_tangent(tangent, blocks, rows, columns, contact)
        more = self._with_terms(nodes[rows], nodes[columns], contact, factor)
        self.system.set(blocks, *more)

    def _with_terms(self, rows, columns, blocks, factor):
        """Blocks of contact, by global nodes, and after them those of added terms."""
        first = self._specimen.mesh.first_node
        for term in self._specimen.added_terms:
            found = self._specimen.ask(term, "stiffness", self._specimen.state)
            if found is None:
                continue
            own_rows, own_columns, more = found
            more = factor * more
            self.held.project_nodes(own_rows, own_columns, more)
            rows = np.concatenate([rows, first + own_rows])
            columns = np.concatenate([columns, first + own_columns])
            blocks = np.concatenate([blocks, more])
        return rows, columns, blocks

    def _share_of_stiffness(self):
        """E* V^(1/3) m/M of each node [N/m], shape (num_nodes,)."""
        mesh, solid = self._specimen.mesh, self._specimen.solid
        volume = np.add.reduceat(solid.volume0, mesh.cell_offset[:-1])
        mass = np.bincount(mesh.grain_of_node, solid.mass, mesh.num_grains)
        stiffness = solid.contact_modulus * np.cbrt(volume)
        return (stiffness / mass)[mesh.grain_of_node] * solid.mass

    def _share_of_hold(self):
        """The same with the least E* of all grains, which holds the others; 0 of glued ones."""
        mesh, modulus = self._specimen.mesh, self._specimen.solid.contact_modulus
        of_bodies = ~mesh.is_tool
        least = modulus[of_bodies].min(initial=math.inf)
        least = self.comm.allreduce(least, op=MPI.MIN)
        hold = least / modulus
        hold[mesh.grain_of_node[self._specimen.glued.nodes]] = 0.0
        return hold[mesh.grain_of_node] * self._stiffness
