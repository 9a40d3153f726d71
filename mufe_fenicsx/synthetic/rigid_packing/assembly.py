"""Grains in a container that move: one step, and how near to rest they are.

Lengths are in mean diameters D, masses in ρD³, stresses in the modulus E of contacts, so that time
is in D √(ρ/E).
"""

import numpy as np

from ...kernels.bulk import rigid
from ...kernels.packing.packed_spheres import kick_and_drift_spheres
from .contacts import Contacts
from .container import CYLINDER

#: Step over the square root of the smallest mass over stiffness of a body; stable below 1.4.
STEP = 0.3
#: A body counts as held by this many contacts at least, so that new ones do no harm.
LEAST_CONTACTS = 4


class Assembly:
    """Bodies in a container, with gravity along -z and a drag relative to the container's strain.

    Args:
        bodies: `bodies.Bodies`.
        container: `container.Container`.
        friction, wall_friction: Coefficients.
        gravity: Acceleration [E/(ρD)].
        progress: Called with the number of steps and the assembly.
    """

    def __init__(self, bodies, container, friction, wall_friction, gravity=0.0, progress=None):
        self.bodies, self.container = bodies, container
        self.contacts = Contacts(bodies, container)
        self.friction, self.wall_friction = friction, wall_friction
        self.gravity, self.drag, self.dashpots = gravity, 0.0, True
        self.num_steps, self.time, self.dt = 0, 0.0, 0.0
        self._progress = progress
        #: What a void ratio that is told has more than that of the container, and what is done.
        self.apart, self.doing = 0.0, ""
        self._told = np.zeros((bodies.mass.size, 6), dtype=bool)  # no motion is
        self._set_dt()

    def step(self, rates=None):
        """One step, in which the container's edges shrink at rates, shape (3,)."""
        b = self.bodies
        strain = None if rates is None else rates * self.dt
        if strain is not None:
            b.centre += (self.container.middle - b.centre) * strain
            self.container.shrink(strain)
        moved = self._drift()
        self.contacts.follow(strain, moved)
        b.force[:] = b.torque[:] = 0.0
        b.force[:, 2] = -self.gravity * b.mass
        self.contacts.add_loads(self.friction, self.wall_friction, self.dashpots, self.dt)
        rigid.kick(
            b.velocity, b.momentum, b.spin, b.force, b.torque, b.axes, b.mass, b.inertia,
            self._told, self.dt, self.drag,
        )  # fmt: skip
        self.num_steps += 1
        self.time += self.dt
        self._set_dt()
        if self._progress and self.num_steps % 50 == 0:
            self._progress(self.num_steps, self)

    def _drift(self):
        """First half of a step; the largest distance that a point of a body moved."""
        b = self.bodies
        if b.shapes.spheres:
            return kick_and_drift_spheres(
                b.centre, b.velocity, b.momentum, b.spin, b.force, b.torque, b.mass, b.inertia,
                self.dt, self.drag,
            )  # fmt: skip
        moved = rigid.kick_and_drift(
            b.centre, b.velocity, b.momentum, b.turn, b.axes, b.force, b.torque, b.mass, b.inertia,
            self._told, b.reach, self.dt, self.drag,
        )  # fmt: skip
        # Slip is the integral of the velocities between both places, or friction gains energy.
        rigid.set_spins(b.spin, b.momentum, b.axes, b.inertia)
        return moved

    def _set_dt(self):
        held = np.maximum(self.contacts.stiff, LEAST_CONTACTS * self.bodies.size)
        self.dt = STEP / np.sqrt((held / self.bodies.mass).max())

    def still(self):
        """Stop all motion."""
        for array in (self.bodies.velocity, self.bodies.momentum, self.bodies.spin):
            array[:] = 0.0

    def turned(self, b, points):
        """Points in the frame of a body about its centre, as large as it is [mean diameters]."""
        return self.bodies.size[b] * points @ self.bodies.axes[b].T

    @property
    def stress(self):
        """Mean stress of the container, compression positive [E], shape (3, 3)."""
        return self.contacts.stress / self.container.volume

    @property
    def axial_stresses(self):
        """Along x, y and z [E], shape (3,); across a cylinder their mean."""
        stress = self.contacts.stress.diagonal() / self.container.volume
        if self.container.kind == CYLINDER:
            stress[:2] = 0.5 * (stress[0] + stress[1])
        return stress

    @property
    def pressure(self):
        """Its mean [E]."""
        s = self.contacts.stress
        return float(s[0, 0] + s[1, 1] + s[2, 2]) / (3 * self.container.volume)

    @property
    def unbalanced(self):
        """Root mean square of the forces on bodies over that of their contacts [-]."""
        push = np.concatenate([self.contacts.push, self.contacts.wall_push.ravel()])
        push = push[push > 0]
        if not push.size:
            return np.inf
        resultant = np.sqrt((self.bodies.force**2).sum(axis=1).mean())
        return float(resultant / np.sqrt((push**2).mean()))

    @property
    def solid_fraction(self):
        """Volume of grains over that of the container."""
        return self.bodies.solid / self.container.volume

    @property
    def void_ratio(self):
        """Volume of voids over that of grains."""
        return 1 / self.solid_fraction - 1
