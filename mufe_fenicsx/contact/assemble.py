"""The contact operator: from positions of the nodes to forces on them."""

import math

import numpy as np
from mpi4py import MPI

from ..kernels.pairs import add_pair_forces, add_pair_stiffness, largest_move, pair_energy
from ..kernels.walls import add_rows, gather_rows
from .checks import check_law, check_stiffness, check_surface, check_walls
from .edges import EdgeContact
from .exchange import SurfaceVector, exchange_surface
from .laws import layer_of_facets, layer_of_nodes
from .pairs import search_pairs
from .surface import own_surface

#: Candidates reach this far beyond the closed gap, in mean facet edges.
SKIN = 0.4
#: The force of a contact grows no more beyond this depth, in mean facet edges.
LARGEST_DEPTH = 0.1


class Contact:
    """Contact of the grains with each other and with walls. Collective.

    Positions of surface nodes go forward to the ranks that need them, forces
    come back and are added, both through PETSc vectors with ghosts.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        x: Reference positions of its nodes [m], shape (num_nodes, 3).
        contact_modulus: E/(1 - nu²) of this rank's grains [Pa], shape (num_grains,).
        tangential_ratio: 2(1 - nu)/(2 - nu) of this rank's grains, shape (num_grains,).
        friction: Coefficient of friction between grains.
        compliance: Constant c of the layer that matches stiffness to mesh.
        walls: :class:`~mufe_fenicsx.contact.walls.Walls`.
        self_contact: Nodes of a grain also meet facets of the same grain across a void.
    """

    def __init__(self, mesh, x, contact_modulus, tangential_ratio, friction, compliance, walls,
                 self_contact=False):  # fmt: skip
        check_law(friction, compliance)
        self.comm = mesh.comm
        self.own = own_surface(mesh, x)
        check_surface(mesh, self.own)
        check_stiffness(mesh, contact_modulus)
        self.friction = float(friction)
        self.walls = walls
        own = self.own
        local = mesh.grain_of_node[own.nodes]
        self.layer = layer_of_nodes(own.area, contact_modulus[local], compliance)
        self.facet_layer = layer_of_facets(
            own.facet_area, contact_modulus[mesh.grain_of_facet], compliance
        )
        self.ratio = tangential_ratio[local]

        total = self.comm.allreduce(np.array([own.facet_area.sum(), own.facet_area.size]))
        self.edge = math.sqrt(4 / math.sqrt(3) * total[0] / total[1])
        self.skin = SKIN * self.edge
        self.width = self.comm.allreduce(float(np.ptp(x, axis=0).max()), op=MPI.SUM)
        self.largest_depth = LARGEST_DEPTH * self.edge
        # Further behind a facet of its own grain, a node is taken to be on the other side of it.
        self.self_depth = 2 * self.largest_depth if self_contact else None
        check_walls(self.comm, walls, x, self.edge)
        self.edges = EdgeContact(self.ratio, self.edge, self.largest_depth)

        self.dissipated = 0.0  #: by friction on this rank so far [J]
        self.num_adopted = 0  #: contacts that were found deep, on this rank
        self.num_deep = 0  #: evaluations beyond the largest depth, on this rank
        self.deepest = 0.0  #: largest depth adopted on this rank [m]
        self.num_searches = 0
        self.clock = 0.0  #: bound of all relative motion so far, the same on all ranks [m]
        self.searched_at = 0.0
        self.pairs = None
        self.surface = None
        self.positions = None
        self.forces = None
        self._move = np.zeros(1)
        self._search(x, deepest=self._initial_depth())

    def _initial_depth(self):
        """Overlaps at the start are found up to one facet edge deep."""
        return self.edge

    def _search(self, x, deepest=0.0, ahead=0.0):
        """Find all pairs anew, those within ``ahead`` [m] at least. Collective."""
        gathered = np.empty((self.own.nodes.size, 3))
        gather_rows(gathered, x, self.own.nodes)
        depth = deepest
        if self.pairs is not None and self.pairs.gap.size:
            depth = max(depth, -self.pairs.gap[np.isfinite(self.pairs.gap)].min(initial=0.0))
        depth = max(depth, self.edges.deepest())
        depth = self.comm.allreduce(depth, op=MPI.MAX)
        reach = max(self.skin, ahead) + 1.1 * depth

        old, old_surface = self.pairs, self.surface
        self.surface, ghosts = exchange_surface(
            self.comm, self.own, self.facet_layer, gathered, reach
        )
        for vector in (self.positions, self.forces):
            if vector is not None:
                vector.destroy()
        num_own = self.own.nodes.size
        self.positions = SurfaceVector(self.comm, num_own, ghosts)
        self.forces = SurfaceVector(self.comm, num_own, ghosts)
        self.positions.array[:num_own] = gathered
        self.positions.begin_forward()
        self.positions.end_forward()
        self.previous = self.positions.array.copy()

        self.pairs = search_pairs(
            self.positions.array, num_own, self.own.grain_of_node, self.surface, reach, self.clock,
            self.self_depth,
        )  # fmt: skip
        if old is not None:
            self.pairs.carry(old, _finder(self.surface.global_facet), old_surface.global_facet)
        self.dissipated += self.edges.search(
            self.positions.array, num_own, self.surface, reach, self.clock
        )
        self.walls.search(self.positions.array, num_own, reach, self.clock)
        self.searched_at = self.clock
        self.num_searches += 1

    def begin(self, x):
        """Start sending the positions ``x`` of this rank's surface to other ranks."""
        gather_rows(self.positions.array[: self.own.nodes.size], x, self.own.nodes)
        self.positions.begin_forward()

    def add_forces(self, f, x, wall_move=0.0, adopt=False):
        """Add the contact forces at the positions sent by :meth:`begin` to ``f``. Collective.

        Args:
            f: Nodal forces [N], shape (num_nodes, 3).
            x: Positions [m], shape (num_nodes, 3).
            wall_move: Largest distance that a wall moved since the last call [m].
            adopt: True at the start of a test: what overlaps now is not in contact.

        Raises:
            FloatingPointError: A position is not finite, or left the others by more than
                all the grains are wide; on all ranks together.
        """
        self.positions.end_forward()
        self._move[0] = max(largest_move(self.previous, self.positions.array), wall_move)
        if self.comm.size > 1:
            self.comm.Allreduce(MPI.IN_PLACE, self._move, op=MPI.MAX)
        move = self._move[0]
        if not move < self.width:
            raise FloatingPointError("positions are not finite")
        self.clock += 2.0 * move
        # The motion of the next step, at twice its speed now, must not leave the skin.
        if self.clock + 4.0 * move - self.searched_at > self.skin:
            self._search(x, ahead=4.0 * move)
        self._evaluate(f, adopt)

    def _evaluate(self, f, adopt):
        p, s, own = self.pairs, self.surface, self.own
        forces, x = self.forces.array, self.positions.array
        forces[:] = 0.0
        dissipated, num_adopted, num_deep, deepest = add_pair_forces(
            forces, p.due, p.candidate_due, p.closest, p.weights, p.normal, p.gap, p.offset,
            p.closed, p.stiffness, p.anchor, p.shear, p.slip, self.clock, x, p.node, p.first,
            p.candidate, s.facets, s.neighbor, s.ring_offset, s.ring, self.edges.beside,
            self.layer, s.layer_of_facet, own.area, self.ratio, self.friction,
            self.largest_depth, adopt,
        )  # fmt: skip
        edge_dissipated, edge_adopted, edge_deep, edge_deepest = self.edges.add_forces(
            forces, x, self.clock, self.friction, adopt
        )
        self.forces.add_back()
        num_own = own.nodes.size
        wall_dissipated, wall_adopted = self.walls.add_forces(
            forces, x, self.clock, self.layer, own.area, self.ratio, adopt
        )
        add_rows(f, own.nodes, forces[:num_own])
        self.dissipated += dissipated + edge_dissipated + wall_dissipated
        self.num_adopted += num_adopted + edge_adopted + wall_adopted
        self.num_deep += num_deep + edge_deep
        self.deepest = max(self.deepest, deepest, edge_deepest)

    def add_stiffness(self, y, q, margin):
        """Add the contact springs nearer than ``margin`` [m] times ``q`` to ``y``. Collective.

        ``y`` and ``q`` have the shape (num_nodes, 3).
        """
        p, s, own = self.pairs, self.surface, self.own
        num_own = own.nodes.size
        positions = self.positions.array.copy()
        gather_rows(self.positions.array[:num_own], q, own.nodes)
        self.positions.begin_forward()
        self.positions.end_forward()
        move, forces = self.positions.array, self.forces.array
        forces[:] = 0.0
        add_pair_stiffness(
            forces, move, margin, p.due, self.clock, p.node, p.first, p.candidate, p.closest,
            p.closed, p.weights, p.normal, p.stiffness, s.facets, self.layer, s.layer_of_facet,
            own.area, self.ratio,
        )  # fmt: skip
        self.edges.add_stiffness(forces, move, margin, self.clock)
        self.forces.add_back()
        self.walls.add_stiffness(forces, move, margin, self.clock, self.layer, own.area, self.ratio)
        add_rows(y, own.nodes, forces[:num_own])
        self.positions.array[:] = positions

    def edge_bounds(self, margin):
        """Bounds of the springs of crossing edges at own surface nodes [N/m]. Collective."""
        self.forces.array[:] = 0.0
        self.edges.add_bounds(self.forces.array, margin, self.clock)
        self.forces.add_back()
        return self.forces.array[: self.own.nodes.size, 0]

    def energy(self):
        """Energy in the contact springs [J] and number of closed contacts. Local."""
        p = self.pairs
        pairs, num_pairs = pair_energy(
            p.gap, p.offset, p.closed, p.stiffness, p.shear, p.node, self.ratio
        )
        edges, num_edges = self.edges.energy()
        walls, num_walls = self.walls.energy(self.layer, self.own.area, self.ratio)
        return pairs + edges + walls, num_pairs + num_edges + num_walls

    def traction(self, num_nodes):
        """Pressure and size of the shear traction at all nodes of this rank [Pa]. Collective.

        Returns:
            Two arrays of shape (num_nodes,), zero inside the grains.
        """
        own, p, w = self.own, self.pairs, self.walls.pairs
        pressure, shear = np.zeros(num_nodes), np.zeros((num_nodes, 3))
        on = np.flatnonzero(p.closed)
        node = own.nodes[p.node[on]]
        half = 0.5 * own.area[p.node[on]]
        depth = np.minimum(p.offset[on] - p.gap[on], self.largest_depth)
        np.add.at(pressure, node, p.stiffness[on] * depth / half)
        np.add.at(shear, node, p.shear[on] / half[:, None])
        on = np.flatnonzero(w.closed)
        node = own.nodes[w.node[on]]
        np.add.at(pressure, node, (w.offset[on] - w.gap[on]) / self.layer[w.node[on]])
        np.add.at(shear, node, w.shear[on] / own.area[w.node[on], None])
        for part, add in ((0, pressure), (1, shear)):
            carried = np.zeros((2, *self.forces.array.shape))
            self.edges.add_traction(*carried)
            self.forces.array[:] = carried[part]
            self.forces.add_back()
            found = self.forces.array[: own.nodes.size] / own.area[:, None]
            add[own.nodes] += found if part else found[:, 0]
        return pressure, np.linalg.norm(shear, axis=1)


def _finder(global_facet):
    """Local number of facets from their numbers over all ranks, -1 where absent."""
    order = np.argsort(global_facet, kind="stable")
    ordered = global_facet[order]

    def find(wanted):
        place = np.minimum(np.searchsorted(ordered, wanted), max(ordered.size - 1, 0))
        return np.where(ordered[place] == wanted, order[place], -1)

    return find
