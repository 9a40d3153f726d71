"""Tables of a scene, a frozen dataclass each; their defaults are those of the file.

The tables of tests by stages are in `stages`, that of static and implicit tests in `implicit`.
"""

from dataclasses import dataclass, field
from pathlib import Path

from ..contact.settings import PLAUSIBLE_FRICTION, ContactSettings
from ..container import CONTAINERS, Container
from ..errors import InputError
from ..materials.elastic import IsotropicSolid
from ..materials.scatter import Scatter
from ..units import REQUIRED, Key, check_keys, require, setting

#: How time goes on: central differences, generalised-α, or without inertia.
INTEGRATORS = ("explicit", "implicit", "static")


@dataclass(frozen=True)
class Sample:
    """[sample]: the grains that are tested."""

    grains: Path | None = setting(
        None, "", "folder that `mufe mesh` wrote, or meshes:NAME of one that the program brings"
    )
    separation: bool = setting(True, "", "move overlapping surfaces apart before the test")
    max_shift: float = setting(
        0.3, "-", "largest such move of a node, over the mesh size", gt=0, le=1
    )
    close_gaps: float = setting(
        0.0, "m", "close gaps between neighbours up to this distance too", ge=0
    )
    close_gaps_over_h: float = setting(
        0.0, "-", "the same, over the mesh size", ge=0, plausible=(0.0, 10.0)
    )

    def __post_init__(self):
        check_keys(self)
        for name in ("close_gaps", "close_gaps_over_h"):
            value = getattr(self, name)
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

    labels: tuple[int, ...] = setting(REQUIRED, "", "labels of these grains", shape=(-1,))
    material: IsotropicSolid  # type: ignore[misc]  # labels have no default either
    scatter: Scatter | None = None  #: None: all alike

    def __post_init__(self):
        if not self.labels:
            raise InputError("labels = [], expected labels of grains")


@dataclass(frozen=True)
class Pair:
    """[contact.pairs]: friction of grains of two materials, NAME-NAME in either order.

    A number alone is ``friction``. The grains that are in no group are of "material".
    """

    friction: float = setting(
        REQUIRED, "-", "coefficient of friction between them", ge=0, plausible=PLAUSIBLE_FRICTION
    )
    friction_kinetic: float | None = setting(
        None, "-", "while they slip; None: friction", plausible=PLAUSIBLE_FRICTION
    )

    def __post_init__(self):
        check_keys(self)
        _require_kinetic(self, "friction_kinetic", "friction")


@dataclass(frozen=True)
class Contact(ContactSettings):
    """[contact]: between grains, and the default between grains and walls.

    With a kinetic coefficient, friction falls to it where a node slips and returns to the
    static one when the node sticks again, whatever the rate of slip: the exponential
    decay with the slip rate of other programs in the limit of an infinite decay
    coefficient. Loading of a quasi-static test is faster than in nature, and a coefficient
    that depends on the rate would see that.
    """

    friction: float = setting(
        REQUIRED, "-", "coefficient of friction between grains", ge=0, plausible=PLAUSIBLE_FRICTION
    )
    wall_friction: float = setting(
        0.0, "-", "coefficient of friction of walls that state none", ge=0,
        plausible=PLAUSIBLE_FRICTION
    )  # fmt: skip
    wall_friction_kinetic: float | None = setting(
        None, "-", "the same of walls that state no friction", plausible=PLAUSIBLE_FRICTION
    )
    pairs: dict[str, Pair] = field(
        default_factory=dict, metadata={"key": Key({}, "", "friction by pair of materials")}
    )

    def __post_init__(self):
        check_keys(self)
        _require_kinetic(self, "friction_kinetic", "friction")
        _require_kinetic(self, "wall_friction_kinetic", "wall_friction")


@dataclass(frozen=True)
class Solver:
    """[solver]: element and time integration."""

    integrator: str = setting(
        "explicit", "", 'or "implicit" dynamics, or "static"; see [implicit]', allowed=INTEGRATORS
    )
    element: str = setting(
        "averaged", "", '"averaged" nodal pressure, or plain "p1"', allowed=("averaged", "p1")
    )
    time_step: str = setting(
        "assembled",
        "",
        'stability limit of the "assembled" system, or by "element"',
        allowed=("assembled", "element"),
    )
    time_step_factor: float = setting(
        0.9, "-", "time step over the stability limit", gt=0, lt=1, plausible=(1e-3, 1.0)
    )
    damping: float = setting(
        0.0, "s^-1", "force -damping·m·v on each node; steps are at most 1/damping", ge=0
    )
    energy_limit: float = setting(
        0.1, "-", "stop at an energy residual over all energy beyond this", gt=0
    )
    retries: int = setting(
        3, "", "times that an unstable run goes back and on with half the time step", ge=0, le=10
    )

    def __post_init__(self):
        check_keys(self)


@dataclass(frozen=True)
class ContainerSettings:
    """[container]: the walls around the sample.

    Those of a box are x_min, x_max, y_min, y_max, z_min and z_max, of a cylinder side, z_min and
    z_max, of a hollow one inner as well. Its axis is along z.
    """

    shape: str = setting("box", "", "what they form", allowed=tuple(CONTAINERS))
    radius: float | None = setting(
        None,
        "m",
        "of the cylinder; None: that which cut the grains, or the smallest around them",
        gt=0,
    )
    inner_radius: float | None = setting(
        None, "m", "of the hole of a hollow cylinder; None: the largest without a node", gt=0
    )
    centre: tuple[float, float] | None = setting(
        None, "m", "of the cylinder across z; None: that of the same one", shape=(2,)
    )

    def __post_init__(self):
        check_keys(self)
        for name, shapes in (("radius", ("box",)), ("centre", ("box",)),
                             ("inner_radius", ("box", "cylinder"))):  # fmt: skip
            value = getattr(self, name)
            if self.shape in shapes and value is not None:
                raise InputError(f'{name} = {value}, expected none of shape = "{self.shape}"')
        if self.radius is not None and self.inner_radius is not None:
            require(self.inner_radius < self.radius, "inner_radius", self.inner_radius,
                    f"less than radius = {self.radius:g}")  # fmt: skip

    @property
    def kind(self) -> Container:
        """Names and measures of these walls."""
        return CONTAINERS[self.shape]


@dataclass(frozen=True)
class Wall:
    """[walls.x_min] and so on: a rigid wall at rest, moving, held at a stress, or a mirror."""

    velocity: float = setting(0.0, "m/s", "along the normal that points into the sample")
    stress: float | None = setting(
        None,
        "Pa",
        "mean pressure that a servo holds",
        gt=0,
        expected="> 0 Pa (compression)",
    )
    speed: float | None = setting(
        None, "m/s",
        "largest speed of that servo; at a lower one, v, the stress is off by the part v/speed",
        gt=0,
    )  # fmt: skip
    friction: float | None = setting(
        None, "-", "with grains; None: contact.wall_friction", ge=0, plausible=PLAUSIBLE_FRICTION
    )
    friction_kinetic: float | None = setting(
        None, "-", "while they slip; None: as contact, or friction", plausible=PLAUSIBLE_FRICTION
    )
    mirror: bool | None = setting(None, "", "plane of symmetry that grains are cut by; None: false")

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
        check_keys(self)
        if self.stress is not None and self.speed is None:
            raise InputError("speed is missing, expected the largest speed of the servo")
        if self.speed is not None:
            require(self.stress is not None, "speed", self.speed, "none without a stress")
        if self.friction_kinetic is not None:
            require(self.friction is not None, "friction_kinetic", self.friction_kinetic,
                    "a friction beside it")  # fmt: skip
            _require_kinetic(self, "friction_kinetic", "friction")


@dataclass(frozen=True)
class Oedometer:
    """[oedometer]: the top platen first seats the sample, then compresses it."""

    strain: float = setting(
        REQUIRED, "-", "largest vertical strain, counted from the end of seating", gt=0, lt=1
    )
    speed: float = setting(REQUIRED, "m/s", "of the top platen", gt=0)
    ramp: float = setting(
        0.005, "-", "strain over which the speed rises smoothly to its value", ge=0
    )
    seating_stress: float = setting(
        50e3, "Pa", "mean vertical stress that ends the seating stage", gt=0
    )
    seating_speed: float | None = setting(
        None, "m/s", "of the platen while seating; None: speed", gt=0
    )
    seating_at_rest: bool = setting(
        False, "", "the platen holds that stress until all is at rest, then strain counts"
    )

    def __post_init__(self):
        check_keys(self)
        require(
            0 <= self.ramp <= self.strain, "ramp", self.ramp, f"0 <= ramp <= strain = {self.strain}"
        )
        if self.seating_speed is None:
            object.__setattr__(self, "seating_speed", self.speed)


@dataclass(frozen=True)
class QuasiStatic:
    """[quasi_static]: the speed of loading follows from what it does to the sample.

    Without this table it is ``oedometer.speed`` (or ``loading.speed``) throughout; with it, that
    is the first speed, in a test by stages that of each stage after the last one with
    ``zero = true``; until there walls travel freely, at their own speeds.
    """

    kinetic: float = setting(0.01, "-", "kinetic over internal energy to stay below", gt=0, lt=1)
    unbalanced: float = setting(
        0.02, "-", "difference of top and bottom force over their mean, likewise", gt=0, lt=1
    )
    loaded: float = setting(
        0.0, "-", "strain from which on; before, the same energy and force as there", ge=0, lt=1
    )
    slowest: float | None = setting(
        None, "m/s", "speed of the platen; None: a tenth of the first one", gt=0
    )
    fastest: float | None = setting(None, "m/s", "the same; None: ten times the first one", gt=0)

    def __post_init__(self):
        check_keys(self)


@dataclass(frozen=True)
class MassScaling:
    """[mass_scaling]: mass added to the worst elements for a longer time step."""

    added: float = setting(
        REQUIRED, "-", "most that may be added to all grains, over their mass", gt=0, le=1
    )
    added_to_grain: float | None = setting(
        None, "-",
        "most added to one, over its mass or a mean grain's; None: ten times added, 1 at most, and "
        "no bound with [fracture]",
        gt=0,
    )  # fmt: skip
    time_step: float | None = setting(
        None, "s",
        "of a single element, wanted; None: what is allowed, with [fracture] half the worst one's",
        gt=0,
    )  # fmt: skip

    def __post_init__(self):
        check_keys(self)


@dataclass(frozen=True)
class Output:
    """[output]: what is stored during the loading stage."""

    fields: int = setting(
        11,
        "",
        "states with all fields, including the start and the end",
        ge=2,
        expected=">= 2: the start and the end",
        plausible=(2, 100_000),
    )
    history: int = setting(
        500,
        "",
        "rows of history.csv",
        ge=2,
        expected=">= 2: the start and the end",
        plausible=(2, 10_000_000),
    )
    checkpoint: float = setting(
        300.0, "s", "time of the clock between two checkpoints; 0: none by time", ge=0
    )
    checkpoint_strain: float = setting(
        0.0, "-", "strain between two checkpoints; 0: none by strain", ge=0
    )
    checkpoint_steps: int = setting(
        0, "", "time steps between two checkpoints; 0: none by steps", ge=0
    )
    report: bool = setting(False, "", "draw the report when the test has ended, as `mufe report`")

    def __post_init__(self):
        check_keys(self)


def _require_kinetic(settings, name, static):
    """Raise InputError unless a kinetic coefficient, if given, is between 0 and the static one."""
    value, most = getattr(settings, name), getattr(settings, static)
    if value is not None:
        require(0 <= value <= most, name, value, f"0 <= {name} <= {static} = {most}")
