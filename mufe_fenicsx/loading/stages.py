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
``STILLED``/T (apparatus.py) at least. Grains that still move after ``LONGEST`` T are taken so
(waiting.py).

Rows of the history fall due by the ways that a stage has come, one for each of what leads it:
s, the changes of lengths that go at a speed, the values of ``until``, and time where it waits and
nobody knows for how long. Each grows alone, so that rows are nowhere farther apart than one
interval of each.

Walls are led by the apparatus (apparatus.py), by what a stage began with (present_stage.py); its
end is looked for in stage_end.py.

The axes are those of the container: x, y, z of a box; r, along which the length is the diameter,
and z of a cylinder; o and i, of its outer and inner diameter, and z of a hollow one. What shears a
sample goes along the same line (shearing.py).
"""

import math

import numpy as np

from ..errors import InputError, SolverError
from ..machine.ranks import on_first_rank
from ..state import Stateful
from .apparatus import Apparatus
from .measured_paths import read_motions
from .measures import WallMeasures
from .present_stage import PresentStage
from .stage_end import StageEnd

STRAIN_DEFINITION = (
    "shortening of the distance between the walls across an axis over that distance at the end of "
    "the last stage with zero = true before (without one: at the start); compression positive"
)


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
        self.simulation, self.program = simulation, program
        self.measures = WallMeasures(simulation) if measures is None else measures
        self.apparatus = Apparatus(simulation, settings, program, quasi_static, self.measures)
        self._end = StageEnd(self.apparatus, settings)
        if self.control is not None and self.measures.lags:
            self.control.lack_of_held = lambda: self.apparatus.lack_of_held(self._now)
        #: Motions that stages follow: number of the stage -> :class:`~.measured.Measured`.
        self.motions = self._read_motions()
        zeros = [number for number, stage in enumerate(program) if stage.zero]
        self._last_zero = max(zeros, default=-1)
        self.first_height = self.height
        self._speed, self._updated = 0.0, -1
        self.stages = []
        self.index = -1
        self._now = None
        self._begin(np.zeros(len(self.measures.container.walls)))

    def _read_motions(self):
        """The files of all stages, on all ranks. Collective."""
        comm = self.simulation.comm
        found = on_first_rank(comm, lambda: read_motions(self.program, self.measures.container))
        return comm.bcast(found)

    # --- what others read -----------------------------------------------------------------

    @property
    def control(self):
        """The speed that adapts, or None."""
        return self.apparatus.paces.control

    @property
    def columns(self):
        """Of history.csv beyond the usual ones."""
        return (*self.apparatus.gauges.columns, *self._targets)

    @property
    def strain(self):
        """Vertical strain."""
        return float(self.apparatus.gauges.strains[-1])

    @property
    def height(self):
        """Distance of top and bottom wall [m]."""
        return float(self.apparatus.gauges.lengths[-1])

    @property
    def reference_height(self):
        """That distance at strain 0 [m]."""
        return self.apparatus.gauges.reference[-1]

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
        now = self._now  # which has gone half its way where it is to come to rest there
        part = max([0.5 * now.s if now.ends else 0.0, *now.parts])
        return (self.index + min(max(part, 0.0), 1.0)) / len(self.program)

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
        return self._now.progress(self.simulation.state.t)

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
        gauges = self.apparatus.gauges
        targets = zip(self._targets, self._now.targets(gauges.mean_stress()), strict=True)
        return gauges.row(forces) | {name: target or 0.0 for name, target in targets}

    def state_dict(self):
        """What a loading that goes on from here has to know, fit for JSON."""
        return super().state_dict() | {
            "now": self._now.state_dict(),
            **self.apparatus.state_dict(),
            "motions": {str(n): motion.checksum for n, motion in self.motions.items()},
        }

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
        stage, apparatus = self.program[self.index], self.apparatus
        apparatus.load_state_dict(kept, stage)
        now = self._now = PresentStage(stage, apparatus.shearing)
        now.load_state_dict(kept["now"])
        apparatus.set_tasks(now, self.motions.get(self.index))
        apparatus.paces.load_state_dict(kept, now.tasks)
        self._updated = -1

    # --- stages ---------------------------------------------------------------------------

    def before_step(self):
        """Set the speeds of the walls and change stage when it is time. Collective."""
        if self._is_over() and self.index + 1 < len(self.program):
            self._begin(self.apparatus.forces)
        self.apparatus.still(not self.loaded and self._now.led_until is not None)
        self._speed = self.apparatus.lead(self._now, self.loaded)

    def leave(self, notice=None):
        """Leave the grains to the damping that the scene states, with a line or None. Local."""
        self.apparatus.still(False)
        self._now.waiting.notice = self._now.waiting.notice or notice

    def waves_waited(self, t):
        """Times that a wave travels since walls had reached what they go to, at the time t [s]."""
        return self._end.waves_waited(self._now, t)

    def _begin(self, forces):
        """Begin the next stage."""
        apparatus, gauges, held = self.apparatus, self.apparatus.gauges, None
        if self._now is not None:
            held = self._now.targets(gauges.mean_stress())
            if self.program[self.index].zero:
                gauges.set_zero()
        self.index += 1
        stage, motion = self.program[self.index], self.motions.get(self.index)
        stress = gauges.axis_stress(forces)
        self._now = apparatus.begin(stage, motion, held, forces)
        if self._now.has_no_end:
            raise SolverError(
                f'stage "{stage.name}": until is missing, expected what ends a stage at a speed '
                "whose strains are there at its start"
            )
        self._updated = -1
        tasks, held = self._now.tasks, apparatus.speed_of_servos(self._now)
        apparatus.paces.begin(tasks, self.loaded, held)
        self.stages.append(
            {
                "name": self.stage,
                "step": self.simulation.state.num_steps,
                "time": self.simulation.state.t,
                "strain": self.strain,
                "strains": gauges.strains.tolist(),
                "stresses": stress.tolist(),
                **apparatus.shearing.values(),
            }
        )

    def _is_over(self):
        """Whether the present stage is over in the present state. Collective."""
        state = self.simulation.state
        if self._updated != state.num_steps:
            self._updated = state.num_steps
            self.apparatus.sample()
            self._end.look(self._now, state.t, self.loaded)
        return self._now.is_over(state.t)

    @property
    def _targets(self):
        """Columns of history.csv of what axes are to carry."""
        return [f"target_{axis}" for axis in self.measures.container.axes]
