"""What holds a sample: the six planes of a box, or a cylinder between two platens.

A sample is loaded along the axes of its container: x, y, z of a box with two planes each; r and z
of a cylinder, whose length along r is its diameter D. With the height H the areas of a
cylinder's walls and its volume are

    A_r = π D H,  A_z = π D²/4,  V = A_z H,

and its stresses along three directions normal to each other are σr, σr and σz.
"""

import math
from collections.abc import Collection, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

TOP, BOTTOM, SIDE = "z_max", "z_min", "side"


@dataclass(frozen=True)
class Bounds:
    """Where the walls of a container stand at the start; the same on all ranks."""

    low: np.ndarray  #: lowest corner of the box around all grains [m], shape (3,)
    high: np.ndarray  #: its highest corner [m], shape (3,)
    centre: np.ndarray  #: of a cylinder, across z [m], shape (2,)
    radius: float  #: of a cylinder [m]

    @property
    def height(self) -> float:
        """Distance of the platens [m]."""
        return float(self.high[2] - self.low[2])


@dataclass(frozen=True)
class Surface:
    """Shape and place of one wall."""

    name: str
    point: np.ndarray  #: of the plane or axis [m], shape (3,)
    normal: np.ndarray  #: into the sample, or along the axis, shape (3,)
    radius: float = 0.0  #: of a cylinder [m]


class Container:
    """Names and measures of the walls of one shape. Lists of walls and axes keep one order.

    Lengths are those along the axes [m], arrays of shape (..., num_axes).
    """

    shape: str  #: as in scene files
    walls: tuple[str, ...]  #: names of the walls; the platens are the last two
    axes: tuple[str, ...]  #: letters; the vertical one is the last
    walls_of_axis: tuple[tuple[int, ...], ...]  #: numbers of the walls across each axis
    widths: tuple[str, ...]  #: columns of a history with the lengths but the height
    three: tuple[int, ...]  #: axes along three directions that are normal to each other
    shortening: tuple[float, ...]  #: how much faster than one of its walls each axis shortens

    @property
    def top(self) -> int:
        """Number of the top platen."""
        return self.walls.index(TOP)

    @property
    def bottom(self) -> int:
        """Number of the bottom platen."""
        return self.walls.index(BOTTOM)

    @property
    def sides(self) -> tuple[str, ...]:
        """Names of the walls beside the sample."""
        return tuple(name for name in self.walls if name not in (TOP, BOTTOM))

    def surfaces(self, bounds: Bounds) -> list[Surface]:
        """Shape and place of each wall at the start."""
        raise NotImplementedError

    def lengths(self, point: np.ndarray, radius: np.ndarray) -> np.ndarray:
        """Lengths between walls at ``point``, (num_walls, 3), of ``radius``, (num_walls,) [m]."""
        raise NotImplementedError

    def lengths_within(self, bounds: Bounds) -> np.ndarray:
        """Lengths at the start [m], shape (num_axes,)."""
        surfaces = self.surfaces(bounds)
        points, radii = ([getattr(s, name) for s in surfaces] for name in ("point", "radius"))
        return self.lengths(np.array(points), np.array(radii))

    def note(self, bounds: Bounds) -> dict[str, object]:
        """What run.json says of it."""
        return {"shape": self.shape}

    def volume(self, lengths: ArrayLike) -> np.ndarray:
        """Volume inside [m³], shape (...)."""
        raise NotImplementedError

    def areas(self, lengths: ArrayLike) -> np.ndarray:
        """Areas of the walls across each axis [m²], shape (..., num_axes)."""
        raise NotImplementedError

    def stresses(self, normal_forces: ArrayLike, lengths: ArrayLike) -> np.ndarray:
        """Mean stress of the walls across each axis [Pa], shape (..., num_axes).

        Args:
            normal_forces: On the walls, compression positive [N], shape (..., num_walls).
            lengths: Along the axes [m].
        """
        forces = np.asarray(normal_forces, dtype=float)
        means = [forces[..., list(walls)].mean(axis=-1) for walls in self.walls_of_axis]
        return np.stack(means, axis=-1) / self.areas(lengths)

    def closing(self, velocity: np.ndarray) -> np.ndarray:
        """Speeds at which the axes shorten, (num_axes,), of those of the walls inward [m/s]."""
        sums = [velocity[list(walls)].sum() for walls in self.walls_of_axis]
        return np.array(sums) * self.shortening

    def along_three(self, values: ArrayLike) -> np.ndarray:
        """Those along three directions, (..., 3), of values along the axes, (..., num_axes)."""
        return np.asarray(values)[..., list(self.three)]

    def means(self, values: ArrayLike) -> np.ndarray:
        """Means along the axes, (..., num_axes), of values along three directions, (..., 3)."""
        values, three = np.asarray(values, dtype=float), np.array(self.three)
        means = [values[..., three == a].mean(axis=-1) for a in range(len(self.axes))]
        return np.stack(means, axis=-1)

    def areas_of_walls(self, lengths: ArrayLike) -> np.ndarray:
        """Area of each wall [m²], shape (num_walls,), of lengths of shape (num_axes,)."""
        found, areas = np.empty(len(self.walls)), self.areas(lengths)
        for area, walls in zip(areas, self.walls_of_axis, strict=True):
            found[list(walls)] = area
        return found


class Box(Container):
    """Six planes."""

    shape = "box"
    walls = ("x_min", "x_max", "y_min", "y_max", BOTTOM, TOP)
    axes = ("x", "y", "z")
    walls_of_axis = ((0, 1), (2, 3), (4, 5))
    widths = ("length_x", "length_y")
    three = (0, 1, 2)
    shortening = (1.0, 1.0, 1.0)

    def surfaces(self, bounds: Bounds) -> list[Surface]:
        """Shape and place of each wall at the start."""
        found = []
        for a, (lower, upper) in enumerate(self.walls_of_axis):
            normal = np.zeros(3)
            normal[a] = 1.0
            found.append(Surface(self.walls[lower], bounds.low.copy(), normal))
            found.append(Surface(self.walls[upper], bounds.high.copy(), -normal))
        return found

    def lengths(self, point: np.ndarray, radius: np.ndarray) -> np.ndarray:
        """Distances of opposite planes [m], shape (3,)."""
        return np.diag(point[1::2]) - np.diag(point[0::2])

    def volume(self, lengths: ArrayLike) -> np.ndarray:
        """Volume inside [m³], shape (...)."""
        return np.prod(lengths, axis=-1)

    def areas(self, lengths: ArrayLike) -> np.ndarray:
        """Areas of the planes across each axis [m²], shape (..., 3)."""
        lengths = np.asarray(lengths, dtype=float)
        return lengths.prod(axis=-1)[..., None] / lengths


class Cylinder(Container):
    """The inside of a cylinder along z, and a platen at each of its ends."""

    shape = "cylinder"
    walls = (SIDE, BOTTOM, TOP)
    axes = ("r", "z")
    walls_of_axis = ((0,), (1, 2))
    widths = ("diameter",)
    three = (0, 0, 1)
    shortening = (2.0, 1.0)  # the diameter by both of its ends

    def surfaces(self, bounds: Bounds) -> list[Surface]:
        """Shape and place of each wall at the start."""
        up = np.array([0.0, 0.0, 1.0])
        ends = [np.append(bounds.centre, end[2]) for end in (bounds.low, bounds.high)]
        return [
            Surface(SIDE, ends[0], up, bounds.radius),
            Surface(BOTTOM, ends[0], up),
            Surface(TOP, ends[1], -up),
        ]

    def note(self, bounds: Bounds) -> dict[str, object]:
        """What run.json says of it."""
        return super().note(bounds) | {"centre": bounds.centre.tolist(), "radius": bounds.radius}

    def lengths(self, point: np.ndarray, radius: np.ndarray) -> np.ndarray:
        """Diameter, and distance of the platens [m], shape (2,)."""
        return np.array([2.0 * radius[0], point[2, 2] - point[1, 2]])

    def volume(self, lengths: ArrayLike) -> np.ndarray:
        """Volume inside [m³], shape (...)."""
        diameter, height = np.moveaxis(np.asarray(lengths, dtype=float), -1, 0)
        return 0.25 * math.pi * diameter**2 * height

    def areas(self, lengths: ArrayLike) -> np.ndarray:
        """Areas of the side and of a platen [m²], shape (..., 2)."""
        diameter, height = np.moveaxis(np.asarray(lengths, dtype=float), -1, 0)
        side = math.pi * diameter * height
        return np.stack([side, 0.25 * math.pi * diameter**2 + 0.0 * side], axis=-1)


BOX, CYLINDER = Box(), Cylinder()
#: By their names in scene files.
CONTAINERS = {each.shape: each for each in (BOX, CYLINDER)}
#: Names of the walls of all containers, each once.
WALLS = tuple(dict.fromkeys(name for each in CONTAINERS.values() for name in each.walls))


def container_of(walls: Iterable[str]) -> Container | None:
    """The container that has these walls; None where none has them all."""
    names = tuple(walls)
    return next((each for each in CONTAINERS.values() if each.walls == names), None)


def container_of_history(columns: Collection[str]) -> Container:
    """The container of a run whose history has these columns."""
    return CYLINDER if f"force_{SIDE}" in columns else BOX
