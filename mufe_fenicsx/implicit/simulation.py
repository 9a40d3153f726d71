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
from typing import Any

import numpy as np
from mpi4py import MPI

from ..arguments import checked
from ..contact.walls import Wall
from ..errors import InputError, SolverError
from ..materials.elastic import IsotropicSolid
from ..mesh import GrainMesh
from ..specimen import OfSpecimen, Specimen
from .contact_in_increments import ContactInIncrements
from .force_controlled_walls import ForceControlledWalls
from .increment import IncrementEquations, check_increments, check_terms
from .increment_end import IncrementEnd
from .increment_settings import IncrementSettings
from .prescribed_nodes import lead_nodes

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
        self.equations = IncrementEquations(specimen, self.settings, self.held)
        self._newton = self.equations.newton()
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
        self.equations.rewind()
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
        check_terms(self.specimen)
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
            self.dt = self.settings.shortened(dt)
        self.dt = self.settings.next_length(self.dt, dt, self._newton.effort)
        self.most_work = max(self.most_work, abs(self._work() - before))
        self.check()

    def _work(self):
        """Work of all walls and tools [J]. Collective."""
        return self.comm.allreduce(self.specimen.work())

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
        self.equations.rewind()
        s = self.state
        (s.t, s.dt, s.num_steps), (self.specimen.damped, self.num_on_jumps), length = mark
        del self.report[length:]

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
            self.equations.search(4.0 * self.equations.too_far)
        if found is None:
            self._reason = self._newton.reason()
            self.equations.rewind()
            return False
        self.equations.take(found, self._unbalanced)
        self._unbalanced = False
        self._last = (found, dt, self._motion())
        self.num_on_jumps += self._newton.num_sides > 1
        self.report.append((s.t, dt, *self._newton.counts()))
        walls.add_work()
        tools = self.tools
        if tools.any:
            tools.act_on_rigid(self.rigid, s)
            tools.add_work(dt)
        return True

    def _begin(self, dt):
        """Keep the state, and move walls and what is prescribed."""
        self.equations.begin(dt)
        expected = lead_nodes(self.specimen, self.prescribed, dt)
        if self._last is not None:
            expected = max(expected, float(np.abs(self._last[0]).max()) * dt / self._last[1])
        self.equations.expect(expected)

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
