"""Which contacts a test will close, from where its grains are before it: a guess by geometry.

Grains are moved as the platens would move them if nothing turned or slipped: without change of
shape, their middles evenly along the axis. A point of contact closes where its gap is less than by
how much its grain comes nearer to the other one. And the platen travels until the chain of
grains from top to bottom with the least sum of gaps has closed.
"""

import numpy as np
from mpi4py import MPI
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

#: Gaps are looked for this far, in mean edges of facets; contacts nearer to horizontal than this
#: do not carry to the next grain: cosine of their normals with the axis.
REACH, STEEP = 0.5, 0.35


class Closing:
    """Gaps of a simulation before its test. Collective; it searches contacts anew and steps once.

    Args:
        simulation: :class:`~mufe_fenicsx.simulation.Simulation`.
        low, high: Corners of the box [m], shape (3,).
    """

    def __init__(self, simulation, low, high):
        s, mesh = simulation, simulation.mesh
        self.comm, self.num_grains = s.comm, mesh.labels.size
        height = s.state.x[:, 2]
        first, last = np.full(self.num_grains, np.inf), np.full(self.num_grains, -np.inf)
        grain = mesh.grains[mesh.grain_of_node]
        np.minimum.at(first, grain, height)
        np.maximum.at(last, grain, height)
        self.comm.Allreduce(MPI.IN_PLACE, first, op=MPI.MIN)
        self.comm.Allreduce(MPI.IN_PLACE, last, op=MPI.MAX)
        middle = 0.5 * (first + last)
        self.below, self.above = first - low[2], high[2] - last
        s.contact.search(s.state.x, ahead=REACH * s.contact.edge)
        s.step()
        pairs, points = s.contact.pairs, s.contact.points
        on = np.isfinite(pairs.gap) & (pairs.closest >= 0)
        self.one, self.other = points.grain_of_point[pairs.node[on]], pairs.grain[on]
        self.steep = np.abs(pairs.normal[on][:, 2])
        self.gap = np.maximum(pairs.gap[on], 0.0)
        self.nearer = np.abs(middle[self.one] - middle[self.other]) * self.steep
        place = s.contact.positions.array[: points.num_points, 2]
        centre = middle[points.grain_of_point]
        for gap, nearer in ((high[2] - place, high[2] - centre), (place - low[2], centre - low[2])):
            self.gap = np.concatenate([self.gap, gap])
            self.nearer = np.concatenate([self.nearer, nearer])
        size = self.comm.allreduce(float((last - first).max()), op=MPI.MAX)
        #: Strain up to which all gaps that may close are known.
        self.known = REACH * s.contact.edge / size

    def num_points(self, strain):
        """Points of contact that are closed at a strain. Collective.

        Beyond what is known they grow with the strain, as the section of balls in a plane does.
        """
        e = min(strain, self.known)
        closed = self.comm.allreduce(int((self.gap < e * self.nearer).sum()))
        return closed * strain / e if e else 0.0

    def travel(self):
        """How far the platen comes down until a chain of grains is closed [m]. Collective.

        Returns:
            It; inf where no chain reaches from top to bottom within what is known.
        """
        n, k = self.one.size, self.steep > STEEP
        chains = _least(self.one[k], self.other[k], self.gap[:n][k] / self.steep[k])
        parts = self.comm.gather(chains)  # a number or two for each two grains
        found = None
        if self.comm.rank == 0:
            joined = (np.concatenate(part) for part in zip(*parts, strict=True))
            one, other, way = _least(*joined)
            grains = np.arange(self.num_grains)
            top, bottom = np.full((2, self.num_grains), [[self.num_grains], [self.num_grains + 1]])
            rows = np.concatenate([one, grains, grains])
            columns = np.concatenate([other, top, bottom])
            ways = np.concatenate([way, self.above, self.below])
            shape = (self.num_grains + 2,) * 2
            # What is stored as zero would be no edge.
            graph = coo_matrix((np.maximum(ways, 1e-15), (rows, columns)), shape=shape)
            found = dijkstra(graph, directed=False, indices=self.num_grains)[-1]
        return float(self.comm.bcast(found))


def _least(one, other, way):
    """The least way of each two grains that are joined by some, all of shape (n,)."""
    one, other = np.minimum(one, other).astype(np.int64), np.maximum(one, other).astype(np.int64)
    order = np.lexsort((way, other, one))
    one, other, way = one[order], other[order], way[order]
    first = np.ones(one.size, dtype=bool)
    first[1:] = (one[1:] != one[:-1]) | (other[1:] != other[:-1])
    return one[first], other[first], way[first]
