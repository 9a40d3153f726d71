"""What holds a sample: the six planes of a box, or one or two cylinders between platens.

A sample is loaded along the axes of its container: x, y, z of a box with two planes each; r and z
of a cylinder, whose length along r is its diameter D. With the height H the areas of a
cylinder's walls and its volume are

    A_r = π D H,  A_z = π D²/4,  V = A_z H,

and its stresses along three directions normal to each other are σr, σr and σz.

A hollow cylinder has the axes o of its outer and i of its inner wall, whose lengths are the
diameters Do and Di; its strains along them are those of the circumferences. Its walls carry the
pressures po and pi; the mean stresses across and around it, and the strains that they do work on,

    σr = (po Do + pi Di)/(Do + Di),  εr = 1 - (Do - Di)/(Do - Di)₀,
    σθ = (po Do - pi Di)/(Do - Di),  εθ = 1 - (Do + Di)/(Do + Di)₀,

are exact: V (σr ε̇r + σθ ε̇θ) is the work of both pressures on the walls that move, and
1 - (1 - εr)(1 - εθ)(1 - εz) the loss of volume.

Source: D. W. Hight, A. Gens & M. J. Symes, Géotechnique 33, 1983, 355-383.
"""

import math
from collections.abc import Collection, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

TOP, BOTTOM, SIDE, INNER = "z_max", "z_min", "side", "inner"
#: What is known of walls that move along themselves, by the key of the stage that moves them:
#: columns of a history, and values that end a stage.
SHEARED = {"shear": ("shear_xz", "gamma_xz"), "turn": ("torque", "shear_tz", "gamma_tz", "twist")}


@dataclass(frozen=True)
class Bounds:
    """Where the walls of a container stand at the start; the same on all ranks."""

    low: np.ndarray  #: lowest corner of the box around all grains [m], shape (3,)
    high: np.ndarray  #: its highest corner [m], shape (3,)
    centre: np.ndarray  #: of a cylinder, across z [m], shape (2,)
    radius: float  #: of a cylinder [m]
    inner_radius: float = 0.0  #: of the hole of a hollow one [m]

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
    radius: float = 0.0  #: of a cylinder [m], negative where the sample is around it


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
    #: Names of stresses that those of contacts have too, and their directions among the three:
    #: a mean of two where these turn around the axis.
    compared: tuple[tuple[str, tuple[int, ...]], ...]
    #: Letters of directions across the vertical one along which stresses and strains are means of
    #: several axes; none where each axis is a direction.
    across: tuple[str, ...] = ()

    def __init__(self) -> None:
        # The lower and the upper wall of each axis; one wall is both.
        self._lower = np.array([walls[0] for walls in self.walls_of_axis])
        self._upper = np.array([walls[-1] for walls in self.walls_of_axis])
        counts = np.array([len(walls) for walls in self.walls_of_axis])
        self._closing = 0.5 * counts * self.shortening
        self._axis_of_wall = np.repeat(np.arange(len(self.axes)), counts)

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
        return self.of_axes(normal_forces) / self.areas(lengths)

    def of_axes(self, values: ArrayLike) -> np.ndarray:
        """Means over the walls of each axis, (..., num_axes), of (..., num_walls) values."""
        values = np.asarray(values, dtype=float)
        return 0.5 * (values[..., self._lower] + values[..., self._upper])

    def to_walls(self, values: np.ndarray) -> np.ndarray:
        """The value of its axis for each wall, (..., num_walls), of (..., num_axes) values."""
        return values[..., self._axis_of_wall]

    def closing(self, velocity: np.ndarray) -> np.ndarray:
        """Speeds at which the axes shorten, (num_axes,), of those of the walls inward [m/s]."""
        return self._closing * (velocity[self._lower] + velocity[self._upper])

    def shortest(self, lengths: ArrayLike) -> float:
        """Least extent of the sample [m], of lengths of shape (num_axes,)."""
        return float(np.min(lengths))

    def three_stresses(self, stresses: ArrayLike, lengths: ArrayLike | None) -> np.ndarray:
        """Mean stresses along three directions [Pa], shape (..., 3).

        Args:
            stresses: Those of the walls across each axis [Pa], shape (..., num_axes).
            lengths: Along the axes [m]; None where these are not known, which only the hollow
                cylinder needs.
        """
        return np.asarray(stresses)[..., list(self.three)]

    def three_strains(self, strains: ArrayLike, lengths: ArrayLike | None) -> np.ndarray:
        """Strains along three directions, shape (..., 3); arguments as of the stresses."""
        return np.asarray(strains)[..., list(self.three)]

    def means(self, values: ArrayLike) -> np.ndarray:
        """Means for :attr:`compared`, (..., num), of values along three directions, (..., 3)."""
        values = np.asarray(values, dtype=float)
        means = [values[..., list(along)].mean(axis=-1) for _, along in self.compared]
        return np.stack(means, axis=-1)

    def areas_of_walls(self, lengths: ArrayLike) -> np.ndarray:
        """Area of each wall [m²], shape (num_walls,), of lengths of shape (num_axes,)."""
        return self.to_walls(self.areas(lengths))


class Box(Container):
    """Six planes."""

    shape = "box"
    walls = ("x_min", "x_max", "y_min", "y_max", BOTTOM, TOP)
    axes = ("x", "y", "z")
    walls_of_axis = ((0, 1), (2, 3), (4, 5))
    widths = ("length_x", "length_y")
    three = (0, 1, 2)
    shortening = (1.0, 1.0, 1.0)
    compared = (("xx", (0,)), ("yy", (1,)), ("zz", (2,)))

    def surfaces(self, bounds: Bounds) -> list[Surface]:
        """Shape and place of each wall at the start; those beside stand on the bottom.

        Points of walls are the lowest corner of the box, and from there along one edge: about them
        walls beside tilt in a box that is sheared.
        """
        found = []
        for a, (lower, upper) in enumerate(self.walls_of_axis):
            normal, opposite = np.zeros(3), bounds.low.copy()
            normal[a], opposite[a] = 1.0, bounds.high[a]
            found.append(Surface(self.walls[lower], bounds.low.copy(), normal))
            found.append(Surface(self.walls[upper], opposite, -normal))
        return found

    def lengths(self, point: np.ndarray, radius: np.ndarray) -> np.ndarray:
        """Distances of opposite planes [m], shape (3,); of tilted ones along the axis."""
        along = np.arange(3)
        return point[self._upper, along] - point[self._lower, along]

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
    compared = (("rr", (0, 1)), ("zz", (2,)))

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
        lengths = np.asarray(lengths, dtype=float)
        return 0.25 * math.pi * lengths[..., 0] ** 2 * lengths[..., 1]

    def areas(self, lengths: ArrayLike) -> np.ndarray:
        """Areas of the side and of a platen [m²], shape (..., 2)."""
        lengths = np.asarray(lengths, dtype=float)
        diameter, areas = lengths[..., 0], np.empty_like(lengths)
        areas[..., 0] = math.pi * diameter * lengths[..., 1]
        areas[..., 1] = 0.25 * math.pi * diameter**2
        return areas


class HollowCylinder(Cylinder):
    """The space between two cylinders along z, and a platen at each of its ends."""

    shape = "hollow cylinder"
    walls = (SIDE, INNER, BOTTOM, TOP)
    axes = ("o", "i", "z")
    walls_of_axis = ((0,), (1,), (2, 3))
    widths = ("diameter", "inner_diameter")
    shortening = (2.0, -2.0, 1.0)  # the hole widens as its wall comes towards the sample
    across = ("r", "t")
    compared = (("hh", (0, 1)), ("zz", (2,)))

    def surfaces(self, bounds: Bounds) -> list[Surface]:
        """Shape and place of each wall at the start."""
        side, bottom, top = super().surfaces(bounds)
        inner = Surface(INNER, side.point.copy(), side.normal.copy(), -bounds.inner_radius)
        return [side, inner, bottom, top]

    def note(self, bounds: Bounds) -> dict[str, object]:
        """What run.json says of it."""
        return super().note(bounds) | {"inner_radius": bounds.inner_radius}

    def lengths(self, point: np.ndarray, radius: np.ndarray) -> np.ndarray:
        """Both diameters, and distance of the platens [m], shape (3,)."""
        return np.array([2.0 * radius[0], -2.0 * radius[1], point[3, 2] - point[2, 2]])

    def shortest(self, lengths: ArrayLike) -> float:
        """Least extent of the sample [m], of lengths of shape (3,)."""
        outer, inner, height = np.asarray(lengths, dtype=float)
        return float(min(0.5 * (outer - inner), height))

    def volume(self, lengths: ArrayLike) -> np.ndarray:
        """Volume inside [m³], shape (...)."""
        outer, inner, height = np.moveaxis(np.asarray(lengths, dtype=float), -1, 0)
        return 0.25 * math.pi * (outer**2 - inner**2) * height

    def areas(self, lengths: ArrayLike) -> np.ndarray:
        """Areas of the two sides and of a platen [m²], shape (..., 3)."""
        outer, inner, height = np.moveaxis(np.asarray(lengths, dtype=float), -1, 0)
        end = 0.25 * math.pi * (outer**2 - inner**2) + 0.0 * height
        return np.stack([math.pi * outer * height, math.pi * inner * height, end], axis=-1)

    def three_stresses(self, stresses: ArrayLike, lengths: ArrayLike | None) -> np.ndarray:
        """σr, σθ and σz [Pa], shape (..., 3)."""
        outer, inner, _ = np.moveaxis(np.asarray(lengths, dtype=float), -1, 0)
        po, pi, axial = np.moveaxis(np.asarray(stresses, dtype=float), -1, 0)
        across = (po * outer + pi * inner) / (outer + inner)
        around = (po * outer - pi * inner) / (outer - inner)
        return np.stack([across, around, axial], axis=-1)

    def three_strains(self, strains: ArrayLike, lengths: ArrayLike | None) -> np.ndarray:
        """εr, εθ and εz, shape (..., 3)."""
        lengths, strains = np.asarray(lengths, dtype=float), np.asarray(strains, dtype=float)
        outer, inner, _ = np.moveaxis(lengths, -1, 0)
        first_outer, first_inner, _ = np.moveaxis(lengths / (1.0 - strains), -1, 0)
        across = 1.0 - (outer - inner) / (first_outer - first_inner)
        around = 1.0 - (outer + inner) / (first_outer + first_inner)
        return np.stack([across, around, strains[..., 2]], axis=-1)


BOX, CYLINDER, HOLLOW_CYLINDER = Box(), Cylinder(), HollowCylinder()
#: By their names in scene files.
CONTAINERS = {each.shape: each for each in (BOX, CYLINDER, HOLLOW_CYLINDER)}
#: Names of the walls of all containers, each once.
WALLS = tuple(dict.fromkeys(name for each in CONTAINERS.values() for name in each.walls))


def container_of(walls: Iterable[str]) -> Container | None:
    """The container that has these walls; None where none has them all."""
    names = tuple(walls)
    return next((each for each in CONTAINERS.values() if each.walls == names), None)


def container_of_history(columns: Collection[str]) -> Container:
    """The container of a run whose history has these columns."""
    if f"force_{INNER}" in columns:
        return HOLLOW_CYLINDER
    return CYLINDER if f"force_{SIDE}" in columns else BOX
