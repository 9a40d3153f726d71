"""A test by stages: the walls of a container led along its axes.

Each axis of a stage has a task (tasks.py):

    rest     its walls stand still
    hold     a servo keeps the stress that it had reached
    stress   it goes to a stress, then holds it
    strain   it goes to a strain, then rests
    follow   it goes along lengths that were measured (measured_paths.py)
    speed    its length changes at a speed until the stage ends
    p, eta   a servo keeps the mean stress, or the ratio of stresses, whatever the platens carry
    volume   its walls go with those of the other axes so that the volume stays (undrained)

Axes that go to a stress or a strain go together along a line,

    σ*(s) = σ0 + s (σ1 - σ0),  L*(s) = L0 + s (L1 - L0), or a curve,  s from 0 to 1,

as fast as all of them can: s grows until the first one is at its largest speed, a strain by the
change of its length, a stress by what its walls would have to move (wall_servo.py). So stress
paths are straight whatever the stiffness of the sample along each axis is. Ramps and the speed
that keeps a test quasi-static are in pace.py; towards the end of a strain speeds fall with the root
of what is left of it, at a constant rate over the strain ``ramp``.

A stage ends when a value of ``until`` is passed, or when s = 1, lengths are reached, and all held
stresses are within ``tolerance`` for twice the time T that a wave travels; then ``hold`` begins.
These stresses are means over T, of each wall across the axis, or of opposite ones where something
beside them carries what they differ by (gauges.py). Grains that still rattle between few contacts
shake a wall for long, and without a load of their own. Where ``until`` is passed walls brake first,
over ``ramp``.

Stages until the last one with ``zero`` seat the sample. They end at rest as well, with a kinetic
energy of ``AT_REST`` of the elastic one, and until then grains lose motion at the rate
``STILLED``/T at least. Grains that still move after ``LONGEST`` T are taken so (waiting.py).

Rows of the history fall due by the ways that a stage has come, one for each of what leads it:
s, the changes of lengths that go at a speed, the values of ``until``, and time where it waits and
nobody knows for how long. Each grows alone, so that rows are nowhere farther apart than one
interval of each.

The axes are those of the container: x, y, z of a box; r, along which the length is the diameter,
and z of a cylinder; o and i, of its outer and inner diameter, and z of a hollow one. What shears a
sample goes along the same line (shearing.py).
"""

import math

import numpy as np

from ..errors import InputError, SolverError
from ..machine.ranks import on_first_rank
from ..state import Stateful
from .gauges import Gauges, WallMeans
from .measured_paths import measured_paths, read_motions
from .measures import WallMeasures
from .oedometer import hindrance
from .pace import Paces
from .present_stage import PresentStage
from .quasi_static import HELD, SIDE
from .shearing import shearing_of
from .task_list import Start, tasks_of, walls_moved
from .tasks import WallsNow
from .wall_servo import Servo

STRAIN_DEFINITION = (
    "shortening of the distance between the walls across an axis over that distance at the end of "
    "the last stage with zero = true before (without one: at the start); compression positive"
)

#: Times that a wave travels for which stresses have to stay within their tolerance.
SETTLED = 2.0
#: Damping while the sample is seated over one over that time.
STILLED = 0.5
#: Ways of every stage: s, that of lengths, and of time where it waits.
NUM_WAYS = 3


class StagedLoading(Stateful):
    """Moves the walls of a simulation through stages. Collective but for plain numbers.

    Args:
        simulation: :class:`~.Simulation` with the walls of a container.
        settings: :class:`~mufe_fenicsx.scene.stages.Loading`.
        program: Its :class:`~mufe_fenicsx.scene.stages.Stage` s, with their names.
        quasi_static: Settings of a speed that adapts (scene.QuasiStatic), or None.
        measures: :class:`~.measures.WallMeasures` of what surrounds the sample; None: of its walls.

    Raises:
        InputError: A file that a stage follows cannot be used; on all ranks.
    """

    end = "last stage done"
    strain_definition = STRAIN_DEFINITION

    STATE = {"common": ("index", "stages", "first_height", "_speed")}

    def __init__(self, simulation, settings, program, quasi_static=None, measures=None):
        self.simulation, self.settings, self.program = simulation, settings, program
        self.measures = WallMeasures(simulation) if measures is None else measures
        self.container = self.measures.container
        self.shearing = shearing_of(simulation, self.container, settings, program)
        self.gauges = Gauges(self.measures, self.shearing)
        self.servo = Servo(simulation, self.measures)
        self.paces = Paces(simulation, self.container, settings, quasi_static)
        if self.control is not None and self.measures.lags:
            self.control.lack_of_held = self._lack_of_held
        #: Motions that stages follow: number of the stage -> :class:`~.measured.Measured`.
        self.motions = self._read_motions()
        zeros = [number for number, stage in enumerate(program) if stage.zero]
        self._last_zero = max(zeros, default=-1)
        self.first_height = self.height
        self._speed = 0.0
        self._updated, self._loads, self._parts = -1, None, []
        self.stages = []
        self.index = -1
        self._now = None
        self._begin(np.zeros(len(self.container.walls)))

    def _read_motions(self):
        """The files of all stages, on all ranks. Collective."""
        comm = self.simulation.comm
        found = on_first_rank(comm, lambda: read_motions(self.program, self.container))
        return comm.bcast(found)

    # --- what others read -----------------------------------------------------------------

    @property
    def control(self):
        """The speed that adapts, or None."""
        return self.paces.control

    @property
    def columns(self):
        """Of history.csv beyond the usual ones."""
        return (*self.gauges.columns, *(f"target_{axis}" for axis in self.container.axes))

    @property
    def strain(self):
        """Vertical strain."""
        return float(self.gauges.strains[-1])

    @property
    def height(self):
        """Distance of top and bottom wall [m]."""
        return float(self.gauges.lengths[-1])

    @property
    def reference_height(self):
        """That distance at strain 0 [m]."""
        return self.gauges.reference[-1]

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

    def take_notice(self):
        """A line for who runs the test, said once, or None. Local."""
        notice, self._now.waiting.notice = self._now.waiting.notice, None
        return notice

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
        """Course between two of ``count`` rows of the test, shared evenly by its stages."""
        return 1.0 / math.ceil((count - 1) / len(self.program))

    def state_interval(self, count):
        """Stages between two of ``count`` stored states: one over a whole number, or a whole one.

        States are ends of stages or lie within them, so that cycles are seen at the same phase.
        """
        num = len(self.program) - 1 - self._last_zero
        if count - 1 < num:
            return float(math.ceil(num / max(count - 1, 1)))
        return self.interval(count)

    def state_course(self, interval):
        """What states fall due by: stages done since the sample is seated. Collective.

        It is as much larger as makes the end of the last one a multiple of ``interval``, but for
        the start, 0.
        """
        done = self.index - self._last_zero - 1 + self.progress
        num = len(self.program) - 1 - self._last_zero
        return done + (-num) % interval if done > 0.0 and interval > 1.0 else done

    def row(self, forces):
        """Columns of history.csv that this loading adds, and those that it defines itself.

        Args:
            forces: On the walls [N], shape (num_walls,).
        """
        targets = zip(self.container.axes, self._stresses_to_carry(), strict=True)
        return self.gauges.row(forces) | {f"target_{a}": target or 0.0 for a, target in targets}

    def state_dict(self):
        """What a loading that goes on from here has to know, fit for JSON."""
        kept = super().state_dict() | {
            "now": self._now.state_dict(),
            "gauges": self.gauges.state_dict(),
            "mean": self.gauges.means.state_dict(),
            "servo": self.servo.state_dict(),
            "shearing": self.shearing.state_dict(),
            "motions": {str(n): motion.checksum for n, motion in self.motions.items()},
        }
        return kept if self.control is None else kept | {"control": self.control.state_dict()}

    def load_state_dict(self, kept):
        """Go on from what :meth:`state_dict` gave.

        Raises:
            InputError: A file that has been followed is another one now.
        """
        super().load_state_dict({"common": kept["common"]})
        for number, motion in self.motions.items():
            if number <= self.index and kept["motions"].get(str(number)) != motion.checksum:
                raise InputError(
                    f'{motion.path} has changed, expected what stage "{self.program[number].name}" '
                    "of the run has followed"
                )
        if kept.get("shearing"):  # else no stage so far had any
            self.shearing.load_state_dict(kept["shearing"])
        self.shearing.take(self.program[self.index])
        self._now.load_state_dict(kept["now"])
        self.gauges.load_state_dict(kept["gauges"])
        self.gauges.means.load_state_dict(kept["mean"])
        self.servo.load_state_dict(kept["servo"])
        self._updated = -1
        self.tasks = self._tasks()
        if self.control is not None:
            self.control.load_state_dict(kept["control"])
            self.paces.lead(self.tasks)

    # --- stages ---------------------------------------------------------------------------

    def before_step(self):
        """Set the speeds of the walls and change stage when it is time. Collective."""
        if self._is_over() and self.index + 1 < len(self.program):
            self._begin(self._loads[0])
        self._still()
        self._move()

    def _still(self):
        """Take the motion of grains while the sample is seated, beside what the scene states."""
        travel, least = self.servo.travel_time, 0.0
        if not self.loaded and self._now.led_until is not None and travel > 0.0:
            least = STILLED / travel
        self.simulation.damping = max(self.servo.damping, least)

    def leave(self, notice=None):
        """Leave the grains to the damping that the scene states, with a line or None. Local."""
        self.simulation.damping = self.servo.damping
        self._now.waiting.notice = self._now.waiting.notice or notice

    def _begin(self, forces):
        """Begin the next stage."""
        gauges, state, held = self.gauges, self.simulation.state, None
        if self._now is not None:
            means = gauges.mean_stress()
            held = [task.target(self._now.s, means) for task in self.tasks]
            if self.program[self.index].zero:
                gauges.set_zero()
        self.index += 1
        stage, stress = self.program[self.index], gauges.axis_stress(forces)
        for name, motion in stage.tools.items():
            self.simulation.tools.set_motion(name, state.t, motion.rates, motion.loads, motion.ramp)
        of_walls = gauges.wall_stress(forces)
        if self.index == 0:
            gauges.means = WallMeans(of_walls.tolist(), state.t)
        of_walls = gauges.led(of_walls)
        held = [None] * len(stress) if held is None else held
        stress0 = [
            float(of_walls[list(walls_moved(stage, self.container, a))].mean()) if h is None else h
            for a, h in enumerate(held)
        ]
        self.shearing.begin(stage)
        ways = [0.0] * (NUM_WAYS + len(self._given))
        lengths, places = gauges.lengths.tolist(), gauges.places.tolist()
        self._now = PresentStage(state.t, lengths, places, stress0, held, ways)
        self.tasks = self._tasks()
        gauges.shut([task.axis for task in self.tasks if task.keeps_volume], stress0)
        self._now.values0 = gauges.values(gauges.mean_stress(), state.t)
        self._updated, self._parts = -1, []
        self.paces.begin(self.tasks, self.loaded, self._speed_of_servos())
        self.stages.append(
            {
                "name": self.stage,
                "step": state.num_steps,
                "time": state.t,
                "strain": self.strain,
                "strains": gauges.strains.tolist(),
                "stresses": stress.tolist(),
                **self.shearing.values(),
            }
        )

    def _tasks(self):
        """What the axes do in this stage, from what it began with."""
        now, container, reference = self._now, self.container, self.gauges.reference
        start = Start(container, now.held, now.stress0, now.length0, reference, self.settings.speed)
        motion = self.motions.get(self.index)
        paths = measured_paths(motion, container, now.length0, reference)
        return tasks_of(self.program[self.index], paths, start)

    def _part_led(self):
        """How far the leading part of the stage has come, from 0 to 1."""
        parts = [self._now.s] if any(task.ends for task in self._all) else []
        parts += self._parts
        return min(max(max(parts, default=0.0), 0.0), 1.0)

    @property
    def _given(self):
        """The values of `until` of this stage, by name."""
        until = self.program[self.index].until
        return {} if until is None else until.given

    def _parts_of_until(self):
        """How far each value of `until` has come; 1 where it is passed."""
        if not self._given:
            return []
        now = self.gauges.values(self.gauges.mean_stress(), self._now.begun)
        before = self._now.values0
        ways = {name: value - before[name] for name, value in self._given.items()}
        return [(now[n] - before[n]) / way if way else 1.0 for n, way in ways.items()]

    def _come(self, lengths, t):
        """Add to the ways of this stage what has been done since, each of which only grows."""
        most = self.settings.largest_strain
        shares = [
            abs(1.0 - lengths[a] / self._now.length0[a]) / most
            for a, task in enumerate(self.tasks)
            if task.free
        ]
        led = self._now.hold_from if "time" in self._given else self._now.led_until
        until = t if led is None else led
        # Rows are as near at first as before it waits, and as many each time that it has waited
        # e times as long: few grains may rattle for long.
        wait = max(self.program[self.index].hold, SETTLED * self.servo.travel_time)
        whole = max(until - self._now.begun, wait, self.paces.ramp_time(self._now))
        waited = math.log1p((t - until) / whole) if whole > 0.0 else 0.0
        now = [self._now.s, max(shares, default=0.0), waited]
        now += self._parts
        self._now.ways = [float(max(a, b)) for a, b in zip(self._now.ways, now, strict=True)]

    def _is_led(self):
        """Whether walls are on the way to what the stage is to reach, or go at a speed."""
        on_line = self._now.s < 1.0 and any(task.goes for task in self._all)
        return on_line or any(task.driven for task in self._all)

    @property
    def _all(self):
        """Tasks of the axes, and what shears the sample."""
        return (*self.tasks, self.shearing)

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
        self._loads = forces, _ = self.measures.pressing()
        gauges, now = self.gauges, self._now
        stress, lengths = gauges.axis_stress(forces), gauges.lengths
        self.servo.sample(stress, lengths)
        gauges.means.add(gauges.wall_stress(forces), t, self.servo.travel_time)
        self.shearing.sample(t, self.servo.travel_time)
        self._parts = self._parts_of_until()
        self._check_lengths(stress, lengths)
        self._come(lengths, t)
        near = now.s == 1.0 or not any(task.goes for task in self._all)
        near &= self.shearing.is_there
        if not self.loaded and any(task.servo for task in self.tasks):
            near &= now.waiting.rests(self.stage, self.servo.kinetic, self.waves_waited(t))
        means, axis_means = gauges.led(np.asarray(gauges.means.stress)), gauges.mean_stress()
        for task in self.tasks:
            near &= task.is_there(means, axis_means, lengths, self.settings.tolerance)
        now.settled = (t if now.settled is None else now.settled) if near else None
        if now.led_until is None and not self._is_led():
            now.led_until = t
        if now.hold_from is None:
            self._look_for_end(t)

    def waves_waited(self, t):
        """Times that a wave travels since walls had reached what they go to, at the time t [s]."""
        led, travel = self._now.led_until, self.servo.travel_time
        return 0.0 if led is None or not travel > 0.0 else (t - led) / travel

    def _look_for_end(self, t):
        """Let `hold` begin where the stage has reached what it is to reach, or `until`."""
        now, stage, tasks = self._now, self.program[self.index], self.tasks
        at_speed = any(task.at_speed for task in self._all)
        ends = any(task.ends for task in self._all)
        ends_itself = ends or not (stage.until is not None or at_speed)
        travel = self.servo.travel_time
        if ends_itself and now.settled is None:
            self._look_whether_it_waits(t)
        if ends_itself and now.settled is not None:
            servo = any(task.servo for task in tasks)
            wait = SETTLED * travel if servo else 0.0
            if t - now.settled >= wait:
                now.hold_from = t
        if now.brake_from is None and any(part >= 1.0 for part in self._parts):
            now.brake_from = t
            if now.led_until is None:
                now.led_until = t
        braked = self.paces.ramp_time(now) if self._is_led() else 0.0
        if now.brake_from is not None and t - now.brake_from >= braked:
            now.hold_from = t

    def _look_whether_it_waits(self, t):
        """Make a notice where the sample is at rest without the stresses that it is to reach.

        Raises:
            SolverError: A seating has not got there for long.
        """
        if not self.loaded:
            self._now.waiting.check(self.stage, self.gauges.means.stress, self.waves_waited(t))
        if not self._now.waiting.is_due(t, self.servo.travel_time):
            return
        means, tolerance = self.gauges.mean_stress(), self.settings.tolerance
        lacks = {}
        for task in self.tasks:
            if task.servo:
                target = task.target(1.0, means)
                lacks[task.axis] = abs(means[task.axis] - target), target
        if not lacks:
            return
        allowed = tolerance * min(target for _, target in lacks.values())
        if not self._now.waiting.look(t, self.servo, self.gauges.lengths, allowed):
            return
        a = max(lacks, key=lambda axis: lacks[axis][0])
        self._now.waiting.notice = (
            f'stage "{self.stage}" waits at rest: stress_{self.container.axes[a]} = '
            f"{means[a] / 1e3:.5g} kPa, expected {lacks[a][1] / 1e3:.5g} kPa for "
            f"{SETTLED:g} travel times of a wave within loading.tolerance = {tolerance:g}: stop, "
            "raise that, and --resume; where grains rattle raise solver.damping in a new run"
        )

    def _check_lengths(self, stress, lengths):
        """Raise SolverError where the sample cannot carry what it is to carry."""
        limit, axes, means = self.settings.largest_strain, self.container.axes, None
        for a, task in enumerate(self.tasks):
            change = 1.0 - lengths[a] / self._now.length0[a]
            if task.free and abs(change) > limit:
                what = hindrance(self.simulation) or (
                    "see that the sample fills its walls and can carry what is asked"
                )
                raise SolverError(
                    f'stage "{self.stage}": the length along {axes[a]} changed by {change:.1%} at '
                    f"a stress of {stress[a]:.3g} Pa there (loading.largest_strain = {limit:g}): "
                    f"{what}"
                )
            if task.servo:
                means = self.gauges.mean_stress() if means is None else means
                if (target := task.target(self._now.s, means)) < 0.0:
                    raise SolverError(
                        f'stage "{self.stage}": at stress_z = {means[-1]:.3g} Pa the mean stress '
                        f"asks for a stress of {target:.3g} Pa along {axes[a]}, expected q < 3 p"
                    )

    def _stresses_to_carry(self):
        """Of the axes, at what these carry in the mean [Pa]; None where that is free."""
        means = self.gauges.mean_stress()
        return [task.target(self._now.s, means) for task in self.tasks]

    def _lack_of_held(self):
        """What the stress of walls that hold one is off, over it, of the worst axis [-]."""
        means = self.gauges.mean_stress()
        off = (means[a] / target - 1.0 for a, target in self._held_stresses(means))
        return float(max(map(abs, off), default=0.0))

    def _held_stresses(self, means):
        """(axis, stress [Pa]) of what servos hold in this stage, at mean stresses of the axes."""
        held = [task for task in self.tasks if task.servo and not task.goes]
        targets = ((task.axis, task.target(self._now.s, means)) for task in held)
        return [(axis, target) for axis, target in targets if target]

    def _speed_of_servos(self):
        """Speed of loading at which these would be off by what is allowed [m/s]."""
        if not (self.servo.impedance > 0.0 and self.measures.lags):
            return math.inf
        stresses = [target for _, target in self._held_stresses(self.gauges.mean_stress())]
        return HELD * min(stresses, default=math.inf) / (SIDE * self.servo.impedance)

    # --- walls ----------------------------------------------------------------------------

    def _move(self):
        """Velocities of the walls for the coming step."""
        sim, now, gauges = self.simulation, self._now, self.gauges
        forces, stiffness = self._loads
        lengths = gauges.lengths
        area = self.container.areas_of_walls(lengths)
        stress, gain = gauges.axis_stress(forces), self.measures.gains(self.servo, stiffness, area)
        walls = WallsNow(
            lengths, stress, gauges.led(gauges.wall_stress(forces)), stiffness, gain,
            gauges.places - now.places0, sim.dt,
        )  # fmt: skip
        pace = self.paces.pace(now, self.tasks, gauges.strains, self.loaded, self.shearing)
        if pace.leading:
            furthest = (task.furthest(now.s, walls, pace) for task in self.tasks)
            sheared = self.shearing.next_s(now.s, pace.factor, pace.ramp)
            now.s = max(now.s, min(1.0, sheared, *furthest))
        velocity = np.zeros(len(area))  # of each wall towards the sample
        for task in self.tasks:
            if not task.keeps_volume:
                velocity[list(task.walls)] = task.speeds(now.s, walls, pace)
        closing = self.container.closing(velocity)
        for task in self.tasks:
            if task.keeps_volume:  # goes with the others
                velocity[list(task.walls)] = task.speeds(now.s, walls, pace, closing)
        self.measures.lead(velocity, self._stresses_to_carry)
        speed = self.shearing.move(now.s if pace.leading else None, pace.factor, velocity)
        self._speed = max(speed, float(np.abs(self.container.closing(velocity)).max()))
