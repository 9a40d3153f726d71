"""A membrane: a sleeve around a sample, glued to both platens and pressed from outside.

The sleeve is a body among the grains (geometry.bodies.sleeve), of a neo-Hookean material, that
walls glue by its label (``bonded`` of contact.walls.Wall). It is no grain: what is measured here is
what a test in a triaxial cell measures through it.
"""

from typing import Any

import numpy as np
from mpi4py import MPI

from ..errors import InputError, finite_array, shown
from ..kernels.bulk.pressure import subtract_drag, volume_beside
from ..mesh import GrainMesh
from ..state import ForceTerm
from .pressure import Pressure

#: Facets with a normal along the axis beyond this are those of the ends.
END = 0.7


class CellPressure(Pressure):
    """Pressure of the fluid around a sleeve, which is not rigid."""

    def act_on_rigid(self, rigid, state):
        """Nothing: the sleeve deforms. Local."""


class Drag(ForceTerm):
    """Force -c m v on the nodes of one body, as of a fluid at rest around it. Local.

    Its energy is what it took so far.

    Args:
        nodes: The body's, shape (n,).
        mass: Of these [kg], shape (n,).
        rate: c [1/s]; c times the time step is far below one.
        name: Of the term.
    """

    STATE = {"sum": ("taken",)}

    def __init__(self, nodes, mass, rate, name="membrane_drag"):
        self.name, self._nodes = name, nodes
        self._force_over_velocity = rate * mass
        self.taken = 0.0  #: by this rank's nodes [J]

    def add_forces(self, f, state, dt):
        """Add the force at the velocity of the last half step. Local."""
        power = subtract_drag(f, state.v, self._nodes, self._force_over_velocity)
        self.taken += dt * power

    def act_on_rigid(self, rigid, state):
        """Nothing: the body deforms. Local."""

    def energy(self, state):
        """Energy that it took [J]. Local."""
        return self.taken


class Membrane:
    """The sleeve of a sample between two horizontal platens, and the fluid around it. Collective.

    Args:
        simulation: :class:`~mufe_fenicsx.explicit.simulation.Simulation` or increments, in which
            the sleeve is a body; walls glue its ends.
        label: Of the sleeve.
        pressure: Of the cell at the start [Pa].
        damping: Rate at which it loses its motion to the fluid [1/s]; none for increments.

    Attributes:
        cell: The pressure, a force term ``cell_pressure``.
        label: Of the sleeve.

    Raises:
        InputError: The label is not known, its body is no sleeve around a vertical axis, a value
            is not finite, or the damping is negative; on all ranks.
    """

    def __init__(
        self, simulation: Any, label: int, pressure: float = 0.0, damping: float = 0.0
    ) -> None:
        mesh = getattr(simulation, "mesh", None)
        if not isinstance(mesh, GrainMesh):
            raise InputError(f"simulation = {shown(simulation)}, expected one such as of build")
        self.simulation, self.label = simulation, int(label)
        sleeves = mesh.labels_of_sleeves
        if label not in sleeves:
            raise InputError(
                f"label of the membrane = {label}, expected that of a sleeve, "
                f"{', '.join(map(str, sleeves)) or 'of which there is none'}: sleeves of build"
            )
        rate = float(finite_array("damping of the membrane", damping, ()))
        if rate < 0.0:
            raise InputError(f"damping of the membrane = {rate}, expected >= 0")
        of_node = mesh.labels[mesh.grains[mesh.grain_of_node]] == label
        own = np.flatnonzero(of_node)
        self._centre = _middle(mesh.comm, mesh.x[own])
        facets = mesh.facets[mesh.labels[mesh.grains[mesh.grain_of_facet]] == label]
        side = self._sides(mesh.x, facets)
        self._inner = np.ascontiguousarray(facets[side < 0])
        if not mesh.comm.allreduce(len(self._inner)):
            raise InputError(
                f"facets on the inside of the membrane {label} = 0, expected a sleeve around a "
                "vertical axis"
            )
        self.cell = CellPressure(
            mesh, pressure, [self.label],
            lambda centre, normal: self._sides_of(centre, normal) > 0, "cell_pressure",
        )  # fmt: skip
        self._measured, self._measured_at = np.zeros(3), -1
        simulation.add_term(self.cell)
        if rate > 0.0:
            simulation.add_term(Drag(own, simulation.solid.mass[own], rate))
        self._platens = _platens(simulation.walls, self.label)

    def _sides(self, x, facets):
        a, b, c = (x[facets[:, i]] for i in range(3))
        normal = np.cross(b - a, c - a)
        length = np.linalg.norm(normal, axis=1)
        return self._sides_of((a + b + c) / 3, normal / length[:, None])

    def _sides_of(self, centre, normal):
        """1 outside, -1 inside, 0 at the ends, shape (num,)."""
        outwards = np.einsum("ni,ni->n", centre[:, :2] - self._centre, normal[:, :2])
        return np.where(np.abs(normal[:, 2]) > END, 0.0, np.sign(outwards))

    @property
    def pressure(self) -> float:
        """Of the cell [Pa]."""
        return self.cell.pressure

    def set_pressure(self, pressure: float) -> None:
        """Go on with another pressure of the cell [Pa]. Local."""
        self.cell.set_pressure(pressure, self.simulation.state)

    def volume(self) -> float:
        """Volume inside the sleeve, between the platens [m³]. Collective."""
        return float(self.measured()[0])

    def axial_forces(self) -> np.ndarray:
        """Forces of the glued ends on the platens, compression positive [N]. Collective.

        Of the lower and of the upper one, shape (2,). Tests on sand take them off.
        """
        return self.measured()[1:].copy()

    def measured(self):
        """Volume [m³] and axial forces [N] of the present state, shape (3,). Collective.

        Measured once a state: the same array until there is another one, not to be changed.
        """
        s = self.simulation
        if self._measured_at != s.state.num_steps:
            # Platens are horizontal, and the normal of the lower one points up.
            along = s.specimen.glued.force[self._platens, 2]
            local = np.array([-volume_beside(s.state.x, self._inner), -along[0], along[1]])
            if s.comm.size > 1:
                s.comm.Allreduce(MPI.IN_PLACE, local)
            self._measured, self._measured_at = local, s.state.num_steps
        return self._measured


def _middle(comm, x):
    """Mean of places across z of the body, which one rank has [m], shape (2,). Collective."""
    parts = comm.allreduce(np.append(x[:, :2].sum(axis=0), len(x)))
    return parts[:2] / parts[2]


def _platens(walls, label):
    """Numbers of the lower and the upper wall that glue the sleeve.

    Raises:
        InputError: There are not two that are horizontal.
    """
    found = [
        w
        for w, wall in enumerate(walls.walls)
        if (wall.bonded is True or (wall.bonded and label in wall.bonded))
        and abs(wall.normal[2]) > 1 - 1e-9
    ]
    if len(found) != 2:
        raise InputError(
            f"platens that glue the membrane {label} = {len(found)}, expected a lower and an upper "
            "one, horizontal"
        )
    return sorted(found, key=lambda w: walls.point[w, 2])
