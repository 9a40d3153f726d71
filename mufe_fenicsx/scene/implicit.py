"""[implicit] of a scene: increments of a static or implicit test."""

from dataclasses import dataclass

from ..solvers import petsc_options
from .checks import one_of, require


@dataclass(frozen=True)
class Implicit:
    """[implicit]: increments of a test with solver.integrator = "implicit" or "static".

    Lengths of increments are strains that the platen makes at the speed of loading.
    """

    step: float = 5e-4  #: strain of the first increment [-]
    smallest: float | None = None  #: at which a test gives up [-]; None: step / 10 000
    largest: float | None = None  #: [-]; None: 4 times step
    spectral_radius: float = 0.8  #: of "implicit", what is left of the highest frequencies [-]
    stabilisation: float = 1e-6  #: of "static", drag on grains over their stiffness [-]
    tolerance: float = 1e-6  #: residual over the internal forces [-]
    max_iterations: int = 30  #: of Newton's method in an increment
    gap_tolerance: float | None = None  #: of "static" with exact gaps, over the facet edge [-]
    max_augmentations: int = 30  #: of an increment, at most
    linear_solver: str | None = None  #: "direct", "multigrid", "products"; None: by size
    petsc: str = ""  #: options of PETSc from a list (docs/implicit.md), e.g. "-ksp_rtol 1e-8"

    def __post_init__(self):
        require(0 < self.step < 1, "step", self.step, "0 < step < 1")
        if self.smallest is not None:
            require(0 < self.smallest <= self.step, "smallest", self.smallest,
                     f"0 < smallest <= step = {self.step}")  # fmt: skip
        if self.largest is not None:
            require(self.step <= self.largest < 1, "largest", self.largest,
                     f"step = {self.step} <= largest < 1")  # fmt: skip
        require(0 <= self.spectral_radius <= 1, "spectral_radius", self.spectral_radius,
                 "0 <= spectral_radius <= 1")  # fmt: skip
        require(0 <= self.stabilisation < 1, "stabilisation", self.stabilisation,
                 "0 <= stabilisation < 1")  # fmt: skip
        require(0 < self.tolerance < 1, "tolerance", self.tolerance, "0 < tolerance < 1")
        require(1 <= self.max_iterations, "max_iterations", self.max_iterations, ">= 1")
        if self.gap_tolerance is not None:
            require(0 < self.gap_tolerance < 0.1, "gap_tolerance", self.gap_tolerance,
                     "0 < gap_tolerance < 0.1")  # fmt: skip
        require(1 <= self.max_augmentations, "max_augmentations", self.max_augmentations, ">= 1")
        if self.linear_solver is not None:
            one_of("linear_solver", self.linear_solver, ("direct", "multigrid", "products"))
        self.petsc_options()

    def petsc_options(self) -> dict:
        """The options as a dict. Raises InputError where they are none that a scene may state."""
        return petsc_options.parse(self.petsc)
