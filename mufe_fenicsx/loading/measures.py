"""What surrounds a sample measures, and how it is led: walls, or platens and a membrane."""

import math

import numpy as np

from ..container import CYLINDER, container_of


class WallMeasures:
    """Walls that form a container. Collective but for plain numbers.

    Args:
        simulation: :class:`~mufe_fenicsx.explicit.simulation.Simulation` or increments.

    Attributes:
        container: :class:`~mufe_fenicsx.container.Container` that the walls are; None: another one.
    """

    columns = ()  #: of history.csv beyond those of the container

    def __init__(self, simulation):
        self.simulation = simulation
        self.container = container_of(simulation.walls.names)

    def lengths(self):
        """Lengths along the axes of the container [m], shape (num_axes,). Collective."""
        walls = self.simulation.walls
        return self.container.lengths(walls.point, walls.curved.radius)

    def places(self):
        """How far in its planes stand, from the origin [m], shape (num_walls,)."""
        walls = self.simulation.walls
        return np.einsum("wi,wi->w", walls.point, walls.normal)

    def forces(self):
        """Normal forces on its walls, compression positive [N], shape (num_walls,). Collective."""
        return self.simulation.wall_forces()

    def pressing(self):
        """These forces [N] and the stiffness of the contacts on the walls [N/m]. Collective."""
        return self.simulation.walls.pressing(self.simulation.comm)

    def gains(self, servo, stiffness, area):
        """Gains of the walls, as :meth:`.wall_servo.Servo.gains`."""
        return servo.gains(stiffness, area)

    def lead(self, speeds, targets):
        """Lead the coming step.

        Args:
            speeds: Of the walls towards the sample [m/s], shape (num_walls,).
            targets: Stress that each axis is to carry [Pa], None where that is free. Not needed.
        """
        self.simulation.walls.set_speeds(speeds)

    def row(self):
        """Values of :attr:`columns`. Collective."""
        return ()


class MembraneMeasures(WallMeasures):
    """Two platens and a membrane, in whose place a cylinder of the same volume stands.

    The cell is a wall without inertia: its pressure is what it is to be. It rises as fast as the
    diameter may shrink, by the speed v,

        dp/dt = (ρ c² + 2 E t/D) v/D,

    with the stiffness ρ c² of the sample that the servo measures (wall_servo), and that of the
    sleeve as a ring, which is all there is before it meets the grains.

    Args:
        membrane: :class:`~.membrane.Membrane`.
        stiffness: E t of the sleeve [N/m].
        correction: Leave the membrane's share out of the forces on the platens.
    """

    columns = ("cell_pressure", "membrane_force")

    def __init__(self, membrane, stiffness, correction):
        self.simulation, self.container = membrane.simulation, CYLINDER
        self.membrane, self._stiffness, self._correction = membrane, stiffness, correction
        self._mass = self.simulation.mass_of_grains()

    def lengths(self):
        """Diameter of the cylinder of that volume, and distance of the platens [m]. Collective."""
        point = self.simulation.walls.point
        height = float(point[1, 2] - point[0, 2])
        return np.array([math.sqrt(4.0 * self.membrane.volume() / (math.pi * height)), height])

    def places(self):
        """Those of the platens, after a zero for the side [m], shape (3,)."""
        return np.append(0.0, super().places())

    def forces(self):
        """Pressure of the cell over the side, and forces on the platens [N]. Collective."""
        return self._with_side(self.simulation.wall_forces())

    def pressing(self):
        """These forces [N], and the stiffness that each meets [N/m]. Collective."""
        forces, stiffness = self.simulation.walls.pressing(self.simulation.comm)
        diameter, height = self.lengths()
        of_side = 2.0 * math.pi * height * 2.0 * self._stiffness / diameter
        return self._with_side(forces), np.append(of_side, stiffness)

    def _with_side(self, forces):
        """Of the side and the platens, the membrane's share left out where that is wanted."""
        if self._correction:
            forces = forces - self.membrane.axial_forces()
        diameter, height = self.lengths()
        return np.append(self.membrane.pressure * math.pi * diameter * height, forces)

    def gains(self, servo, stiffness, area):
        """Of the platens as of walls; of the cell that which makes its pressure rise as above."""
        found = servo.gains(stiffness, area)
        lengths = self.lengths()
        density = self._mass / float(self.container.volume(lengths))
        modulus = servo.impedance**2 / density + 2.0 * self._stiffness / lengths[0]
        found[0] = 0.5 * lengths[0] / (modulus * self.simulation.dt)
        return found

    def lead(self, speeds, targets):
        """Set the pressure of the cell and the speeds of the platens."""
        if targets[0] is not None and targets[0] != self.membrane.pressure:
            self.membrane.set_pressure(targets[0])
        self.simulation.walls.set_speeds(speeds[1:])

    def row(self):
        """Pressure of the cell [Pa], and the membrane's mean force on the platens [N]."""
        share = float(self.membrane.axial_forces().mean())
        return self.membrane.pressure, share
