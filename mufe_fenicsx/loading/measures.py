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
    lags = True  #: whether walls move to carry a stress

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

    def carried(self, stress):
        """What the grains carry of the stresses along the axes [Pa], shape (num_axes,)."""
        return stress

    def has_support(self):
        """Whether opposite walls may differ at rest, for what else carries, shape (num_walls,).

        That is friction or glue of walls across other axes, a tool, or a force on the grains.
        """
        sim, container = self.simulation, self.container
        if sim.tools.any or sim.specimen.added_terms:
            return np.ones(len(container.walls), dtype=bool)
        holds = (sim.walls.friction > 0.0) | [bool(wall.bonded) for wall in sim.walls.walls]
        found = np.zeros(holds.size, dtype=bool)
        for own in map(list, container.walls_of_axis):
            found[own] = np.delete(holds, own).any()
        return found

    def gains(self, servo, stiffness, area):
        """Gains of the walls, as :meth:`.wall_servo.Servo.gains`."""
        return servo.gains(stiffness, area)

    def lead(self, speeds, targets):
        """Lead the coming step.

        Args:
            speeds: Of the walls towards the sample [m/s], shape (num_walls,).
            targets: Gives the stress that each axis is to carry [Pa], None where that is free. Not
                called.
        """
        self.simulation.walls.set_speeds(speeds)

    def row(self):
        """Values of :attr:`columns`. Collective."""
        return ()


class PlatenMeasures(WallMeasures):
    """Of walls of which the top platen alone is led: the others go on as their scene says."""

    def lead(self, speeds, targets):
        """Set the speed of the top platen."""
        self.simulation.walls.set_speed(self.container.top, speeds[self.container.top])


class MembraneMeasures(WallMeasures):
    """Two platens and a membrane, in whose place a cylinder of the same volume stands.

    The cell is a wall without inertia: its pressure is what it is to be. It rises as fast as the
    diameter may shrink, by the speed v,

        dp/dt = (φ ρ c² + 2 E t/D) v/D,

    with the stiffness ρ c² of the sample and the part φ of the pressure that its grains carry,
    which the servo measures (wall_servo), and the stiffness of the sleeve as a ring: all there is
    before it meets the grains.

    Args:
        membrane: :class:`~.membrane.Membrane`.
        stiffness: E t of the sleeve [N/m].
        correction: Leave the membrane's share out of the forces on the platens.
    """

    columns = ("cell_pressure", "membrane_force")
    lags = False

    def __init__(self, membrane, stiffness, correction):
        self.simulation, self.container = membrane.simulation, CYLINDER
        self.membrane, self._stiffness, self._correction = membrane, stiffness, correction
        self._mass = self.simulation.mass_of_grains()
        self._measured, self._lengths = None, None

    def lengths(self):
        """Diameter of the cylinder of that volume, and distance of the platens [m]. Collective."""
        measured = self.membrane.measured()
        if measured is not self._measured:
            point = self.simulation.walls.point
            height = float(point[1, 2] - point[0, 2])
            diameter = math.sqrt(4.0 * float(measured[0]) / (math.pi * height))
            self._measured, self._lengths = measured, np.array([diameter, height])
        return self._lengths

    def places(self):
        """Those of the platens, after a zero for the side [m], shape (3,)."""
        return np.append(0.0, super().places())

    def forces(self):
        """Pressure of the cell over the side, and forces on the platens [N]. Collective."""
        return self._with_side(self.simulation.wall_forces())

    def pressing(self):
        """These forces [N], and the stiffness that each meets [N/m]. Collective."""
        forces, of_walls = self.simulation.walls.pressing(self.simulation.comm)
        diameter, height = self.lengths().tolist()
        stiffness = np.empty(1 + of_walls.size)
        stiffness[0] = 2.0 * math.pi * height * 2.0 * self._stiffness / diameter
        stiffness[1:] = of_walls
        return self._with_side(forces), stiffness

    def _with_side(self, of_walls):
        """Of the side and the platens, the membrane's share left out where that is wanted."""
        diameter, height = self.lengths().tolist()
        forces = np.empty(1 + of_walls.size)
        forces[0] = self.membrane.pressure * math.pi * diameter * height
        forces[1:] = of_walls
        if self._correction:
            forces[1:] -= self.membrane.measured()[1:]
        return forces

    def carried(self, stress):
        """Mean stress in the grains, over the volume of the sample [Pa], shape (2,). Collective.

        While a sleeve closes a gap it carries the pressure of the cell alone. Inside rigid grains
        there is no stress: across they are said to carry no more than along.
        """
        sim = self.simulation
        if sim.specimen.any_rigid:
            along = max(float(stress[1]), 0.0)
            return np.array([min(float(stress[0]), along), along])
        total = sim.solid.normal_stresses(sim.state, np.flatnonzero(sim.mesh.is_of_sample))
        total = sim.comm.allreduce(total) / -float(self.container.volume(self.lengths()))
        return np.array([0.5 * (total[0] + total[1]), total[2]])

    def has_support(self):
        """The sleeve carries of both platens what they differ by."""
        return np.ones(len(self.container.walls), dtype=bool)

    def gains(self, servo, stiffness, area):
        """Of the platens as of walls; of the cell that which makes its pressure rise as above."""
        found = servo.gains(stiffness, area)
        lengths = self.lengths()
        density = self._mass / float(self.container.volume(lengths))
        modulus = servo.share * servo.impedance**2 / density
        modulus += 2.0 * self._stiffness / lengths[0]
        found[0] = 0.5 * lengths[0] / (modulus * self.simulation.dt)
        return found

    def lead(self, speeds, targets):
        """Set the pressure of the cell and the speeds of the platens.

        Where a mean stress or a ratio is kept, the pressure follows what the platens carry in the
        mean: their single values would go through to the sample, which answers a wave later.
        """
        pressure = targets()[0]
        if pressure is not None and pressure != self.membrane.pressure:
            self.membrane.set_pressure(pressure)
        self.simulation.walls.set_speeds(speeds[1:])

    def row(self):
        """Pressure of the cell [Pa], and the membrane's mean force on the platens [N]."""
        share = float(self.membrane.axial_forces().mean())
        return self.membrane.pressure, share
