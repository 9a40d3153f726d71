"""Pressure of a fluid on surfaces of grains."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import checked
from ..errors import InputError, finite_array, raise_together
from ..kernels.bulk.pressure import add_pressure, enclosed_volume, swept_rate
from ..mesh import GrainMesh
from ..state import ForceTerm


class Pressure(ForceTerm):
    """Pressure p on facets, which follows them: f = -p n da on the present surface.

    It has the potential p V, V the volume that the facets sweep from their first places. That holds
    for closed surfaces, and for open ones each rim of which is at rest or moves without a turn, as
    where it is glued to a platen. A rim may also slide in planes of symmetry that meet in
    ``origin``. Local.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        pressure: p [Pa]; may be changed between two steps.
        labels: Grains that it acts on; None for all.
        where: ``where(centres, normals)`` chooses among their facets, from arrays of shape (num, 3)
            of the reference configuration [m, 1]; None for all.
        name: Of the term; the energy balance has the account ``energy_NAME``.
        origin: Place from which volumes are counted [m], shape (3,); None: in the middle.

    Raises:
        InputError: p is not finite, a label is not known, or no facet on any rank is chosen.
            Collective.
    """

    STATE = {"common": ("_pressure",), "sum": ("_potential", "_volume")}

    @checked
    def __init__(
        self,
        mesh: GrainMesh,
        pressure: float,
        labels: list[int] | None = None,
        where: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None,
        name: str = "pressure",
        origin: ArrayLike | None = None,
    ):
        self.name, self.mesh = name, mesh
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
            some, message = chosen, None
            try:
                some = np.asarray(where((a + b + c) / 3, normal))
            except Exception as error:  # whatever a user's own function raises
                message = f"where of the pressure {name} fails: {type(error).__name__}: {error}"
            if some.shape != chosen.shape or some.dtype != bool:
                message = (
                    f"where of the pressure {name} gives {some.dtype} of shape {some.shape}, "
                    f"expected true or false for each facet, shape {chosen.shape}"
                )
            raise_together(mesh.comm, message)
            chosen &= some
        self._take(chosen)
        if not mesh.comm.allreduce(len(self.facets)):
            raise InputError(f"facets under the pressure {name} = 0, expected at least one")
        self._pressure = float(finite_array(name, pressure, ()))
        # The same on all ranks: of an open surface whose rim moves the potential depends on it.
        parts = mesh.comm.allreduce(np.append(mesh.x.sum(axis=0), mesh.num_nodes))
        self._origin = parts[:3] / parts[3]
        if origin is not None:
            self._origin = finite_array(f"origin of {name}", origin, (3,))
        # What the potential was when the pressure was set last, and the volume then.
        self._potential = 0.0
        self._find_rim()
        self._volume = self._swept(mesh.x)

    def _take(self, chosen):
        self._rows = np.flatnonzero(chosen)
        self.facets = np.ascontiguousarray(self.mesh.facets[chosen])

    def _find_rim(self):
        x = self.mesh.x
        self._rim, self._rim_weight = rim_weights(x - self._origin, self.facets)
        self._rim_place = x[self._rim]

    def grow(self, mesh, share):
        """Go on with the same facets; there is no pressure on those that opened. Local."""
        chosen = np.isin(mesh.source.facets, self._rows)
        self.mesh = mesh
        self._take(chosen)
        self._find_rim()

    @property
    def pressure(self) -> float:
        """p [Pa]."""
        return self._pressure

    def set_pressure(self, pressure: float, state) -> None:
        """Go on with another pressure [Pa], from the present ``state``. Local.

        Central differences feel it from the middle of the coming step on. The volume there follows
        from its rate, the area vectors times the velocities.
        """
        volume = self._swept(state.x)
        volume += 0.5 * state.dt * swept_rate(state.x, state.v, self.facets)
        self._potential += self._pressure * (volume - self._volume)
        self._volume = volume
        self._pressure = float(finite_array(self.name, pressure, ()))

    def add_forces(self, f, state, dt):
        """Add the forces on the nodes of the facets. Local."""
        add_pressure(f, state.x, self.facets, self._pressure)

    def energy(self, state):
        """Potential since the start [J]. Local."""
        volume = self._swept(state.x)
        return self._potential + self._pressure * (volume - self._volume)

    def _swept(self, x):
        """A volume whose rate is that of the facets' motion outwards, times their areas [m³]."""
        volume = enclosed_volume(x, self.facets, self._origin)
        return volume + float(np.vdot(self._rim_weight, x[self._rim] - self._rim_place))


def rim_weights(y, facets):
    """What the motion of the rim of an open surface adds to the volume over it.

    With places y from a fixed one, the volume V of cones over the facets changes at a rate that
    lacks what their rim i, j, … sweeps:

        Σ A · (v_a + v_b + v_c)/3 = dV/dt + Σ (v_i + v_j) · (y_i × y_j)/6,

    the sums over facets of area A and over edges of the rim. Where a closed rim moves without a
    turn the last sum keeps its factors of the start.

    Args:
        y: Places [m], shape (num_nodes, 3).
        facets: Their corners, outwards, shape (num_facets, 3).

    Returns:
        Nodes of the rim, shape (n,), and their factors [m²], shape (n, 3).
    """
    ends = np.stack([facets, np.roll(facets, -1, axis=1)], axis=-1).reshape(-1, 2)
    key = np.sort(ends, axis=1)
    _, which, count = np.unique(key, axis=0, return_inverse=True, return_counts=True)
    rim = ends[count[which.ravel()] == 1]
    cross = np.cross(y[rim[:, 0]], y[rim[:, 1]]) / 6.0
    nodes, place = np.unique(rim, return_inverse=True)
    weights = np.zeros((nodes.size, 3))
    np.add.at(weights, place.reshape(-1, 2), cross[:, None])
    return nodes, weights
