"""How fast a platen may move for the test to stay quasi-static, measured as it goes on.

The sample has the mass m, the height H, the internal energy U (elastic and plastic) and carries
the mean force F of its two platens. As a spring of the same force and energy it has the
stiffness K = F²/2U, and a wave travels through it in about

    T = sqrt(m/K) = sqrt(2 m U)/F,

which is H/c of a column. A platen of speed v, the other one at rest, moves the sample with a linear
profile, so that kinetic over internal energy is

    k = m v²/6U,   for a linear law and t since the first load: k = (T/t)²/3,

and grows with the square of the speed. The forces of the platens differ by the change of
momentum, which the platen's own acceleration makes up to m v̇/2, and by what still travels from
earlier. At constant k the speed of a linear sample grows with its strain, v̇/v = F v/2U, and the
force difference over F is 3k/2.

The control samples both every T/32, takes the mean of k and the root mean square of the force
difference over the force, d, over about T/2 (exponentially weighted), and has

    r = max( sqrt(k/k_target), d/d_target, l/l_target ),

1 where a target is reached; l is what a stress that a servo holds is off, over that stress, where
the test has any: the servo lags by as much as the walls that it leads have to give way. While r < 1
the speed follows the kinetic energy that is allowed, v̇/v = F v/2U + (half of the rate at which ln
k_target changes), and goes towards r = 0.9 within 2 T; that is an aperiodic loop with a filter of
T/2. Once r exceeds 1 the speed only falls, until r < 0.9 (hysteresis). The acceleration obeys, in
this order,

    |v̇| ≤ v/T  and  m |v̇|/2 ≤ half of the force difference that is allowed,

and follows its aim within T/4: changes of speed make no waves of their own. The speed stays between
the two limits stated, so that a rearrangement of grains, which frees energy at any speed, slows
the test but never stops it.

Before the strain ``loaded`` the allowed kinetic energy and force difference are, in joules and
newtons, those that a linear sample has at that strain: both targets are divided by
(strain/loaded)² and strain/loaded, a tenth at least.
"""

import math

from ..state import Stateful

#: Samples within the time T that a wave travels.
SAMPLES = 32
#: r that the control aims at.
AIM = 0.9
#: Lag of the filter over T.
FILTER = 0.5
#: Time over T within which it gets there: four times that lag.
RESPONSE = 2.0
#: Time over T within which the acceleration follows its aim, and the speed its limits.
SMOOTHING = 0.25
#: Share of the allowed force difference that the acceleration may make.
SHARE = 0.5
#: l_target: the report allows a little more.
HELD = 0.04
#: Speed of the walls that hold a stress over that of those which load, a guess for the start.
SIDE = 0.5
#: Below this part of ``loaded`` targets grow no more.
LEAST = 0.1


class QuasiStaticSpeed(Stateful):
    """Speed of the top platen that keeps a test quasi-static at few steps. Collective.

    Args:
        simulation: :class:`~mufe_fenicsx.explicit.simulation.Simulation`.
        settings: :class:`~mufe_fenicsx.scene.QuasiStatic` with its limits of speed filled in.
        top, bottom: Indices of the platens among its walls.
    """

    STATE = {
        "common": (
            "speed",
            "acceleration",
            "travel_time",
            "falling",
            "_last",
            "_next",
            "_square",
            "_force",
            "_kinetic",
            "_target",
            "range",
            "worst",
        )
    }

    def __init__(self, simulation, settings, top, bottom):
        self.simulation, self.settings = simulation, settings
        self.platens = top, bottom
        #: Gives l, the mean over the time of a wave; None: no stress is held.
        self.lack_of_held = None
        self.speed = self.acceleration = 0.0
        self.travel_time = 0.0  #: T at the last sample [s]; 0 before the first one
        self.falling = False  #: the speed only falls, until r < 0.9
        self._last = self._next = 0.0  # times of the last and the next sample [s]
        self._square = self._force = self._kinetic = 0.0  # filtered: d², F, k
        self._target = 0.0  # k_target of the last sample
        self.range = [math.inf, 0.0]  #: slowest and fastest so far [m/s]
        self.worst = [0.0, 0.0]  #: largest k and d since the strain ``loaded`` [-]

    def begin(self, speed):
        """Start from a speed [m/s] of the platen."""
        self.speed, self._next = speed, self.simulation.state.t

    def __call__(self, strain):
        """Speed [m/s] of the coming step. Collective; the same on all ranks.

        Args:
            strain: Strain reached [-].
        """
        state = self.simulation.state
        if state.t >= self._next:
            self._sample(strain)
        s = self.settings
        speed = self.speed + self.acceleration * self.simulation.dt
        self.speed = min(max(speed, min(s.slowest, self.speed)), max(s.fastest, self.speed))
        self.range = [min(self.range[0], self.speed), max(self.range[1], self.speed)]
        return self.speed

    def targets(self, strain):
        """Allowed k and d at a strain [-]."""
        s = self.settings
        growth = max(1.0, s.loaded / max(strain, LEAST * s.loaded)) if s.loaded else 1.0
        return s.kinetic * growth**2, s.unbalanced * growth

    def _sample(self, strain):
        sim, v = self.simulation, self.speed
        forces, energies = sim.wall_forces(), sim.energies()
        mass = sim.mass_of_grains()
        top, bottom = (forces[i] for i in self.platens)
        force = 0.5 * (top + bottom)
        internal = energies["elastic"] + energies["plastic"]
        if internal <= 0.0:  # rigid grains: all is in the springs of contact
            internal = energies["contact"]
        if force > 0.0 and internal > 0.0:
            T = math.sqrt(2.0 * mass * internal) / force
            # Where grains lose touch for a moment, the force says nothing about stiffness.
            self.travel_time = min(T, 2.0 * self.travel_time) if self.travel_time else T
        T, t = self.travel_time, sim.state.t
        if T == 0.0:  # nothing is loaded: free travel
            self._next = t + 32 * sim.dt
            return
        elapsed, self._last = t - self._last, t
        self._next = t + T / SAMPLES
        weight = 1.0 if self._force == 0.0 else 1.0 - math.exp(-elapsed / (FILTER * T))
        self._force += weight * (force - self._force)
        # Ratios are filtered, not their parts: they change little while the load grows.
        k = energies["kinetic"] / internal if internal > 0.0 else 1.0
        d = (top - bottom) / self._force if self._force > 0.0 else 1.0
        self._kinetic += weight * (k - self._kinetic)
        self._square += weight * (d * d - self._square)
        k, d = self._kinetic, math.sqrt(self._square)
        k_target, d_target = self.targets(strain)
        more = 0.5 * math.log(k_target / self._target) / elapsed if self._target else 0.0
        self._target = k_target
        if strain >= self.settings.loaded:
            self.worst = [max(self.worst[0], k), max(self.worst[1], d)]
        # Far off is far off: by how much is no matter, and the logarithm of it stays finite.
        lack = 0.0 if self.lack_of_held is None else self.lack_of_held() / HELD
        r = min(max(math.sqrt(k / k_target), d / d_target, lack, 1e-3), 1e3)
        self.falling = r > 1.0 or (self.falling and r > AIM)
        rate = -math.log(r / AIM) / (RESPONSE * T)
        if not self.falling:
            rate = max(0.0, rate + max(0.0, more + force * v / max(2.0 * internal, 1e-300)))
        aim = min(max(rate, -1.0 / T), 1.0 / T) * v
        most = 2.0 * SHARE * d_target * max(self._force, 0.0) / mass
        aim = min(max(aim, -most), most)
        delay = SMOOTHING * T
        aim = min(aim, (self.settings.fastest - v) / delay)
        aim = max(aim, (self.settings.slowest - v) / delay)
        self.acceleration += (1.0 - math.exp(-elapsed / delay)) * (aim - self.acceleration)

    def summary(self):
        """What it did, for run.json."""
        kinetic, unbalanced = self.worst
        return {
            "slowest": self.range[0] if self.range[1] else None,
            "fastest": self.range[1],
            "largest_kinetic": kinetic,
            "largest_unbalanced": unbalanced,
            "travel_time": self.travel_time,
        }
