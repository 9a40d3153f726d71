"""What holds the grains: a box, an upright cylinder, or a cell that repeats itself."""

from dataclasses import dataclass, field

import numpy as np

BOX, CYLINDER, PERIODIC = "box", "cylinder", "periodic"


@dataclass
class Container:
    """Its corners, and what its sides are; a cylinder fills its box."""

    kind: str  #: `BOX`, `CYLINDER` or `PERIODIC`
    low: np.ndarray  #: corner [mean diameters], shape (3,)
    high: np.ndarray  #: shape (3,)
    open_top: bool = False  #: whether the wall z_max is missing
    names: tuple = field(init=False)  #: of the walls, as in scenes
    point: np.ndarray = field(init=False)  #: of each wall, shape (num_walls, 3)
    normal: np.ndarray = field(init=False)  #: into the container, shape (num_walls, 3)
    radius: np.ndarray = field(init=False)  #: of a cylinder; 0: a plane, shape (num_walls,)

    def __post_init__(self):
        planes = [("x_min", 0, 1), ("x_max", 0, -1), ("y_min", 1, 1), ("y_max", 1, -1)]
        ends = [("z_min", 2, 1), ("z_max", 2, -1)][: 1 if self.open_top else 2]
        if self.kind == PERIODIC:
            walls = []
        elif self.kind == CYLINDER:
            walls = [("side", None, 0), *ends]
        else:
            walls = planes + ends
        self.names = tuple(name for name, _, _ in walls)
        self.normal = np.zeros((len(walls), 3))
        for w, (_, axis, sign) in enumerate(walls):
            if axis is not None:
                self.normal[w, axis] = sign
        self.point, self.radius = np.zeros((len(walls), 3)), np.zeros(len(walls))
        self._above = np.array([name.endswith("max") for name in self.names], dtype=bool)[:, None]
        self.place_walls()

    def place_walls(self):
        """Put the walls where the corners are now, in place."""
        self.point[:] = np.where(self._above, self.high, self.low)
        if self.kind == CYLINDER:
            self.point[0], self.radius[0] = self.middle, 0.5 * (self.high - self.low)[0]

    @property
    def middle(self):
        """Centre of its box, shape (3,)."""
        return 0.5 * (self.low + self.high)

    @property
    def edge(self):
        """Lengths of a periodic cell; zeros of other containers, shape (3,)."""
        return self.high - self.low if self.kind == PERIODIC else np.zeros(3)

    @property
    def volume(self):
        """Its volume [mean diameters cubed]."""
        part = np.pi / 4 if self.kind == CYLINDER else 1.0
        x, y, z = (self.high - self.low).tolist()
        return part * x * y * z

    def shrink(self, strain):
        """Shorten its edges about its middle by parts of their lengths, shape (3,), in place."""
        middle = self.middle
        self.low += (middle - self.low) * strain
        self.high += (middle - self.high) * strain
        self.place_walls()

    def from_walls(self, points):
        """Distance of points from its nearest side, below 0 outside, shape (num_points,)."""
        away = np.minimum(points - self.low, self.high - points)
        if self.kind == CYLINDER:
            off = np.linalg.norm((points - self.middle)[:, :2], axis=1)
            return np.minimum(away[:, 2], 0.5 * (self.high - self.low)[0] - off)
        return away.min(axis=1)

    def pulled_in(self, points):
        """Points, those outside moved to the nearest side, shape (num_points, 3)."""
        if self.kind == CYLINDER:
            points, off = points.copy(), (points - self.middle)[:, :2]
            length = np.linalg.norm(off, axis=1, keepdims=True)
            part = np.minimum(1.0, 0.5 * (self.high - self.low)[0] / np.maximum(length, 1e-300))
            points[:, :2] = self.middle[:2] + part * off
        return np.clip(points, self.low, self.high)

    def inside(self, points, margin):
        """Whether points are farther than ``margin`` from its sides, shape (num_points,)."""
        if self.kind == PERIODIC:
            return np.ones(len(points), dtype=bool)
        return self.from_walls(points) > margin
