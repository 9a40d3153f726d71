"""The apparatus of a test by stages: walls that are led, and gauges on them.

Gauges measure stresses and strains (gauges.py), servos bring walls to stresses (wall_servo.py), a
drive shears the sample (shearing.py), and the pace says how fast all of them may go (pace.py).
"""

import math

import numpy as np

from .gauges import Gauges, WallMeans
from .measured_paths import measured_paths
from .pace import Paces
from .present_stage import PresentStage
from .quasi_static import HELD, SIDE
from .shearing import shearing_of
from .task_list import Start, tasks_of, walls_moved
from .tasks import WallsNow
from .wall_servo import Servo

#: Damping while the sample is seated over one over the time that a wave travels.
STILLED = 0.5


class Apparatus:
    """Leads the walls of a container, and measures on them. Collective but for plain numbers.

    Args:
        simulation, settings, program, quasi_static: As of :class:`~.stages.StagedLoading`.
        measures: :class:`~.measures.WallMeasures` of what surrounds the sample.

    Attributes:
        forces, stiffness: Normal forces [N], and stiffness of the contacts [N/m], of the walls
            when :meth:`sample` looked last, shape (num_walls,).
    """

    def __init__(self, simulation, settings, program, quasi_static, measures):
        self.simulation, self.settings, self.measures = simulation, settings, measures
        self.container = container = measures.container
        self.shearing = shearing_of(simulation, container, settings, program)
        self.gauges = Gauges(measures, self.shearing)
        self.servo = Servo(simulation, measures)
        self.paces = Paces(simulation, container, settings, quasi_static)
        self.forces, self.stiffness = np.zeros(len(container.walls)), None

    def state_dict(self):
        """What a test that goes on from here has to know, by part, fit for JSON."""
        return {
            "gauges": self.gauges.state_dict(),
            "mean": self.gauges.means.state_dict(),
            "servo": self.servo.state_dict(),
            "shearing": self.shearing.state_dict(),
        } | self.paces.state_dict()

    def load_state_dict(self, kept, stage):
        """Go on in a stage from what :meth:`state_dict` gave, before that has its tasks."""
        if kept.get("shearing"):  # else no stage so far had any
            self.shearing.load_state_dict(kept["shearing"])
        self.shearing.take(stage)
        self.gauges.load_state_dict(kept["gauges"])
        self.gauges.means.load_state_dict(kept["mean"])
        self.servo.load_state_dict(kept["servo"])

    # --- a stage --------------------------------------------------------------------------

    def begin(self, stage, motion, held, forces):
        """Begin a stage.

        Args:
            stage: :class:`~mufe_fenicsx.scene.stages.Stage`.
            motion: :class:`~.measured.Measured` that it follows, or None.
            held: Stress that each axis holds [Pa], None where that is free; None: the first stage.
            forces: On the walls [N], shape (num_walls,).

        Returns:
            :class:`~.present_stage.PresentStage`.
        """
        gauges, t = self.gauges, self.simulation.state.t
        for name, tool in stage.tools.items():
            self.simulation.tools.set_motion(name, t, tool.rates, tool.loads, tool.ramp)
        of_walls = gauges.wall_stress(forces)
        if held is None:
            gauges.means = WallMeans(of_walls.tolist(), t)
            held = [None] * len(self.container.axes)
        of_walls = gauges.led(of_walls)
        stress = [
            float(of_walls[list(walls_moved(stage, self.container, a))].mean()) if h is None else h
            for a, h in enumerate(held)
        ]
        self.shearing.begin(stage)
        lengths, places = gauges.lengths.tolist(), gauges.places.tolist()
        now = PresentStage(stage, self.shearing, t, lengths, places, stress, held)
        self.set_tasks(now, motion)
        gauges.shut([task.axis for task in now.tasks if task.keeps_volume], stress)
        now.values0 = gauges.values(gauges.mean_stress(), t)
        return now

    def set_tasks(self, now, motion):
        """Tell the present stage the tasks of its axes, from what it began with."""
        container, reference = self.container, self.gauges.reference
        first = now.stress0, now.length0
        start = Start(container, now.held, *first, reference, self.settings.speed)
        paths = measured_paths(motion, container, now.length0, reference)
        now.tasks = tasks_of(now.stage, paths, start)

    def sample(self):
        """Look at the present state. Collective; twice gives the same as once."""
        gauges, servo, t = self.gauges, self.servo, self.simulation.state.t
        self.forces, self.stiffness = self.measures.pressing()
        servo.sample(gauges.axis_stress(self.forces), gauges.lengths)
        gauges.means.add(gauges.wall_stress(self.forces), t, servo.travel_time)
        self.shearing.sample(t, servo.travel_time)

    def still(self, seats):
        """Take the motion of grains while the sample is seated, beside what the scene states."""
        travel = self.servo.travel_time
        least = STILLED / travel if seats and travel > 0.0 else 0.0
        self.simulation.damping = max(self.servo.damping, least)

    def lack_of_held(self, now):
        """What the stress of walls that hold one is off, over it, of the worst axis [-]."""
        means = self.gauges.mean_stress()
        off = (means[a] / target - 1.0 for a, target in now.held_stresses(means))
        return float(max(map(abs, off), default=0.0))

    def speed_of_servos(self, now):
        """Speed of loading at which servos would be off by what is allowed [m/s]."""
        if not (self.servo.impedance > 0.0 and self.measures.lags):
            return math.inf
        stresses = [target for _, target in now.held_stresses(self.gauges.mean_stress())]
        return HELD * min(stresses, default=math.inf) / (SIDE * self.servo.impedance)

    def lead(self, now, loaded):
        """Set the velocities of the walls for the coming step, and how far the stage comes in it.

        Args:
            now: :class:`~.present_stage.PresentStage`.
            loaded: Whether the sample is seated.

        Returns:
            Fastest change of a length [m/s].
        """
        gauges, shearing, container = self.gauges, self.shearing, self.container
        lengths = gauges.lengths
        area = container.areas_of_walls(lengths)
        gain = self.measures.gains(self.servo, self.stiffness, area)
        walls = WallsNow(
            lengths, gauges.axis_stress(self.forces), gauges.led(gauges.wall_stress(self.forces)),
            self.stiffness, gain, gauges.places - now.places0, self.simulation.dt,
        )  # fmt: skip
        pace = self.paces.pace(now, now.tasks, gauges.strains, loaded, shearing)
        if pace.leading:
            furthest = (task.furthest(now.s, walls, pace) for task in now.tasks)
            sheared = shearing.next_s(now.s, pace.factor, pace.ramp)
            now.s = max(now.s, min(1.0, sheared, *furthest))
        velocity = np.zeros(len(area))  # of each wall towards the sample
        for task in now.tasks:
            if not task.keeps_volume:
                velocity[list(task.walls)] = task.speeds(now.s, walls, pace)
        closing = container.closing(velocity)
        for task in now.tasks:
            if task.keeps_volume:  # goes with the others
                velocity[list(task.walls)] = task.speeds(now.s, walls, pace, closing)
        self.measures.lead(velocity, lambda: now.targets(gauges.mean_stress()))
        speed = shearing.move(now.s if pace.leading else None, pace.factor, velocity)
        return max(speed, float(np.abs(container.closing(velocity)).max()))
