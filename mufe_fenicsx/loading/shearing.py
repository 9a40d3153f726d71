"""Walls that move along themselves: simple shear of a box, torsion of a round sample.

**Simple shear.** The top moves along x, the bottom does not. With the way d of the top and the
height H the four walls around the plane stay a parallelogram where the walls across x are tilted
by θ about their lower edges,

    γ = d/H = tan θ,

so that they turn by atan(d'/H') - atan(d/H) in a step, whatever the height does. All walls then
move as the material of a homogeneous sample, v = L x with L_xz = ḋ/H - γ L̇x/Lx. The volume is
Lx Ly H, with Lx the distance of the tilted walls along x. Of the normal force N on these σx =
N cos θ/(Ly H) is the pressure. Of the forces of the platens along x,

    τ = ½ (F_bottom - F_top)/(Lx Ly).

**Torsion.** A platen turns about the axis. The torque T is the mean of both platens' and, with the
radii R and r, the height H and the angle φ between the platens,

    τ = 3 T/(2π (R³ - r³)),  γ = 2 φ (R³ - r³)/(3 H (R² - r²)),

the mean over the section of a stress that is even, and the mean of the strain φ ρ/H. Their
product does the work of the torque, V τ γ̇ = T φ̇ (Hight, Gens & Symes 1983).

On the way to a target both are part of the straight line of the stage (stages.py).
"""

import math

import numpy as np

from ..container import BOX, SHEARED
from ..errors import SolverError
from ..state import Stateful
from .gauges import WallMeans

#: Part of a target to which it is reached.
EXACT = 1e-9
#: γ of a box at which a test stops that goes at a rate: its walls are nearly flat.
LARGEST = 10.0


class Unsheared(Stateful):
    """Nothing shears the sample. What it says of itself is what tasks of axes say."""

    ends = False  #: whether the stage ends when a target is reached
    at_speed = False  #: whether it goes at a rate until the stage ends, which may be zero
    driven = False  #: whether that is not zero
    is_there = True  #: whether the target is reached, if there is one
    columns = ()  #: of history.csv
    way = 0.0  #: shear strain of this stage so far
    stress = 0.0  #: shear stress as :meth:`values` has it [Pa]

    @property
    def goes(self):
        """Whether it goes along the line of the stage."""
        return self.ends

    def row(self):
        """Values of the columns of history.csv. Collective."""
        return ()

    def values(self):
        """What `until` can name; stresses are means over the time that a wave travels."""
        return {}

    def across(self, forces):
        """Those parts of normal forces on walls [N], (num_walls,), that areas are loaded by."""
        return forces

    def sample(self, t, travel_time):
        """Take the present load into its mean. Collective."""

    def begin(self, stage):
        """Begin a stage."""

    def take(self, stage):
        """Do what a stage says."""

    def next_s(self, s, factor, ramp):
        """How far along the line of the stage the target lets it go in the coming step."""
        return 1.0

    def move(self, s, factor, inward):
        """Speeds of the coming step; that of the fastest point of a platen [m/s]."""
        return 0.0


class Shearing(Unsheared):
    """What shears a sample through the stages of a test. Collective but for plain numbers.

    Args:
        simulation: :class:`~mufe_fenicsx.explicit.simulation.Simulation`.
        container: :class:`~mufe_fenicsx.container.Container` that its walls are.
        speed: Of the fastest point of a platen where a stage states no rate [m/s].
    """

    STATE = {"common": ("start",)}
    key = ""  #: of a stage

    def __init__(self, simulation, container, speed):
        self.simulation, self.container, self.speed = simulation, container, speed
        self.given = None  #: Shear or Turn of the present stage, or None: at rest
        self.start = 0.0  #: :attr:`value` as that began
        self.mean = WallMeans([0.0], 0.0)  #: of :attr:`load`

    # --- of each kind ---------------------------------------------------------------------

    @property
    def value(self):
        """How far the sample is sheared: γ, or the angle [rad]."""
        raise NotImplementedError

    @property
    def arm(self):
        """Way of the fastest point of a platen over :attr:`value` [m]."""
        raise NotImplementedError

    def load(self):
        """What does work on :attr:`value`: τ [Pa], or T [N m]. Collective."""
        raise NotImplementedError

    def results(self, load):
        """Columns of history.csv and values of `until`, in the order of ``SHEARED``."""
        raise NotImplementedError

    def advance(self, way, inward):
        """Let walls do a part of the way in the coming step.

        Args:
            way: By which :attr:`value` grows, beside what the height does to it.
            inward: Speeds of the walls towards the sample [m/s], shape (num_walls,).
        """
        raise NotImplementedError

    # --- of all ---------------------------------------------------------------------------

    @property
    def columns(self):
        """Of history.csv."""
        return SHEARED[self.key]

    def row(self):
        """Values of the columns of history.csv. Collective."""
        return self.results(self.load())

    def values(self):
        """What `until` can name; stresses are means over the time that a wave travels."""
        return dict(zip(self.columns, self.results(self.mean.stress[0]), strict=True))

    @property
    def stress(self):
        """Shear stress as :meth:`values` has it [Pa]."""
        return next(v for name, v in self.values().items() if name.startswith("shear_"))

    def sample(self, t, travel_time):
        """Take the present load into its mean. Collective."""
        self.mean.add(np.array([self.load()]), t, travel_time)

    def begin(self, stage):
        """Begin a stage."""
        self.take(stage)
        self.start = self.value

    def take(self, stage):
        """Do what a stage says."""
        self.given = getattr(stage, self.key)

    def state_dict(self):
        """What a test that goes on has to know, fit for JSON."""
        return super().state_dict() | {"mean": self.mean.state_dict()}

    def load_state_dict(self, kept):
        """Become what :meth:`state_dict` told."""
        super().load_state_dict({"common": kept["common"]})
        self.mean.load_state_dict(kept["mean"])

    @property
    def ends(self):
        """Whether there is a target in this stage."""
        return self.given is not None and self.given.target is not None

    @property
    def at_speed(self):
        """Whether it goes at a rate until the stage ends, which may be zero."""
        return self.given is not None and self.given.target is None

    @property
    def driven(self):
        """Whether that is not zero."""
        return self.at_speed and self.given.rate != 0.0

    @property
    def is_there(self):
        """Whether the target is reached, if there is one."""
        if not self.ends:
            return True
        return abs(self.value - self.given.target) <= EXACT * max(1.0, abs(self.given.target))

    @property
    def way(self):
        """Shear strain of this stage so far."""
        return abs(self.value - self.start) * self.arm / self._height

    @property
    def _height(self):
        return float(self._lengths[-1])

    @property
    def _lengths(self):
        walls = self.simulation.walls
        return self.container.lengths(walls.point, walls.curved.radius)

    def _sum(self, value):
        """Over all ranks. Collective."""
        return float(self.simulation.comm.allreduce(float(value)))

    def _rate(self):
        """Largest rate of :attr:`value` on the way to a target [1/s]."""
        return self.speed / self.arm if self.given.rate is None else self.given.rate

    def next_s(self, s, factor, ramp):
        """How far along the line of the stage the target lets it go in the coming step.

        Args:
            s: Part that is done.
            factor: Of the rate.
            ramp: Strain over which it slows down.
        """
        way = abs(self.given.target - self.start) if self.ends else 0.0
        if way == 0.0:
            return 1.0
        left = (1.0 - s) * way * self.arm / self._height
        slow = math.sqrt(min(left / ramp, 1.0)) if ramp > 0.0 else 1.0
        return s + self._rate() * factor * slow * self.simulation.dt / way

    def move(self, s, factor, inward):
        """Speeds of the coming step, after those of the axes are set.

        Args:
            s: Part of the stage's line to get to; None while its end is held.
            factor: Of the rate.
            inward: Speeds of the walls towards the sample [m/s], shape (num_walls,).

        Returns:
            Speed of the fastest point of a platen [m/s].
        """
        way = 0.0
        if s is not None and self.ends:
            way = self.start + s * (self.given.target - self.start) - self.value
        elif s is not None and self.driven:
            way = self.given.rate * factor * self.simulation.dt
        self.advance(way, inward)
        return abs(way) * self.arm / self.simulation.dt


class SimpleShear(Shearing):
    """The top of a box moves along x, the walls across x tilt about their lower edges."""

    key = "shear"

    @property
    def value(self):
        """γ, the tangent of the tilt."""
        normal = self.simulation.walls.normal[0]
        return float(-normal[2] / normal[0])

    @property
    def arm(self):
        """Height [m]."""
        return self._height

    def load(self):
        """Shear stress of the platens [Pa]. Collective."""
        force, bottom, top = self.simulation.walls.force, self.container.bottom, self.container.top
        area = float(self.container.areas(self._lengths)[-1])
        return 0.5 * self._sum(force[bottom, 0] - force[top, 0]) / area

    def results(self, load):
        """τ [Pa] and γ."""
        return load, self.value

    def advance(self, way, inward):
        """As of the base: γ grows by ``way`` at the height that the step ends with.

        Raises:
            SolverError: γ is beyond ``LARGEST``; on all ranks.
        """
        if abs(self.value) > LARGEST:
            raise SolverError(
                f"gamma_xz = {self.value:.3g}, expected at most {LARGEST:g}: end the stage before"
            )
        walls, dt = self.simulation.walls, self.simulation.dt
        bottom, top = self.container.bottom, self.container.top
        height = self._height
        after = height - dt * (inward[bottom] + inward[top])
        apart = walls.point[top, 0] - walls.point[bottom, 0]
        led = self.ends and way != 0.0
        # On the way to a target γ is what is asked for; else the top goes its own way.
        speed = ((self.value + way) * after - apart) / dt if led else way * height / dt
        walls.velocity[top, 0] = speed
        tilt = math.atan2(apart + dt * speed, after) - math.atan(self.value)
        for i, sign in ((0, 1.0), (1, -1.0)):
            walls.velocity[i] = sign * inward[i], 0.0, inward[bottom]
            walls.angular_velocity[i, 1] = tilt / dt

    def across(self, forces):
        """Those parts of normal forces on walls [N], (num_walls,), that areas are loaded by."""
        found = np.array(forces, dtype=float)
        found[:2] *= abs(self.simulation.walls.normal[0, 0])
        return found


class Torsion(Shearing):
    """A platen of a cylinder, or of a hollow one, turns about the axis."""

    STATE = {"common": ("start", "turned")}
    key = "turn"

    def __init__(self, simulation, container, speed):
        super().__init__(simulation, container, speed)
        self.turned = 0.0  #: angle when it was asked for last [rad]

    @property
    def value(self):
        """Angle of the top against the bottom, right-handed about z [rad]."""
        rotation = self.simulation.walls.rotation
        turn = rotation[self.container.top] @ rotation[self.container.bottom].T
        now = math.atan2(turn[1, 0], turn[0, 0])
        # The rotations do not say how many whole turns there were.
        self.turned += math.remainder(now - self.turned, 2.0 * math.pi)
        return self.turned

    @property
    def _radii(self):
        """Of the outer and of the inner wall [m]; the latter 0 without one."""
        outer, *inner, _ = self._lengths
        return 0.5 * float(outer), 0.5 * float(inner[0]) if inner else 0.0

    @property
    def arm(self):
        """Radius [m]."""
        return self._radii[0]

    def load(self):
        """Torque of the platens [N m]. Collective."""
        torque = self.simulation.walls.torque
        return 0.5 * self._sum(torque[self.container.bottom, 2] - torque[self.container.top, 2])

    def results(self, load):
        """T [N m], τ [Pa], γ, and the angle [rad]."""
        angle, (outer, inner) = self.value, self._radii
        cubes = outer**3 - inner**3
        strain = 2.0 * angle * cubes / (3.0 * self._height * (outer**2 - inner**2))
        return load, 3.0 * load / (2.0 * math.pi * cubes), strain, angle

    def advance(self, way, inward):
        """As of the base."""
        walls = self.simulation.walls
        turning = "top" if self.given is None else self.given.wall
        speed = way / self.simulation.dt
        walls.angular_velocity[self.container.top, 2] = speed if turning == "top" else 0.0
        walls.angular_velocity[self.container.bottom, 2] = -speed if turning == "bottom" else 0.0


def shearing_of(simulation, container, settings, program):
    """What shears the sample in a program of stages.

    Args:
        simulation, container: As of :class:`Shearing`.
        settings: :class:`~mufe_fenicsx.scene.stages.Loading`.
        program: Stages.
    """
    kind = SimpleShear if container is BOX else Torsion
    if all(getattr(stage, kind.key) is None for stage in program):
        return Unsheared()
    return kind(simulation, container, settings.speed)
