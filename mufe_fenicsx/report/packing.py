"""Arrays made small for a page: fewer bits, differences, planes of bytes, deflate.

`report/assets/decode.js` reads what :class:`Packer` writes.

- Positions are counted in steps of 1/65535 of a box along each axis (:func:`to_grid`), so that
  they are off by half of such a step at most.
- Values become one byte, :func:`to_bytes`, with steps that grow with the root of the value where
  all are positive: small plastic strains stay apart beside large ones.
- A whole number is stored as its difference from the one before, even where positive (0, -1, 1,
  -2 … become 0, 1, 2, 3 …), and all lowest bytes come first, then the next ones: neighbours
  in a mesh are alike, so that the upper planes are nearly empty.
"""

import base64
import zlib

import numpy as np

#: Number of steps of a position along an axis, and of a value.
GRID_STEPS, BYTE_STEPS = 65535, 255
KINDS = {"u1": np.uint8, "u2": np.uint16, "u4": np.uint32, "f4": np.float32}


def to_grid(points, low, high):
    """Positions as whole steps of a box, uint16, shape (num_points, 3).

    Args:
        points: Inside the box [m], shape (num_points, 3).
        low, high: Its corners [m], shape (3,).
    """
    size = np.where(np.asarray(high) > low, np.asarray(high) - low, 1.0)
    return np.rint((points - low) / size * GRID_STEPS).astype(np.uint16)


def to_bytes(values, low, high, power):
    """Values of low ≤ v ≤ high as bytes q, v = low + (high - low) (q/255)^power.

    What is above ``low`` is not 0: with power 2 a small value may grow to (high - low)/255².
    """
    if not high > low:
        return np.zeros(np.shape(values), np.uint8)
    share = np.clip((np.asarray(values, dtype=float) - low) / (high - low), 0, 1)
    q = np.rint(BYTE_STEPS * share ** (1 / power))
    if power != 1:
        q = np.where(share > 0, np.maximum(q, 1), q)
    return q.astype(np.uint8)


class Packer:
    """Collects arrays into one row of bytes and a list of what is where."""

    def __init__(self):
        self.entries, self._parts, self._at = [], [], 0

    def add(self, name, values, kind, differences=False):
        """Append an array.

        Args:
            name: What the page asks for.
            values: Array; the page sees it flat, rows after each other.
            kind: One of :data:`KINDS`.
            differences: Store each number less the one before, for whole numbers.
        """
        values = np.ascontiguousarray(values, dtype=KINDS[kind]).ravel()
        width, plain = values.itemsize, values
        if differences:
            signed = np.dtype(f"i{width}")
            step = np.diff(plain, prepend=plain.dtype.type(0)).view(signed)
            plain = ((step << 1) ^ (step >> (8 * width - 1))).view(plain.dtype)
        planes = plain.view(np.uint8).reshape(-1, width).T
        self._parts.append(np.ascontiguousarray(planes).tobytes())
        self.entries.append(
            {"name": name, "kind": kind, "at": self._at, "count": int(values.size)}
            | ({"differences": True} if differences else {})
        )
        self._at += values.nbytes

    @property
    def data(self):
        """All bytes, one array after the other."""
        return b"".join(self._parts)

    def text(self):
        """The bytes deflated, as base64."""
        return base64.b64encode(zlib.compress(self.data, 9)).decode("ascii")
