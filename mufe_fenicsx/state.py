"""What changes with time: motion of nodes, history of material points; and what acts on them."""

from dataclasses import dataclass
from typing import Any

import numpy as np

#: What a value that changes may be besides None: it stays of its kind.
KINDS = (int | float, str, list, dict)


class Stateful:
    """Something that steps change. It says what changes, and comes back from it.

    :attr:`STATE` names the attributes by the place where their values live:

    - ``nodes``, ``cells``, ``rigid``: a row for each node, tetrahedron, rigid grain of this rank;
    - ``common``: the same on all ranks, numbers, texts or small arrays;
    - ``sum``, ``largest``: of each rank, of which the sum or the largest matters;
    - ``here``: of this rank's arrays of now, which a checkpoint makes anew in another way.

    What refers to another object has its own :meth:`state_dict`.

    Where a mesh grows, each part of a node that is doubled has the rows of that; but of sums over
    the nodes, which :attr:`SHARED` names, each part has the share of its mass.
    """

    STATE = {}  #: place -> names of attributes
    SHARED = ()  #: those of ``nodes`` that are sums, as forces and masses

    def state_dict(self):
        """{place: {name: value}}; arrays are those of now, not copies. Local."""
        return {
            place: {name: getattr(self, name) for name in names}
            for place, names in self.STATE.items()
        }

    def grown(self, source, share):
        """What :meth:`state_dict` tells, with rows for a mesh that has grown. Local.

        What is ``here`` is left out; rows of cells stay, in the arrays of now.

        Args:
            source: :class:`~mufe_fenicsx.mesh.Source` of the rows.
            share: Mass of each node over that of the node that it comes from, (num_nodes,).
        """
        kept = {place: dict(of) for place, of in self.state_dict().items() if place != "here"}
        for name, values in kept.get("nodes", {}).items():
            kept["nodes"][name] = values[source.nodes]
        for name in self.SHARED:
            values = kept["nodes"][name]
            kept["nodes"][name] = (values.T * share).T
        return kept

    def load_state_dict(self, kept):
        """Become what :meth:`state_dict` told; arrays take values in place. Local."""
        for values in kept.values():
            for name, value in values.items():
                now = getattr(self, name)
                if isinstance(now, np.ndarray):
                    if value is not now:
                        now[...] = np.reshape(value, now.shape)
                else:
                    single = isinstance(value, np.ndarray | np.generic)
                    value = value.item() if single else value
                    for kind in KINDS:
                        if isinstance(now, kind) and not isinstance(value, kind | None):
                            said = f"{type(value).__name__}, expected a {type(now).__name__}"
                            raise TypeError(f"{name} is a {said}")
                    setattr(self, name, value)


def copied(kept):
    """A copy of what :meth:`Stateful.state_dict` gives, which later steps leave alone."""
    return {
        place: {
            name: value.copy() if isinstance(value, np.ndarray) else value
            for name, value in values.items()
        }
        for place, values in kept.items()
    }


@dataclass
class State(Stateful):
    """Motion and history on one rank; the arrays are changed in place."""

    STATE = {
        "nodes": ("x", "u", "v", "a"),
        "cells": ("deviator", "plastic_strain", "plastic_work"),
        "common": ("t", "dt", "num_steps"),
    }

    t: float  #: time [s]
    dt: float  #: length of the last step [s]
    num_steps: int  #: steps so far
    x: np.ndarray  #: positions [m], shape (num_nodes, 3)
    u: np.ndarray  #: displacements [m], shape (num_nodes, 3)
    v: np.ndarray  #: velocities [m/s], shape (num_nodes, 3)
    a: np.ndarray  #: accelerations [m/s²], shape (num_nodes, 3)
    deviator: np.ndarray  #: J times that of Cauchy stress [Pa], xx yy zz xy yz xz, (num_cells, 6)
    plastic_strain: np.ndarray  #: equivalent plastic strain, shape (num_cells,)
    plastic_work: np.ndarray  #: plastic work of tetrahedra, without dents [J], shape (num_cells,)
    #: Between two steps: v is that of the middle of the last one, a that of the one before, and
    #: nodes of rigid grains may be left behind.
    halfway: bool = False


def initial_state(x, num_cells, before=None):
    """At rest and without stress, at the positions ``x``, shape (num_nodes, 3).

    ``before``: :class:`State` whose cells these are, with its arrays of them; None: none.
    """
    if before is None:
        cells = {
            "deviator": np.zeros((num_cells, 6)),
            "plastic_strain": np.zeros(num_cells),
            "plastic_work": np.zeros(num_cells),
        }
    else:
        cells = before.state_dict()["cells"]
    return State(
        t=0.0,
        dt=0.0,
        num_steps=0,
        x=x.copy(),
        u=np.zeros_like(x),
        v=np.zeros_like(x),
        a=np.zeros_like(x),
        **cells,
    )


class ForceTerm(Stateful):
    """One kind of force on the nodes, of those that a specimen adds up.

    A term states its forces in two halves. In the first, messages to other ranks leave, and forces
    are added that need none; meanwhile they travel. In the second half the rest is added. Most
    terms have :meth:`add_forces` alone, which is the second half. Constraints come last: they take
    from the sum what they hold.

    What changes in a term besides, :attr:`STATE` names.
    """

    name = ""  #: of the term, in messages and in the energy balance
    mesh: Any = None  #: :class:`~mufe_fenicsx.mesh.GrainMesh` whose nodes it means; None: of any
    opens = False  #: whether it has facets open between cells, by :meth:`facets_to_open`
    constraint: Any = None  #: :class:`Constraint` that comes and goes with it

    def begin_forces(self, f, state, dt):
        """First half: send what others need, add what needs no other rank. May be collective."""

    def add_forces(self, f, state, dt):
        """Add the forces to ``f``, in place. May be collective.

        Args:
            f: Sum of the forces on the nodes [N], shape (num_nodes, 3).
            state: :class:`State` at the positions where the forces act.
            dt: Length of the step or increment that led there [s]; 0 where forces are only looked
                at, at the start and for a row of the history.
        """

    def act_on_rigid(self, rigid, state):
        """Add force and torque to rigid grains, of which few nodes are looked at. Local.

        Args:
            rigid: :class:`~mufe_fenicsx.bulk.rigid.RigidGrains`, whose ``force`` [N] and
                ``torque`` about ``centre`` [N m] have shape (num_grains, 3).
            state: As of :meth:`add_forces`.
        """

    def energy(self, state):
        """Energy that the term has stored [J] on this rank, None where it has none. Local."""
        return None

    def parts_of_energy(self, state):
        """Shares of :meth:`energy` that figures want to tell apart [J], by name. Local."""
        return {}

    def facets_to_open(self, state):
        """Pairs of cells of this rank whose facet opens, None for none on any rank. Collective.

        With no pairs on any rank the mesh only looks for pieces that came loose.
        """
        return None

    def holding(self):
        """Pairs of cells that hang together by the term, though their facet is open. Local."""
        return np.empty((0, 2), dtype=np.int64)

    def opened_and_failed(self):
        """Facets that opened, their area, and what of it bears no more [m²], (3,). Local."""
        return np.zeros(3)

    def cell_fields(self):
        """Values of the cells that stored states have, {name: shape (num_cells,)}. Local."""
        return {}

    def let_go(self, state):
        """Leave the faces between two pieces of a grain to contact. Local.

        Returns:
            Sides of the cells beside them, shape (n, 2), tractions on the first [Pa], (n, 3), and
            what the springs held that bore these [J].
        """
        return np.empty((0, 2), dtype=np.int64), np.empty((0, 3)), 0.0

    def stiffness(self, state):
        """Minus the derivative of the forces by the positions, None where there is none. Local.

        Returns:
            Rows and columns, nodes of this rank, shape (num_blocks,); blocks [N/m], shape
            (num_blocks, 3, 3). The stable time step and the tangent of increments count it. The
            time step does so now and then: where it grows between, it has to be a bound.
        """
        return None

    def springs(self, state, margin):
        """Springs of what acts and of what a motion can make act, None where there are none.

        They count in the stable time step and in mass scaling as those of contact do: they may
        open and close. May be collective, then on all ranks.

        Args:
            state: The present :class:`State`.
            margin: That motion [m].

        Returns:
            What :meth:`~mufe_fenicsx.bulk.far_nodes.FarNodes.springs` gives.
        """
        return None

    def grow(self, mesh, share):
        """Go on with a mesh that has grown. Collective.

        Rows of nodes and cells that :attr:`STATE` names follow, and :meth:`load_tables` is called
        with the tables of before: names of nodes stay. A term that keeps anything else of nodes,
        cells or facets needs its own method, and all need a :attr:`mesh`.

        Args:
            mesh: The :class:`~mufe_fenicsx.mesh.GrainMesh`, with the ``source`` of its rows.
            share: As of :meth:`grown`.
        """
        tables, kept = self.tables(), self.grown(mesh.source, share)
        self.mesh = mesh
        for place in ("nodes", "cells"):
            for name, values in kept.get(place, {}).items():
                setattr(self, name, values)
        self.load_tables(tables)

    def part(self, before, after):
        """Add to the forces of a mesh that has grown what holds parts of nodes together. Local.

        Args:
            before, after: :class:`~mufe_fenicsx.specimen.Specimen` before and after the growth,
                with the forces of all others in ``after.f``.
        """

    def settle(self, specimen, damping):
        """Change the motion of what a growth has let loose, at its end. Local.

        Args:
            specimen: :class:`~mufe_fenicsx.specimen.Specimen` after the growth.
            damping: That of the last step [1/s].

        Returns:
            Whether kinetic energy has changed, which :meth:`energy` has now.
        """
        return False

    def tables(self):
        """Tables that a checkpoint keeps: {name: {column: array}}, one row a thing. Local.

        Each has a column ``grain``, the global index of the grain whose rank keeps the row; other
        columns know no ranks either.
        """
        return {}

    def load_tables(self, tables):
        """Become what :meth:`tables` told, with the rows of this rank's grains. Collective."""


class Constraint(ForceTerm):
    """Nodes that do not move as their forces and masses have it.

    Time steps move all other nodes, and ask each constraint in turn for what is its own; increments
    ask where its nodes go. What a constraint has not is left to these defaults.
    """

    any = False  #: whether some rank has such nodes

    def lead(self, t, dt):
        """Take up the motion that is told for the step from ``t`` to ``t + dt`` [s]. Local.

        Returns:
            Largest speed of a place by it [m/s], a bound.
        """
        return 0.0

    def drift(self, state, dt, damping, moves, field):
        """First half of a kick, and the motion over a step, after walls and other nodes. Local.

        Args:
            state: :class:`State` whose nodes are moved.
            dt: Length of the step [s].
            damping: [1/s].
            moves, field: Of the grains, as in kernels.bulk.motion: moves may grow.

        Returns:
            Largest distance that a node moved [m], a bound.
        """
        return 0.0

    def kick(self, mass, dt, damping):
        """Second half of a kick, in the reverse order of constraints. Local.

        Args:
            mass: Nodal masses [kg], shape (num_nodes,).
            dt, damping: As of :meth:`drift`.

        Returns:
            Energy that the damping took in the step [J], less what other nodes count of it.
        """
        return 0.0

    def take_masses(self, mass):
        """Follow a change of the nodal masses [kg], shape (num_nodes,). Local."""

    def complete(self, state):
        """Bring positions and velocities of all nodes to the end of the last step. Local."""

    def kinetic_energy(self, dt, damping):
        """Kinetic energy [J] beside that of other nodes, as kernels.bulk.energy has it. Local."""
        return 0.0
