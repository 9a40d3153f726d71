"""Yield stresses of the grains, which limit the pressure of contacts smaller than an element."""

import numpy as np
from mpi4py import MPI


class Strengths:
    """Tables of all materials, and which one each grain has. Collective.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        tables: As of :class:`~mufe_fenicsx.contact.settings.ContactGrains`.

    Attributes:
        tables: At an offset the number n of points, n plastic strains and n yield stresses [Pa];
            empty where no grain yields.
    """

    def __init__(self, mesh, tables):
        own = [tuple(map(float, np.ravel(t))) if t is not None else () for t in tables]
        distinct = sorted(set().union(*mesh.comm.allgather(set(own))) - {()})
        rows = [(len(values) // 2, *values) for values in distinct]
        first = np.cumsum([0, *(len(row) for row in rows)])
        offset = dict(zip(distinct, first[:-1].tolist(), strict=True))
        self._offset = np.full(mesh.labels.size, -1, dtype=np.int32)  # of all grains
        if own:
            self._offset[mesh.grains] = [offset.get(values, -1) for values in own]
        mesh.comm.Allreduce(MPI.IN_PLACE, self._offset, op=MPI.MAX)
        self.tables = np.array([number for row in rows for number in row], dtype=float)
        self.any = bool(rows)  #: whether some grain yields, on all ranks

    def offsets(self, grain, partner=None):
        """Places of both bodies' tables, -1 without one, int32, (num, 2); none yields: (0, 2).

        Args:
            grain, partner: Global indices of grains, shape (num,); None: walls.
        """
        if not self.any:
            return np.empty((0, 2), dtype=np.int32)
        both = np.full((grain.size, 2), -1, dtype=np.int32)
        both[:, 0] = self._offset[grain]
        if partner is not None:
            both[:, 1] = self._offset[partner]
        return both
