"""The contact operator: from positions of the nodes to forces on them."""

import math

import numpy as np
from mpi4py import MPI

from ..state import Stateful
from .laws import LARGEST_DEPTH
from .mirrors import nodes_on_mirrors
from .pairs.edge_pairs import EdgeContact
from .pairs.relative_motion import SKIN, RelativeMotion
from .results.dents import Dents
from .results.dissipation import Dissipation
from .search import find_pairs
from .start.checks import check_stiffness, check_surface, check_walls
from .start.overlap import Overlaps
from .stiffness.layers import SurfaceLayers
from .surface.ghosts import Ghosts
from .surface.grown import GrownSurface
from .surface.points import RECESS
from .surface.surface import own_surface


class Contact(Stateful):
    """Contact of the grains with each other and with walls. Collective.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        x: Reference positions of its nodes [m], shape (num_nodes, 3).
        walls: :class:`~mufe_fenicsx.contact.walls.Walls`.
        grains: :class:`~mufe_fenicsx.contact.settings.ContactGrains`.
        settings: :class:`~mufe_fenicsx.contact.settings.ContactSettings`.
        before: The contact of the mesh that this one has grown from: no pairs are searched yet, and
            what contact of the start cannot be is not looked for. None: of the start.

    Attributes:
        own, surface: This rank's surface, and with that of other ranks near it.
        points: Where contact acts, :class:`~mufe_fenicsx.contact.surface.points.Points`.
        layers: :class:`~mufe_fenicsx.contact.stiffness.layers.SurfaceLayers`.
        friction: :class:`~mufe_fenicsx.contact.friction.FrictionTable`.
        ghosts: Positions and forces, :class:`~mufe_fenicsx.contact.surface.ghosts.Ghosts`.
        motion: :class:`~mufe_fenicsx.contact.pairs.relative_motion.RelativeMotion`.
        pairs: Points and facets, :class:`~mufe_fenicsx.contact.pairs.facet_pairs.Pairs`.
        edges: Crossing edges, :class:`~mufe_fenicsx.contact.pairs.edge_pairs.EdgeContact`.
        dissipation: :class:`~mufe_fenicsx.contact.results.dissipation.Dissipation`.
        overlaps: :class:`~mufe_fenicsx.contact.start.overlap.Overlaps`.
        edge: Mean facet edge of all ranks [m].
        searched: Positions of own surface nodes at the last search [m], shape (num_nodes, 3).

    Raises:
        InputError: There are no such points; a coefficient cannot be; a wall stands inside the
            sample; a surface is open.
    """

    STATE = {"common": ("num_searches",)}

    def __init__(self, mesh, x, walls, grains, settings, before=None):
        self.comm, self.walls, self.self_contact = mesh.comm, walls, settings.self_contact
        mirrors, grown = (nodes_on_mirrors(x, walls.walls), walls.normal), None
        if before is None:
            self.own = own = own_surface(mesh, x, *mirrors)
            check_surface(mesh, own)
            check_stiffness(mesh, grains.modulus)
        else:  # layers of kinematic contact change with all masses
            surface = GrownSurface(mesh, x, *mirrors, before.own, settings.kinematic)
            self.own, grown = surface.own, (surface, before.layers)
            own = self.own
        self.friction = settings.pair_friction.table(settings.friction_kinetic, mesh.labels.size)
        self.layers = SurfaceLayers(mesh, own, x, grains, settings, grown)
        self.points = self.layers.points
        #: The first of the bodies that are tools; None: there are none.
        self.first_tool = mesh.first_tool if mesh.tools else None
        area = own.facet_area[own.grain_of_facet < mesh.first_tool]
        total = self.comm.allreduce(np.array([area.sum(), area.size]))
        self.edge = math.sqrt(4 / math.sqrt(3) * total[0] / total[1])
        self.motion = RelativeMotion(self.comm, mesh.grains, self.edge, x)
        if before is None:
            of_grains = ~mesh.is_tool[mesh.grain_of_node]
            check_walls(self.comm, walls, x[of_grains] if mesh.tools else x, self.edge)
        of_tools = _of_tools(own, self.points, self.first_tool)
        walls.begin(x[own.nodes], mesh.labels[own.grain_of_node], self.points, of_tools)
        self.ghosts = Ghosts(self.comm, own.nodes, self.points)
        node_ratio = grains.tangential_ratio[mesh.grain_of_node[own.nodes]]
        # As of sharp vertices: edges that end a flat contact add nothing to it.
        recess = RECESS if self.ghosts.num_before else 0.0
        self.edges = EdgeContact(
            node_ratio, recess, self.friction, self.first_tool,
            None if mesh.origin is None else mesh.origin[own.nodes],
        )  # fmt: skip
        dents = Dents(mesh.num_cells, self.layers.strengths.any)
        self.dissipation = Dissipation(self.points.grain_of_point, mesh.labels.size, dents)
        self.overlaps = Overlaps()
        self.num_searches = 0
        self.pairs = self.surface = None
        #: Whether a force can act on a node of this rank, or by one of its pairs on another one.
        self.any_pair = False
        #: Called before each search; afterwards all positions are those of this moment.
        self.before_search = None
        if before is None:
            self.search(x)

    @property
    def parts(self):
        """All that steps change, :class:`~mufe_fenicsx.state.Stateful` by name, but pairs."""
        dents = self.dissipation.dents
        return {
            "contact": self,
            "contact_motion": self.motion,
            "layers": self.layers,
            "dissipation": self.dissipation,
            "overlaps": self.overlaps,
            **({"dents": dents} if dents.any else {}),
        }

    def search(self, x, ahead=0.0, skin=SKIN):
        """Find all pairs anew, those within ``ahead`` [m] at least. Collective.

        The first search also finds overlaps, up to an edge of the facet deep. ``skin``: how far
        candidates reach beyond the closed gap, in mean facet edges.
        """
        if self.before_search is not None:
            self.before_search()
        find_pairs(self, x, ahead, skin)
        self.num_searches += 1

    def deepest(self):
        """Depths of the deepest pair of a point, and of the deepest closed one of edges [m].

        Collective.
        """
        of_points = 0.0 if self.pairs is None else self.pairs.deepest()
        depths = of_points, self.edges.deepest()
        return np.array([self.comm.allreduce(depth, op=MPI.MAX) for depth in depths])

    def destroy(self):
        """Free what sends messages. Collective."""
        self.ghosts.destroy()
        self.motion.destroy()

    # --- forces ---------------------------------------------------------------------------

    def set_time_step(self, dt):
        """Make kinematic layers those of steps of length ``dt`` [s]. Local."""
        factor = self.layers.set_time_step(dt)
        surface, of_layers = self.surface, (self.pairs, self.walls.pairs)
        if factor != 1.0:
            surface.layer_of_facet[:] *= factor
            for pairs in of_layers:
                pairs.stiffness /= factor

    def begin_step(self, x, moved=0.0, known=()):
        """Begin a step to the positions ``x``, which :meth:`add_forces` ends. Collective.

        What other ranks need of this one, and how far anything moved, is on its way afterwards.

        Args:
            x: Positions [m], shape (num_nodes, 3).
            moved: Largest distance that a wall moved since the last call [m].
            known: Motion of nodes, which need not be measured then and is part of ``moved``: how
                far each grain moved beside a field [m], that field as in kernels.bulk.motion, its
                slope in any direction at most [1/s] and the length of the step [s].
        """
        self.ghosts.place(x)
        if known:
            moves, field, slope, dt = known
            known = moves, self.walls.near.motion_in(self.walls, field, dt), slope, dt
        self.motion.begin_agreement(self.ghosts.positions.own, moved, known)

    def follow_all(self, x):
        """Know all own surface nodes from now on, the motion up to ``x`` being known. Local."""
        self.ghosts.moving = None
        self.motion.measure_from(x[self.own.nodes])

    def add_forces(self, f, x, accept=False):
        """Add the contact forces at the positions of :meth:`begin_step` to ``f``. Collective.

        Args:
            f: Nodal forces [N], shape (num_nodes, 3).
            x: Positions [m], shape (num_nodes, 3).
            accept: True at the start of a test: what overlaps now is not in contact.

        Raises:
            FloatingPointError: A position is not finite, or left the others by more than
                all the grains are wide; on all ranks together.
        """
        self.ghosts.receive()
        move = self.motion.end_agreement()
        # The motion of the next step, at twice its speed now, must not leave the skin.
        if self.motion.is_beyond(4.0 * move):
            self.search(x, ahead=4.0 * move)
        part, pair = self.evaluate(f, accept)
        if not accept:
            self.overlaps.look_at(part, pair, self.pairs, self.points.grain_of_point)

    def bind(self):
        """Let the kernels know the arrays of new pairs, which stay where they are. Local."""
        points, work = self.points, self.dissipation.dents.work
        if self.pairs.forces is None:
            self.pairs.bind(
                points, self.surface, self.ghosts, self.layers, self.friction, self.edges.beside,
                self.motion.grains, work,
            )  # fmt: skip
        if self.walls.pairs.forces is None:
            self.walls.bind(points, self.ghosts, self.layers, work)
        if self.edges.pairs.forces is None:
            self.edges.bind(self.ghosts)

    def evaluate(self, f, accept=False):
        """Add the forces of the known pairs at the positions that were received. Collective.

        Arguments as of :meth:`add_forces`; the bounds have to know the motion already.

        Returns:
            Depth over edge of the deepest pair of this rank, and its number.
        """
        if not self.any_pair:
            self.walls.clear()
            return 0.0, -1
        self.bind()
        ghosts, layers, motion, edges = self.ghosts, self.layers, self.motion, (0.0, 0.0, 0, 0.0)
        ghosts.clear_forces()

        def between():
            nonlocal edges
            if not layers.kinematic:
                edges = self.edges.pairs.forces(motion.bound, accept)
            ghosts.begin_reverse()

        # What other ranks wait for comes first.
        pairs = self.pairs.forces(motion.longest, motion.left, accept, between)
        walls = self.walls.add_forces(accept, layers.ahead)
        ghosts.end_reverse()
        ghosts.hand_on(f)
        # Springs of the kinematic law hold no energy.
        switched = 0.0 if layers.kinematic else pairs[1] + edges[1]
        self.dissipation.add(pairs[0] + edges[0] + walls[0], switched)
        if accept:
            self.overlaps.accept(pairs[2] + edges[2] + walls[1], max(pairs[3], edges[3]))
        part, pair = pairs[4]
        return 0.5 * LARGEST_DEPTH * part, pair

    # --- numbers --------------------------------------------------------------------------

    def energy(self, left_out=None):
        """Energy in the contact springs [J] and number of closed contacts. Local.

        The springs of the kinematic law hold none: they belong to one step.

        Args:
            left_out: Whether pairs of each body with others do not count, shape (num_bodies,);
                None: all pairs count.
        """
        of_pairs = self.pairs.energy(self.points, left_out)
        found = of_pairs, self.edges.energy(left_out), self.walls.pairs.energy()
        energy, number = map(sum, zip(*found, strict=True))
        return (0.0 if self.layers.kinematic else energy), number

    def counts(self):
        """Closed pairs, those with an offset of the start, and those at their largest force. Local.

        Pairs of points with facets and walls, and crossings of edges; of pieces of one grain none.
        """
        pairs, edges = self.pairs, self.edges.pairs
        of_pairs = self.points.grain_of_point[pairs.node] != pairs.grain
        of_edges = edges.grain != edges.partner
        numbers = pairs.counts(of_pairs) + edges.counts(of_edges) + self.walls.pairs.counts()
        at_largest = pairs.num_at_largest(of_pairs) + edges.num_at_largest(of_edges, edges.recess)
        return np.append(numbers, at_largest)

    def areas(self, pairs):
        """Parts of the contact area [m²] that the closed pairs ``pairs`` carry. Local."""
        return self.pairs.areas(pairs, self.points, self.surface)


def _of_tools(own, points, first_tool):
    """Which own nodes, and which points, are of tools; None where there are none."""
    if first_tool is None:
        return None
    return own.grain_of_node >= first_tool, points.grain_of_point >= first_tool
