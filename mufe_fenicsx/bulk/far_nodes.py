"""Nodes of any grains, on whatever rank they are: positions come, forces go back."""

from itertools import pairwise

import numpy as np

from ..contact.stiffness.springs import SpringList, Springs
from ..contact.surface.exchange import SurfaceVector
from ..errors import raise_together
from ..kernels.build.rows import add_rows, gather_rows


class FarNodes:
    """Nodes that a force term of this rank asks for. Collective, as its methods.

    A node is named by its grain and its number among the nodes of that, as they were given: names
    know no ranks, and stay when a run goes on with another number of them.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        grain: Global indices of the grains of the nodes, shape (num,).
        number: Their numbers there, shape (num,); :func:`names_of_nodes` has those of this rank.

    Attributes:
        at: Nodes of this rank that some rank asks for, increasing, shape (num_at,).
        global_nodes: The nodes asked for as numbers over all ranks, shape (num,).

    Raises:
        InputError: There is no such node; on all ranks together.
    """

    def __init__(self, mesh, grain, number):
        self.comm = comm = mesh.comm
        grain, number, message = _whole_numbers(grain, number)
        rank = self._ranks(mesh, grain, number, message)
        order = np.argsort(rank, kind="stable")
        parts = np.searchsorted(rank[order], np.arange(comm.size + 1))
        parts = [order[a:b] for a, b in pairwise(parts)]
        asked = comm.alltoall([(grain[part], number[part]) for part in parts])
        names, asked = asked, [_own_nodes(mesh, *names) for names in asked]
        raise_together(comm, _what_is_missing(names, asked))
        self.at = at = np.unique(np.concatenate(asked)).astype(np.int32)
        first = comm.exscan(at.size) or 0
        answers = comm.alltoall(
            [(first + np.searchsorted(at, n), mesh.first_node + n) for n in asked]
        )
        place, self.global_nodes = np.empty((2, grain.size), dtype=np.int64)
        for part, (places, nodes) in zip(parts, answers, strict=True):
            place[part], self.global_nodes[part] = places, nodes
        far = (place < first) | (place >= first + at.size)
        ghosts = np.unique(place[far])
        self._row = np.where(far, at.size + np.searchsorted(ghosts, place), place - first)
        self._row = self._row.astype(np.int32)
        self._there, self._back = (SurfaceVector(comm, at.size, ghosts) for _ in range(2))

    @staticmethod
    def _ranks(mesh, grain, number, message):
        """Ranks of grains; ``message``: what is wrong already."""
        wrong = (grain < 0) | (grain >= mesh.labels.size) | (number < 0)
        if wrong.any():
            k = int(np.argmax(wrong))
            message = (
                f"node {number[k]} of grain {grain[k]}, expected numbers of nodes from 0 and "
                f"grains from 0 to {mesh.labels.size - 1}"
            )
        raise_together(mesh.comm, message)
        return mesh.rank_of_grain[grain]

    def positions(self, x):
        """Positions of the nodes [m], shape (num, 3), where those of this rank are at ``x``."""
        gather_rows(self._there.own, x, self.at)
        self._there.forward()
        return self._there.array[self._row]

    def add_forces(self, f, forces):
        """Add ``forces`` [N] on the nodes, shape (num, 3), to the sums ``f`` of their ranks."""
        self._back.array[:] = 0.0
        np.add.at(self._back.array, self._row, forces)
        self._back.add_back()
        add_rows(f, self.at, self._back.own)

    def springs(self, listed):
        """Springs between the nodes, as the time step wants them. Local.

        Args:
            listed: SpringList whose nodes are places among those asked for.
        """
        rows = SpringList(self._row[listed.nodes], *listed[1:])
        return Springs(self.at, (rows,), self._there, self._back)

    def destroy(self):
        """Free the PETSc vectors."""
        self._there.destroy()
        self._back.destroy()


def names_of_nodes(mesh, nodes):
    """Grains and numbers there of nodes of this rank, two arrays of shape (num,). Local."""
    place = np.empty(mesh.num_nodes, dtype=np.int64)
    place[mesh.named_nodes] = np.arange(mesh.num_nodes)
    local = mesh.grain_of_node[nodes]
    return mesh.grains[local], place[nodes] - mesh.node_offset[local]


def _own_nodes(mesh, grain, number):
    """Nodes of this rank by their names, -1 where there is none."""
    local = np.searchsorted(mesh.grains, grain)
    last = mesh.node_offset[local + 1]
    place = mesh.node_offset[local] + number
    return np.where(place < last, mesh.named_nodes[np.minimum(place, last - 1)], -1)


def _what_is_missing(names, asked):
    """The line for a node that was asked for and is not there, or None."""
    for (grain, number), nodes in zip(names, asked, strict=True):
        for k in np.flatnonzero(nodes < 0)[:1]:
            return f"node {number[k]} of grain {grain[k]}, expected a number of a node of it"
    return None


def _whole_numbers(grain, number):
    """Both as integers, and the line for what is none."""
    grain, number = np.asarray(grain), np.asarray(number)
    kinds = all(a.dtype.kind in "iu" or not a.size for a in (grain, number))
    if grain.ndim != 1 or grain.shape != number.shape or not kinds:
        message = (
            f"grains of shape {grain.shape} ({grain.dtype}) and numbers of nodes of shape "
            f"{number.shape} ({number.dtype}), expected as many whole numbers of both"
        )
        return *np.empty((2, 0), dtype=np.int64), message
    return grain.astype(np.int64), number.astype(np.int64), None
