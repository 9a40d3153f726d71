"""Which rank works on which grain, by what the grains cost now.

Counted are tetrahedra and pairs in contact, not seconds: two runs of the same test then
move the same grains at the same steps, and give the same bits.
"""

import numpy as np

from ..mesh import partition_grains

#: What a pair in contact costs in a step, in tetrahedra: between grains, and with a wall, whose
#: rows are shorter. In a sample of 204 grains 135 ns with crossing edges, and 34 ns; a tetrahedron
#: 23 ns (docs/record/2026-11-performance.md).
PAIR_COSTS = np.array([6.0, 1.5])
#: Work of the busiest rank over the mean from which on grains move; and what that has to gain.
LIMIT, GAIN = 1.1, 0.97
#: Work is looked at each time the strain has grown by this.
INTERVAL = 0.005


def work_of_grains(simulation):
    """Work of this rank's grains in a step, in tetrahedra, shape (num_grains,). Local."""
    mesh, contact = simulation.mesh, simulation.contact
    work = np.zeros(mesh.num_grains)
    deforming = simulation.solid.grains
    work[deforming] = np.diff(mesh.cell_offset)[deforming]
    for cost, pairs in zip(PAIR_COSTS, (contact.pairs, contact.walls.pairs), strict=True):
        grain = contact.points.local_grain[pairs.node[pairs.closed]]
        work += cost * np.bincount(grain, minlength=mesh.num_grains)
    return work


def imbalance(work, rank_of_grain, num_ranks):
    """Work of the busiest rank over the mean."""
    loads = np.bincount(rank_of_grain, work, num_ranks)
    return float(loads.max() / loads.mean()) if loads.any() else 1.0


def better_partition(simulation):
    """Ranks of all grains that share the work better, or None. Collective.

    None where the work is even to ``LIMIT``, or nothing better is found.
    """
    mesh, comm = simulation.mesh, simulation.comm
    if comm.size == 1:
        return None
    table = np.zeros((mesh.labels.size, 4))
    table[mesh.grains, 0] = work_of_grains(simulation)
    count = np.diff(mesh.node_offset)[:, None]
    x = simulation.state.x[mesh.nodes]
    table[mesh.grains, 1:] = np.add.reduceat(x, mesh.node_offset[:-1]) / count
    table = comm.allreduce(table)
    work, centroids = table[:, 0], table[:, 1:]
    now = imbalance(work, mesh.rank_of_grain, comm.size)
    if now <= LIMIT:
        return None
    # Grains that cost nothing go with their neighbours.
    better = partition_grains(np.maximum(work, 1.0), centroids, comm.size)
    return better if imbalance(work, better, comm.size) < GAIN * now else None
