"""Which contacts a test will close, from where its grains are before it: a guess by geometry.

Grains are moved as the platens would move them if nothing turned or slipped: without change of
shape, their middles evenly along the axis. A point of contact closes where its gap is less than by
how much its grain comes nearer to the other one.

The platen travels until the bottom feels it. It takes the grains along one after the other, each at
its own speed v once their contact, gap and all, is so deep that it has done a part of the work

    W(x) = Σ A ∫ p dx = part · m v²/2,   1/m = 1/m₁ + 1/m₂,

p the pressure of the layers until it is that of a contact that flows. The way is the least sum of
these x over all chains of grains from top to bottom.
"""

import numpy as np
from mpi4py import MPI
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

#: Gaps are looked for this far, in mean edges of facets; contacts nearer to horizontal than this
#: do not carry to the next grain: cosine of their normals with the axis.
REACH, STEEP = 0.5, 0.35
#: Part of the energy that a contact takes before the next grain goes on: of 1/8, 1/4 and 1/2 that
#: which gives the seating of two balls and of a lattice (docs/method/planning.md).
PART = 0.25


class Closing:
    """Gaps of a simulation before its test. Collective; it searches contacts anew and steps once.

    Args:
        simulation: :class:`~mufe_fenicsx.explicit.simulation.Simulation`.
        bounds: :class:`~mufe_fenicsx.container.Bounds` of its walls.
    """

    def __init__(self, simulation, bounds):
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
        mass = np.bincount(grain, s.solid.mass, self.num_grains)
        self.comm.Allreduce(MPI.IN_PLACE, mass)
        s.contact.search(s.state.x, ahead=REACH * s.contact.edge)
        s.step()
        contact, pairs, points = s.contact, s.contact.pairs, s.contact.points
        # A sleeve or a tool between the platens is no way for them to feel each other.
        of_sample = np.arange(self.num_grains) < mesh.num_sample_grains
        on = np.isfinite(pairs.gap) & (pairs.closest >= 0)
        on &= of_sample[points.grain_of_point[pairs.node]] & of_sample[pairs.grain]
        one, other = points.grain_of_point[pairs.node[on]], pairs.grain[on]
        steep, gap = np.abs(pairs.normal[on][:, 2]), np.maximum(pairs.gap[on], 0.0)
        nearer = np.abs(middle[one] - middle[other]) * steep
        area, layer = points.area, contact.points.layer
        # Layers of both grains; each side has points of its own, which cover the contact.
        self.sides = [
            _Side(one, other, steep, gap, nearer, area[pairs.node[on]],
                  2 * layer[pairs.node[on]], mass[one] * mass[other] / (mass[one] + mass[other]))
        ]  # fmt: skip
        own = points.grain_of_point
        of_grain = of_sample[own]
        place = contact.ghosts.positions.array[: points.num_points, 2][of_grain]
        own, area, layer = own[of_grain], area[of_grain], layer[of_grain]
        for wall, gap, nearer in (
            (self.num_grains, bounds.high[2] - place, bounds.high[2] - middle[own]),
            (self.num_grains + 1, place - bounds.low[2], middle[own] - bounds.low[2]),
        ):
            self.sides.append(
                _Side(own, np.full_like(own, wall), np.ones(own.size), gap, nearer,
                      area, layer, mass[own])
            )  # fmt: skip
        size = self.comm.allreduce(float((last - first).max()), op=MPI.MAX)
        self.reach = REACH * contact.edge
        #: Strain up to which all gaps that may close are known.
        self.known = self.reach / size

    def num_points(self, strain):
        """Points of contact between grains and with platens that are closed. Collective.

        Beyond what is known they grow with the strain, as the section of balls in a plane does.

        Returns:
            Array of shape (2,).
        """
        e = min(strain, self.known)
        between, top, bottom = (int((s.gap < e * s.nearer).sum()) for s in self.sides)
        closed = self.comm.allreduce(np.array([between, top + bottom]))
        return closed * (strain / e if e else 0.0)

    def travel(self, speed=0.0, pressure=np.inf):
        """How far the platen comes down until the bottom feels it [m]. Collective.

        Args:
            speed: Of the platen [m/s]; 0: until a chain of grains is closed.
            pressure: At which contacts flow [Pa].

        Returns:
            It; inf where no chain reaches from top to bottom within what is known.
        """
        between, top, bottom = self.sides
        sides = [between.those(between.steep > STEEP)]
        sides += [side.those(side.gap < self.reach) for side in (top, bottom)]
        speeds = speed, speed, 0.0  # the bottom feels it at once
        chains = [
            _joined(*side.ways(v, pressure, self.reach))
            for side, v in zip(sides, speeds, strict=True)
        ]
        parts = self.comm.gather(chains)  # a number or two for each two grains
        found = None
        if self.comm.rank == 0:
            all_ways = [way for part in parts for way in part]
            one, other, way = _joined(*map(np.concatenate, zip(*all_ways, strict=True)))
            shape = (self.num_grains + 2,) * 2
            # What is stored as zero would be no edge.
            graph = coo_matrix((np.maximum(way, 1e-15), (one, other)), shape=shape)
            ends = {"indices": self.num_grains, "directed": False}
            found = dijkstra(graph, **ends)[-1]
        return float(self.comm.bcast(found))


class _Side:
    """Points of contact, all of shape (n,), and how they resist."""

    def __init__(self, one, other, steep, gap, nearer, area, layer, mass):
        self.one, self.other = one.astype(np.int64), other.astype(np.int64)
        self.steep, self.gap, self.nearer = steep, gap, nearer
        self.area, self.layer, self.mass = area, layer, mass

    def those(self, which):
        """Some of them."""
        arrays = (self.one, self.other, self.steep, self.gap, self.nearer, self.area, self.layer,
                  self.mass)  # fmt: skip
        return _Side(*(a[which] for a in arrays))

    def ways(self, speed, pressure, reach):
        """Way after which each of two bodies takes the other along [m]: (one, other, way).

        At most ``reach`` beyond their least gap.
        """
        key = self.one * (self.other.max(initial=0) + 1) + self.other
        order = np.lexsort((self.gap / self.steep, key))
        s, key = self.those(order), key[order]
        first = np.flatnonzero(np.r_[True, key[1:] != key[:-1]]) if key.size else key
        pair = np.repeat(np.arange(first.size), np.diff(np.r_[first, key.size]))
        low = (s.gap / s.steep)[first]
        if speed > 0.0 and first.size:
            need = 0.5 * PART * s.mass[first] * speed**2
            flows = pressure * s.layer  # depth
            least, high = low, low + reach
            for _ in range(40):
                way = 0.5 * (least + high)
                depth = np.maximum(way[pair] * s.steep - s.gap, 0.0)
                elastic = np.minimum(depth, flows)
                work = s.area * (elastic * (depth - 0.5 * elastic)) / s.layer
                enough = np.add.reduceat(work, first) >= need
                least, high = np.where(enough, least, way), np.where(enough, way, high)
            low = high
        return s.one[first], s.other[first], low


def _joined(one, other, way):
    """The least way of each two that are joined by some, all of shape (n,)."""
    one, other = np.minimum(one, other), np.maximum(one, other)
    order = np.lexsort((way, other, one))
    one, other, way = one[order], other[order], way[order]
    first = np.ones(one.size, dtype=bool)
    first[1:] = (one[1:] != one[:-1]) | (other[1:] != other[:-1])
    return one[first], other[first], way[first]
