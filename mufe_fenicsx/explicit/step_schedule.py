"""When the limit of explicit time steps is found again, and what may move until then."""

import math

from ..state import Stateful

#: How much faster than so far grains may move before the limit is found early.
FASTER = 1.25
#: Where the bound by contact is so many times the limit, pairs that can close before the next
#: evaluation matter little: it waits up to so many times as long, as long as the limit stays.
SLACK, LONGEST_WAIT = 1.02, 4
#: A limit that is so much of the last one stays.
STEADY = 0.99


class StepSchedule(Stateful):
    """Evaluations of the limit: the last one, and when the next one is due.

    Args:
        steps: Steps between two of them, where none waits longer.
    """

    STATE = {"common": ("bound", "at", "margin", "wait", "steady", "limit")}

    def __init__(self, steps):
        self.steps = steps
        self.bound, self.at = 0.0, 0  #: contact's bound of motion [m] and step of the last one
        self.margin = 0.0  #: motion that it allows for [m]
        self.wait = 1  #: how many times as long the next one waits
        self.steady = False  #: whether the one after that may wait longer
        self.limit = 0.0  #: what it found [s]
        self._moved, self._waited = 0.0, 1

    def waited(self, num_steps):
        """Steps since the last one."""
        return num_steps - self.at

    def due(self, num_steps):
        """Whether the next one is due."""
        return self.waited(num_steps) >= self.wait * self.steps

    def is_passed(self, motion):
        """Whether grains moved more than the last one allows for.

        Args:
            motion: :class:`~mufe_fenicsx.contact.pairs.relative_motion.RelativeMotion`.
        """
        beyond = motion.bound - self.bound > self.margin
        return beyond or (motion.overrun_of_all > 0.0 and self.margin < math.inf)

    def begin(self, bound, num_steps, early):
        """Begin one at this bound of contact's motion [m], ``early`` soon after the last one."""
        self._moved, self._waited = bound - self.bound, max(self.waited(num_steps), 1)
        self.bound, self.at = bound, num_steps
        self.wait = min(2 * self.wait, LONGEST_WAIT) if self.steady and not early else 1

    def look_ahead(self, least, most):
        """Motion from here to the next one [m], by that since the last one; and times that it is.

        Args:
            least, most: Bounds of it [m].
        """
        factor = FASTER * self.wait * self.steps / self._waited
        self.margin = max(min(factor * self._moved, most), least)
        return self.margin, factor

    def too_far(self, limit):
        """Whether a longer wait made the limit [s] shorter: it is to be found without it."""
        if self.wait == 1 or limit > STEADY * self.limit:
            return False
        self.wait = 1
        return True

    def end(self, limit, slack):
        """End it with this limit [s], over which the bound by contact is ``slack``."""
        self.steady = bool(slack > SLACK and limit > STEADY * self.limit)
        self.limit = limit
