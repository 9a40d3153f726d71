"""Tables of a scene, a frozen dataclass each; their defaults are those of the file.

The tables of tests by stages are in `stages`, that of static and implicit tests in `implicit`.
"""

from dataclasses import dataclass, field
from pathlib import Path

from ..contact.laws import COMPLIANCE, law_names
from ..errors import InputError
from ..materials.elastic import IsotropicSolid
from ..materials.scatter import Scatter
from .checks import one_of, require, require_kinetic

#: Walls by name: the axis that they are normal to and the side of the sample.
WALLS = ("x_min", "x_max", "y_min", "y_max", "z_min", "z_max")
#: The wall that `Oedometer` drives.
TOP_PLATEN = "z_max"

#: How time goes on: central differences, generalised-α, or without inertia.
INTEGRATORS = ("explicit", "implicit", "static")


@dataclass(frozen=True)
class Sample:
    """[sample]: the grains that are tested."""

    grains: Path | None = None  #: folder that `mufe mesh` wrote
    separation: bool = True  #: move overlapping surfaces apart before the test
    max_shift: float = 0.3  #: largest such move of a node, over the mesh size [-]
    close_gaps: float = 0.0  #: close gaps between neighbours up to this distance too [m]
    close_gaps_over_h: float = 0.0  #: the same, over the mesh size [-]

    def __post_init__(self):
        require(0 < self.max_shift <= 1, "max_shift", self.max_shift, "0 < max_shift <= 1")
        for name in ("close_gaps", "close_gaps_over_h"):
            value = getattr(self, name)
            require(0 <= value, name, value, ">= 0")
            require(value == 0 or self.separation, name, value, "0 where separation = false")
        require(
            self.close_gaps == 0 or self.close_gaps_over_h == 0,
            "close_gaps_over_h",
            self.close_gaps_over_h,
            "only one of close_gaps and close_gaps_over_h",
        )


@dataclass(frozen=True)
class Group:
    """[materials.NAME]: grains of another material than the rest."""

    labels: tuple[int, ...]  #: labels of these grains
    material: IsotropicSolid
    scatter: Scatter | None = None  #: None: all alike

    def __post_init__(self):
        if not self.labels:
            raise InputError("labels = [], expected labels of grains")


@dataclass(frozen=True)
class Pair:
    """[contact.pairs]: friction of grains of two materials, NAME-NAME in either order.

    A number alone is ``friction``. The grains that are in no group are of "material".
    """

    friction: float  #: coefficient of friction between them [-]
    friction_kinetic: float | None = None  #: while they slip [-]; None: friction

    def __post_init__(self):
        require(0 <= self.friction, "friction", self.friction, ">= 0")
        require_kinetic("friction_kinetic", self.friction_kinetic, "friction", self.friction)


@dataclass(frozen=True)
class Contact:
    """[contact]: between grains, and the default between grains and walls.

    With a kinetic coefficient, friction falls to it where a node slips and returns to the
    static one when the node sticks again, whatever the rate of slip: the exponential
    decay with the slip rate of other programs in the limit of an infinite decay
    coefficient. Loading of a quasi-static test is faster than in nature, and a coefficient
    that depends on the rate would see that.
    """

    friction: float  #: coefficient of friction between grains [-]
    points: str = "facets"  #: where it acts: centroids of "facets", "facets3" (three) or "nodes"
    law: str = "matched"  #: normal law: stiffness "matched" to the mesh, or "kinematic"
    compliance: float = COMPLIANCE  #: layer of compliance·h/E* on each side, h the mesh size [-]
    wall_friction: float = 0.0  #: coefficient of friction of walls that state none [-]
    friction_kinetic: float | None = None  #: between grains while they slip [-]; None: friction
    wall_friction_kinetic: float | None = None  #: the same of walls that state no friction [-]
    self_contact: bool = False  #: concave grains meet themselves too
    pairs: dict[str, Pair] = field(default_factory=dict)  #: friction by pair of materials

    def __post_init__(self):
        require(0 <= self.friction, "friction", self.friction, ">= 0")
        one_of("points", self.points, ("facets", "facets3", "nodes"))
        one_of("law", self.law, law_names())
        require(0 < self.compliance, "compliance", self.compliance, "> 0")
        require(0 <= self.wall_friction, "wall_friction", self.wall_friction, ">= 0")
        require_kinetic("friction_kinetic", self.friction_kinetic, "friction", self.friction)
        require_kinetic(
            "wall_friction_kinetic", self.wall_friction_kinetic, "wall_friction", self.wall_friction
        )


@dataclass(frozen=True)
class Solver:
    """[solver]: element and time integration."""

    integrator: str = "explicit"  #: or "implicit" dynamics, or "static"; see [implicit]
    element: str = "averaged"  #: "averaged" nodal pressure, plain "p1", or "composite"
    time_step: str = "assembled"  #: stability limit of the "assembled" system, or by "element"
    time_step_factor: float = 0.9  #: time step over the stability limit [-]
    damping: float = 0.0  #: force -damping·m·v on each node [1/s]; steps are at most 1/damping
    energy_limit: float = 0.1  #: stop at an energy residual over all energy beyond this [-]
    retries: int = 3  #: times that an unstable run goes back and on with half the time step

    def __post_init__(self):
        one_of("integrator", self.integrator, INTEGRATORS)
        one_of("element", self.element, ("averaged", "p1", "composite"))
        one_of("time_step", self.time_step, ("assembled", "element"))
        require(
            0 < self.time_step_factor < 1,
            "time_step_factor",
            self.time_step_factor,
            "0 < time_step_factor < 1",
        )
        require(0 <= self.damping, "damping", self.damping, ">= 0 per second")
        require(0 < self.energy_limit, "energy_limit", self.energy_limit, "> 0")
        require(0 <= self.retries <= 10, "retries", self.retries, "0 <= retries <= 10")


@dataclass(frozen=True)
class Wall:
    """[walls.x_min] and so on: a rigid plane at rest, moving, held at a stress, or a mirror."""

    velocity: float = 0.0  #: along the normal that points into the sample [m/s]
    stress: float | None = None  #: mean pressure that a servo holds [Pa]
    speed: float | None = None  #: largest speed of that servo [m/s]
    friction: float | None = None  #: with grains [-]; None: contact.wall_friction
    friction_kinetic: float | None = None  #: while they slip [-]; None: as contact, or friction
    mirror: bool | None = None  #: plane of symmetry that grains are cut by; None: false

    def __post_init__(self):
        if self.mirror:
            for name, none in (("velocity", 0.0), ("stress", None), ("friction", 0.0)):
                value = getattr(self, name)
                if value not in (none, None):
                    raise InputError(f"{name} = {value}, expected none of a mirror")
        if self.stress is not None:
            require(
                self.velocity == 0, "velocity", self.velocity, "none where a stress is prescribed"
            )
            require(0 <= self.stress, "stress", self.stress, ">= 0 Pa (compression)")
            if self.speed is None:
                raise InputError("speed is missing, expected the largest speed of the servo")
        if self.speed is not None:
            require(self.stress is not None, "speed", self.speed, "none without a stress")
            require(0 < self.speed, "speed", self.speed, "> 0 m/s")
        if self.friction is not None:
            require(0 <= self.friction, "friction", self.friction, ">= 0")
        if self.friction_kinetic is not None:
            require(self.friction is not None, "friction_kinetic", self.friction_kinetic,
                     "a friction beside it")  # fmt: skip
            require_kinetic("friction_kinetic", self.friction_kinetic, "friction", self.friction)


@dataclass(frozen=True)
class Oedometer:
    """[oedometer]: the top platen first seats the sample, then compresses it."""

    strain: float  #: largest vertical strain, counted from the end of seating [-]
    speed: float  #: of the top platen [m/s]
    ramp: float = 0.005  #: strain over which the speed rises smoothly to its value [-]
    seating_stress: float = 50e3  #: mean vertical stress that ends the seating stage [Pa]
    seating_speed: float | None = None  #: of the platen while seating [m/s]; None: speed

    def __post_init__(self):
        require(0 < self.strain < 1, "strain", self.strain, "0 < strain < 1")
        require(0 < self.speed, "speed", self.speed, "> 0 m/s")
        require(
            0 <= self.ramp <= self.strain, "ramp", self.ramp, f"0 <= ramp <= strain = {self.strain}"
        )
        require(0 < self.seating_stress, "seating_stress", self.seating_stress, "> 0 Pa")
        if self.seating_speed is None:
            object.__setattr__(self, "seating_speed", self.speed)
        require(0 < self.seating_speed, "seating_speed", self.seating_speed, "> 0 m/s")


@dataclass(frozen=True)
class QuasiStatic:
    """[quasi_static]: the speed of loading follows from what it does to the sample.

    Without this table it is ``oedometer.speed`` (or ``loading.speed``) throughout; with it, that
    is the first speed, in a test by stages that of each stage after the last one with
    ``zero = true``; until there walls travel freely, at their own speeds.
    """

    kinetic: float = 0.01  #: kinetic over internal energy to stay below [-]
    unbalanced: float = 0.02  #: difference of top and bottom force over their mean, likewise [-]
    loaded: float = 0.0  #: strain from which on; before, the same energy and force as there [-]
    slowest: float | None = None  #: speed of the platen [m/s]; None: a tenth of the first one
    fastest: float | None = None  #: the same [m/s]; None: ten times the first one

    def __post_init__(self):
        for name in ("kinetic", "unbalanced"):
            value = getattr(self, name)
            require(0 < value < 1, name, value, f"0 < {name} < 1")
        require(0 <= self.loaded < 1, "loaded", self.loaded, "0 <= loaded < 1")
        for name in ("slowest", "fastest"):
            value = getattr(self, name)
            require(value is None or 0 < value, name, value or 0.0, "> 0 m/s")


@dataclass(frozen=True)
class MassScaling:
    """[mass_scaling]: mass added to the worst elements for a longer time step."""

    added: float  #: most that may be added to all grains, over their mass [-]
    added_to_grain: float | None = None  #: most added to one, over its mass; None: ten times added
    time_step: float | None = None  #: of a single element, wanted [s]; None: what is allowed

    def __post_init__(self):
        require(0 < self.added <= 1, "added", self.added, "0 < added <= 1")
        if self.added_to_grain is None:
            object.__setattr__(self, "added_to_grain", min(10 * self.added, 1.0))
        require(0 < self.added_to_grain <= 1, "added_to_grain", self.added_to_grain,
                 "0 < added_to_grain <= 1")  # fmt: skip
        if self.time_step is not None:
            require(0 < self.time_step, "time_step", self.time_step, "> 0 s")


@dataclass(frozen=True)
class Output:
    """[output]: what is stored during the loading stage."""

    fields: int = 11  #: states with all fields, including the start and the end
    history: int = 500  #: rows of history.csv
    checkpoint: float = 300.0  #: time of the clock between two checkpoints [s]; 0: none by time
    checkpoint_strain: float = 0.0  #: strain between two checkpoints [-]; 0: none by strain
    checkpoint_steps: int = 0  #: time steps between two checkpoints; 0: none by steps

    def __post_init__(self):
        require(2 <= self.fields, "fields", self.fields, ">= 2: the start and the end")
        require(2 <= self.history, "history", self.history, ">= 2: the start and the end")
        for name in ("checkpoint", "checkpoint_strain", "checkpoint_steps"):
            require(0 <= getattr(self, name), name, getattr(self, name), ">= 0; 0: none")
