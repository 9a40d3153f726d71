"""A test by stages: the walls of a container led by stress, strain or speed along its axes.

Each axis of a stage does one of these:

    rest     its walls stand still
    hold     a servo keeps the stress that it had reached
    stress   it goes to a stress, then holds it
    strain   it goes to a strain, then rests
    speed    its length changes at a speed until the stage ends

Axes that go to a stress or a strain go together along a straight line,

    σ*(s) = σ0 + s (σ1 - σ0),  L*(s) = L0 + s (L1 - L0),  s from 0 to 1,

as fast as all of them can: s grows until the first one is at its largest speed, a strain by the
change of its length, a stress by what its walls would have to move (servo.py). So stress paths
are straight whatever the stiffness of the sample along each axis is. Speeds rise over the strain
``ramp`` as a smooth step of time; towards the end of a strain they fall with the root of what is
left of it, at a constant rate over the same strain.

A stage ends when a value of ``until`` is passed, or when s = 1, lengths are reached, and all held
stresses are within ``tolerance`` for twice the time T that a wave travels; then ``hold`` begins.
These stresses are means over T (exponentially weighted): grains that still rattle between few
contacts shake a wall for long, and without a load of their own. Where ``until`` is passed walls
brake first, over ``ramp``: at once they would send a wave through the sample that unloads it.

Rows of the history fall due by the ways that a stage has come, one for each of what leads it:
s, the changes of lengths that go at a speed, the values of ``until``, and time where it only
waits. Each grows alone, so that rows are nowhere farther apart than one interval of each.

Stresses are forces over the present areas of the walls; strains are 1 - L/L0, L0 the length at the
end of the last stage with ``zero``, or at the start. Compression is positive. The axes are those of
the container: x, y, z of a box; r, along which the length is the diameter, and z of a cylinder; o
and i, of its outer and inner diameter, and z of a hollow one. What shears a sample: shearing.py.
"""

import math

import numpy as np

from ..container import container_of
from ..errors import SolverError
from ..state import Stateful
from .oedometer import overdamped, smooth_step
from .present_stage import PresentStage, WallMeans
from .quasi_static import QuasiStaticSpeed
from .shearing import shearing_of
from .wall_servo import Servo

REST, HOLD, STRESS, STRAIN, SPEED = "rest", "hold", "stress", "strain", "speed"

STRAIN_DEFINITION = (
    "shortening of the distance between the walls across an axis over that distance at the end of "
    "the last stage with zero = true before (without one: at the start); compression positive"
)

#: Walls that hold a stress may move so many times faster than `loading.speed`.
HOLDING = 4.0
#: Times that a wave travels for which stresses have to stay within their tolerance.
SETTLED = 2.0
#: Part of the way along the line while a wall that is to carry a stress has not met the sample.
UNMET = 0.2
#: Part of a length to which a strain is reached.
EXACT = 1e-9
#: Ways of every stage: s, that of lengths, and of time where it waits.
NUM_WAYS = 3


class StagedLoading(Stateful):
    """Moves the walls of a simulation through stages. Collective but for plain numbers.

    Args:
        simulation: :class:`~.Simulation` with the walls of a container.
        settings: :class:`~mufe_fenicsx.scene.stages.Loading`.
        program: Its :class:`~mufe_fenicsx.scene.stages.Stage` s, with their names.
        quasi_static: Settings of a speed that adapts (scene.QuasiStatic), or None.
    """

    end = "last stage done"
    strain_definition = STRAIN_DEFINITION

    STATE = {"common": ("index", "stages", "first_height", "_reference", "_held", "_speed")}

    def __init__(self, simulation, settings, program, quasi_static=None):
        self.simulation, self.settings, self.program = simulation, settings, program
        self.container = container_of(simulation.walls.names)
        self.servo = Servo(simulation, self.container)
        self.control = None
        if quasi_static is not None:
            platens = self.container.top, self.container.bottom
            self.control = QuasiStaticSpeed(simulation, quasi_static, *platens)
        zeros = [number for number, stage in enumerate(program) if stage.zero]
        self._last_zero = max(zeros, default=-1)
        self.shearing = shearing_of(simulation, self.container, settings, program)
        self._reference = self.lengths.tolist()
        self.first_height = self._reference[-1]
        self._held = [None] * len(self._reference)  # stress that each axis holds [Pa]
        self._speed = 0.0
        self._updated, self._loads = -1, None
        self.stages = []
        self.index = -1
        self._begin(np.zeros(len(self.container.walls)))

    # --- what others read -----------------------------------------------------------------

    @property
    def columns(self):
        """Of history.csv beyond the usual ones."""
        of_shear = () if self.shearing is None else self.shearing.columns
        return (*self._of_axes, *of_shear)

    @property
    def _of_axes(self):
        letters = (*self.container.axes, *self.container.across)
        return (*(f"stress_{a}" for a in letters), *(f"strain_{a}" for a in letters))

    @property
    def lengths(self):
        """Lengths between the walls along the axes [m], shape (num_axes,)."""
        walls = self.simulation.walls
        return self.container.lengths(walls.point, walls.curved.radius)

    @property
    def strains(self):
        """Along the axes, compression positive, shape (num_axes,)."""
        return 1.0 - self.lengths / self._reference

    @property
    def strain(self):
        """Vertical strain."""
        return float(self.strains[-1])

    @property
    def height(self):
        """Distance of top and bottom wall [m]."""
        return float(self.lengths[-1])

    @property
    def reference_height(self):
        """That distance at strain 0 [m]."""
        return self._reference[-1]

    @property
    def speed_now(self):
        """Fastest change of a length in the last step [m/s]."""
        return self._speed

    @property
    def stage(self):
        """Name of the present stage."""
        return self.program[self.index].name

    @property
    def loaded(self):
        """Whether the stages that bring the sample to strain 0 are over."""
        return self.index > self._last_zero

    @property
    def follows(self):
        """Whether the start of this stage is the stored end of another one."""
        return self.index - 1 > self._last_zero and self.index > 0

    @property
    def part_done(self):
        """Of all stages, as far as known without asking other ranks."""
        return (self.index + 0.5 * self._now.s) / len(self.program)

    @property
    def finished(self):
        """Whether the last stage is over. Collective."""
        return self.index == len(self.program) - 1 and self._is_over()

    @property
    def course(self):
        """What rows fall due by: sum of the ways of this stage, whole at its end. Collective."""
        if self._is_over():
            return math.floor(sum(self._now.ways)) + 1.0
        return sum(self._now.ways)

    @property
    def progress(self):
        """How far the present stage has come, from 0 to 1, 1 only when it is over. Collective."""
        if self._is_over():
            return 1.0
        stage, t = self.program[self.index], self.simulation.state.t
        # Where it waits it stays just below what a row or a state is due at.
        done = self._part_led() * (1.0 - 1e-9)
        if stage.hold > 0.0:
            held = 0.0 if self._now.hold_from is None else (t - self._now.hold_from) / stage.hold
            done = 0.5 * (done if self._now.hold_from is None else 1.0) + 0.5 * min(held, 1.0)
        return min(done, 1.0 - 1e-9)

    def interval(self, count):
        """Progress between two of ``count`` records of the test, shared evenly by its stages."""
        return 1.0 / math.ceil((count - 1) / len(self.program))

    def row(self, forces):
        """Columns of history.csv that this loading adds, and those that it defines itself.

        Args:
            forces: On the walls [N], shape (num_walls,).
        """
        stress = self._axis_stress(forces)
        values = dict(zip(self._of_axes, self._along_all(stress), strict=True))
        of_shear = {} if self.shearing is None else self.shearing.row()
        return values | of_shear | {"stress": stress[-1]}

    def _along_all(self, stress):
        """Stresses, then strains, along the axes and the directions across the vertical one."""
        container, lengths, strains, found = self.container, self.lengths, self.strains, []
        num = len(container.across)
        for values, three in ((stress, container.three_stresses(stress, lengths)),
                              (strains, container.three_strains(strains, lengths))):  # fmt: skip
            found += [*values, *three[:num]]
        return [float(value) for value in found]

    def state_dict(self):
        """What a loading that goes on from here has to know, fit for JSON."""
        kept = super().state_dict() | {
            "now": self._now.state_dict(),
            "mean": self._mean.state_dict(),
            "servo": self.servo.state_dict(),
        }
        if self.shearing is not None:
            kept["shearing"] = self.shearing.state_dict()
        return kept if self.control is None else kept | {"control": self.control.state_dict()}

    def load_state_dict(self, kept):
        """Go on from what :meth:`state_dict` gave."""
        super().load_state_dict({"common": kept["common"]})
        if self.shearing is not None:
            if "shearing" in kept:  # else no stage so far had any
                self.shearing.load_state_dict(kept["shearing"])
            self.shearing.take(self.program[self.index])
        self._now.load_state_dict(kept["now"])
        self._mean.load_state_dict(kept["mean"])
        self.servo.load_state_dict(kept["servo"])
        self._updated = -1
        self._do = self._tasks()
        if self.control is not None:
            self.control.load_state_dict(kept["control"])
            self.control.platens = self._leading_walls()

    # --- stages ---------------------------------------------------------------------------

    def before_step(self):
        """Set the speeds of the walls and change stage when it is time. Collective."""
        if self._is_over() and self.index + 1 < len(self.program):
            self._begin(self._loads[0])
        self._move()

    def _begin(self, forces):
        """Begin the next stage."""
        if self.index >= 0:
            self._held = [self._target(a) for a in range(len(self._held))]
            if self.program[self.index].zero:
                self._reference = self.lengths.tolist()
        self.index += 1
        state = self.simulation.state
        for name, motion in self.program[self.index].tools.items():
            self.simulation.tools.set_motion(name, state.t, motion.rates, motion.loads, motion.ramp)
        stress = self._axis_stress(forces)
        self._do = self._tasks()
        stress0 = [
            held if held is not None else self._moving_mean(a, forces)
            for a, held in enumerate(self._held)
        ]
        if self.index == 0:
            self._mean = WallMeans(self._wall_stress(forces).tolist(), state.t)
        if self.shearing is not None:
            self.shearing.begin(self.program[self.index])
        ways = [0.0] * (NUM_WAYS + len(self._given()))
        self._now = PresentStage(state.t, self.lengths.tolist(), stress0, ways)
        self._now.values0 = self._values(self._mean_stress())
        self._updated = -1
        if self._is_controlled():
            self.control.begin(self.settings.speed)
            self.control.acceleration = 0.0
            self.control.platens = self._leading_walls()
        self.stages.append(
            {
                "name": self.stage,
                "step": state.num_steps,
                "time": state.t,
                "strain": self.strain,
                "strains": self.strains.tolist(),
                "stresses": stress.tolist(),
                **({} if self.shearing is None else self.shearing.values()),
            }
        )

    def _tasks(self):
        """What the axes do in this stage: list of (task, Axis or None)."""
        axes, found = self.program[self.index].axes, []
        for a, name in enumerate(self.container.axes):
            axis = axes.get(name)
            if axis is None:
                found.append((REST if self._held[a] is None else HOLD, None))
            elif axis.stress is not None:
                found.append((STRESS, axis))
            else:
                found.append((SPEED if axis.strain is None else STRAIN, axis))
        return found

    def _moving(self, a):
        """Walls of an axis that move."""
        axis, walls = self._do[a][1], self.container.walls_of_axis[a]
        which = "both" if axis is None else axis.walls
        return {"both": walls, "min": walls[:1], "max": walls[-1:]}[which]

    def _leading_axis(self):
        """The axis that leads the stage: the last one that goes somewhere, or the vertical one."""
        leads = [a for a, (task, _) in enumerate(self._do) if task in (STRESS, STRAIN, SPEED)]
        return leads[-1] if leads else len(self._do) - 1

    def _leading_walls(self):
        """Upper and lower wall of the leading axis, for the quasi-static speed."""
        walls = self.container.walls_of_axis[self._leading_axis()]
        return walls[-1], walls[0]

    def _on_line(self):
        """Whether the stage has stresses, strains or a shear to reach along its line."""
        shears = self.shearing is not None and self.shearing.leads
        return shears or any(task in (STRESS, STRAIN) for task, _ in self._do)

    def _at_speed(self):
        """Whether walls go at a speed until the stage ends, which may be none."""
        shears = self.shearing is not None and self.shearing.goes
        return shears or any(task == SPEED for task, _ in self._do)

    def _part_led(self):
        """How far the leading part of the stage has come, from 0 to 1."""
        parts = [self._now.s] if self._on_line() else []
        parts += self._parts_of_until()
        return min(max(max(parts, default=0.0), 0.0), 1.0)

    def _given(self):
        """The values of `until` of this stage, by name."""
        until = self.program[self.index].until
        return {} if until is None else until.given

    def _parts_of_until(self):
        """How far each value of `until` has come; 1 where it is passed."""
        if not self._given() or self._loads is None:
            return []
        now, before = self._values(self._mean_stress()), self._now.values0
        ways = {name: value - before[name] for name, value in self._given().items()}
        return [(now[n] - before[n]) / way if way else 1.0 for n, way in ways.items()]

    def _come(self, lengths, t):
        """Add to the ways of this stage what has been done since, each of which only grows."""
        most = self.settings.largest_strain
        shares = [
            abs(1.0 - lengths[a] / self._now.length0[a]) / most
            for a, (task, _) in enumerate(self._do)
            if task in (HOLD, STRESS, SPEED)
        ]
        if self.shearing is not None and self.shearing.goes:
            shares.append(self.shearing.way / most)
        until = t if self._now.led_until is None else self._now.led_until
        # Rows are as near at first as before it waits, and as many each time that it has waited
        # e times as long: few grains may rattle for long.
        wait = max(self.program[self.index].hold, SETTLED * self.servo.travel_time)
        whole = max(until - self._now.begun, wait, self._ramp_time())
        waited = math.log1p((t - until) / whole) if whole > 0.0 else 0.0
        now = [self._now.s, max(shares, default=0.0), waited]
        now += self._parts_of_until()
        self._now.ways = [float(max(a, b)) for a, b in zip(self._now.ways, now, strict=True)]

    def _is_led(self):
        """Whether walls are on the way to what the stage is to reach, or go at a speed."""
        moves = any(task == SPEED and axis.speed for task, axis in self._do)
        moves |= self.shearing is not None and self.shearing.goes
        return moves or (self._now.s < 1.0 and self._on_line())

    def _is_over(self):
        """Whether the present stage is over in the present state. Collective."""
        t = self.simulation.state.t
        if self._updated != self.simulation.state.num_steps:
            self._updated = self.simulation.state.num_steps
            self._update(t)
        hold = self.program[self.index].hold
        return self._now.hold_from is not None and t - self._now.hold_from >= hold

    def _update(self, t):
        """Look at the present state. Collective; twice gives the same as once."""
        self._loads = forces, _ = self.simulation.walls.pressing(self.simulation.comm)
        stress, lengths, now = self._axis_stress(forces), self.lengths, self._now
        self.servo.sample(stress, lengths)
        self._check_lengths(stress, lengths)
        self._mean.add(self._wall_stress(forces), t, self.servo.travel_time)
        if self.shearing is not None:
            self.shearing.sample(t, self.servo.travel_time)
        self._come(lengths, t)
        near = self.shearing is None or self.shearing.is_there
        for a, (task, axis) in enumerate(self._do):
            if task in (HOLD, STRESS):
                target = now.stress0[a] if task == HOLD else axis.stress
                off = max(abs(self._mean.stress[wall] - target) for wall in self._moving(a))
                near &= bool(off <= self.settings.tolerance * target)
            elif task == STRAIN:
                near &= bool(abs(lengths[a] - self._length1(a)) <= EXACT * lengths[a])
        near &= now.s == 1.0 or not self._on_line()
        now.settled = (t if now.settled is None else now.settled) if near else None
        if now.led_until is None and not self._is_led():
            now.led_until = t
        if now.hold_from is not None:
            return
        stage = self.program[self.index]
        servo = any(task in (HOLD, STRESS) for task, _ in self._do)
        ends_itself = not (stage.until is not None or self._at_speed()) or self._on_line()
        if ends_itself and now.settled is not None:
            wait = SETTLED * self.servo.travel_time if servo else 0.0
            if t - now.settled >= wait:
                now.hold_from = t
        if now.brake_from is None and any(part >= 1.0 for part in self._parts_of_until()):
            now.brake_from = t
            if now.led_until is None:
                now.led_until = t
        braked = self._ramp_time() if self._is_led() else 0.0
        if now.brake_from is not None and t - now.brake_from >= braked:
            now.hold_from = t

    def _check_lengths(self, stress, lengths):
        limit, axes = self.settings.largest_strain, self.container.axes
        for a, (task, _) in enumerate(self._do):
            change = 1.0 - lengths[a] / self._now.length0[a]
            if task in (HOLD, STRESS, SPEED) and abs(change) > limit:
                what = overdamped(self.simulation) or (
                    "see that the sample fills its walls and can carry what is asked"
                )
                raise SolverError(
                    f'stage "{self.stage}": the length along {axes[a]} changed by {change:.1%} at '
                    f"a stress of {stress[a]:.3g} Pa there (loading.largest_strain = {limit:g}): "
                    f"{what}"
                )

    def _values(self, stress):
        """All that `until` can name."""
        container, lengths, shear = self.container, self.lengths, 0.0
        x, y, z = (float(value) for value in container.three_stresses(stress, lengths))
        volumes = container.volume([lengths, self._reference])
        found = dict(zip(self._of_axes, self._along_all(stress), strict=True))
        if self.shearing is not None:
            found |= self.shearing.values()
            shear = self.shearing.stress
        square = 0.5 * ((x - y) ** 2 + (y - z) ** 2 + (z - x) ** 2) + 3.0 * shear**2
        return found | {
            "mean_stress": (x + y + z) / 3.0,
            "deviator": math.sqrt(square),
            "strain_volume": float(1.0 - volumes[0] / volumes[1]),
            "time": self.simulation.state.t - self._now.begun,
        }

    # --- walls ----------------------------------------------------------------------------

    def _axis_stress(self, forces):
        """Mean stress of the walls of each axis [Pa], shape (num_axes,)."""
        return self.container.stresses(self._across(forces), self.lengths)

    def _mean_stress(self):
        """That, as the mean over the time that a wave travels [Pa], shape (num_axes,)."""
        mean = np.asarray(self._mean.stress)
        return np.array([mean[list(walls)].mean() for walls in self.container.walls_of_axis])

    def _wall_stress(self, forces):
        """Stress of each wall [Pa], shape (num_walls,)."""
        forces = np.asarray(self._across(forces))
        return forces / self.container.areas_of_walls(self.lengths)

    def _across(self, forces):
        """Those parts of the normal forces that the areas of the walls are loaded by [N]."""
        return forces if self.shearing is None else self.shearing.across(forces)

    def _moving_mean(self, a, forces):
        stress = self._wall_stress(forces)
        return float(stress[list(self._moving(a))].mean())

    def _length1(self, a):
        """Length at the strain that an axis goes to [m]."""
        return self._reference[a] * (1.0 - self._do[a][1].strain)

    def _target(self, a):
        """Stress that an axis is to carry now [Pa]; None where that is free."""
        task, axis = self._do[a]
        if task == STRESS:
            return self._now.stress0[a] + self._now.s * (axis.stress - self._now.stress0[a])
        return self._now.stress0[a] if task == HOLD else None

    def _move(self):
        """Velocities of the walls for the coming step."""
        sim, settings, now = self.simulation, self.settings, self._now
        forces, stiffness = self._loads
        lengths = self.lengths
        area = self.container.areas_of_walls(lengths)
        stress, gain = self._wall_stress(forces), self.servo.gains(stiffness, area)
        leading = now.hold_from is None
        factor = self._ramp() * self._control_factor() if leading else 0.0
        if leading:
            now.s = self._next_s(factor, lengths, stress, gain)
        velocity = np.zeros(len(area))  # of each wall towards the sample
        for a, (task, axis) in enumerate(self._do):
            walls = list(self._moving(a))
            share = self._share(a)
            if task in (HOLD, STRESS):
                most, free, target = HOLDING * self._fastest(), settings.speed, self._target(a)
                if task == STRESS and leading:
                    free = self._most(axis) * factor
                    if now.s < 1.0 and axis.stress != now.stress0[a]:
                        most = free
                for w in walls:
                    if stiffness[w] > 0.0:
                        v = gain[w] * (target - stress[w])
                        velocity[w] = min(max(v, -most * abs(share)), most * abs(share))
                    else:  # on towards the sample
                        velocity[w] = abs(share) * free
            elif task == STRAIN and leading:
                wanted = now.length0[a] + now.s * (self._length1(a) - now.length0[a])
                velocity[walls] = share * (lengths[a] - wanted) / sim.dt
            elif task == SPEED and leading:
                velocity[walls] = share * axis.speed * factor
        sim.walls.set_speeds(velocity)
        self._speed = float(np.abs(self.container.closing(velocity)).max())
        if self.shearing is not None:
            speed = self.shearing.move(now.s if leading else None, factor, velocity)
            self._speed = max(self._speed, speed)

    def _share(self, a):
        """Speed of each moving wall of an axis over that of its length, which it shortens.

        Negative where a wall that comes towards the sample makes the length longer.
        """
        return 1.0 / (self.container.shortening[a] * len(self._moving(a)))

    def _fastest(self):
        """The speed of the test, or that which keeps it quasi-static where this is larger."""
        return max(self.settings.speed, self.control.speed if self._is_controlled() else 0.0)

    def _most(self, axis):
        return self.settings.speed if axis.speed is None else axis.speed

    def _ramp(self):
        """Part of the speed that the ramps, at the start of a stage and at its end, let through."""
        time, now = self._ramp_time(), self._now
        # The middle of the coming step: the first one moves.
        t = self.simulation.state.t + 0.5 * self.simulation.dt
        if time == 0.0:
            return 1.0
        brake = 0.0 if now.brake_from is None else smooth_step((t - now.brake_from) / time)
        return smooth_step((t - now.begun) / time) * (1.0 - brake)

    def _ramp_time(self):
        """In which walls get from rest to their speed, and back [s]."""
        shortest = self.container.shortest(self._now.length0)
        return self.settings.ramp * shortest / self.settings.speed

    def _is_controlled(self):
        """Whether the speed adapts: not while the sample is seated, where walls travel freely."""
        return self.control is not None and self.loaded

    def _control_factor(self):
        """Speed that keeps the test quasi-static over the one that is stated."""
        if not self._is_controlled():
            return 1.0
        if self._now.s == 1.0 and not self._at_speed():
            return self.control.speed / self.settings.speed
        strain = abs(float(self.strains[self._leading_axis()]))
        if self.shearing is not None:
            strain = max(strain, self.shearing.way)
        return self.control(strain) / self.settings.speed

    def _next_s(self, factor, lengths, stress, gain):
        """How far along the line walls may go in the coming step."""
        now, dt, ramp = self._now, self.simulation.dt, self.settings.ramp
        found = 1.0
        if self.shearing is not None:
            found = min(found, self.shearing.next_s(now.s, factor, ramp))
        for a, (task, axis) in enumerate(self._do):
            if task == STRAIN:
                way = abs(self._length1(a) - now.length0[a])
                if way > 0.0:
                    most = self._most(axis) * factor
                    left = (1.0 - now.s) * way / (ramp * now.length0[a]) if ramp > 0.0 else 1.0
                    found = min(found, now.s + most * math.sqrt(min(left, 1.0)) * dt / way)
            elif task == STRESS:
                way = axis.stress - now.stress0[a]
                walls = self._moving(a)
                most = self._most(axis) * factor * abs(self._share(a))
                for w in walls:
                    if not math.isfinite(gain[w]):
                        # Those that have met the sample press a little, and stay.
                        found = min(found, UNMET)
                    elif way != 0.0:
                        come = (stress[w] - now.stress0[a]) * math.copysign(1.0, way)
                        found = min(found, (come + most / gain[w]) / abs(way))
        return max(now.s, found)
