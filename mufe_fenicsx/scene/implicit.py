"""[implicit] of a scene: increments of a static or implicit test."""

from dataclasses import dataclass

from ..solvers import petsc_options
from ..units import check_keys, require, setting


@dataclass(frozen=True)
class Implicit:
    """[implicit]: increments of a test with solver.integrator = "implicit" or "static".

    Lengths of increments are strains that the platen makes at the speed of loading.
    """

    step: float = setting(5e-4, "-", "strain of the first increment", gt=0, lt=1)
    smallest: float | None = setting(
        None,
        "-",
        "at which a test gives up; None: step / 10 000",
        gt=0,
        expected="0 < smallest <= step",
    )
    largest: float | None = setting(
        None,
        "-",
        "strain of any increment; None: 4 times step",
        lt=1,
        expected="step <= largest < 1",
    )
    spectral_radius: float = setting(
        0.8, "-", 'of "implicit", what is left of the highest frequencies', ge=0, le=1
    )
    stabilisation: float = setting(
        1e-6, "-", 'of "static", drag on grains over their stiffness', ge=0, lt=1
    )
    tolerance: float = setting(1e-6, "-", "residual over the internal forces", gt=0, lt=1)
    max_iterations: int = setting(
        30, "", "of Newton's method in an increment", ge=1, plausible=(1, 100_000)
    )
    linear_solver: str | None = setting(
        None, "", '"direct" or "products"; None: by size', allowed=("direct", "products")
    )
    petsc: str = setting(
        "",
        "",
        'options of PETSc from a list (docs/howto/static_increments.md), e.g. "-ksp_rtol 1e-8"',
    )

    def __post_init__(self):
        check_keys(self)
        if self.smallest is not None:
            require(self.smallest <= self.step, "smallest", self.smallest,
                    f"0 < smallest <= step = {self.step}")  # fmt: skip
        if self.largest is not None:
            require(self.step <= self.largest, "largest", self.largest,
                    f"step = {self.step} <= largest < 1")  # fmt: skip
        self.petsc_options()

    def petsc_options(self) -> dict:
        """The options as a dict. Raises InputError where they are none that a scene may state."""
        return petsc_options.parse(self.petsc)
