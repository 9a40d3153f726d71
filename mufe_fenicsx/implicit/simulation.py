"""Grains, contact and walls, moved together by implicit increments: static or dynamic.

Forces are those of the specimen, as in time steps, evaluated from the state at the start of the
increment: stress update, contact and friction are the same functions of positions, and a state
can go from one integrator to another and back. Newton's method solves for the displacements; the
tangent is that of `tangent` and `contact.tangent`. Pairs of contact are those of one search
through all iterations of an increment; where grains move further than it saw, it is repeated
from the start of the increment, for a longer way.

Static increments leave inertia out. What no contact holds would then float, and a drag holds it:

    F = -c ΔU/Δt,   c = s E* V^(1/3) Δt_first m/M,

on a node of mass m of a grain of mass M and volume V, s the ``stabilisation``, E* the least of all
grains; glued grains have none. Over the first step Δt_first it is a spring of s times about the
stiffness of the softest grain, and it grows as steps
shrink: where a grain snaps to another place, shorter steps follow it as if through a viscous fluid.
Its work counts as damping.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from mpi4py import MPI

from ..arguments import checked
from ..contact.mark import ContactMark
from ..contact.walls import Wall
from ..errors import InputError, SolverError
from ..materials.elastic import IsotropicSolid
from ..mesh import GrainMesh
from ..solvers.newton import Newton
from ..specimen import OfSpecimen, Specimen
from .contact_in_increments import ContactInIncrements
from .force_controlled_walls import ForceControlledWalls
from .increment import IncrementEquations, check_increments
from .increment_end import IncrementEnd
from .increment_settings import IncrementSettings
from .increment_start import IncrementStart
from .linear_system import solver_by_size

#: Iterations over the most allowed, up to which the next increment is much and a little longer, and
#: from which on it is shorter.
FEW, SOME, MANY = 0.25, 0.5, 0.75
#: Factors of the length of an increment then, and where it failed.
LONGER, LITTLE_LONGER, SHORTER, FAILED = 1.5, 1.2, 0.7, 0.4
#: Searches within one increment.
MAX_SEARCHES = 6


class ImplicitSimulation(OfSpecimen):
    """A specimen in implicit increments. Collective.

    Args:
        mesh, materials, walls: As of :class:`~mufe_fenicsx.specimen.Specimen`; no rigid
            grains, no kinematic law. Walls held at a force, in static increments only, move
            within each until they carry it. Tools, in static increments only, whose motion is told.
        held: Pairs (nodes of this rank, unit vector (3,)): displacements along the vector are
            those of :attr:`prescribed` at these nodes. Their work is not part of that of the walls.
        options: Beside those of the specimen, fields of
            :class:`~mufe_fenicsx.implicit.increment_settings.IncrementSettings` by name.

    Raises:
        InputError: What cannot be used; see the arguments.

    Attributes:
        settings: :class:`~mufe_fenicsx.implicit.increment_settings.IncrementSettings`.
        equations: :class:`~.increment_equations.IncrementEquations`.
        prescribed: Displacements of held nodes in the next increments [m], (num_nodes, 3); they
            stay until they are changed.
        report: Of each increment since the start: (time, length [s], Newton iterations, linear
            iterations, residual at the last three iterations).
        end: :class:`~.increment_end.IncrementEnd`: how far the next increment may go.
        num_on_jumps: Increments that ended on a jump of the forces of contact (solvers.nonsmooth).
    """

    STATE = {"common": ("dt", "dt_element", "most_work")}

    increments = True
    scaling = None  #: increments need no added mass

    @checked
    def __init__(
        self,
        mesh: GrainMesh,
        materials: Sequence[IsotropicSolid],
        walls: Sequence[Wall] = (),
        *,
        held: Sequence[tuple[np.ndarray, np.ndarray]] = (),
        **options: Any,
    ):
        self.settings, options = IncrementSettings.taken_from(options)
        self.method = self.settings.method
        specimen = Specimen(mesh, materials, walls, **options)
        super().__init__(specimen)
        check_increments(specimen, self.method)
        if self.walls.has_servo and self.method:
            raise InputError(
                "a wall is held at a force, expected walls at rest or moving for dynamic increments"
            )
        self.held = [(np.asarray(nodes), np.asarray(d, float)) for nodes, d in held]
        self.held += specimen.mirrors.held()
        self.prescribed = np.zeros_like(mesh.x)
        specimen.start()
        specimen.terms.insert(0, ContactInIncrements(self.contact))
        self.state.a[:] = specimen.f / specimen.solid.mass[:, None]
        self.dt = float(self.settings.first_step)
        own = specimen.solid.element_time_step(self.state.x)
        self.dt_element = self.comm.allreduce(own, op=MPI.MIN)
        specimen.initial_kinetic = self.kinetic_energy()
        self.equations = IncrementEquations(
            specimen, self.method, self.settings.drag_time, self.held,
            self.settings.linear_solver or solver_by_size(mesh), self.settings.petsc,
        )  # fmt: skip
        self._newton = self._make_newton()
        self._held_walls = None
        if self.walls.has_servo:
            self._held_walls = ForceControlledWalls(specimen, self.settings.first_step)
        self._last = None  # displacement of the last increment, its length, motion of its walls
        self.most_work = 0.0  #: of an increment so far [J]
        self._unbalanced = True  # at the start there may be forces without an equilibrium
        self.end = IncrementEnd()
        self.report = []
        self.num_failed = 0  #: increments that had to be shortened
        self.num_on_jumps = 0

    def _make_newton(self):
        """Newton's method for the displacements of an increment. Collective."""
        equations, settings = self.equations, self.settings
        modulus = self.solid.contact_modulus
        floor = self.comm.allreduce(float(modulus.max(initial=0.0)), op=MPI.MAX)
        return Newton(
            equations.system, equations.residual, equations.set_tangent, "mufe_",
            settings.tolerance,
            settings.no_force * floor * self.contact.edge**2 / settings.tolerance,
            settings.max_iterations, equations.products,
        )  # fmt: skip

    @property
    def static(self):
        """Whether increments leave inertia out."""
        return self.method is None

    @property
    def system(self):
        """:class:`~.linear_system.LinearSystem` that the tangent goes to."""
        return self.equations.system

    @property
    def parts(self):
        """All that increments change, :class:`~mufe_fenicsx.state.Stateful` by name."""
        return self.specimen.parts | {"increments": self}

    def deform_all_but(self, still_rigid):
        """Nothing: there are no rigid grains. Local."""

    # --- what stays the same ---------------------------------------------------------------

    def kinetic_energy(self):
        """Kinetic energy of this rank's grains [J]. Local."""
        s = self.state
        return 0.5 * float(self.specimen.free_mass @ (s.v**2).sum(axis=1))

    def complete(self):
        """All nodes are up to date at the end of an increment. Local."""

    def update_time_step(self):
        """Nothing: the length of increments follows from their success. Local."""

    def check(self):
        """Stop where an element fails or a grain is too deep in another one. Collective.

        Raises:
            UnstableError: An element turned inside out or collapsed, or the motion is not
                finite; on all ranks.
            SolverError: An element left its table of yield stresses, or a grain is too deep in
                another one; on all ranks.
        """
        self.specimen.check(math.isfinite(self.kinetic_energy()))

    def response(self, load: np.ndarray) -> np.ndarray:
        """Displacements [m] by small further forces ``load`` [N], both (num_nodes, 3). Collective.

        With the tangent of the present state, which stays.
        """
        self._begin(self.dt)
        found = self._newton.solve_linear(
            np.zeros_like(load), self.equations.held.project(load.copy())
        )
        self._rewind()
        return found

    def take_over(self):
        """Go on from a state that another integrator left. Collective.

        Static increments know no motion: its energy counts as damped.
        """
        s = self.state
        self.dt, self._last, self._unbalanced = float(self.settings.first_step), None, True
        if self.method is None:
            self.specimen.damped += self.kinetic_energy()
            s.v[:], s.a[:] = 0.0, 0.0
        else:
            s.a[:] = self.specimen.f / self.solid.mass[:, None]

    # --- an increment ----------------------------------------------------------------------

    def step(self, everywhere: bool = True) -> None:
        """One increment, shortened until it converges and ends where it may. Collective.

        Raises:
            SolverError: It does not converge at the smallest length; the state is the last one
                that did. On all ranks.
            UnstableError, SolverError: As of :meth:`check`.
        """
        self._check_terms()
        tries, smallest, before = 0, self.settings.smallest, self._work()
        while True:
            dt, mark = self.end.cut(self.dt), self._mark()
            if self._increment(dt) if self._held_walls is None else self._balance(dt, mark):
                if not self.end.goes_too_far(dt, smallest):
                    break
                self._take_back(mark)
                continue
            tries += 1
            self.num_failed += 1
            if tries > 1:  # perhaps it is the guess
                self._last = None
            if dt <= smallest:
                raise SolverError(
                    f"no equilibrium found from t = {self.state.t:g} s on, with increments down "
                    f"to {dt:g} s ({self._reason}): the last one found is kept; load in smaller "
                    "steps, with more stabilisation or less friction, or go on with "
                    'solver.integrator = "explicit"'
                )
            self.dt = max(FAILED * dt, smallest)
        effort = self._newton.effort
        if effort <= SOME:
            factor = LONGER if effort <= FEW else LITTLE_LONGER
            # One that was cut tells nothing about longer ones.
            self.dt = max(self.dt, min(factor * dt, self.settings.largest))
        elif effort >= MANY:
            self.dt = max(SHORTER * dt, smallest)
        self.most_work = max(self.most_work, abs(self._work() - before))
        self.check()

    def _work(self):
        """Work of all walls and tools [J]. Collective."""
        return self.comm.allreduce(float(self.walls.work + self.specimen.tools.work))

    def energy_of_touch(self):
        """Largest work of an increment so far [J]: it is a trapezium. Local.

        A contact that closes within an increment stores less, by at most all of its work.
        """
        return self.most_work

    def _balance(self, dt, mark):
        """One increment at whose end walls carry their targets, or move at their full speed."""

        def take_back():
            self._take_back(mark)
            self._reason = f"walls not at their forces after {self._held_walls.num_trials} trials"

        return self._held_walls(self._increment, take_back, dt)

    def _mark(self):
        """What :meth:`_take_back` needs beside the copy of the state."""
        s = self.state
        return (
            (s.t, s.dt, s.num_steps),
            (self.specimen.damped, self.num_on_jumps),
            len(self.report),
        )

    def _take_back(self, mark):
        """Undo an increment that converged."""
        self._rewind()
        s = self.state
        (s.t, s.dt, s.num_steps), (self.specimen.damped, self.num_on_jumps), length = mark
        del self.report[length:]

    def _check_terms(self):
        """Raise InputError for an added term that has springs alone. Collective."""
        s = self.state
        for term in self.specimen.added_terms:
            springs = self.specimen.ask(term, "springs", s, 0.0)
            if springs is not None and term.stiffness(s) is None:
                raise InputError(
                    f"force term {term.name} has springs alone, expected a stiffness where "
                    "increments are static or implicit: time steps know springs"
                )

    def _increment(self, dt):
        """One increment of length ``dt``; whether it converged. The state stays where not."""
        s, walls = self.state, self.walls
        self._begin(dt)
        guess = self._guess(dt)
        found = None
        for _ in range(MAX_SEARCHES):
            self.equations.too_far = 0.0
            found = self._newton(guess)
            if found is not None or not self.equations.too_far:
                break
            self._search(4.0 * self.equations.too_far)
        if found is None:
            self._reason = (
                f"{self._newton.num_iterations} iterations, residual "
                f"{min(self._newton.history, default=math.nan):.1e} of the internal forces"
            )
            self._rewind()
            return False
        self._finish(found, dt)
        self.num_on_jumps += self._newton.num_sides > 1
        history = self._newton.history
        self.report.append(
            (s.t, dt, self._newton.num_iterations, self._newton.num_linear, history[-3:])
        )
        walls.add_work()
        tools = self.specimen.tools
        if tools.any:
            tools.act_on_rigid(self.rigid, s)
            tools.add_work(dt)
        return True

    def _begin(self, dt):
        """Keep the state, and move walls and what is prescribed."""
        walls = self.walls
        equations = self.equations
        equations.begin(IncrementStart(self.specimen), dt)
        equations.wall_move = walls.move(dt)
        # Anchors on walls that turned have gone along.
        equations.mark = ContactMark(self.contact)
        walls.add_work()
        equations.reach = self.contact.motion.searched_at + self.contact.motion.skin
        expected = max(equations.wall_move, self._prescribe(dt))
        if self._last is not None:
            expected = max(expected, float(np.abs(self._last[0]).max()) * dt / self._last[1])
        expected = self.comm.allreduce(expected, op=MPI.MAX)
        if self.contact.motion.bound + 3.0 * expected > equations.reach:
            self._search(4.0 * expected)

    def _prescribe(self, dt):
        """Where nodes of constraints go in ``dt`` [s]; how far at most [m]. Local.

        Nodes have to go there with those of the grains: contact pairs see both move.
        """
        specimen, s = self.specimen, self.state
        constraints = specimen.constraints
        if not constraints:
            return 0.0
        there, farthest = replace(s, x=s.x.copy(), u=s.u.copy(), v=s.v.copy()), 0.0
        moves, field = np.zeros(self.mesh.num_grains), np.zeros((4, 3))
        for constraint in constraints:
            constraint.lead(s.t, dt)
        for constraint in constraints:
            farthest = max(farthest, constraint.drift(there, dt, 0.0, moves, field))
            constraint.complete(there)
        for nodes in (specimen.glued.nodes, specimen.rigid.lists.nodes):
            self.prescribed[nodes] = (there.x - s.x)[nodes]
        return farthest

    def _search(self, ahead):
        """Pairs anew at the start of the increment, for motions of ``ahead`` [m]."""
        self.equations.mark.restore()
        x0 = self.equations.start.state["x"]
        self.contact.search(x0, ahead=ahead)
        motion = self.contact.motion
        self.equations.reach = motion.searched_at + max(motion.skin, ahead)
        self.equations.mark = ContactMark(self.contact)
        self.system.forget()

    def _guess(self, dt):
        """First guess of the displacement."""
        s = self.state
        if self.method:
            guess = dt * s.v + 0.5 * dt**2 * s.a
        elif self._last is not None:
            guess = self._last[0] * self._as_far(dt)
        else:
            guess = np.zeros_like(s.x)
        return self.equations.held.project(guess) + self.prescribed

    def _as_far(self, dt):
        """How far this increment goes over the last one: by what is moved, else by time."""
        (walls, nodes), (walls0, nodes0) = self._motion(), self._last[2]
        products = [np.vdot(nodes0, nodes0), np.vdot(nodes0, nodes), np.vdot(nodes, nodes)]
        size, along, now = self.comm.allreduce(np.array(products))
        size += walls0 @ walls0
        along += walls0 @ walls
        if size > 0.0:
            return along / size
        if now > 0.0 or walls.any():
            return 0.0
        return dt / self._last[1]

    def _motion(self):
        """The last motion of all walls, turns over an edge of facets, and of held nodes [m]."""
        walls = np.concatenate([self.walls.displacement, self.contact.edge * self.walls.turn])
        return walls.ravel(), self.prescribed.copy()

    def _finish(self, du, dt):
        """Take the state that was found."""
        s, start, method = self.state, self.equations.start.state, self.method
        if method:
            s.a[:] = method.acceleration(du, start["v"], start["a"], dt)
            s.v[:] = method.velocity(s.a, start["v"], start["a"], dt)
            middle = 0.5 * (s.v + start["v"])
            mass = self.specimen.free_mass[:, None]
            self.specimen.damped += self.damping * dt * float((mass * middle**2).sum())
        else:
            s.a[:], s.v[:] = 0.0, 0.0
            self.specimen.damped += float(((self.equations.drag / dt)[:, None] * du**2).sum())
            if self._unbalanced:
                # Weight that comes at once, or what time steps left: half of its work is lost.
                self.specimen.damped += 0.5 * float(np.vdot(self.equations.start.force, du))
                self._unbalanced = False
        self._last = (du, dt, self._motion())
        self.contact.motion.measure_from(self.contact.ghosts.positions.own)
        s.t += dt
        s.dt = dt
        s.num_steps += 1

    def _rewind(self):
        """Back to the start of the increment."""
        self.equations.mark.restore()
        self.walls.turn_back()
        self.equations.start.restore()
