"""Where a surface is, in cells of a regular grid: what a rank tells others about its own."""

from dataclasses import dataclass

import numpy as np

from ...kernels.contact.occupancy import fill_cells, touch_full_cells
from ...kernels.geometry.boxes import box_around

#: Edge of the cells over the mean extent of a facet: half of it sends few facets in vain, and
#: the cells of a surface are still far fewer bytes than what is sent for them.
CELL = 0.5
#: Cells at most for each facet: grains far apart have larger cells.
MOST_CELLS = 32


@dataclass(frozen=True)
class Cells:
    """Cells that a surface touches: a part of a regular grid."""

    low: np.ndarray  #: lower corner of the whole grid [m], shape (3,)
    size: float  #: edge of the cells [m]
    first: np.ndarray  #: index of the part's first cell in the whole grid, int64, shape (3,)
    full: np.ndarray  #: whether the surface touches each cell, bool, shape (nx, ny, nz)

    def within(self, low, high):
        """The cells of this part that a box touches, as :class:`Cells`.

        Args:
            low, high: Corners of the box [m], shape (3,).
        """
        begin, end = (np.floor((v - self.low) / self.size) - self.first for v in (low, high))
        begin = np.clip(begin, 0, self.full.shape).astype(np.int64)
        end = np.clip(end + 1, begin, self.full.shape).astype(np.int64)
        part = self.full[tuple(slice(b, e) for b, e in zip(begin, end, strict=True))]
        return Cells(self.low, self.size, self.first + begin, part)

    def near(self, low, high, reach):
        """Which boxes come within ``reach`` [m] of a full cell along all axes, shape (num_boxes,).

        Args:
            low, high: Corners of the boxes [m], shape (num_boxes, 3).
        """
        touch = np.empty(len(low), dtype=bool)
        full = np.ascontiguousarray(self.full)
        touch_full_cells(touch, low - reach, high + reach, full, self.low, self.size, self.first)
        return touch

    def packed(self):
        """These cells as bytes, uint8: ten numbers, then a bit for each cell."""
        head = np.array([*self.low, self.size, *self.first, *self.full.shape])
        return np.concatenate([head.view(np.uint8), np.packbits(self.full)])

    @staticmethod
    def unpacked(data):
        """The cells that :meth:`packed` made ``data`` of."""
        head = data[:80].copy().view(np.float64)
        shape = tuple(head[7:].astype(np.int64))
        full = np.unpackbits(data[80:], count=int(np.prod(shape))).astype(bool)
        return Cells(head[:3], float(head[3]), head[4:7].astype(np.int64), full.reshape(shape))


def occupied_cells(low, high):
    """Cells that facets touch with their boxes.

    Args:
        low, high: Corners of the boxes [m], shape (num_facets, 3).
    """
    if not low.size:
        return Cells(np.zeros(3), 1.0, np.zeros(3, dtype=np.int64), np.zeros((0, 0, 0), dtype=bool))
    corner = box_around(low)[0]
    span, extent = box_around(high)[1] - corner, (high - low).mean()
    size = max(CELL * extent, np.cbrt(np.prod(span + extent) / (MOST_CELLS * len(low))))
    full = np.zeros(tuple((span / size).astype(np.int64) + 1), dtype=bool)
    fill_cells(full, low, high, corner, size)
    return Cells(corner, float(size), np.zeros(3, dtype=np.int64), full)
