"""How long an increment may be, so that a stage of loading ends where it is to end."""

import math


class IncrementEnd:
    """Bounds of the next increment, which what moves the walls sets. Collective by what it calls.

    Attributes:
        longest: That takes the walls just to where they are to go [s].
        passed: Function that tells after an increment whether it went beyond the end of a stage
            by more than it may, the same on all ranks; None: no end is looked for. The end is
            found by bisection: an increment that passes it is taken back, and the next one half
            as long; one that does not is kept, and the end lies in what is left of the other.
        within: Length from here on in which the end lies [s]; infinity: not known.
    """

    def __init__(self):
        self.longest, self.passed, self.within = math.inf, None, math.inf

    def aim(self, longest=math.inf, passed=None):
        """Bounds of the next increment; other ends than the last one are not known yet."""
        if passed is None:
            self.within = math.inf
        self.longest, self.passed = longest, passed

    def cut(self, dt):
        """The length of the next increment [s], where ``dt`` is wanted."""
        return min(dt, self.longest, 0.5 * self.within)

    def goes_too_far(self, dt, smallest):
        """Whether the increment of length ``dt`` that was found is to be taken back. Collective.

        None that is not longer than ``smallest`` [s] is.
        """
        if self.passed is None:
            return False
        if dt > smallest and self.passed():
            self.within = dt
            return True
        self.within = max(self.within - dt, 2.0 * smallest)
        return False
