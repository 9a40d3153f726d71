"""How fast a wall moves that is to carry a stress.

A wall that carries σ and shall carry σ* moves towards the sample by

    v = g (σ* - σ),  g = min( 1/(ρ c), α A/(K Δt) ),

never faster than it may. The first gain is that of a viscous boundary under a dead load (Lysmer
& Kuhlemeyer 1969): waves that meet the wall do not come back, and the stress of a sample of
length L between two such walls gets to σ* as exp(-2 t c/L), of one such wall as exp(-t c/L).
The sample's ρ c is measured as it goes on: with the mass m, the energy U in springs and in
elastic strain (of the grains, not of a membrane), and the stresses σj of the three axes it is that
of a solid of the same stresses and energy, M = V Σ σj²/2U, so that

    ρ c = √(ρ M) = √( m Σ σj² / 2U ).

The second gain is the bound of stability, that of the servo walls of PFC (Itasca, PFC
documentation, wall servo: G = α A/(k N Δt), α = 0.5); YADE's TriaxialStressController divides the
lacking force by the same stiffness. K is the stiffness of all contacts on the wall, so
that a step changes the stress by at most the part α of what it lacks. With the mass of the nodes
in contact that is stable below α = 2 - (ω Δt)²/2 (theory.servo), which is 1 at the longest
time step that contacts allow.
"""

import math

import numpy as np

from ..contact.walls import SERVO_GAIN
from ..state import Stateful

#: Samples of ρ c in the time that a wave travels through the sample.
SAMPLES = 8
#: Steps between two of them before there is one.
FIRST_STEPS = 32
#: Largest change of ρ c from one to the next, and of the time between two. ρ c may change as much
#: as the stresses have grown: a sample that carries next to nothing says little.
CHANGE = 2.0


def energy_in_sample(simulation):
    """Elastic energy of grains, of their contacts, and of those with walls [J]. Collective.

    A sleeve, and contacts with it, yield as its rubber does: theirs is left out.
    """
    mesh, left_out = simulation.mesh, None
    elastic = simulation.solid.elastic_energy(simulation.state)
    if mesh.sleeves:
        left_out = np.zeros(mesh.labels.size, dtype=bool)
        left_out[mesh.num_sample_grains : mesh.first_tool] = True
        elastic[left_out[mesh.grains]] = 0.0
    contact, _ = simulation.contact.energy(left_out)
    return float(simulation.comm.allreduce(np.array([elastic.sum(), contact])).sum())


class Servo(Stateful):
    """Gains of the walls of a simulation. Collective.

    Args:
        simulation: :class:`~mufe_fenicsx.explicit.simulation.Simulation`.
        measures: :class:`~.measures.WallMeasures` of what surrounds the sample.
    """

    STATE = {
        "common": ("impedance", "travel_time", "share", "kinetic", "_next", "_interval", "_carried")
    }

    def __init__(self, simulation, measures):
        self.simulation, self.measures = simulation, measures
        self.container = measures.container
        self.damping = simulation.damping  #: that the scene states [1/s]
        self.impedance = 0.0  #: ρ c [Pa s/m]; 0 before the sample carries anything
        self.travel_time = 0.0  #: of a wave through the sample along its shortest length [s]
        #: Part of the stress of the side that the grains carry, from 0 to 1: not all of it where a
        #: membrane closes a gap.
        self.share = 0.0
        self.kinetic = 0.0  #: kinetic energy over that of :func:`energy_in_sample`
        self._next, self._interval = 0.0, 0.0  # next sample, and time since the last one [s]
        self._carried = 0.0  # largest root of Σ σj² so far [Pa]

    def sample(self, stress, lengths):
        """Measure ρ c where that is due. Collective.

        Args:
            stress: Along the axes [Pa], shape (num_axes,).
            lengths: Of the sample [m], shape (num_axes,).
        """
        sim = self.simulation
        t = sim.state.t
        if t < self._next:
            return
        energy = energy_in_sample(sim)
        carried = self.measures.carried(stress)
        square = float((self.container.three_stresses(carried, lengths) ** 2).sum())
        interval = FIRST_STEPS * sim.dt
        self.share = min(max(float(carried[0] / stress[0]), 0.0), 1.0) if stress[0] > 0.0 else 0.0
        moving = sim.comm.allreduce(float(sim.kinetic_energy()))
        self.kinetic = moving / energy if energy > 0.0 else math.inf
        if energy > 0.0 and square > 0.0:
            mass, now = sim.mass_of_grains(), math.sqrt(square)
            found = now * math.sqrt(mass / (2.0 * energy))
            before = self.impedance or found
            change = max(CHANGE, now / self._carried) if self._carried > 0.0 else math.inf
            self.impedance = min(max(found, before / change), before * change)
            self._carried = max(self._carried, now)
            density = mass / float(self.container.volume(lengths))
            shortest = self.container.shortest(lengths)
            self.travel_time = shortest * density / self.impedance
            interval = max(interval, min(self.travel_time / SAMPLES, CHANGE * self._interval))
        self._next, self._interval = t + interval, interval

    def gains(self, stiffness, area):
        """Speed over lack of stress of each wall [m/(s Pa)], (num_walls,).

        That of walls which are free is inf until some contact carries.

        Args:
            stiffness: Of the contacts on each wall [N/m], shape (num_walls,).
            area: Of each wall [m²], shape (num_walls,).
        """
        bound = np.full(stiffness.shape, np.inf)
        touched = stiffness > 0.0
        bound[touched] = SERVO_GAIN * area[touched] / (stiffness[touched] * self.simulation.dt)
        return np.minimum(bound, 1.0 / self.impedance) if self.impedance > 0.0 else bound
