"""The oedometer test as a sequence of stages that drive the top platen.

Strain is the shortening of the distance between top and bottom platen over that
distance at the end of the seating stage, positive in compression: gaps that the
segmentation left are closed by the seating and do not count. There the top platen comes down until
both platens carry the seating stress; with ``seating_at_rest`` a servo holds that until all is at
rest (stages.py), and the platen begins anew from there. Increments end at that stress to ``SEATED``
of it, and where the strain of the test is reached.
"""

import math

import numpy as np
from mpi4py import MPI

from ..container import BOTTOM, TOP
from ..errors import SolverError
from ..state import Stateful
from .measures import WallMeasures
from .quasi_static import QuasiStaticSpeed
from .waiting import LONGEST

SEATING, LOADING = "seating", "loading"

STRAIN_DEFINITION = (
    "shortening of the distance between top and bottom platen over that distance at the end of "
    "the seating stage (the first step at which both carry the seating stress, or at rest after "
    "that); compression positive"
)

#: The seating stage gives up when the platens have approached by this part of their distance.
LARGEST_SEATING = 0.25
#: Part of the seating force by which an increment may go beyond it.
SEATED = 0.01
#: Part of the strain of the test to which it is reached.
EXACT = 1e-9
#: Part of the work of the walls that damping takes where it is what a test fails by.
OVERDAMPED = 0.5
#: Speed of a wall over that of waves in the grains, from which on these do not follow it.
TOO_FAST = 0.05


def smooth_step(s):
    """0 below 0, 1 above 1, between them the quintic with two vanishing derivatives."""
    s = min(max(s, 0.0), 1.0)
    return s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)


def hindrance(simulation):
    """What to do about walls or damping that keep grains from following; "" if none. Collective."""
    speed = float(np.linalg.norm(simulation.walls.velocity, axis=1).max(initial=0.0))
    wave = float(simulation.solid.wave_speed.min(initial=math.inf))
    part = speed / simulation.comm.allreduce(wave, op=MPI.MIN)
    if part > TOO_FAST:
        return f"walls move at {part:.0%} of the speed of waves in the grains: load more slowly"
    energies = simulation.energies()
    damped, work = energies["damping"], energies["work"]
    if not 0.0 < OVERDAMPED * work < damped:
        return ""
    return (
        f"solver.damping = {simulation.damping:g} 1/s takes {damped / work:.0%} of the work of the "
        "walls, and grains move as through a viscous fluid: lower it"
    )


class OedometerLoading(Stateful):
    """Moves the top platen of a simulation through seating and loading.

    Args:
        simulation: :class:`~.Simulation` with walls z_min and z_max.
        strain: Strain at which the test ends.
        speed: Speed of the top platen [m/s].
        ramp: Strain over which the speed rises smoothly, at the start of each stage.
        seating_force: Force on top and bottom that ends the seating [N].
        seating_speed: Speed of the top platen while seating [m/s].
        quasi_static: Settings of a speed that adapts (scene.QuasiStatic), from the end of the
            seating on; None: ``speed`` throughout, reached over ``ramp``.
        make_hold: Makes the :class:`~.stages.StagedLoading` by which the platen holds that force,
            once both carry it, until all is at rest; None: the seating ends at that step.
    """

    columns = ()  #: of history.csv beyond the usual ones
    end = "final strain reached"  #: why a test stops that does all it should
    strain_definition = STRAIN_DEFINITION

    STATE = {
        "common": (
            "stage",
            "stages",
            "first_height",
            "reference_height",
            "_speed",
            "_speed_at_start",
        )
    }

    def __init__(
        self, simulation, strain, speed, ramp, seating_force, seating_speed, quasi_static=None,
        make_hold=None,
    ):  # fmt: skip
        self.simulation = simulation
        self.final_strain, self.speed, self.ramp = strain, speed, ramp
        self.seating_force, self.seating_speed = seating_force, seating_speed
        walls = simulation.walls
        self.measures = WallMeasures(simulation)
        self.container = self.measures.container
        self._top, self._bottom = walls.names.index(TOP), walls.names.index(BOTTOM)
        self.control = None
        if quasi_static is not None:
            self.control = QuasiStaticSpeed(simulation, quasi_static, self._top, self._bottom)
        self.first_height = self.height
        self.reference_height = self.first_height
        self._speed = self._speed_at_start = 0.0
        self._make_hold, self._hold = make_hold, None
        self._held = self._held_stresses()
        self.stage = SEATING
        self.stages = [self._note()]

    @property
    def height(self):
        """Distance of top and bottom platen [m]."""
        points = self.simulation.walls.point
        return points[self._top, 2] - points[self._bottom, 2]

    @property
    def strain(self):
        """Strain since the end of the seating; zero while it lasts."""
        return 0.0 if self.stage == SEATING else self.progress

    @property
    def progress(self):
        """How far the present stage has come: the height lost over the reference height [-]."""
        return 1.0 - self.height / self.reference_height

    def take_notice(self):
        """What there is to tell of the hold that ends the seating, once, or None. Local."""
        return None if self._hold is None else self._hold.take_notice()

    @property
    def speed_now(self):
        """Speed of the top platen in the last step [m/s]."""
        return self._speed

    @property
    def loaded(self):
        """Whether the seating is over."""
        return self.stage == LOADING

    @property
    def part_done(self):
        """Of the whole test."""
        return self.strain / self.final_strain

    @property
    def course(self):
        """What rows of the history fall due by: the progress."""
        return self.progress

    def interval(self, count):
        """Progress between two of ``count`` records of the loading stage."""
        return self.final_strain / (count - 1)

    def state_interval(self, count):
        """The same between two of ``count`` stored states."""
        return self.interval(count)

    def state_course(self, interval):
        """What stored states fall due by: the progress of the loading stage."""
        return self.progress

    def row(self, forces):
        """Columns of history.csv that this loading adds: none."""
        return {}

    @property
    def finished(self):
        """Whether the strain of the test is reached."""
        return self.stage == LOADING and self.progress >= self.final_strain * (1.0 - EXACT)

    def state_dict(self):
        """What a loading that goes on from here has to know, fit for JSON."""
        kept = super().state_dict()
        if self._hold is not None and self.stage == SEATING:
            kept["hold"] = self._hold.state_dict()
        return kept if self.control is None else kept | {"control": self.control.state_dict()}

    def load_state_dict(self, kept):
        """Go on from what :meth:`state_dict` gave."""
        super().load_state_dict({"common": kept["common"]})
        if "hold" in kept:
            self._hold = self._make_hold()
            self._hold.load_state_dict(kept["hold"])
        if self.control is not None:
            if "control" in kept:
                self.control.load_state_dict(kept["control"])
            elif self.stage == LOADING:  # the speed was constant before
                self.control.begin(self._speed)

    def _note(self):
        state = self.simulation.state
        return {"name": self.stage, "step": state.num_steps, "time": state.t, "strain": 0.0}

    def _held_stresses(self):
        """Walls that hold a force, each with its number and the stress that this is now [Pa]."""
        walls = self.simulation.walls
        if self.container is None:
            return []
        areas = self._areas()
        return [
            (i, wall, wall.target / areas[i])
            for i, wall in enumerate(walls.walls)
            if wall.target is not None
        ]

    def _areas(self):
        """Of the walls of the container, between those around them [m²], shape (num_walls,)."""
        return self.container.areas_of_walls(self.measures.lengths())

    def before_step(self):
        """Set the speed of the platen and change stage when it is time. Collective."""
        if self._held:
            areas = self._areas()
            for i, wall, stress in self._held:
                wall.target = stress * areas[i]
        if self.stage == SEATING:
            self._seat()
        if self.stage == LOADING and self.control is not None:
            self._speed = self.control(self.progress)
        elif self.stage == LOADING:
            start = self._speed_at_start
            self._speed = start + (self.speed - start) * smooth_step(self._part_of_ramp())
        elif self._hold is not None:
            return
        self.simulation.walls.velocity[self._top, 2] = -self._speed
        if self.simulation.increments:
            self._bound_increment()

    def _part_of_ramp(self):
        """How far the speed is on its way: by the strain, or from rest by the time that takes."""
        part = self.progress
        if self._speed_at_start == 0.0:
            since = self.simulation.state.t + 0.5 * self.simulation.dt - self.stages[-1]["time"]
            part = since * self.speed / self.reference_height
        return part / self.ramp if self.ramp > 0.0 else 1.0

    def _seat(self):
        """One step of the seating, or its end. Collective."""
        if self._hold is None and self._carried() < self.seating_force:
            self._check_seating()
            ramp_time = self.ramp * self.first_height / self.seating_speed
            s = self.simulation.state.t / ramp_time if ramp_time > 0 else 1.0
            self._speed = self.seating_speed * smooth_step(s)
            return
        if self._make_hold is None:
            self._begin_loading(self._speed)
            return
        self._hold = self._hold or self._make_hold()
        waited = self._hold.waves_waited(self.simulation.state.t)
        if self._hold.finished or waited > LONGEST:
            self._hold.leave(self._lack(waited))
            self._begin_loading(0.0)
        else:
            self._hold.before_step()
            self._speed = self._hold.speed_now

    def _lack(self, waited):
        """A line where the hold was given up, or None."""
        if waited <= LONGEST:
            return None
        stress = self._carried() / self.seating_force
        return (
            f"the sample carries {stress:.2g} of the seating stress after {LONGEST:g} times that a "
            "wave travels, expected all of it: the test begins with that; a denser packing or more "
            "oedometer.seating_stress may hold it"
        )

    def _begin_loading(self, speed):
        """Strain counts from here; the platen has a speed [m/s]."""
        self.stage = LOADING
        self.reference_height = self.height
        self._speed = self._speed_at_start = speed
        self.stages.append(self._note())
        if self.control is not None:
            self.control.begin(max(speed, self.control.settings.slowest))

    def _check_seating(self):
        """Raise SolverError where the platen has come far and meets nothing. Collective."""
        if self.progress > LARGEST_SEATING:
            what = hindrance(self.simulation) or (
                "lower oedometer.seating_stress, or check that the sample fills its walls"
            )
            raise SolverError(
                f"after {LARGEST_SEATING:.0%} of the height top and bottom do not both carry "
                f"the seating force of {self.seating_force:.3g} N: {what}"
            )

    def _carried(self):
        """Force that both platens carry [N]. Collective."""
        forces = self.simulation.wall_forces()
        return min(forces[self._top], forces[self._bottom])

    def _bound_increment(self):
        """The coming increment ends with its stage, at the latest."""
        end = self.simulation.end
        if self.stage == SEATING:
            most = (1.0 + SEATED) * self.seating_force
            end.aim(passed=lambda: self._carried() > most)
        else:
            left = (self.final_strain - self.progress) * self.reference_height
            end.aim(longest=left / self._speed)
