"""Whether a stage waits for a stress or for rest that does not come, said once a stage."""

import numpy as np

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

    def say_moving(self, line):
        """Let a line on grains that do not come to rest be the notice, once."""
        if not self._moving:
            self.notice, self._moving = line, True

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
