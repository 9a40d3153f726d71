"""The contact operator: from positions of the nodes to forces on them."""

import math

import numpy as np
from mpi4py import MPI

from ..errors import InputError
from ..kernels.motion import largest_move
from ..kernels.pairs import PairForces, pair_energy
from ..kernels.points import place_points
from ..kernels.rows import gather_rows, gather_some, hand_rows, hand_some
from ..state import Stateful
from .friction import PairFriction
from .laws import (
    KINEMATIC,
    LARGEST_DEPTH,
    LAYERS,
    edge_of_area,
    inertial_layers,
    largest_depths,
    law_names,
    replace_layers,
)
from .mirrors import nodes_on_mirrors
from .pairs.edge_pairs import EdgeContact, edge_compliances
from .pairs.facet_pairs import search_pairs
from .pairs.motion_bounds import RANGE, Motion
from .results.dissipation import Ledger
from .results.edge_contacts import new_slip
from .start.checks import check_law, check_stiffness, check_surface, check_walls
from .start.overlap import NOT_SUNK
from .surface.exchange import SurfaceArray, SurfaceVector, exchange_surface
from .surface.halo_messages import Messages
from .surface.points import RECESS, surface_points
from .surface.surface import own_surface

#: Candidates reach this far beyond the closed gap, in mean facet edges.
SKIN = 0.4
#: Overlaps of the start are found up to this depth, in the largest edge of the other grain.
DEEPEST_START = 1.1


class Contact(Stateful):
    """Contact of the grains with each other and with walls. Collective.

    Positions of surface nodes go forward to the ranks that need them, forces
    come back and are added, both through PETSc vectors with ghosts.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        x: Reference positions of its nodes [m], shape (num_nodes, 3).
        contact_modulus: E/(1 - nu²) of this rank's grains [Pa], shape (num_grains,).
        tangential_ratio: 2(1 - nu)/(2 - nu) of this rank's grains, shape (num_grains,).
        friction: Coefficient of friction between grains, or a
            :class:`~mufe_fenicsx.contact.friction.PairFriction`.
        compliance: Constant c of the layer that matches stiffness to mesh.
        walls: :class:`~mufe_fenicsx.contact.walls.Walls`.
        points: Where contact acts, one of contact.surface.points.KINDS.
        law: Normal law, one of contact.laws.law_names().
        mass: Nodal masses [kg], shape (num_nodes,), for the kinematic law.
        friction_kinetic: Coefficient while a contact slips; ``friction`` if None.
        self_contact: Nodes of a grain also meet facets of the same grain across a void.
        rigid_layer: Compliance of the layer of grains that do not deform [m/Pa], nan for
            others, shape (num_grains,); None: all deform.
        edge_compliance: Gives what a mesh lacks of compliance between the ends of its sharp edges,
            called as :meth:`~mufe_fenicsx.bulk.solid.Solid.edge_compliance`; None: nothing.

    Raises:
        InputError: There are no such points, or no such law; a coefficient cannot be; a wall
            stands inside the sample; self-contact at other points than nodes.
    """

    STATE = {
        "common": ("clock", "searched_at", "reach", "overlap", "num_searches", "step_of_layers"),
        "sum": ("dissipated", "switched", "num_adopted"),
        "largest": ("deepest", "overrun", "overrun_of_all"),
    }

    def __init__(
        self,
        mesh,
        x,
        contact_modulus,
        tangential_ratio,
        friction,
        compliance,
        walls,
        points="facets",
        law="matched",
        mass=None,
        friction_kinetic=None,
        self_contact=False,
        rigid_layer=None,
        edge_compliance=None,
    ):
        by_pair = friction if isinstance(friction, PairFriction) else PairFriction(friction)
        check_law(by_pair.friction, compliance)
        if self_contact and points != "nodes":
            raise InputError(f'self-contact with points of contact = {points}, expected "nodes"')
        self.comm, self._grains = mesh.comm, mesh.grains
        self.own = own_surface(mesh, x, nodes_on_mirrors(x, walls.walls), walls.normal)
        check_surface(mesh, self.own)
        check_stiffness(mesh, contact_modulus)
        #: Static and kinetic coefficients, of no pair of materials and of each, shape (n, 2).
        self.coefficients = by_pair.table(friction_kinetic, mesh.labels.size)
        self._friction_rows = by_pair.rows
        self.walls = walls
        own = self.own
        if law not in law_names():
            names = ", ".join(law_names())
            raise InputError(f"normal law of contact = {law}, expected one of {names}")
        self.kinematic = law == KINEMATIC
        self.step_of_layers = 1.0  #: step that kinematic layers are made for [s]
        if self.kinematic:
            layers = inertial_layers(own, mass[own.nodes])
        else:
            modulus = contact_modulus[mesh.grain_of_node[own.nodes]]
            of_facets = contact_modulus[self.own.local_grain_of_facet]
            layers = LAYERS[law](own, modulus, of_facets, compliance)
            if rigid_layer is not None:
                replace_layers(mesh, own, layers, rigid_layer)
        depths = largest_depths(mesh, own, contact_modulus, rigid_layer)
        self.depth_of_facet = depths[1]
        of_mesh = None if self.kinematic else edge_compliance
        self.compliance_of_edge = edge_compliances(own, x, of_mesh)
        self.points = surface_points(points, mesh, own, x, *layers, *depths)
        self.facet_layer = layers[1]
        self.layer = self.points.layer
        # Points come before nodes in all arrays; nodes that are points come once.
        self.num_before = 0 if self.points.corner is None else self.points.num_points
        self._around = self.points.around + np.int32(self.num_before)
        self.ratio = tangential_ratio[self.points.local_grain]

        total = self.comm.allreduce(np.array([own.facet_area.sum(), own.facet_area.size]))
        self.edge = math.sqrt(4 / math.sqrt(3) * total[0] / total[1])
        self.skin = SKIN * self.edge
        self.width = self.comm.allreduce(float(np.ptp(x, axis=0).max()), op=MPI.SUM)
        self.self_contact = self_contact
        check_walls(self.comm, walls, x, self.edge)
        node_ratio = tangential_ratio[mesh.grain_of_node[own.nodes]]
        # As of sharp vertices: edges that end a flat contact add nothing to it.
        self.edges = EdgeContact(
            node_ratio, RECESS if self.num_before else 0.0, self.coefficients, by_pair.rows
        )

        self.ledger = Ledger(self.points.grain_of_point, mesh.labels.size)
        self.dissipated = 0.0  #: by friction on this rank so far [J]
        #: Energy that springs lost so far where pairs passed to other facets and edges [J]: less
        #: than none where a point came under an edge; on this rank.
        self.switched = 0.0
        self.num_adopted = 0  #: pairs that overlapped at the start, on this rank
        self.deepest = 0.0  #: largest depth of them on this rank [m]
        #: Deepest of all pairs since this was reset, on this rank: depth over the edge of the finer
        #: side, depth [m], grain and the one that it is in; steps set it, searches for
        #: an equilibrium do not.
        self.sunk = NOT_SUNK
        self.num_searches = 0
        #: Bound of all relative motion so far, the same on all ranks [m]; of two grains: clocks.
        self.clock = 0.0
        self._longest = RANGE * self.edge
        self.searched_at = 0.0
        self.pairs = None
        self.surface = None
        self.positions = None
        self.forces = self.motion = self._messages = None
        self._move, self._agreement = np.zeros(2), None
        #: By how much clocks of two grains go beyond what was expected soon, on this rank, and two
        #: steps ago on all [m].
        self.overrun = self.overrun_of_all = -np.inf
        #: Called before each search; afterwards all positions are those of this moment.
        self.before_search = None
        #: Own surface nodes whose positions are known until the next search; None: all.
        self.moving = None
        self.search(x)

    def search(self, x, ahead=0.0):
        """Find all pairs anew, those within ``ahead`` [m] at least. Collective.

        The first search also finds overlaps, up to an edge of the facet deep.
        """
        if self.before_search is not None:
            self.before_search()
        self.moving = None
        gathered = np.empty((self.own.nodes.size, 3))
        gather_rows(gathered, x, self.own.nodes)
        depth = self.edges.deepest()
        if self.pairs is not None and self.pairs.gap.size:
            depth = max(depth, -self.pairs.gap[np.isfinite(self.pairs.gap)].min(initial=0.0))
        depth = self.comm.allreduce(depth, op=MPI.MAX)
        reach = max(self.skin, ahead) + 1.1 * depth

        old, old_crossings = self.pairs, self.edges.pairs
        if old is not None:
            # The kernels keep positions and forces of before.
            self.walls.pairs.forces = None
            # Whether a node meets its own grain hangs on more than their distance.
            wait = min(self.searched_at + self.reach - self.clock, self._longest)
            wait = 0.0 if self.self_contact else wait
            self.edges.slip += new_slip(self)
            old.drop_candidates(self.surface.global_facet)
        overlaps = self._overlaps_at_start() if old is None else np.zeros(self.ledger.num_grains)
        overlap = float(overlaps.max(initial=0.0))
        self.exchange(gathered, reach, overlap)
        num_own, num_points = self.own.nodes.size, self.points.num_points

        self.pairs = search_pairs(
            self.positions.array,
            num_points,
            self.points.grain_of_point,
            self.facets,
            self.surface,
            reach + overlaps[self.surface.grain_of_facet],
            self.clock,
            self.points.depth if self.self_contact else None,
        )
        if old is not None:
            self.pairs.carry(old, self.surface.global_facet, wait)
        self.pairs.clocks.follow(self.motion)
        nodes = self.positions.array[self.num_before :]
        self.edges.search(nodes, num_own, self.surface, reach + overlap, self.clock)
        points, old_walls = self.positions.array[:num_points], self.walls.pairs
        of_points = self.points.corner, self.points.grain_of_point
        self.walls.search(points, gathered, *of_points, reach, self.clock)
        self.walls.pairs.clocks.follow(self.motion)
        self.walls.enclose(self.comm, points, reach)
        if old is not None:
            self.ledger.change(old, self.pairs, old_walls, self.walls.pairs, old_crossings)
        if self.num_before:
            # The others are needed again at the next search only.
            self.list_near()
        self.connect()
        self.searched_at = self.clock
        self.num_searches += 1

    def _overlaps_at_start(self):
        """How deep in each grain points are looked for at the start [m], (num_grains,). Collective.

        All facets of a grain have to be found that far: the closest one tells the side.
        """
        largest = np.zeros(self.ledger.num_grains)
        np.maximum.at(largest, self.own.grain_of_facet, self.own.facet_area)
        self.comm.Allreduce(MPI.IN_PLACE, largest, op=MPI.MAX)
        return DEEPEST_START * edge_of_area(largest, 1)

    def connect(self):
        """Steps exchange what the pairs of now ask for from here on. Collective."""
        self._messages = Messages(self)
        pairs = self.pairs.node, self.walls.pairs.node, self.edges.pairs.first
        # Else no force can act on a node of this rank, or by one of its pairs on another one.
        self._any_pair = any(of.size for of in pairs) or self._messages.any_force

    def list_near(self):
        """The points of all pairs. Local."""
        near = np.zeros(self.points.num_points, dtype=bool)
        near[self.pairs.node] = near[self.walls.pairs.node] = True
        self._near = np.flatnonzero(near).astype(np.int32)

    def exchange(self, gathered, reach, overlap=0.0):
        """Fetch what other ranks have near this one's surface. Collective.

        Args:
            gathered: Positions of own surface nodes [m], shape (num_nodes, 3).
            reach: Distance [m].
            overlap: Largest depth that is looked for beyond it [m].
        """
        self.searched, self.reach, self.overlap = gathered, reach, overlap
        self.surface, ghosts = exchange_surface(
            self.comm, self.own, self.facet_layer, self.depth_of_facet, self.compliance_of_edge,
            gathered, reach + overlap,
        )  # fmt: skip
        self.own = self.surface.part_of(self.own)
        if self.forces is not None:
            self.destroy()
        num_own = self.own.nodes.size
        self.positions = SurfaceArray(num_own, ghosts, self.num_before)
        self.forces, self._lent = SurfaceVector(self.comm, num_own, ghosts, self.num_before), True
        self.facets = self.surface.facets + np.int32(self.num_before)
        self.ring_offset, self.ring = self.surface.ring_offset, self.surface.ring
        if self.num_before:
            offset, ring = self.points.ring_offset, self.points.ring
            self.ring_offset = np.concatenate([offset[:-1], ring.size + self.ring_offset])
            self.ring = np.concatenate([ring, self.ring])
        self.forces.own[:] = gathered
        self.forces.forward()
        self.positions.array[self.num_before :] = self.forces.array[self.num_before :]
        self._near = np.arange(self.num_before, dtype=np.int32)
        self.place_points()
        near, num_walls = self.surface.neighbours, len(self.walls.walls)
        self.motion = Motion(self.comm, self._grains, near, num_walls, self._longest)
        self.measure_from(gathered)

    def destroy(self):
        """Free what sends messages. Collective."""
        if self._messages is not None:
            self._messages.destroy()
        self._messages = None
        self.forces.destroy()
        self.motion.destroy()

    def set_time_step(self, dt):
        """Make kinematic layers those of steps of length ``dt`` [s]. Local."""
        if self.kinematic and dt != self.step_of_layers:
            factor = (dt / self.step_of_layers) ** 2
            self.step_of_layers = dt
            # The layers of the points are these arrays too.
            self.layer *= factor
            self.facet_layer *= factor
            self.surface.layer_of_facet[:] *= factor
            self.pairs.stiffness /= factor
            self.walls.pairs.stiffness /= factor

    def begin(self, x, moved=0.0, known=()):
        """Begin a step to the positions ``x``, which :meth:`add_forces` ends. Collective.

        What other ranks need of this one, and how far anything moved, is on its way afterwards.

        Args:
            x: Positions [m], shape (num_nodes, 3).
            moved: Largest distance that a wall moved since the last call [m].
            known: Motion of nodes, which need not be measured then and is part of ``moved``: how
                far each grain moved beside a field [m], that field as in kernels.motion, its slope
                in any direction at most [1/s] and the length of the step [s].
        """
        self.place(x)
        if known:
            moves, field, slope, dt = known
            self.motion.begin(moves, self.walls.motion_in(field, dt), slope, dt)
        else:
            self.motion.begin()
            moved = max(largest_move(self._previous, self.positions.own), moved)
        self._move[:] = moved, self.overrun
        if self.comm.size > 1:
            self._agreement = self.comm.Iallreduce(MPI.IN_PLACE, self._move, op=MPI.MAX)

    def follow_all(self, x):
        """Know all own surface nodes from now on, the motion up to ``x`` being known. Local."""
        self.moving = None
        self.measure_from(x[self.own.nodes])

    def measure_from(self, positions):
        """The next motion that :meth:`begin` measures is that from there. Local.

        Args:
            positions: Of own surface nodes [m], shape (num_nodes, 3).
        """
        self._previous = positions.copy()

    def place(self, x):
        """Start sending the positions ``x`` of this rank's surface to other ranks. Collective."""
        if self.moving is None:
            gather_rows(self.positions.own, x, self.own.nodes)
        else:
            gather_some(self.positions.own, x, self.own.nodes, self.moving)
        self.send()

    def send(self):
        """Own positions start on their way to the ranks that know them. Collective."""
        self._messages.begin_there()

    def receive(self):
        """Positions from other ranks have arrived afterwards. Collective."""
        self._messages.end_there()

    def agree(self):
        """The largest distance that anything of any rank moved in this step [m]. Collective."""
        if self.comm.size > 1:
            self._agreement.Wait()
        self.overrun_of_all = float(self._move[1])
        return float(self._move[0])

    def begin_give_back(self):
        """Forces on nodes of other ranks start on their way there. Collective."""
        self._messages.begin_back()

    def end_give_back(self):
        """They have been added afterwards. Collective."""
        self._messages.end_back()

    def corners(self):
        """Nodes and weights of points in facets as kernels.points wants them, made anew. Local."""
        if not self.num_before:
            return np.empty((0, 3), np.int32), np.empty((0, 3))
        return self.points.corner + np.int32(self.num_before), self.points.weight

    def place_points(self):
        """Bring all points of pairs to where their nodes are; a step places those it needs."""
        if self.num_before:
            place_points(self.positions.array, self._near, *self.corners())

    def add_forces(self, f, x, adopt=False):
        """Add the contact forces at the positions of :meth:`begin` to ``f``. Collective.

        Args:
            f: Nodal forces [N], shape (num_nodes, 3).
            x: Positions [m], shape (num_nodes, 3).
            adopt: True at the start of a test: what overlaps now is not in contact.

        Raises:
            FloatingPointError: A position is not finite, or left the others by more than
                all the grains are wide; on all ranks together.
        """
        self.receive()
        move = self.agree()
        self.motion.end()
        if not move < self.width:
            raise FloatingPointError("positions are not finite")
        self.advance(2.0 * move, self.motion)
        # The motion of the next step, at twice its speed now, must not leave the skin.
        if self.clock + 4.0 * move - self.searched_at > self.skin:
            self.search(x, ahead=4.0 * move)
        self.evaluate(f, adopt)
        part, pair = self._sunk
        if part > self.sunk[0] and not adopt:
            p = self.pairs
            depth = p.offset[pair] - p.gap[pair]
            grain = self.points.grain_of_point[p.node[pair]]
            self.sunk = (part, float(depth), int(grain), int(p.grain[pair]))

    def advance(self, step, motion=None):
        """All clocks go on by ``step`` [m], those of grains by less where their motion is known.

        Local; the same on all ranks.
        """
        self.clock += step
        of_grains, of_walls = self.pairs.clocks, self.walls.pairs.clocks
        self.overrun = max(of_grains.advance(step, motion), of_walls.advance(step, motion))

    def expect(self, margin, least, factor):
        """Expect motion until the time step is found again, arguments as of the clocks. Local."""
        for pairs in (self.pairs, self.walls.pairs):
            pairs.clocks.expect(margin, least, factor)
        self.overrun = self.overrun_of_all = -np.inf

    def mark(self):
        """Look at motion from here on where it is expected next. Local."""
        for pairs in (self.pairs, self.walls.pairs):
            pairs.clocks.mark()

    def bind(self):
        """Let the kernels know the arrays of new pairs, which stay where they are. Local."""
        p, points = self.pairs, self.points
        x, forces = self.positions.array, self.forces.array
        if p.forces is None:
            s = self.surface
            p.friction_row = self._friction_rows(points.grain_of_point[p.node], p.grain)
            p.forces = PairForces(
                p.state, p.due, p.candidate_due, p.clocks.readings, p.clocks.of, p.closest,
                p.node, p.first, p.candidate,
                self.facets, s.neighbour, self.ring_offset, self.ring, self.edges.beside,
                self.layer, s.layer_of_facet, points.area, points.facet_area, s.area_of_facet,
                points.depth, s.depth_of_facet, points.recess, self.ratio, self._around,
                points.around_of, *self.corners(), x, forces, self._early_pairs(),
                self.coefficients, p.friction_row,
            )  # fmt: skip
        if self.walls.pairs.forces is None:
            self.walls.bind(forces, x, self.corners(), self.layer, points, self.ratio)

    def _early_pairs(self):
        """Pairs with grains of other ranks, whose forces travel while the others are found."""
        far = np.ones(self.ledger.num_grains, dtype=bool)
        far[self._grains] = False
        return far[self.pairs.grain]

    def evaluate(self, f, adopt=False):
        """Add the forces of the known pairs at the positions that were received. Collective.

        Arguments as of :meth:`add_forces`; ``clock`` has to bound the motion already.
        """
        if not self._any_pair:
            self.walls.clear()
            self._sunk = 0.0, -1
            return
        self.bind()
        p, forces, x = self.pairs, self.forces.array, self.positions.array
        if self._lent:  # else all forces have been handed on since, and are zero
            forces[self.num_before :] = 0.0
        edges = 0.0, 0.0, 0, 0.0

        def between():
            nonlocal edges
            if not self.kinematic:
                nodes = slice(self.num_before, None)
                edges = self.edges.add_forces(forces[nodes], x[nodes], self.clock, adopt)
            self.begin_give_back()

        # What other ranks wait for comes first.
        pairs = p.forces(self._longest, adopt, between)
        ahead = self.step_of_layers if self.kinematic else 0.0
        walls = self.walls.add_forces(adopt, ahead)
        self.end_give_back()
        if self.moving is None:
            hand_rows(f, self.own.nodes, self.forces.own)
        else:
            hand_some(f, self.own.nodes, self.forces.own, self.moving)
        part, pair = pairs[4]
        self._lent, self._sunk = False, (0.5 * LARGEST_DEPTH * part, pair)
        self.dissipated += pairs[0] + edges[0] + walls[0]
        if not self.kinematic:  # whose springs hold no energy
            self.switched += pairs[1] + edges[1]
        self.num_adopted += pairs[2] + edges[2] + walls[1]
        self.deepest = max(self.deepest, pairs[3], edges[3])

    def energy(self):
        """Energy in the contact springs [J] and number of closed contacts. Local.

        The springs of the kinematic law hold none: they belong to one step.
        """
        p = self.pairs
        pairs, num_pairs = pair_energy(
            p.gap, p.offset, p.closed, p.stiffness, p.shear, p.node, self.ratio, p.largest_depth
        )
        edges, num_edges = self.edges.energy()
        walls, num_walls = self.walls.energy(self.layer, self.points.area, self.ratio)
        energy = 0.0 if self.kinematic else pairs + edges + walls
        return energy, num_pairs + num_edges + num_walls

    def counts(self):
        """Closed pairs, those with an offset of the start, and those at their largest force. Local.

        Pairs of points with facets and walls, and crossings of edges.
        """
        numbers = np.zeros(3, dtype=np.int64)
        for pairs, recess in ((self.pairs, 0.0), (self.edges.pairs, self.edges.pairs.recess)):
            depth = pairs.offset - pairs.gap - recess
            at_largest = pairs.closed & (depth > pairs.largest_depth)
            with_offset = pairs.closed & (pairs.offset != 0.0)
            numbers += [of.sum() for of in (pairs.closed, with_offset, at_largest)]
        walls = self.walls.pairs
        numbers[:2] += walls.closed.sum(), (walls.closed & (walls.offset != 0.0)).sum()
        return numbers

    @property
    def known_ahead(self):
        """Motion from now on in which no pairs close but those that are known [m]."""
        return min(self.searched_at + self.reach - self.clock, self.skin)

    @property
    def num_exchanged(self):
        """Ghosts whose positions come in a step, and those on which forces go back. Local."""
        return self._messages.num_ghosts

    @property
    def num_nodes_with_ghosts(self):
        """Surface nodes of this rank and those of others that it knows."""
        return self.positions.array.shape[0] - self.num_before

    def back_to_owners(self, values, largest=False):
        """Sums, or the largest, of values at surface nodes over all ranks. Collective.

        Args:
            values: Of this rank's surface nodes and its ghosts, (num_nodes_with_ghosts, 3).
            largest: The largest instead of the sum.

        Returns:
            Values at own surface nodes, shape (num_nodes, 3).
        """
        vector = self.lend()
        vector.array[self.num_before :] = values
        if largest:
            vector.largest_back()
        else:
            vector.add_back()
        return vector.own.copy()

    def lend(self):
        """The vector of forces, for other values: forces are not needed once they are added up."""
        self._lent = True
        return self.forces

    def areas(self, pairs):
        """Parts of the contact area [m²] that the closed pairs ``pairs`` carry. Local.

        Both sides of a contact carry points; their shares of it add up to one.
        """
        p = self.pairs
        facet = p.candidate[p.closest[pairs]]
        layers = self.layer[p.node[pairs]] + self.surface.layer_of_facet[facet]
        return p.stiffness[pairs] * layers
