"""Lists of the nodes of rigid grains, and of all others."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class RigidNodes:
    """Nodes of the rigid grains of one rank, one grain after the other, and of all others."""

    grains: np.ndarray  #: local index of each rigid grain
    nodes: np.ndarray  #: of the rigid grains, shape (n,)
    offset: np.ndarray  #: first entry of each grain in ``nodes``, shape (num_grains + 1,)
    surface: np.ndarray  #: those on the surface
    surface_offset: np.ndarray  #: first entry of each grain in ``surface``
    soft: np.ndarray  #: nodes of all other grains
    #: The same grain by grain, whose nodes are numbered in a row: first and end of each and its
    #: local grain, shape (num_runs, 3).
    runs: np.ndarray

    def of(self, b):
        """Nodes of one rigid grain."""
        return self.nodes[self.offset[b] : self.offset[b + 1]]


def list_nodes(mesh, grains):
    """:class:`RigidNodes` of the local ``grains``, in their order. Local."""
    at = [mesh.nodes[slice(*mesh.node_offset[g : g + 2])] for g in grains]
    nodes, offset = _rows(at)
    on_surface = np.zeros(mesh.num_nodes, dtype=bool)
    on_surface[mesh.facets] = True
    surface, surface_offset = _rows([n[on_surface[n]] for n in at])
    soft = np.ones(mesh.num_nodes, dtype=bool)
    soft[nodes] = False
    soft = np.flatnonzero(soft)
    return RigidNodes(grains, nodes, offset, surface, surface_offset, soft, _runs(mesh, grains))


def _rows(parts):
    """Lists of nodes one after the other, int32, and where each begins."""
    offset = np.cumsum([0] + [p.size for p in parts])
    return np.concatenate([np.empty(0, np.int32), *parts]).astype(np.int32), offset


def _runs(mesh, without):
    """Ranges of nodes of all grains but those ``without``, increasing, shape (num_runs, 3)."""
    grains = np.setdiff1d(np.arange(mesh.num_grains), without)
    first = mesh.nodes[mesh.node_offset[grains]].astype(np.int64)
    runs = np.column_stack([first, first + np.diff(mesh.node_offset)[grains], grains])
    return runs[np.argsort(first)]
