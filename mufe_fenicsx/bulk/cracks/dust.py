"""Dust: fragments of few tetrahedra, which go on as rigid bodies."""

from typing import NamedTuple

import numpy as np

from ...kernels.bulk import rigid as kernels
from ...kernels.bulk.energy import kinetic_energy
from ...kernels.bulk.glued import largest_of_glued, squares_of_glued
from ...state import Constraint
from ..mass_properties import point_properties, quaternion_of


class Bodies(NamedTuple):
    """Rigid bodies, by grain and piece; other arrays as in kernels.bulk.rigid."""

    grain: np.ndarray  #: local, shape (n,)
    piece: np.ndarray  #: of that grain, shape (n,)
    lost: np.ndarray  #: energy that they lost as they became rigid, or hold for good [J], (n,)
    mass: np.ndarray
    inertia: np.ndarray
    centre: np.ndarray
    turn: np.ndarray
    axes: np.ndarray
    velocity: np.ndarray
    momentum: np.ndarray
    spin: np.ndarray
    force: np.ndarray
    torque: np.ndarray


#: Shapes of a row of the last ones from ``mass`` on.
ROWS = (), (3,), (3,), (4,), (3, 3), (3,), (3,), (3,), (3,), (3,)
#: Columns of a checkpoint; axes follow from turns.
KEPT = (
    "piece", "lost", "mass", "inertia", "centre", "turn", "velocity", "momentum", "spin", "force",
    "torque",
)  # fmt: skip


class Carried(NamedTuple):
    """Nodes of the bodies, one body after the other."""

    nodes: np.ndarray  #: int32, shape (n,); of a body in an order that knows no ranks
    offset: np.ndarray  #: first entry of each body, shape (num_bodies + 1,)
    mass: np.ndarray  #: of the nodes [kg], shape (n,)
    place: np.ndarray  #: in the principal axes [m], shape (n, 3)
    reach: np.ndarray  #: of the farthest one of each body [m], shape (num_bodies,)
    told: np.ndarray  #: False, shape (num_bodies, 6)
    at: np.ndarray  #: their positions [m], shape (n, 3)
    velocity: np.ndarray  #: mean ones in the last step [m/s], shape (n, 3)

    @property
    def body(self):
        """Of each node."""
        return np.repeat(np.arange(self.reach.size), np.diff(self.offset))


class Dust(Constraint):
    """Motion of the dust of one rank. Local.

    A piece of at most ``most`` tetrahedra is rigid from the moment on at which it comes loose, in
    the shape of then. It keeps momentum and angular momentum of its nodes, whose masses it has, but
    not the kinetic energy of their motion beside the rigid one. What it has stored stays. Nodes
    that a wall holds are none of dust.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        most: Tetrahedra of a piece that becomes dust, at most.

    Attributes:
        bodies: :class:`Bodies`, by grain and piece.
        of_cell: Body of each cell, -1 for none, shape (num_cells,).
    """

    any = True

    def __init__(self, mesh, most):
        self.mesh, self.most = mesh, most
        whole = np.empty(0, dtype=np.int64)
        self.bodies = Bodies(whole, whole, np.empty(0), *(np.empty((0, *row)) for row in ROWS))
        self._carry(np.empty(0), np.empty((0, 3)))

    # --- which bodies there are -----------------------------------------------------------

    def _carry(self, mass, place):
        """List cells and nodes of the bodies; masses and places are in that order. Local."""
        of_piece, num = self._pieces()
        key = self.bodies.grain * num + self.bodies.piece
        self.of_cell = np.full(self.mesh.num_cells, -1)
        if key.size:
            at = np.minimum(np.searchsorted(key, of_piece), key.size - 1)
            self.of_cell = np.where(key[at] == of_piece, at, -1)
        nodes, offset = self._nodes_of(self.of_cell, key.size)
        distance, reach = np.sqrt((place**2).sum(axis=1)), np.zeros(key.size)
        if key.size:
            reach = np.maximum.reduceat(distance, offset[:-1])
        told = np.zeros((key.size, 6), dtype=bool)
        at, velocity = np.zeros((2, *place.shape))
        kernels.places_of(at, offset, place, self.bodies.centre, self.bodies.axes)
        self.carried = Carried(nodes, offset, mass, place, reach, told, at, velocity)

    def _pieces(self):
        """A number for the grain and the piece of each cell, and those of a grain at most."""
        mesh, piece = self.mesh, self.mesh.piece_of_cell
        num = 1 if piece is None else int(piece.max()) + 1
        return mesh.grain_of_cell * np.int64(num) + (0 if piece is None else piece), num

    def _nodes_of(self, of_cell, num):
        """Nodes of bodies and where each begins, from the body of each cell."""
        mesh, rows = self.mesh, np.flatnonzero(of_cell >= 0)
        if not rows.size:
            return np.empty(0, dtype=np.int32), np.zeros(num + 1, dtype=np.int64)
        name = np.empty(mesh.num_nodes, dtype=np.int64)
        name[mesh.named_nodes] = np.arange(mesh.num_nodes)
        body, nodes = np.repeat(of_cell[rows], 4), mesh.cells[rows].ravel()
        order = np.lexsort((name[nodes], body))
        body, nodes = body[order], nodes[order]
        first = np.append(True, nodes[1:] != nodes[:-1])
        return nodes[first].astype(np.int32), np.searchsorted(body[first], np.arange(num + 1))

    def _new_pieces(self, held):
        """Body of each cell among the pieces that become dust now, and their grains and pieces."""
        mesh, (key, num) = self.mesh, self._pieces()
        found, size = np.unique(key, return_counts=True)
        grain = found // num
        small = (size <= self.most) & (mesh.num_pieces[grain] > 1) & mesh.is_of_sample[grain]
        fixed = np.zeros(mesh.num_nodes, dtype=bool)
        fixed[held] = True
        kept = np.concatenate([key[fixed[mesh.cells].any(axis=1)], key[self.of_cell >= 0]])
        found = found[small & ~np.isin(found, kept)]
        of_cell = np.full(mesh.num_cells, -1)
        if found.size:
            at = np.minimum(np.searchsorted(found, key), found.size - 1)
            of_cell = np.where(found[at] == key, at, -1)
        return of_cell, found // num, found % num

    def inside(self, across):
        """Whether facets between these pairs of cells are inside a body. Local."""
        body = self.of_cell[across]
        return (body[:, 0] == body[:, 1]) & (body[:, 0] >= 0)

    def take(self, specimen, damping, inner):
        """Make dust of what has become small enough; whether any has. Local.

        Args:
            specimen: :class:`~mufe_fenicsx.specimen.Specimen`, complete.
            damping: That of its last step [1/s].
            inner: Called with the cells' new bodies, lets what is open inside them go; what springs
                held there [J], by the new body.
        """
        s, m = specimen.state, specimen.solid.mass
        held = np.concatenate([specimen.glued.nodes, specimen.mirrors.node])
        of_cell, grain, piece = self._new_pieces(held)
        nodes, offset = self._nodes_of(of_cell, grain.size)
        if grain.size:
            at = np.split(nodes, offset[1:-1])
            made = [_body(s.x[n], s.v[n], specimen.f[n], m[n]) for n in at]
            rows = [np.array(column) for column in zip(*(row for row, _ in made), strict=True)]
            new = Bodies(grain, piece, inner(of_cell, grain.size), *rows)
            kernels.set_spins(new.spin, new.momentum, new.axes, new.inertia)
            new.lost[:] += [
                kinetic_energy(s.v[n], s.a[n], s.dt, damping, m[n], np.array([[0, n.size, 0]]))
                for n in at
            ]
            new.lost[:] -= _kinetic_energies(new, np.zeros((grain.size, 6), bool), s.dt, damping)
            place = np.concatenate([place for _, place in made])
            self._join(new, np.diff(offset), m[nodes], place)
        # Old ones too: their loads are known already.
        kernels.clear(specimen.f, self.carried.nodes)
        kernels.clear(s.a, self.carried.nodes)
        self.complete(s)
        return grain.size > 0

    def _join(self, new, sizes, mass, place):
        """Take in further bodies, of so many nodes of these masses and places. Local."""
        old, c = self.bodies, self.carried
        joined = Bodies(*map(np.concatenate, zip(old, new, strict=True)))
        order = np.lexsort((joined.piece, joined.grain))
        self.bodies = Bodies(*(np.ascontiguousarray(column[order]) for column in joined))
        body = np.concatenate([c.body, old.mass.size + np.repeat(np.arange(sizes.size), sizes)])
        rows = np.argsort(np.argsort(order)[body], kind="stable")
        mass, place = np.concatenate([c.mass, mass]), np.concatenate([c.place, place])
        self._carry(mass[rows], np.ascontiguousarray(place[rows]))

    # --- stepping -------------------------------------------------------------------------

    def drift(self, state, dt, damping, moves, field):
        """As of the constraint; nodes have their mean velocity of the step. Local."""
        b, c = self.bodies, self.carried
        if not b.mass.size:
            return 0.0
        moved = kernels.kick_and_drift(
            b.centre, b.velocity, b.momentum, b.turn, b.axes, b.force, b.torque, b.mass, b.inertia,
            c.told, c.reach, dt, damping,
        )  # fmt: skip
        # Strain is that of the motion from place to place: of a turn by its chords there is none.
        kernels.carry_nodes(
            state.x, state.u, state.v, self.mesh.x, c.nodes, c.offset, c.place, b.centre, b.axes,
            c.at, c.velocity, dt,
        )  # fmt: skip
        largest_of_glued(moves, state.x, c.velocity, c.nodes, self.mesh.grain_of_node, field, dt)
        return moved

    def add_forces(self, f, state, dt):
        """Force and torque of each body from the nodal forces, which are taken. Local."""
        b, c = self.bodies, self.carried
        kernels.gather_loads(b.force, b.torque, f, state.x, c.nodes, c.offset, b.centre)
        kernels.clear(f, c.nodes)

    def kick(self, mass, dt, damping):
        """Half a kick at the end of a step; as of the constraint. Local."""
        b, c = self.bodies, self.carried
        lost = kernels.kick(
            b.velocity, b.momentum, b.spin, b.force, b.torque, b.axes, b.mass, b.inertia, c.told,
            dt, damping,
        )  # fmt: skip
        scale = 1.0 / (1.0 + 0.5 * dt * damping)
        return lost - dt * damping * scale**2 * squares_of_glued(mass, c.velocity, c.nodes)

    def complete(self, state):
        """Velocities of all nodes by those of the bodies. Local."""
        b, c = self.bodies, self.carried
        kernels.node_velocities(state.v, state.x, c.nodes, c.offset, b.centre, b.velocity, b.spin)

    def kinetic_energy(self, dt, damping):
        """That of the bodies less what their nodes have by their velocities [J]. Local."""
        b, told = self.bodies, self.carried.told
        of_nodes = (1.0 + (0.5 * dt * damping) ** 2) * _kinetic_energies(b, told, 0.0, 0.0)
        return float((_kinetic_energies(b, told, dt, damping) - of_nodes).sum())

    def energy(self, state):
        """What is lost, or held for good, since pieces became rigid [J]. Local."""
        return float(self.bodies.lost.sum())

    def take_masses(self, mass):
        """Bodies whose nodes have other masses now move as they did. Local."""
        b, c = self.bodies, self.carried
        for k in np.unique(c.body[c.mass != mass[c.nodes]]):
            rows = slice(*c.offset[k : k + 2])
            m, r = mass[c.nodes[rows]], c.place[rows] @ b.axes[k].T
            b.mass[k], shift, b.inertia[k], b.turn[k] = _principal(r, m)
            b.axes[k] = _axes(b.turn[k])
            c.place[rows], c.mass[rows] = (r - shift) @ b.axes[k], m
            b.centre[k] += shift
            b.velocity[k] += np.cross(b.spin[k], shift)
            b.torque[k] -= np.cross(shift, b.force[k])
            b.momentum[k] = b.axes[k] @ (b.inertia[k] * (b.spin[k] @ b.axes[k]))
            c.reach[k] = np.sqrt((c.place[rows] ** 2).sum(axis=1).max())
        kernels.places_of(c.at, c.offset, c.place, b.centre, b.axes)

    # --- growth, and what is kept ---------------------------------------------------------

    def grow(self, mesh, share):
        """Go on with a mesh that has grown, in which dust is as it was. Local."""
        self.mesh = mesh
        self._carry(self.carried.mass, self.carried.place)

    def tables(self):
        """The bodies, and their nodes body after body."""
        b, c = self.bodies, self.carried
        grain = self.mesh.grains[b.grain]
        bodies = {"grain": grain} | {name: getattr(b, name).copy() for name in KEPT}
        nodes = {"piece": b.piece[c.body], "mass": c.mass.copy(), "place": c.place.copy()}
        return {"dust": bodies, "dust_nodes": {"grain": grain[c.body]} | nodes}

    def load_tables(self, tables):
        """Become what :meth:`tables` told. Local."""
        bodies, nodes = tables["dust"], tables["dust_nodes"]
        order = np.lexsort((bodies["piece"], bodies["grain"]))
        kept = {name: np.ascontiguousarray(bodies[name][order]) for name in KEPT}
        grain = np.searchsorted(self.mesh.grains, bodies["grain"][order])
        axes = np.empty((grain.size, 3, 3))
        kernels.set_axes(axes, kept["turn"])
        self.bodies = Bodies(grain=grain, axes=axes, **kept)
        order = np.lexsort((nodes["piece"], nodes["grain"]))  # of a body as they stand
        self._carry(nodes["mass"][order], np.ascontiguousarray(nodes["place"][order]))


def _kinetic_energies(bodies, told, dt, damping):
    """As of kernels.bulk.rigid, shape (num_bodies,)."""
    b, energy = bodies, np.empty(bodies.mass.size)
    kernels.kinetic_energies(
        energy, b.velocity, b.momentum, b.force, b.torque, b.axes, b.mass, b.inertia, told, dt,
        damping,
    )  # fmt: skip
    return energy


def _body(x, v, f, mass):
    """A body of some nodes: its row of :class:`Bodies` from ``mass`` on, and their places in it."""
    whole, centre, inertia, turn = _principal(x, mass)
    axes, r = _axes(turn), x - centre
    row = (
        whole, inertia, centre, turn, axes, mass @ v / whole, mass @ np.cross(r, v), np.zeros(3),
        f.sum(axis=0), np.cross(r, f).sum(axis=0),
    )  # fmt: skip
    return row, r @ axes


def _principal(x, mass):
    """Mass, centre, principal moments and turn to their axes, of point masses at ``x``."""
    whole, centre, inertia = point_properties(x, mass)
    moments, axes = np.linalg.eigh(inertia[0])
    axes[:, 2] *= np.linalg.det(axes)  # right-handed
    return whole[0], centre[0], moments, quaternion_of(axes)


def _axes(turn):
    """Matrix of a unit quaternion."""
    axes = np.empty((1, 3, 3))
    kernels.set_axes(axes, turn[None])
    return axes[0]
