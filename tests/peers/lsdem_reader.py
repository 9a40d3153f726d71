"""What LS-DEM codes make of their files, as their readers and grains do it.

Written from ``readParameters`` (positions, quaternions, ``generateGrainFromFile``), ``Grain3d``
(rotation, points of a grain in the frame of another) and ``Levelset3d`` (``findPenetration``) of
LS-DEM_Parallel_Benchmark (Tan & Sitar), whose files and functions are those of Kawamoto's code
(Kawamoto, Andò, Viggiani & Andrade 2016, J. Mech. Phys. Solids 91, 1-13). Lengths are in units of
the spacing.
"""

from dataclasses import dataclass

import numpy as np


def numbers(line, count):
    """The first ``count`` numbers of a line, as `getline(…, ' ')` and `atof` see them.

    Two spaces in a row would be a number of their own, 0.
    """
    words = line.split(" ")
    assert len(words) == count and all(words), f"{len(words)} numbers, expected {count}"
    return np.array(words, float)


def rotation(quaternion):
    """Matrix from the axes of a grain to the sample, of its four numbers."""
    a, b, c, d = quaternion
    return np.array(
        [
            [-a * a + b * b - c * c + d * d, -2 * (a * b - c * d), 2 * (b * c + a * d)],
            [-2 * (a * b + c * d), a * a - b * b - c * c + d * d, -2 * (a * c - b * d)],
            [2 * (b * c - a * d), -2 * (a * c + b * d), -a * a - b * b + c * c + d * d],
        ]
    )


@dataclass
class Grain:
    """A grain as these codes hold it."""

    mass: float
    moments: np.ndarray
    centre: np.ndarray  #: of mass, from the first node of the grid
    points: np.ndarray  #: of the surface about it, along the principal axes
    radius: float
    shape: tuple  #: of the grid
    values: np.ndarray  #: signed distances, single precision
    position: np.ndarray
    turn: np.ndarray

    @property
    def surface(self):
        """The points in the sample."""
        return self.points @ self.turn.T + self.position

    @property
    def nodes(self):
        """Nodes of the grid in the sample, in the order of the values."""
        nx, ny, nz = self.shape
        z, y, x = np.unravel_index(np.arange(nx * ny * nz), (nz, ny, nx))
        return (np.column_stack([x, y, z]) - self.centre) @ self.turn.T + self.position

    def depth(self, point):
        """How deep a point of the sample is inside, negative, and the outer normal; None outside.

        Eight nodes around it are interpolated, if the nearest is no more than one spacing outside.
        """
        at = self.turn.T @ (point - self.position) + self.centre
        if (at < 0).any() or (at + 1 > self.shape).any():
            return None
        if self._value(*np.floor(at + 0.5).astype(int)) > 1:
            return None
        low, high = np.floor(at).astype(int), np.ceil(at).astype(int)
        part = at - low
        ends = [(low[k], high[k]) for k in range(3)]
        corner = np.array([[[self._value(x, y, z) for z in ends[2]] for y in ends[1]]
                           for x in ends[0]])  # fmt: skip
        weight = [np.array([1 - t, t]) for t in part]
        slope = np.array([-1.0, 1.0])
        value = np.einsum("ijk,i,j,k", corner, *weight)
        if value >= 0:
            return None
        gradient = np.array(
            [
                np.einsum("ijk,i,j,k", corner, *(slope if a == b else weight[b] for b in range(3)))
                for a in range(3)
            ]
        )
        return value, self.turn @ (gradient / np.linalg.norm(gradient))

    def _value(self, x, y, z):
        nx, ny, _ = self.shape
        return self.values[z * ny * nx + y * nx + x]


def read_grain(folder, i):
    """Grain ``i`` of a folder, from 1: line after line."""
    with (folder / f"morph_{i}.dat").open() as file:
        lines = [line.removesuffix("\n") for line in file]
    assert len(lines) == 8
    mass = numbers(lines[0], 1)[0]
    moments, centre = numbers(lines[1], 3), numbers(lines[2], 3)
    points = numbers(lines[4], 3 * int(lines[3])).reshape(-1, 3)
    radius = numbers(lines[5], 1)[0]
    shape = tuple(int(n) for n in numbers(lines[6], 3))
    values = numbers(lines[7], np.prod(shape)).astype(np.float32).astype(float)
    place = (folder / "positions.dat").read_text().splitlines()[i - 1]
    quaternion = (folder / "rotations.dat").read_text().splitlines()[i - 1]
    turn = rotation(numbers(quaternion, 4))
    return Grain(mass, moments, centre, points, radius, shape, values, numbers(place, 3), turn)
