"""What an increment has to bring into balance: the residual of the forces, and its tangent."""

import math

import numpy as np
from mpi4py import MPI

from ..bulk.elastic_tangent import NearTangent
from ..bulk.tangent import SolidTangent
from ..contact.mark import ContactMark
from ..contact.stiffness.tangent import ContactTangent
from ..errors import InputError
from ..solvers.jacobian_products import Products
from ..solvers.newton import Newton
from .increment_start import IncrementStart
from .linear_system import LinearSystem, solver_by_size
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


def check_terms(specimen):
    """Raise InputError for an added term that has springs alone. Collective."""
    s = specimen.state
    for term in specimen.added_terms:
        springs = specimen.ask(term, "springs", s, 0.0)
        if springs is not None and term.stiffness(s) is None:
            raise InputError(
                f"force term {term.name} has springs alone, expected a stiffness where "
                "increments are static or implicit: time steps know springs"
            )


class IncrementEquations:
    """Residual and tangent of an increment, for :mod:`~mufe_fenicsx.solvers.newton`. Collective.

    Args:
        specimen: :class:`~mufe_fenicsx.specimen.Specimen`, the term of contact first.
        settings: :class:`~.increment_settings.IncrementSettings`.
        held: Pairs (nodes, unit vector) of what is prescribed.

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

    def __init__(self, specimen, settings, held):
        s, self._settings = specimen, settings
        self._specimen, self.comm, self.method, mesh = s, s.comm, settings.method, s.mesh
        self._contact_tangent = ContactTangent(s.contact, mesh)
        led = s.rigid.lists.nodes  # of tools, the only rigid bodies here
        fixed = np.concatenate([s.glued.nodes, led])
        self.held = HeldNodes(mesh, held, fixed, self._contact_tangent)
        part = 1.0 - self.method.force_of_start if self.method else 1.0
        solver, petsc = settings.linear_solver or solver_by_size(mesh), settings.petsc
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
        self.drag = settings.drag_time * self._share_of_hold()
        self.drag[led] = 0.0
        self.start = self.mark = self._dt = None
        self.wall_move = self.reach = self.too_far = 0.0

    def newton(self):
        """Newton's method for the displacements of an increment. Collective."""
        settings, sp = self._settings, self._specimen
        modulus = float(sp.solid.contact_modulus.max(initial=0.0))
        modulus = self.comm.allreduce(modulus, op=MPI.MAX)
        return Newton(
            self.system, self.residual, self.set_tangent, "mufe_", settings.tolerance,
            settings.no_force * modulus * sp.contact.edge**2 / settings.tolerance,
            settings.max_iterations, self.products,
        )  # fmt: skip

    def begin(self, dt):
        """Be those of an increment of length ``dt`` [s] from here on; walls move. Local."""
        s = self._specimen
        self.start, self._dt = IncrementStart(s), dt
        self.wall_move = s.walls.move(dt)
        # Anchors on walls that turned have gone along.
        self.mark = ContactMark(s.contact)
        s.walls.add_work()
        self.reach = s.contact.motion.searched_at + s.contact.motion.skin

    def expect(self, way):
        """Search pairs anew where nodes may move out of reach by ``way`` [m]. Collective."""
        way = self.comm.allreduce(max(self.wall_move, way), op=MPI.MAX)
        if self._specimen.contact.motion.bound + 3.0 * way > self.reach:
            self.search(4.0 * way)

    def search(self, ahead):
        """Pairs anew at the start of the increment, for motions of ``ahead`` [m]. Collective."""
        self.mark.restore()
        contact = self._specimen.contact
        contact.search(self.start.state["x"], ahead=ahead)
        self.reach = contact.motion.searched_at + max(contact.motion.skin, ahead)
        self.mark = ContactMark(contact)
        self.system.forget()

    def rewind(self):
        """Back to the start of the increment. Local."""
        self.mark.restore()
        self._specimen.walls.turn_back()
        self.start.restore()

    def take(self, du, unbalanced):
        """Take the state that was found, displaced by ``du`` [m]. Local.

        Args:
            unbalanced: Whether forces of the start had no equilibrium.
        """
        sp, start, method, dt = self._specimen, self.start.state, self.method, self._dt
        s = sp.state
        if method:
            s.a[:] = method.acceleration(du, start["v"], start["a"], dt)
            s.v[:] = method.velocity(s.a, start["v"], start["a"], dt)
            middle = 0.5 * (s.v + start["v"])
            sp.damped += sp.damping * dt * float((sp.free_mass[:, None] * middle**2).sum())
        else:
            s.a[:], s.v[:] = 0.0, 0.0
            sp.damped += float(((self.drag / dt)[:, None] * du**2).sum())
            if unbalanced:
                # Weight that comes at once, or what time steps left: half of its work is lost.
                sp.damped += 0.5 * float(np.vdot(self.start.force, du))
        sp.contact.motion.measure_from(sp.contact.ghosts.positions.own)
        s.t += dt
        s.dt = dt
        s.num_steps += 1

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
