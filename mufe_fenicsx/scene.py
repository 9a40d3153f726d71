"""A scene: everything that a user decides about a test. TOML is its written form.

Values are in SI units. Each class is one table of the scene file and states its
defaults; `load_scene` and `scene_to_toml` (in `scene_io`, offered here too) read
and write the file.
"""

import importlib.util
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from .contact.laws import COMPLIANCE, law_names
from .errors import InputError
from .geometry.settings import MeshSettings, SegmentSettings
from .materials.auto import Auto
from .materials.elastic import IsotropicSolid
from .materials.rigid import Rigid
from .materials.scatter import Scatter
from .scene_checks import one_of, require, require_kinetic
from .scene_implicit import Implicit
from .scene_loading import Loading, Stage, named

#: Walls by name: the axis that they are normal to and the side of the sample.
WALLS = ("x_min", "x_max", "y_min", "y_max", "z_min", "z_max")

#: How time goes on: central differences, generalised-α, or without inertia.
INTEGRATORS = ("explicit", "implicit", "static")

#: The wall that `Oedometer` drives.
TOP_PLATEN = "z_max"

#: Images that installed packages carry: name -> (package, path inside it).
PACKAGED_IMAGES = {"spam:snow": ("spam", "data/snow/snow.tif")}


@dataclass(frozen=True, kw_only=True)
class ImageSettings(SegmentSettings):
    """[image]: the tomography and how its grains are told apart."""

    file: str | Path  #: image file or folder of slices, or a name in `PACKAGED_IMAGES`

    @property
    def path(self) -> Path:
        """Where the image is. Raises InputError where its package is not installed."""
        return image_path(self.file)


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
    damping: float = 0.0  #: force -damping·m·v on each node [1/s]
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
    is the first speed, in a test by stages that of each stage.
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


@dataclass(frozen=True)
class Scene:
    """A whole test. ``walls`` always has all six, each with its friction filled in.

    Raises:
        InputError: a wall that does not exist, or that two tables move; a grain in two groups;
            no test, or two.
    """

    material: IsotropicSolid
    contact: Contact
    oedometer: Oedometer | None = None  #: or ``loading`` with ``stages``
    title: str = ""
    image: ImageSettings | None = None
    mesh: MeshSettings | None = None
    sample: Sample = Sample()
    solver: Solver = Solver()
    implicit: Implicit = field(default_factory=Implicit)
    walls: dict[str, Wall] = field(default_factory=dict)
    output: Output = Output()
    quasi_static: QuasiStatic | None = None  #: None: constant speed
    mass_scaling: MassScaling | None = None  #: None: no mass is added
    scatter: Scatter | None = None  #: of ``material``; None: all grains alike
    materials: dict[str, Group] = field(default_factory=dict)  #: of grains that differ
    loading: Loading | None = None  #: of a test by stages
    stages: tuple[Stage, ...] = ()  #: [[stage]]: parts of that test, in their order
    #: Wanted error of the stress, which plans the rest (planning); None: as the scene states it.
    accuracy: float | None = None

    def __post_init__(self):
        if self.accuracy is not None:
            require(0 < self.accuracy < 1, "accuracy", self.accuracy, "0 < accuracy < 1")
        self._check_test()
        group_of = {}
        for name, group in self.materials.items():
            for label in group.labels:
                if group_of.setdefault(label, name) != name:
                    raise InputError(
                        f"materials.{name}.labels has {label}, expected each label in one group: "
                        f"it is in materials.{group_of[label]} too"
                    )
        for name in self.walls:
            if name not in WALLS:
                raise InputError(f"walls.{name} is not a wall, expected one of {', '.join(WALLS)}")
        if self.mass_scaling is not None:
            self._check_mass_scaling()
        if self.solver.integrator != "explicit":
            self._check_implicit()
        if self.implicit.gap_tolerance is not None and self.solver.integrator != "static":
            raise InputError(
                f"implicit.gap_tolerance = {self.implicit.gap_tolerance}, expected none for "
                f'solver.integrator = "{self.solver.integrator}": augmentations belong to "static"'
            )
        self._check_mirrors()
        models = [self.material, *(group.material for group in self.materials.values())]
        if any(isinstance(model, Rigid | Auto) for model in models):
            if self.contact.law == "kinematic":
                raise InputError('contact.law = "kinematic", expected "matched" for rigid grains')
            if self.solver.time_step == "element":
                raise InputError(
                    'solver.time_step = "element", expected "assembled" for rigid grains'
                )
        self._check_walls()
        if self.quasi_static is not None:
            object.__setattr__(self, "quasi_static", self._between_speeds())
        object.__setattr__(self, "walls", {name: self._wall(name) for name in WALLS})

    def materials_of(self, labels, known):
        """Material of each grain of ``labels``.

        Args:
            labels: Labels of the grains, shape (num_grains,).
            known: Labels of all grains of the sample.

        Raises:
            InputError: a group names a grain that the sample has not.
        """
        group_of = {label: g for g in self.materials.values() for label in g.labels}
        known = set(np.asarray(known).tolist())
        for name, group in self.materials.items():
            for label in group.labels:
                if label not in known:
                    raise InputError(
                        f"materials.{name}.labels has {label}, expected a label of the sample, "
                        f"{min(known)} to {max(known)}"
                    )
        rest = Group((0,), self.material, self.scatter)
        found = []
        for label in labels:
            group = group_of.get(int(label), rest)
            scatter = group.scatter
            found.append(scatter.of(group.material, label) if scatter else group.material)
        return found

    def _check_test(self):
        """Raise InputError unless there is one test; name its stages."""
        if self.oedometer is not None:
            for name, given in (("[loading]", self.loading), ("[[stage]]", self.stages)):
                if given:
                    raise InputError(f"{name} is given, expected none beside [oedometer]")
            return
        if self.loading is None:
            raise InputError("[oedometer] is missing, expected it, or [loading] with [[stage]]")
        if not self.stages:
            raise InputError("[[stage]] is missing, expected at least one with [loading]")
        object.__setattr__(self, "stages", named(self.stages))
        if self.solver.integrator != "explicit":
            raise InputError(
                "[loading] is given, expected [oedometer] for solver.integrator = "
                f'"{self.solver.integrator}": a servo follows the force after an increment'
            )
        if self.contact.law == "kinematic":
            raise InputError('contact.law = "kinematic", expected "matched" with [loading]')

    def _check_walls(self):
        """Raise InputError where a wall is moved by its own table and by the test."""
        moved, by = (TOP_PLATEN,), "[oedometer] moves the top platen"
        if self.loading is not None:
            moved, by = WALLS, "[[stage]] moves the walls"
        for name in moved:
            wall = self.walls.get(name, Wall())
            for key, rest in (("velocity", 0), ("stress", None)):
                if getattr(wall, key) != rest:
                    raise InputError(
                        f"walls.{name}.{key} = {getattr(wall, key)}, expected none: {by}"
                    )

    def _check_mass_scaling(self):
        """Raise InputError where mass must not be added: laws that depend on it, bodies."""
        groups = [("material", self.material)]
        groups += [(f"materials.{name}", group.material) for name, group in self.materials.items()]
        for name, material in groups:
            if isinstance(material, Rigid | Auto):
                raise InputError(
                    f"[mass_scaling] is given, expected none for {name}, which is rigid"
                )
        for key, value, wanted in (
            ("contact.law", self.contact.law, "matched"),
            ("solver.time_step", self.solver.time_step, "assembled"),
        ):
            if value != wanted:
                raise InputError(f'{key} = "{value}", expected "{wanted}" with [mass_scaling]')

    def _check_implicit(self):
        """Raise InputError where an implicit or static solver cannot do what the scene wants."""
        wanted = f'for solver.integrator = "{self.solver.integrator}"'
        groups = [("material", self.material)]
        groups += [(f"materials.{name}", group.material) for name, group in self.materials.items()]
        for name, material in groups:
            if isinstance(material, Rigid | Auto):
                raise InputError(f"{name} is rigid, expected grains that deform {wanted}")
        for name, wall in self.walls.items():
            # Dynamics have no state to iterate for: over long increments a servo would overshoot.
            if wall.stress is not None and self.solver.integrator == "implicit":
                raise InputError(f"walls.{name}.stress = {wall.stress}, expected none {wanted}")
        if self.contact.law == "kinematic":
            raise InputError(f'contact.law = "kinematic", expected "matched" {wanted}')
        for name, table in (
            ("mass_scaling", self.mass_scaling),
            ("quasi_static", self.quasi_static),
        ):
            if table is not None:
                raise InputError(f"[{name}] is given, expected none {wanted}")

    def _check_mirrors(self):
        """Raise InputError where a plane of symmetry cannot be."""
        name = next((name for name in self.walls if self.walls[name].mirror), None)
        if name is None:
            return
        if self.walls.get(TOP_PLATEN, Wall()).mirror:
            raise InputError(
                f"walls.{TOP_PLATEN}.mirror = true, expected none: [oedometer] moves the top platen"
            )
        if self.contact.law == "kinematic":
            raise InputError(
                f'contact.law = "kinematic", expected "matched" with walls.{name}.mirror'
            )
        if self.sample.separation:
            # Nodes on the plane would be moved off it.
            raise InputError(f"sample.separation = true, expected false with walls.{name}.mirror")
        models = [self.material, *(group.material for group in self.materials.values())]
        if any(isinstance(model, Rigid | Auto) for model in models):
            raise InputError(
                f"walls.{name}.mirror = true, expected false with rigid grains, or grains that "
                "deform"
            )

    def _between_speeds(self):
        """Settings of the speed of loading with both limits filled in."""
        wanted, table = self.quasi_static, "loading" if self.oedometer is None else "oedometer"
        speed = getattr(self, table).speed
        slowest = speed / 10 if wanted.slowest is None else wanted.slowest
        fastest = speed * 10 if wanted.fastest is None else wanted.fastest
        if not slowest <= speed <= fastest:
            raise InputError(
                f"{table}.speed = {speed:g}, expected quasi_static.slowest = {slowest:g} "
                f"<= speed <= quasi_static.fastest = {fastest:g}"
            )
        return replace(wanted, slowest=slowest, fastest=fastest)

    def _wall(self, name):
        wall = self.walls.get(name, Wall())
        if wall.mirror:
            return Wall(friction=0.0, mirror=True)
        friction, kinetic = wall.friction, wall.friction_kinetic
        if friction is None:
            friction, kinetic = self.contact.wall_friction, self.contact.wall_friction_kinetic
        return Wall(wall.velocity, wall.stress, wall.speed, friction, kinetic)


def image_path(file) -> Path:
    """Where an image is: a path as it stands, or that of a packaged image.

    The package is located, not imported.

    Raises:
        InputError: the package that carries the image is not installed.
    """
    if str(file) not in PACKAGED_IMAGES:
        return Path(file)
    package, inside = PACKAGED_IMAGES[str(file)]
    found = importlib.util.find_spec(package)
    if found is None or not found.submodule_search_locations:
        raise InputError(
            f"image {file} is in the package {package}, which is not installed: "
            "expected pip install 'mufe-fenicsx[demo]'"
        )
    return Path(found.submodule_search_locations[0]) / inside


def load_scene(path) -> Scene:
    """Read a scene file. Relative paths in it stay in its folder; absolute ones lead anywhere.

    Raises:
        InputError: not TOML, an unknown or missing key, a wrong type or unit, or a
            value that is not physical; the message names the dotted key.
    """
    from .scene_io import read_scene

    return read_scene(path)


def scene_to_toml(scene) -> str:
    """The scene as TOML with every default written out: loading it gives it back."""
    from .scene_io import write_scene

    return write_scene(scene)
