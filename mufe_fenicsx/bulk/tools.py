"""Tools: rigid bodies whose motion is told, or that hold a force, or are free.

A tool meets grains as another grain does, with friction of its own, and neither walls nor other
tools. Each of its six degrees of freedom, along and about x, y and z, is told or free:

- a told one has a given velocity, and what the grains push with is its reaction. Its mass counts
  nowhere. The work of the reaction is part of the work done on the sample;
- a free one has the mass of the body, m dv/dt = F + T with the forces F of the grains (and of
  gravity) and the given force T. A dead load is such a force, and so a plate that holds one falls
  until it meets the sample, as a dropped weight does.

With turns told or free about ``point``, the rate of turning is ω and the velocity of a place x is
V + ω × (x - point); force and torque of a tool are those about the point, which goes along with it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arguments import body_of, check_fields, finite_number
from ..contact.laws import kinetic_of
from ..contact.walls import rotation_of
from ..errors import InputError, finite_array, raise_together, shortened, shown
from ..kernels.bulk import tools as kernels
from ..kernels.geometry.topology import body_defect
from ..materials.rigid import ToolSolid
from ..state import Constraint
from .rigid import RigidGrains

#: Degrees of freedom in the order of all arrays.
FREEDOMS = ("x", "y", "z", "rx", "ry", "rz")


@dataclass(frozen=True)
class ToolPath:
    """Motion over time: straight lines between the rows of a table, and rest before and after.

    Raises:
        InputError: Times do not increase, or the first row is not the place of the start.
    """

    time: np.ndarray  #: increasing [s], shape (num_rows,)
    place: np.ndarray  #: way from the start [m] and turn since then [rad], shape (num_rows, 6)

    def __post_init__(self):
        time = finite_array(
            "time of a path",
            self.time,
            (len(self.time) if isinstance(self.time, list | tuple | np.ndarray) else 1,),
        )
        place = finite_array("row of a path", self.place, (len(time), 6))
        if len(time) < 2 or not (np.diff(time) > 0).all() or time[0] < 0:
            raise InputError(
                f"times of a path = {shown(time.tolist())} s, expected two or more that increase, "
                "from 0 s on"
            )
        if place[0].any():
            raise InputError(
                f"first row of a path = {shown(place[0].tolist())}, expected zeros: places are "
                "counted from that of the start"
            )
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "place", place)

    def at(self, t):
        """Way [m] and turn, a rotation vector [rad], at the time ``t`` [s], shape (6,)."""
        return np.array([np.interp(t, self.time, column) for column in self.place.T])


@dataclass(frozen=True)
class Tool:
    """A rigid body in a test: shear-box half, vane, cone, funnel, platen.

    Raises:
        InputError: It is no body; a value that is not finite; friction below zero; a velocity of
            what is free, or a load on what is told; turns that are free in a way that is not
            computed.
    """

    name: str
    points: np.ndarray  #: nodes [m], shape (num_nodes, 3)
    cells: np.ndarray  #: tetrahedra, shape (num_cells, 4)
    friction: float = 0.0  #: coefficient of friction with all grains [-]
    friction_kinetic: float | None = None  #: coefficient while a contact slips [-]; None: friction
    velocity: Sequence[float] = (0.0, 0.0, 0.0)  #: of the point [m/s]
    angular_velocity: Sequence[float] = (0.0, 0.0, 0.0)  #: about the point [rad/s]
    point: Sequence[float] | None = None  #: [m]; None: the centre of mass
    path: ToolPath | None = None  #: in place of velocities
    free: Sequence[str] = ()  #: degrees of freedom that are not told, some of :data:`FREEDOMS`
    force: Sequence[float] = (0.0, 0.0, 0.0)  #: on what is free [N]
    torque: Sequence[float] = (0.0, 0.0, 0.0)  #: on what is free, about the point [N m]
    density: float = 7850.0  #: of the body, where it is free [kg/m³]

    def __post_init__(self):
        check_fields(self, f" of tool {shortened(self.name)}")
        for name in ("velocity", "angular_velocity", "force", "torque", "point"):
            value = getattr(self, name)
            if value is not None or name != "point":
                value = finite_array(f"{name} of tool {self.name}", value, (3,))
                object.__setattr__(self, name, tuple(value.tolist()))
        kinetic_of(self.friction, self.friction_kinetic, f"of tool {self.name}")
        finite_number(f"density of tool {self.name}", self.density, gt=0, unit="kg/m³")
        points, cells = body_of(f"tool {self.name}", (self.points, self.cells))
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "cells", cells)
        defect = body_defect(cells, len(points))
        if defect:
            raise InputError(f"tool {self.name} has {defect}, expected one body")
        unknown = [f for f in self.free if f not in FREEDOMS]
        if unknown:
            raise InputError(
                f"free of tool {self.name} has {shown(unknown[0])}, expected some of "
                f"{', '.join(FREEDOMS)}"
            )
        self._check_motion()

    @property
    def told(self):
        """Whether each degree of freedom is told, shape (6,)."""
        return tuple(f not in self.free for f in FREEDOMS)

    @property
    def rates(self):
        """Told velocity [m/s] and rate of turning [rad/s], shape (6,)."""
        return np.array([*self.velocity, *self.angular_velocity], dtype=float)

    @property
    def applied(self):
        """Force [N] and torque [N m] on what is free, shape (6,)."""
        return np.array([*self.force, *self.torque], dtype=float)

    def _check_motion(self):
        told, moving = np.array(self.told), self.rates != 0.0
        if self.path is not None:
            if moving.any():
                raise InputError(
                    f"velocity of tool {self.name} is given, expected none with a path"
                )
            moving = self.path.place.any(axis=0)
        for wrong, what in (
            (moving & ~told, "a motion along it, expected none of what is free"),
            ((self.applied != 0.0) & told, "a load along it, expected none of what is told"),
        ):
            if wrong.any():
                raise InputError(f"tool {self.name}, {FREEDOMS[wrong.argmax()]} has {what}")
        turns = ~told[3:]
        if turns.sum() == 2:
            raise InputError(
                f"free of tool {self.name} = {', '.join(self.free)}, expected one turn or all three"
            )
        if turns.any() and moving[3:].any():
            raise InputError(
                f"tool {self.name} turns in a told way, expected no such turn beside a free one"
            )
        if self.point is not None and turns.any() and not told[:3].all():
            raise InputError(
                f"point of tool {self.name} = {shown(list(self.point))}, expected none where it is "
                "free to move and to turn: it turns about its centre of mass"
            )

    def material(self, E, nu):
        """Its :class:`~mufe_fenicsx.materials.rigid.ToolSolid` beside grains of such elasticity."""
        point = None if self.point is None else tuple(map(float, self.point))
        return ToolSolid(E, nu, self.density, told=self.told, point=point)


class Tools(Constraint):
    """Motion of tools, loads on them, and the work of what moves them. Collective.

    A tool belongs to one rank, as a grain does.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        tools: All tools, in the order of the last labels of the mesh.
        rigid: :class:`~.rigid.RigidGrains`.
    """

    STATE = {"sum": ("work",)}

    def __init__(self, mesh, tools: Sequence[Tool], rigid: RigidGrains):
        self.tools, self.mesh, self.rigid = list(tools), mesh, rigid
        self.any = bool(self.tools)
        self.work = 0.0  #: done on the sample by what moves the tools of this rank [J]
        here = mesh.grains[rigid.grains[: rigid.num_always]] - mesh.first_tool
        #: Rows of this rank's tools among rigid grains, and their numbers.
        self.rows = np.flatnonzero(here >= 0)
        self.numbers = here[self.rows]
        own = [self.tools[number] for number in self.numbers]
        n = len(own)
        self.rates = np.array([tool.rates for tool in own]).reshape(n, 6)
        self.applied = np.array([tool.applied for tool in own]).reshape(n, 6)
        #: Of rates and applied loads: where a change came from and goes to, when it began and how
        #: long it takes [s]; four times twelve columns.
        told = [self.rates, self.applied]
        self.change = np.hstack([*told, *told, np.zeros((n, 24))])
        self._applied_next = self.applied.copy()
        #: Of grains on tools, and all loads on them but the applied ones.
        self.reaction, self.loads = np.zeros((2, n, 6))
        self._spin = np.zeros((n, 3))
        self._led = [(k, tool.path) for k, tool in enumerate(own) if tool.path is not None]
        self._first = rigid.centre[self.rows].copy(), rigid.axes[self.rows].copy()

    @property
    def names(self):
        """Of all tools, in their order."""
        return [tool.name for tool in self.tools]

    def state_dict(self):
        """Loads too, with a row for each rigid grain."""
        kept = super().state_dict()
        if self.any:
            rows = np.zeros((self.rigid.num_grains, sum(of.shape[1] for of in self._changing)))
            rows[self.rows] = np.hstack(self._changing)
            kept["rigid"] = {"loads": rows}
        return kept

    def load_state_dict(self, kept):
        """Become what :meth:`state_dict` told."""
        kept = dict(kept)
        rows = kept.pop("rigid", {}).get("loads")
        super().load_state_dict(kept)
        if rows is not None:
            ends = np.cumsum([of.shape[1] for of in self._changing])[:-1]
            for now, then in zip(self._changing, np.split(rows[self.rows], ends, 1), strict=True):
                now[:] = then
            self._applied_next[:] = self.applied

    @property
    def _changing(self):
        """Arrays that steps change, with a row for each tool of this rank."""
        return self.reaction, self.loads, self.rates, self.applied, self.change

    def set_motion(self, name, t, rates=(None,) * 6, applied=(None,) * 6, ramp=0.0):
        """Change what a tool is told from the time ``t`` on, smoothly. Local.

        Args:
            name: Of the tool.
            t: Now [s].
            rates: Velocity [m/s] and rate of turning [rad/s], six values; None where one goes on.
            applied: Force [N] and torque [N m] on what is free, likewise.
            ramp: Time that it takes [s].
        """
        for k in np.flatnonzero(self.numbers == self.names.index(name)):
            now, change = [*self.rates[k], *self.applied[k]], self.change[k].reshape(4, 12)
            for column, goal in enumerate((*rates, *applied)):
                if goal is not None:
                    change[:, column] = now[column], goal, t, ramp

    def _changes(self, t):
        """Whether a change of this rank's tools is not over at the time ``t``."""
        return bool((self.change[:, 24:36] + self.change[:, 36:] >= t).any())

    def _follow_change(self, t, dt):
        """Rates of the step from ``t`` on, and applied loads at its end."""
        begin, goal, start, ramp = np.split(self.change, 4, axis=1)
        for at, columns, out in (
            (t + 0.5 * dt, slice(6), self.rates),
            (t + dt, slice(6, 12), self._applied_next),
        ):
            s = np.clip((at - start) / np.maximum(ramp, 1e-300), 0.0, 1.0)[:, columns]
            out[:] = begin[:, columns] + s * s * (3.0 - 2.0 * s) * (goal - begin)[:, columns]

    def borne_nodes(self):
        """Nodes of this rank's tools that bearings hold, without weight. Local."""
        held = [b for b in self.rows if self.rigid.told[b, :3].all()]
        return np.concatenate([np.empty(0, np.int32), *(self.rigid.lists.of(b) for b in held)])

    # --- stepping -------------------------------------------------------------------------

    def lead(self, t, dt):
        """Give the tools their told motion of the step from ``t`` to ``t + dt`` [s]. Local."""
        r = self.rigid
        if self._changes(t):
            self._follow_change(t, dt)
        for k, path in self._led if dt > 0.0 else ():
            b, wanted = self.rows[k], path.at(t + dt)
            self.rates[k, :3] = (self._first[0][k] + wanted[:3] - r.centre[b]) / dt
            turned = r.axes[b] @ self._first[1][k].T
            self.rates[k, 3:] = rotation_vector(rotation_of(wanted[3:]) @ turned.T) / dt
        return kernels.tell_motion(
            r.velocity, r.momentum, self.rows, r.told, self.rates, r.inertia, r.followed.reach
        )

    def drift(self, state, dt, damping, moves, field):
        """The work of the loads of before, now that rigid grains have moved. Local."""
        self.add_work(dt)
        return 0.0

    def kick(self, mass, dt, damping):
        """The work of the loads at the end of the step. Local."""
        self.add_work(dt)
        return 0.0

    def add_work(self, dt):
        """Add half of the work of a step of ``dt`` [s] by the loads that act now. Local."""
        r = self.rigid
        self.work += 0.5 * kernels.work_of_motion(
            self.loads, self.rows, self.applied, r.told, r.velocity, r.momentum, self._spin, r.axes,
            r.inertia, dt,
        )  # fmt: skip

    def add_forces(self, f, state, dt):
        """Take what the grains push with, which rigid grains have gathered. Local."""
        kernels.keep_loads(self.reaction, self.rows, self.rigid.force, self.rigid.torque)

    def act_on_rigid(self, rigid, state):
        """Add what is applied. Comes after all others. Local."""
        self.applied[:] = self._applied_next
        kernels.keep_loads(self.loads, self.rows, rigid.force, rigid.torque)
        kernels.apply_loads(rigid.force, rigid.torque, self.rows, self.applied)

    # --- numbers --------------------------------------------------------------------------

    def _of_all(self, values):
        """Values of this rank's tools in rows of all, shape (num_tools, 6). Collective."""
        found = np.zeros((len(self.tools), 6))
        found[self.numbers] = values
        return self.mesh.comm.allreduce(found)

    def forces(self):
        """Force [N] and torque about its point [N m] of the grains on each tool. Collective.

        Returns:
            Shape (num_tools, 6).
        """
        return self._of_all(self.reaction)

    def places(self):
        """Way from the start [m] and turn since then, a rotation vector [rad]. Collective.

        Returns:
            Shape (num_tools, 6); turns are below π.
        """
        r, (centre, axes) = self.rigid, self._first
        turned = np.einsum("kij,klj->kil", r.axes[self.rows], axes)
        turns = np.array([rotation_vector(one) for one in turned]).reshape(-1, 3)
        return self._of_all(np.hstack([r.centre[self.rows] - centre, turns]))

    @property
    def columns(self):
        """Columns of a history, of :meth:`row`."""
        return [
            f"{what}_{name}_{axis}"
            for name in self.names
            for what in ("force", "torque", "displacement", "turn")
            for axis in "xyz"
        ]

    def row(self):
        """Values of :attr:`columns` now. Collective."""
        values = np.hstack([self.forces(), self.places()])
        return dict(zip(self.columns, values.ravel().tolist(), strict=True))

    def summary(self):
        """What they carry and where they are, fit for JSON. Collective."""
        return [
            {
                "name": name,
                "force": load[:3].tolist(),
                "torque": load[3:].tolist(),
                "displacement": place[:3].tolist(),
                "turn": place[3:].tolist(),
            }
            for name, load, place in zip(self.names, self.forces(), self.places(), strict=True)
        ]

    def points(self):
        """The point of each tool now [m], shape (num_tools, 3). Collective."""
        values = np.zeros((self.rows.size, 6))
        values[:, :3] = self.rigid.centre[self.rows]
        return self._of_all(values)[:, :3]


def rotation_vector(matrix):
    """The vector of a rotation by less than π [rad]: along its axis, of the length of its angle."""
    sine = 0.5 * np.array(
        [matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]
    )
    size = float(np.linalg.norm(sine))
    angle = math.atan2(size, 0.5 * (np.trace(matrix) - 1.0))
    return sine * (angle / size) if size > 0.0 else sine


def tool_solids(comm, mesh, tools, materials):
    """Materials of this rank's tools, from those of its grains. Collective.

    Args:
        comm: MPI communicator.
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        tools: All tools.
        materials: Of this rank's grains, shape (num_grains - num_tools of this rank,).

    Raises:
        InputError: The mesh has other tools; on all ranks.
    """
    names = tuple(tool.name for tool in tools)
    wrong = None
    if names != mesh.tools:
        wrong = f"tools = {', '.join(names)}, expected those of the mesh: {', '.join(mesh.tools)}"
    raise_together(comm, wrong)
    stiffest = max((m.contact_modulus, m.E, m.nu) for m in materials) if materials else (0, 0, 0)
    _, E, nu = max(comm.allgather(stiffest))
    here = mesh.grains[mesh.is_tool] - mesh.first_tool
    return [tools[k].material(E, nu) for k in here]
