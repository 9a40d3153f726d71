"""Which contacts a test will close, from where its grains are before it: a guess by geometry.

Grains are moved as the platens would move them if nothing turned or slipped: without change of
shape, their middles evenly along the axis. A point of contact closes where its gap is less than by
how much its grain comes nearer to the other one.
"""

import numpy as np
from mpi4py import MPI

#: Gaps are looked for this far, in mean edges of facets.
REACH = 0.5


def closing_points(simulation, bounds, strain):
    """Points of contact between grains and with platens that are closed at a strain. Collective.

    It searches contacts anew and steps once. Beyond the strain up to which all gaps that may close
    are known, the points grow with the strain, as the section of balls in a plane does.

    Args:
        simulation: :class:`~mufe_fenicsx.explicit.simulation.Simulation` before its test.
        bounds: :class:`~mufe_fenicsx.container.Bounds` of its walls.
        strain: Of the axis z.

    Returns:
        Array of shape (2,).
    """
    s, mesh = simulation, simulation.mesh
    comm, num_grains, height = s.comm, mesh.labels.size, s.state.x[:, 2]
    first, last = np.full(num_grains, np.inf), np.full(num_grains, -np.inf)
    grain = mesh.grains[mesh.grain_of_node]
    np.minimum.at(first, grain, height)
    np.maximum.at(last, grain, height)
    comm.Allreduce(MPI.IN_PLACE, first, op=MPI.MIN)
    comm.Allreduce(MPI.IN_PLACE, last, op=MPI.MAX)
    middle = 0.5 * (first + last)
    reach = REACH * s.contact.edge
    s.contact.search(s.state.x, ahead=reach)
    s.step()
    contact, pairs, points = s.contact, s.contact.pairs, s.contact.points
    known = reach / comm.allreduce(float((last - first).max()), op=MPI.MAX)
    e = min(strain, known)
    # A sleeve or a tool between the platens is no grain that they press.
    of_sample = np.arange(num_grains) < mesh.num_sample_grains
    on = np.isfinite(pairs.gap) & (pairs.closest >= 0)
    on &= of_sample[points.grain_of_point[pairs.node]] & of_sample[pairs.grain]
    one, other = points.grain_of_point[pairs.node[on]], pairs.grain[on]
    nearer = np.abs(middle[one] - middle[other]) * np.abs(pairs.normal[on][:, 2])
    between = int((np.maximum(pairs.gap[on], 0.0) < e * nearer).sum())
    own = points.grain_of_point
    of_grain = of_sample[own]
    place = contact.ghosts.positions.array[: points.num_points, 2][of_grain]
    own = own[of_grain]
    top = bounds.high[2] - place < e * (bounds.high[2] - middle[own])
    bottom = place - bounds.low[2] < e * (middle[own] - bounds.low[2])
    closed = comm.allreduce(np.array([between, int(top.sum() + bottom.sum())]))
    return closed * (strain / e if e else 0.0)
