"""How long the first stages take, until the sample is seated.

In a box or a rigid cylinder the platen travels until the bottom feels it. Then the sample comes to
rest by the damping of the seating, d/T with T the time of a wave and d = ``STILLED``: its kinetic
energy falls as exp(-d t/T) to the part ``AT_REST``, and two waves end it. Grains
that still turn and slip take longer. In a membrane three things follow each other, H the height and
D the diameter:

- The pressure of the cell rises to σ as fast as the sleeve, which alone carries it, may shrink by
  the speed v, with its stiffness E t:  t₁ = σ D²/(2 E t v).
- Platens close gaps that take the part ε₀ of H, at the speed u of loading:  t₂ = ε₀ H/u.
- Each platen has no inertia and goes at (σ - σz)/ρc (loading.wall_servo). Where σz grows evenly
  over the strain ε, it is within the tolerance τ of σ after  t₃ = ρc H ε/(2 σ) ln(1/τ).

Here ρc is that of elastic balls in contact, and ε that of a linear sample. The end waits for the
time of two waves. Loose grains close further at a stress that stays: how far is not known. At half
of the pressure each part dε of the height takes them the time  dt = ρc H dε/σ.
"""

import math

from ..loading.oedometer import LARGEST_SEATING
from ..loading.stages import SETTLED, STILLED
from ..loading.waiting import AT_REST
from .course import SOLID, speed_under


def seating_time(scene, course, measured):
    """Time until the sample is seated [s]; 0 where walls do not load it.

    Args:
        scene: :class:`~mufe_fenicsx.scene.Scene`.
        course: Its :class:`~.course.Course`.
        measured: Its :class:`~.cost.Benchmark`.
    """
    if not course.presses:
        return 0.0
    if scene.membrane is not None and course.seating_stress > 0.0:
        return _in_a_membrane(scene, course, measured)
    # A ramp of speed that rises smoothly from rest covers half of the way in its time.
    way = min(measured.travel + 0.5 * course.ramp, LARGEST_SEATING)
    found = way * measured.height / course.seating_speed
    if course.seating_stress > 0.0 and _is_held(scene):
        waves = SETTLED - math.log(AT_REST) / STILLED
        found += waves * measured.height / speed_under(scene, course.seating_stress)
    return found


def _is_held(scene):
    """Whether the seating ends at rest."""
    return scene.oedometer is None or scene.oedometer.seating_at_rest


def closing_time(scene, course, measured):
    """Time of the platens for a hundredth of the height, at half of the pressure [s].

    Of a sample in a membrane; 0 of others. Arguments as of :func:`seating_time`.
    """
    if scene.membrane is None or not course.seating_stress > 0.0:
        return 0.0
    return 0.01 * measured.height * _impedance(scene, course) / course.seating_stress


def _impedance(scene, course):
    """ρc at the seating stress [Pa s/m]."""
    return SOLID * scene.material.rho * speed_under(scene, course.seating_stress)


def _in_a_membrane(scene, course, measured):
    sleeve, stress, b = scene.membrane, course.seating_stress, measured
    rises = stress * b.diameter**2 / (2.0 * sleeve.E * sleeve.thickness * course.seating_speed)
    gaps = (b.travel - b.pressed) * b.height / course.speed
    times = max(-math.log(scene.loading.tolerance), 0.0)
    presses = _impedance(scene, course) * b.pressed * b.height / (2.0 * stress) * times
    return rises + gaps + presses + SETTLED * b.height / speed_under(scene, stress)
