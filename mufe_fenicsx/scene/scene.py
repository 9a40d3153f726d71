"""A scene: everything that a user decides about a test, from its tables."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from ..contact.friction import PairFriction
from ..container import SIDE
from ..errors import InputError
from ..geometry.settings import MeshSettings
from ..machine.notebook import html_table
from ..materials.elastic import IsotropicSolid
from ..materials.fracture import Fracture
from ..materials.scatter import Scatter
from ..units import check_keys, setting
from .consistency import check
from .image import ImageSettings
from .implicit import Implicit
from .membrane import MembraneSettings
from .pairs import MEMBRANE, REST, by_materials
from .reference import Reference
from .rows import scene_rows
from .stages import Loading, Stage, named
from .tables import (
    Contact,
    ContainerSettings,
    Group,
    MassScaling,
    Oedometer,
    Output,
    QuasiStatic,
    Sample,
    Solver,
    Wall,
)
from .tools import Tool


@dataclass(frozen=True)
class Scene:
    """A whole test. ``walls`` has all of the container, each with its friction filled in.

    Raises:
        InputError: a wall that does not exist, or that two tables move; a grain in two groups;
            no test, or two.
    """

    material: IsotropicSolid
    contact: Contact
    oedometer: Oedometer | None = None  #: or ``loading`` with ``stages``
    title: str = setting("", "", "shown in reports")
    image: ImageSettings | None = None
    mesh: MeshSettings | None = None
    sample: Sample = field(default_factory=Sample)
    container: ContainerSettings = field(default_factory=ContainerSettings)
    solver: Solver = field(default_factory=Solver)
    implicit: Implicit = field(default_factory=Implicit)
    walls: dict[str, Wall] = field(default_factory=dict)
    output: Output = field(default_factory=Output)
    quasi_static: QuasiStatic | None = None  #: None: constant speed
    mass_scaling: MassScaling | None = None  #: None: no mass is added
    membrane: MembraneSettings | None = None  #: around the sample, in place of a cylinder's side
    fracture: Fracture | None = None  #: None: grains stay whole
    scatter: Scatter | None = None  #: of ``material``; None: all grains alike
    materials: dict[str, Group] = field(default_factory=dict)  #: of grains that differ
    loading: Loading | None = None  #: of a test by stages
    stages: tuple[Stage, ...] = ()  #: [[stage]]: parts of that test, in their order
    tools: tuple[Tool, ...] = ()  #: [[tool]]: rigid bodies beside the grains
    references: tuple[Reference, ...] = ()  #: [[reference]]: measured curves, for reports
    accuracy: float | None = setting(
        None, "", "wanted error of the stress, which plans the rest", gt=0, lt=1
    )
    modulus: float | None = setting(
        None, "Pa", "constrained modulus of the sample, where it is known; only plans take it", gt=0
    )
    gravity: tuple[float, float, float] | None = setting(
        None, "m/s^2", "acceleration of gravity along x, y and z; left out: grains have no weight",
        shape=(3,),
    )  # fmt: skip

    def __post_init__(self):
        check_keys(self)
        check(self)
        object.__setattr__(self, "stages", named(self.stages))
        if self.quasi_static is not None:
            object.__setattr__(self, "quasi_static", self._between_speeds())
        object.__setattr__(
            self, "walls", {name: self._wall(name) for name in self.container.kind.walls}
        )
        object.__setattr__(self, "tools", tuple(map(self._tool, self.tools)))

    def _repr_html_(self) -> str:
        """The test in a short table, which notebooks show."""
        return html_table(self.title or "Scene", scene_rows(self))

    def materials_of(self, labels: Iterable[int], known: ArrayLike) -> list[IsotropicSolid]:
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

    def friction_of(self, labels, num_sleeves=0):
        """Coefficients of friction between grains, by pair of their materials where these differ.

        Args:
            labels: Labels of all grains of the sample, and of membranes, shape (num_grains,).
            num_sleeves: So many of the last ones are membranes: grains rub on them as on the side.
        """
        group_of = {label: name for name, g in self.materials.items() for label in g.labels}
        names = [group_of.get(int(label), REST) for label in labels]
        pairs = by_materials(self.contact.pairs, self.materials)
        found = {
            pair: (entry.friction, entry.friction_kinetic)
            for pair, entry in pairs.items()
            if set(pair) <= set(names)
        }
        if num_sleeves:
            names[-num_sleeves:] = [MEMBRANE] * num_sleeves
            side = self.walls[SIDE]
            found |= {
                (MEMBRANE, name): (side.friction, side.friction_kinetic) for name in set(names)
            }
        return PairFriction(self.contact.friction, names, found)

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

    def _tool(self, tool):
        """A tool with its friction filled in."""
        if tool.friction is not None:
            return tool
        contact = self.contact
        return replace(
            tool, friction=contact.wall_friction, friction_kinetic=contact.wall_friction_kinetic
        )

    def _wall(self, name):
        wall = self.walls.get(name, Wall())
        if wall.mirror:
            return Wall(friction=0.0, mirror=True)
        friction, kinetic = wall.friction, wall.friction_kinetic
        if friction is None:
            friction, kinetic = self.contact.wall_friction, self.contact.wall_friction_kinetic
        return Wall(wall.velocity, wall.stress, wall.speed, friction, kinetic)
