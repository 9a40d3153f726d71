"""Pressure of a fluid on surfaces of grains."""

from collections.abc import Callable

import numpy as np

from ..errors import InputError, finite_array
from ..kernels.pressure import add_pressure, enclosed_volume
from ..mesh import GrainMesh
from ..state import ForceTerm


class Pressure(ForceTerm):
    """Pressure p on facets, which follows them: f = -p n da on the present surface.

    It has the potential p V, V the volume between the facets and a fixed place. That holds for
    closed surfaces, and for open ones whose rim is at rest, as where it is glued to a wall. Local.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        pressure: p [Pa]; may be changed between two steps.
        labels: Grains that it acts on; None for all.
        where: ``where(centres, normals)`` chooses among their facets, from arrays of shape (num, 3)
            of the reference configuration [m, 1]; None for all.
        name: Of the term; the energy balance has the account ``energy_NAME``.

    Raises:
        InputError: p is not finite, a label is not known, or no facet on any rank is chosen.
            Collective.
    """

    STATE = {"common": ("_pressure",), "sum": ("_potential", "_volume")}

    def __init__(
        self,
        mesh: GrainMesh,
        pressure: float,
        labels: list[int] | None = None,
        where: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None,
        name: str = "pressure",
    ):
        self.name = name
        chosen = np.ones(len(mesh.facets), dtype=bool)
        if labels is not None:
            unknown = sorted(set(labels) - set(mesh.labels.tolist()))
            if unknown:
                raise InputError(f"label of a grain = {unknown[0]}, expected one of the sample")
            label = mesh.labels[mesh.grains[mesh.grain_of_facet]]
            chosen &= np.isin(label, labels)
        if where is not None:
            a, b, c = (mesh.x[mesh.facets[:, i]] for i in range(3))
            normal = np.cross(b - a, c - a)
            normal /= np.linalg.norm(normal, axis=1)[:, None]
            chosen &= np.asarray(where((a + b + c) / 3, normal), dtype=bool)
        self.facets = np.ascontiguousarray(mesh.facets[chosen])
        if not mesh.comm.allreduce(len(self.facets)):
            raise InputError(f"facets under the pressure {name} = 0, expected at least one")
        self._pressure = float(finite_array(name, pressure, ()))
        # The same on all ranks: of an open surface whose rim moves the potential depends on it.
        parts = mesh.comm.allreduce(np.append(mesh.x.sum(axis=0), mesh.num_nodes))
        self._origin = parts[:3] / parts[3]
        # What the potential was when the pressure was set last, and the volume then.
        self._potential = 0.0
        self._volume = enclosed_volume(mesh.x, self.facets, self._origin)

    @property
    def pressure(self) -> float:
        """p [Pa]."""
        return self._pressure

    def set_pressure(self, pressure: float, state) -> None:
        """Go on with another pressure [Pa], from the present ``state``. Local.

        Central differences feel it from the middle of the coming step on. The volume there follows
        from its rate, the area vectors times the velocities.
        """
        slope = np.zeros_like(state.x)
        add_pressure(slope, state.x, self.facets, -1.0)
        volume = enclosed_volume(state.x, self.facets, self._origin)
        volume += 0.5 * state.dt * float(np.vdot(slope, state.v))
        self._potential += self._pressure * (volume - self._volume)
        self._volume = volume
        self._pressure = float(finite_array(self.name, pressure, ()))

    def add_forces(self, f, state, dt):
        """Add the forces on the nodes of the facets. Local."""
        add_pressure(f, state.x, self.facets, self._pressure)

    def energy(self, state):
        """Potential since the start [J]. Local."""
        volume = enclosed_volume(state.x, self.facets, self._origin)
        return self._potential + self._pressure * (volume - self._volume)
