"""Says at the start of a run that grains are meshed so coarsely that their edges are sharp."""

import math

import numpy as np

from ..contact.laws import edge_of_area
from ..contact.surface.surface import SHARP_EDGE
from ..units import with_unit

#: Part of the edges of grains that may be sharp: of a ball with edges h, whose facets turn by
#: 0.6 h/R in the mean, half are at h/R = 0.55. Then all of them are searched for crossings.
MOST_SHARP = 0.5
#: Edges over the radius of a ball of which a tenth are sharp.
SMOOTH = 0.45


def mean_edge_and_radius(simulation):
    """Edge of the mean facet, and radius of a ball of the grains' mean volume [m]. Collective."""
    mesh, own = simulation.mesh, simulation.contact.own
    area = own.facet_area[own.grain_of_facet < mesh.num_sample_grains]
    volume = simulation.solid.volume0[: mesh.num_sample_cells].sum()
    area, number, volume = simulation.comm.allreduce(np.array([area.sum(), area.size, volume]))
    radius = math.cbrt(3 / (4 * math.pi) * volume / mesh.num_sample_grains)
    return float(edge_of_area(area, number)), radius


def coarse_zones(simulation):
    """Lines where the mesh is too coarse for how grains break. Collective."""
    lines = [term.coarse_line() for term in simulation.specimen.opening_terms]
    return [line for line in lines if line is not None]


def warning_of_coarse_meshes(simulation):
    """A line where most edges of the sample's grains are sharp, or None. Collective.

    None once cracks are open, whose edges all are: the run told of its first mesh then.
    """
    mesh, own = simulation.mesh, simulation.contact.own
    if mesh.version:
        return None
    sharp = own.sharp_edge[own.grain_of_facet < mesh.num_sample_grains]
    num_sharp, num_edges = simulation.comm.allreduce(np.array([sharp.sum(), sharp.size]))
    if num_sharp <= MOST_SHARP * num_edges:
        return None
    edge, radius = mean_edge_and_radius(simulation)
    return (
        f"warning: {num_sharp / num_edges:.0%} of the edges of grains turn by more than "
        f"{math.degrees(SHARP_EDGE):g}°, expected at most {MOST_SHARP:.0%}: each is searched for "
        f"crossings, and steps take several times as long; edges are {with_unit(edge, 'm')}, "
        f"{edge / radius:.2g} of the radius of grains: mesh round grains with "
        f"{with_unit(SMOOTH * radius, 'm')} or less"
    )
