"""Lengths, tolerances and solvers of increments, and how long the next one is."""

from dataclasses import dataclass, fields

from ..arguments import check_fields, finite_number
from ..errors import InputError
from ..solvers.generalised_alpha import GeneralisedAlpha

#: Iterations over the most allowed, up to which the next increment is much and a little longer, and
#: from which on it is shorter.
FEW, SOME, MANY = 0.25, 0.5, 0.75
#: Factors of the length of an increment then, and where it failed.
LONGER, LITTLE_LONGER, SHORTER, FAILED = 1.5, 1.2, 0.7, 0.4


@dataclass(frozen=True)
class IncrementSettings:
    """How increments are solved, and how long they may be."""

    first_step: float  #: length of the first increment [s]
    smallest_step: float | None = None  #: at which it gives up [s]; None: 1e-4 of the first
    largest_step: float | None = None  #: of any increment [s]; None: 4 times the first
    #: Of :class:`~mufe_fenicsx.solvers.generalised_alpha.GeneralisedAlpha`; None: static ones.
    spectral_radius: float | None = None
    stabilisation: float = 1e-6  #: s of static increments
    tolerance: float = 1e-6  #: residual over the internal forces, in the norm over all nodes
    max_iterations: int = 30  #: of Newton's method in an increment
    no_force: float = 1e-9  #: residual that is none, over E* times the square of the mean edge
    linear_solver: str | None = None  #: one of linear_system.SOLVERS; None: by size
    petsc: dict | None = None  #: further options of PETSc, without the prefix ``mufe_``

    def __post_init__(self):
        check_fields(self)
        finite_number("tolerance", self.tolerance, gt=0, le=1)
        finite_number("max_iterations", self.max_iterations, ge=1, le=1e6)
        if not 0 < self.smallest <= self.first_step <= self.largest:
            raise InputError(
                f"first_step = {self.first_step} s, expected 0 < smallest_step = {self.smallest} "
                f"<= first_step <= largest_step = {self.largest}"
            )

    @classmethod
    def taken_from(cls, options):
        """The settings among ``options`` by name, and a dict of the other options."""
        names = [field.name for field in fields(cls)]
        own = {name: value for name, value in options.items() if name in names}
        return cls(**own), {name: value for name, value in options.items() if name not in names}

    @property
    def method(self):
        """How dynamics are integrated; None for static increments."""
        return None if self.spectral_radius is None else GeneralisedAlpha(self.spectral_radius)

    @property
    def smallest(self):
        """Smallest length of an increment [s]."""
        return 1e-4 * self.first_step if self.smallest_step is None else self.smallest_step

    @property
    def largest(self):
        """Largest length of an increment [s]."""
        return 4.0 * self.first_step if self.largest_step is None else self.largest_step

    def next_length(self, wanted, dt, effort):
        """Length of the increment after one that was found [s].

        Args:
            wanted: Length that was wanted [s].
            dt: Its length [s], which may have been cut.
            effort: Iterations of Newton's method over the most allowed.
        """
        if effort <= SOME:
            factor = LONGER if effort <= FEW else LITTLE_LONGER
            # One that was cut tells nothing about longer ones.
            return max(wanted, min(factor * dt, self.largest))
        return max(SHORTER * dt, self.smallest) if effort >= MANY else wanted

    def shortened(self, dt):
        """Length of the next attempt after one of ``dt`` [s] that failed [s]."""
        return max(FAILED * dt, self.smallest)

    @property
    def drag_time(self):
        """Drag of static increments over the stiffness of grains [s]; 0 in dynamics."""
        return float(self.stabilisation) * self.first_step if self.method is None else 0.0
