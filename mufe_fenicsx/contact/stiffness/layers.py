"""How stiff this rank's surface is in contact: layers, depths, compliance of edges, strengths."""

import math
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from ...kernels.build.pair_rows import POINT_DENT
from ...kernels.geometry.boxes import grown_by
from ...kernels.geometry.topology import rows_of
from ...state import Stateful
from ..laws import LAYERS, inertial_layers, largest_depths, replace_layers
from ..pairs.edge_pairs import edge_compliances
from ..surface.bulges import (
    Bulges,
    bulges_beside_cracks,
    bulges_of,
    bulges_of_the_start,
    highest,
    no_bulges,
)
from ..surface.points import Points, surface_points
from .strength import Strengths

#: What points keep of dents.
DENTS = ("dent", "beyond", "met")


class SurfaceLayers(Stateful):
    """Layers of points and facets that make the springs of pairs. Collective.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        own: Its :class:`~mufe_fenicsx.contact.surface.surface.OwnSurface`.
        x: Reference positions of its nodes [m], shape (num_nodes, 3).
        grains: :class:`~mufe_fenicsx.contact.settings.ContactGrains`.
        settings: :class:`~mufe_fenicsx.contact.settings.ContactSettings`.
        grown: Of a surface that has grown, :class:`~mufe_fenicsx.contact.surface.grown.
            GrownSurface` and the layers of before; None: of the start.
    """

    STATE = {"common": ("step",), "here": DENTS}

    def __init__(self, mesh, own, x, grains, settings, grown=None):
        self.kinematic = settings.kinematic
        self.step = 1.0  #: that kinematic layers are made for [s]
        if grown is None:
            found = _made(mesh, own, x, grains, settings)
        else:
            found = _regrown(mesh, x, grains, settings, *grown)
        self.of_facet = found.of_facet  #: compliance of own facets [m/Pa], shape (num_facets,)
        self.depth_of_facet = found.depth_of_facet  #: part in the largest depth of pairs [m]
        #: Of sharp edges, relative, of both ends [m/N], shape (num_facets, 3).
        self.compliance_of_edge = found.compliance_of_edge
        #: The smooth surface over the facets, :class:`~mufe_fenicsx.contact.surface.bulges.Bulges`.
        self.smooth = found.smooth
        #: :class:`~mufe_fenicsx.contact.surface.points.Points` of the surface.
        self.points = found.points
        #: How far smooth surfaces stand above facets [m], and how much faster than nodes their
        #: gaps go at most, on all ranks.
        self.highest, self.steepest = self._bounds(mesh.comm, own)
        strain = grains.plastic_strain
        #: Plastic strain of the cells, shape (num_cells,); zeros where nothing is known.
        self.plastic_strain = np.zeros(mesh.num_cells) if strain is None else strain
        #: Of all grains, :class:`~mufe_fenicsx.contact.stiffness.strength.Strengths`.
        self.strengths = Strengths(mesh, grains.yield_tables)
        #: Depth of the dents at points [m], in their own surface and beyond it in that of the grain
        #: that they ``met``, a global index; shape (num_points,).
        self.dents = np.zeros(self.points.num_points, POINT_DENT)
        self.dent, self.beyond, self.met = (self.dents[name] for name in DENTS)
        self.met[:] = -1
        #: Tangential over normal stiffness of points, shape (num_points,).
        self.ratio = grains.tangential_ratio[self.points.local_grain]

    def on(self, mesh, own, before):
        """What the surface of a mesh that has grown has as this one. Local.

        Args:
            mesh: The :class:`~mufe_fenicsx.mesh.GrainMesh` that has grown.
            own: Its :class:`~mufe_fenicsx.contact.surface.surface.OwnSurface`.
            before: That of before.

        Returns:
            :class:`Known`.
        """
        facet = rows_of(before.side, own.side)
        # The compliance of an edge is that of the cells around it and around these.
        near, ends = mesh.near_parts(2)[own.nodes], own.facets
        compliance = self.compliance_of_edge[facet]
        compliance[near[ends] | near[np.roll(ends, -1, axis=1)]] = np.nan
        marked = mesh.near_parts(0)[own.nodes]
        marked[own.facets[facet < 0]] = True
        changed = grown_by(own.facets, marked, 2)
        return Known(compliance, self.smooth.some(facet), changed)

    def _bounds(self, comm, own):
        """Fields ``highest`` and ``steepest``. Collective.

        Along a slope gaps go faster than points. A point that stands z over its facet goes by
        √(1 + 3 z² Σ |∇N|²) of what the three nodes do at most (Cauchy and Schwarz), where |∇N| is a
        side over twice the area, and the squares of sides add up to half that of the perimeter at
        most.
        """
        slope = self.smooth.slope.max(initial=0.0)
        gradients = math.sqrt(1.5) * 1.5 * own.facet_edge / own.facet_area
        stands = self.points.stands[: self.points.num_in_facets].reshape(len(gradients), -1)
        turn = np.abs(stands * gradients[:, None]).max(initial=0.0)
        most = np.array([highest(self.smooth.bulge).max(initial=0.0), slope, turn])
        comm.Allreduce(MPI.IN_PLACE, most, op=MPI.MAX)
        above, slope, turn = most.tolist()
        return above, math.hypot(1.0, slope) * math.hypot(1.0, turn)

    @property
    def rise(self):
        """By how much smooth surfaces bring facets nearer [m]."""
        return 2.0 * self.highest

    def set_time_step(self, dt):
        """Make kinematic layers those of steps of length ``dt`` [s]. Local.

        Returns:
            Their compliance now over that of before, 1 of other layers.
        """
        if not self.kinematic or dt == self.step:
            return 1.0
        factor = (dt / self.step) ** 2
        self.step = dt
        self.points.layer[:] *= factor
        self.of_facet *= factor
        return factor

    @property
    def ahead(self):
        """How much later than walls the positions are at which contact acts [s]."""
        return self.step if self.kinematic else 0.0


class _OfSurface(NamedTuple):
    """What follows from the surface: attributes of :class:`SurfaceLayers` by name."""

    of_facet: np.ndarray
    depth_of_facet: np.ndarray
    compliance_of_edge: np.ndarray
    smooth: Bulges
    points: Points


def _made(mesh, own, x, grains, settings, known=None):
    """That of a surface, or of a part of it. Local.

    Args:
        mesh, own, x, grains, settings: As of :class:`SurfaceLayers`.
        known: What it has as before, :class:`Known`; None: nothing.
    """
    layers = _layers(mesh, own, grains, settings)
    depths = largest_depths(mesh, own, grains.modulus, grains.rigid_layer)
    of_mesh = None if settings.kinematic else grains.edge_compliance
    edges = edge_compliances(own, x, of_mesh, known and known.compliance)
    faceted = settings.kinematic or settings.points == "nodes"
    smooth = no_bulges(own) if faceted else smooth_surface(mesh, own, x, known)
    if grains.rigid_layer is not None:  # layers of rigid grains stand for all that yields
        smooth.curvature[~np.isnan(grains.rigid_layer[own.local_grain_of_facet])] = 0.0
    points = surface_points(settings.points, mesh, own, x, *layers, *depths, smooth)
    return _OfSurface(layers[1], depths[1], edges, smooth, points)


def _regrown(mesh, x, grains, settings, grown, before):
    """:class:`_OfSurface` of a surface that has grown from the layers ``before``. Local."""
    known = before.on(mesh, grown.part, grown.before)
    part = _made(mesh, grown.part, x, grains, settings, known)
    rows = grown.facets.rows
    return _OfSurface(
        rows(before.of_facet, part.of_facet),
        rows(before.depth_of_facet, part.depth_of_facet),
        rows(before.compliance_of_edge, part.compliance_of_edge),
        before.smooth.joined(part.smooth, rows),
        grown.points(before.points, part.points),
    )


def _layers(mesh, own, grains, settings):
    """Compliance of nodes and of facets [m/Pa]; of kinematic ones for a step of 1 s."""
    if settings.kinematic:
        return inertial_layers(own, grains.mass[own.nodes])
    of_nodes = grains.modulus[mesh.grain_of_node[own.nodes]]
    of_facets = grains.modulus[own.local_grain_of_facet]
    layers = LAYERS[settings.law](own, of_nodes, of_facets, settings.compliance)
    if grains.rigid_layer is not None:
        replace_layers(mesh, own, layers, grains.rigid_layer)
    return layers


class Known(NamedTuple):
    """What own facets have as before a growth."""

    compliance: np.ndarray  #: as :attr:`SurfaceLayers.compliance_of_edge`, nan where it may differ
    smooth: Bulges  #: as :attr:`SurfaceLayers.smooth`
    changed: np.ndarray  #: whether that of facets of cracks may differ, shape (num_facets,)


def smooth_surface(mesh, own, x, known=None):
    """The smooth surface over own facets, with cracks or without. Local.

    Args:
        mesh, own, x, known: As of :class:`SurfaceLayers`.
    """
    if mesh.origin is None:
        return bulges_of(own, x[own.nodes])
    cracks = np.isin(own.side, mesh.sides_between(mesh.all_opened[:, :2]))
    if known is None:
        smooth = bulges_of_the_start(own, x[own.nodes], mesh.origin[own.nodes], ~cracks)
        return bulges_beside_cracks(own, x[own.nodes], smooth, cracks)
    return bulges_beside_cracks(own, x[own.nodes], known.smooth, cracks & known.changed)
