"""Tetrahedra that meet with every pair of features: vertex, edge, face."""

import math

import numpy as np

from ..contact.surface.points import RECESS
from ..explicit.simulation import Simulation
from ..materials.elastic import Elastic
from ..mesh import create_grain_mesh
from .case import case, compare
from .tet_depth import penetration_depth
from .tets import rotation, tet_pairs

E, NU, RHO, EDGE = 100e9, 0.15, 2650.0, 1e-3

#: No plane and no edge along an axis.
TURN = rotation([1.0, 2.0, -0.7], 1.1)


#: Depth over the edge at which sharp vertices and edges begin to carry, at contact of facets.
BEGIN = RECESS


@case("feature-pairs", num_bodies=64)
def feature_pairs(comm, num_random=26, slow=0.005, way=0.7, friction=0.3, rounds=3):
    """Tetrahedra that approach with every pair of features: none missed, momentum kept.

    Single-element tetrahedra, both of a pair on different ranks: each pair of features
    head on, the same a little off, and random ones; free bodies, the lower at rest. How
    deep they overlap is computed apart from contact, by separating axes (tet_depth).
    Lengths in edges. Three times:

    - slow;
    - fast, at the speed that moves a tenth of an edge in a step of the free elements,
      0.19 of the wave speed (the steps get shorter where contact comes near);
    - moved, not stepped, by up to a tenth of an edge at once, at any phase: whether force
      appears at once where they overlap for the first time.

    Args:
        comm: MPI communicator.
        num_random: Random pairs besides the named ones.
        slow: Slow speed over the wave speed sqrt(E/rho).
        way: How far a body at that speed would go on after contact [edges].
        friction: Coefficient of friction.
        rounds: Sets of pairs that are moved.
    """
    wave = math.sqrt(E / RHO)
    free = _Pairs(comm, num_random, gap=1.0, speed=0.0, friction=0.0).simulation.dt
    results, simulations = {}, []
    # Elastic depth v (m/2k)^½ = 0.41 v/c edges on the softest spring, a crossing at a corner,
    # k = 0.35 E h; then what is beyond the reach of nodes and crossings: edges closer to parallel
    # than PARALLEL, by (h/2) 0.01 tan(55°) = 0.007 edges at most.
    for name, speed, gap in (("slow", slow * wave, 0.02), ("fast", 0.1 * EDGE / free, 0.3)):
        pairs = _Pairs(comm, num_random, gap, speed, friction)
        pairs.run((gap + way) * EDGE / speed)
        elastic = 0.41 * speed / wave
        results |= {
            f"{name}: deepest overlap over the edge": compare(
                pairs.deepest, 0.0, BEGIN + 0.007 + elastic, scale=1.0
            ),
            # In the fast case also the way of a step or two, 0.015 edges each.
            f"{name}: deepest overlap without a force over the edge": compare(
                pairs.missed, 0.0, BEGIN + 0.007 + 2 * pairs.step_length, scale=1.0
            ),
            f"{name}: pairs that met": compare(pairs.num_met, pairs.count, 0),
            f"{name}: pairs that did not part again": compare(pairs.num_stuck, 0, 0, scale=1.0),
            # Round-off of the sums at each step, of the momentum of a body times its edge.
            f"{name}: momentum of a pair": compare(pairs.momentum, 0.0, 1e-12, scale=1.0),
            f"{name}: angular momentum of a pair": compare(pairs.angular, 0.0, 1e-12, scale=1.0),
            # Bodies of one element that meet in some steps of a stiff spring: by the time step.
            f"{name}: energy residual": compare(pairs.residual, 0.0, 0.02, scale=1.0),
        }
        simulations.append(pairs.simulation)
    late, wrong, count = 0, 0, 0
    for seed in range(rounds):
        pairs = _Pairs(comm, num_random, 0.0, 0.0, friction, seed=seed + 2, phases=True)
        found = pairs.move()
        late, wrong, count = late + found[0], wrong + found[1], count + found[2]
    results["moved: pairs that came to overlap"] = compare(count, rounds * pairs.count, 0)
    results["moved: pairs without a force then"] = compare(late, 0, 0, scale=1.0)
    results["moved: pairs pulled together"] = compare(wrong, 0, 0, scale=1.0)
    return results, simulations


class _Pairs:
    """Pairs of tetrahedra side by side in one simulation. Collective."""

    def __init__(self, comm, num_random, gap, speed, friction, seed=1, phases=False):
        self.comm = comm
        self.names, lower, upper = tet_pairs(num_random, seed=seed)
        n = self.count = len(self.names)
        rng = np.random.default_rng(seed)
        gaps = rng.uniform(0.3, 0.4, n) if phases else np.full(n, gap)
        upper = upper + gaps[:, None, None] * [0.0, 0.0, 1.0]
        side = math.ceil(n ** (1 / 3))
        site = 5.0 * np.stack(np.unravel_index(np.arange(n), (side,) * 3), axis=1)
        self.site = EDGE * site @ TURN.T
        tets = np.stack([lower + site[:, None], upper + site[:, None]], axis=1)
        points = EDGE * tets.reshape(2 * n, 4, 3) @ TURN.T
        grain = np.arange(2 * n)
        rank_of_grain = ((grain // 2 + grain % 2) % comm.size).astype(np.int32)
        mine = np.flatnonzero(rank_of_grain == comm.rank)
        mesh = self.mesh = create_grain_mesh(
            comm,
            points[mine].reshape(-1, 3),
            np.arange(4 * mine.size).reshape(-1, 4),
            mine,
            grain + 1,
            rank_of_grain,
        )
        self.grain = mesh.grains[mesh.grain_of_node]
        self.is_upper = self.grain % 2 == 1
        velocity = np.zeros_like(mesh.x)
        velocity[self.is_upper] = -speed * TURN[:, 2]
        material = [Elastic(E, NU, RHO)] * mesh.num_grains
        self.simulation = Simulation(mesh, material, friction=friction, velocity=velocity)

    def _sum(self, values, index, size):
        """Sums of rows of nodal values by index, over all ranks."""
        total = np.zeros((size, 3))
        np.add.at(total, index, values)
        return self.comm.allreduce(total)

    def depths(self, x):
        """Overlap of each pair [edges], negative where apart."""
        m = self.mesh
        tets = np.zeros((2 * self.count, 4, 3))
        tets[m.grains[m.grain_of_cell]] = x[m.cells]
        tets = self.comm.allreduce(tets)
        return penetration_depth(tets[0::2], tets[1::2]) / EDGE

    def carrying(self):
        """Which pairs are in contact, by any rank."""
        contact, found = self.simulation.contact, np.zeros(self.count, dtype=int)
        closed = contact.pairs.node[contact.pairs.closed]
        found[contact.points.grain_of_point[closed] // 2] = 1
        found[contact.edges.closed_grains()[:, 0] // 2] = 1
        return self.comm.allreduce(found) > 0

    def momenta(self):
        s = self.simulation
        p = s.solid.mass[:, None] * s.state.v
        arm = s.state.x - self.site[self.grain // 2]
        return (
            self._sum(p, self.grain // 2, self.count),
            self._sum(np.cross(arm, p), self.grain // 2, self.count),
        )

    def run(self, duration):
        """Step, and watch overlaps, momenta and energy."""
        s = self.simulation
        p0, L0 = self.momenta()
        size = np.linalg.norm(p0, axis=1).max()
        speed = size / (RHO * EDGE**3 / math.sqrt(72))
        self.deepest = self.missed = self.momentum = self.angular = self.residual = 0.0
        self.step_length = 0.0
        met, parted = np.zeros((2, self.count), dtype=bool)
        while s.state.t < duration:
            s.step()
            p, L = self.momenta()
            self.momentum = max(self.momentum, np.abs(p - p0).max() / size)
            self.angular = max(self.angular, np.abs(L - L0).max() / (size * EDGE))
            depth = self.depths(s.state.x)
            met |= depth > 0
            parted |= met & (depth < 0)
            self.deepest = max(self.deepest, depth.max())
            self.missed = max(self.missed, depth[~self.carrying()].max(initial=0.0))
            if depth.max() > 0:
                self.step_length = max(self.step_length, speed * s.dt / EDGE)
            if s.state.num_steps % 10 == 0:
                gained = abs(s.energies()["residual"]) / s.initial_kinetic
                self.residual = max(self.residual, gained)
        self.num_met, self.num_stuck = int(met.sum()), int((met & ~parted).sum())

    def move(self, longest=0.1):
        """Move the upper ones on, faster and faster, without any stepping.

        Returns:
            Number of pairs without force where they first overlap, of pairs pulled
            together there, and of pairs that came to overlap.
        """
        s, n = self.simulation, self.count
        x, step = self.mesh.x.copy(), 0.02
        new = np.ones(n, dtype=bool)
        late = wrong = 0
        for _ in range(9):
            x[self.is_upper] -= step * EDGE * TURN[:, 2]
            step = min(1.5 * step, longest)
            f = np.zeros_like(x)
            s.contact.begin_step(x)
            s.contact.add_forces(f, x)
            force = self._sum(f[self.is_upper], self.grain[self.is_upper] // 2, n)
            # Sharp vertices and edges begin to carry that deep.
            first = new & (self.depths(x) > BEGIN)
            new &= ~first
            late += int((first & ~force.any(axis=1)).sum())
            wrong += int((first & (force @ TURN[:, 2] < 0)).sum())
        return late, wrong, n - int(new.sum())
