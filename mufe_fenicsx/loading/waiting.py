"""Whether a stage waits for a stress or for rest that does not come, said once a stage."""

import numpy as np

from ..errors import SolverError

#: Kinetic over elastic energy of a sample that is seated, at most.
AT_REST = 0.02
#: Times that a wave travels after which a seating without rest is taken as it is, and after which
#: stresses that are not there end the test.
LONGEST, NEVER = 300.0, 3000.0
#: Travel times of a wave over which lengths are compared.
WAVES = 100.0


class Waiting:
    """Looks at one stage that has to reach or to hold stresses; the same on all ranks.

    A servo that lacks Δσ moves its wall at Δσ/ρc, which over 100 T is a strain of 100 Δσ/M, with
    M = ρ c L/T. The sample is at rest where over that time no length has changed by the strain
    Δσ/M of the lack that is allowed.
    """

    def __init__(self):
        self.notice = None  #: a line for who runs the test, until it is taken
        self._from, self._lengths, self._said = None, None, False
        self._moving = False

    def rests(self, name, kinetic, waves):
        """Whether grains of a seating move little enough, or will not come to rest.

        Args:
            name: Of the stage.
            kinetic: Their kinetic energy over the elastic one.
            waves: Times that a wave travels since walls had reached what they go to.
        """
        if kinetic > AT_REST and waves > LONGEST and not self._moving:
            self._moving = True
            self.notice = (
                f'stage "{name}" does not come to rest: kinetic energy is {kinetic:.2g} of the '
                f"elastic, expected {AT_REST:g}; the test begins with it: more stress or "
                "solver.damping may hold grains that slide or roll"
            )
        return kinetic <= AT_REST or waves > LONGEST

    def check(self, name, stresses, waves):
        """Raise SolverError where the walls of a seating do not get to their stresses [Pa]."""
        if waves > NEVER:
            found = ", ".join(f"{x / 1e3:.5g}" for x in stresses)
            raise SolverError(
                f'stage "{name}" has not got to its stresses in {NEVER:g} times that a wave '
                f"travels: walls carry {found} kPa; lower the speed of the seating, or raise "
                "solver.damping or loading.tolerance"
            )

    def is_due(self, t, travel):
        """Whether it is time to look again, a wave needing ``travel`` [s] through the sample."""
        return (
            not self._said
            and travel > 0.0
            and (self._from is None or t - self._from >= WAVES * travel)
        )

    def look(self, t, servo, lengths, allowed):
        """Whether the sample is at rest now, where it is time to look (:meth:`is_due`).

        Args:
            t: Time [s].
            servo: :class:`~.wall_servo.Servo`.
            lengths: Along the axes [m], shape (num_axes,).
            allowed: Lack of stress that is allowed [Pa].
        """
        before, self._from, self._lengths = self._lengths, t, np.array(lengths)
        if before is None:
            return False
        modulus = servo.impedance * float(lengths.min()) / servo.travel_time
        self._said = bool(np.abs(lengths / before - 1.0).max() < allowed / modulus)
        return self._said
