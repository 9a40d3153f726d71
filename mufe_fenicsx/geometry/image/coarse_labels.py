"""A coarser grid of labels whose grains are one piece and do not touch themselves."""

import numpy as np
import scipy.ndimage

from .labels import grains_in


def prevailing(labels, wanted, sigma):
    """The label that prevails in each cell of a coarser grid, and the edges of its cells.

    Args:
        labels: 0 void, grains from 1.
        wanted: Edge of the cells [voxels].
        sigma: Standard deviation of the filter by which they choose their label [voxels].
    """
    shape = np.maximum(np.round(np.array(labels.shape) / wanted).astype(int), 1)
    spacing = np.array(labels.shape) / shape
    best, cells = np.zeros(shape), np.zeros(shape, dtype=np.int32)
    for label, where in [(0, [slice(0, n) for n in labels.shape]), *grains_in(labels)]:
        pad = int(np.ceil(3 * sigma)) + 1
        low = np.array([max(s.start - pad, 0) for s in where])
        high = np.array([min(s.stop + pad, n) for s, n in zip(where, labels.shape, strict=True)])
        part = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
        smooth = scipy.ndimage.gaussian_filter(
            (labels[part] == label).astype(np.float32), sigma, mode="nearest", truncate=3.0
        )
        first = np.ceil(low / spacing - 0.5).astype(int)
        last = np.minimum(np.floor(high / spacing - 0.5).astype(int) + 1, shape)
        axes = [
            (np.arange(a, b) + 0.5) * s - 0.5 - o
            for a, b, s, o in zip(first, last, spacing, low, strict=True)
        ]
        found = scipy.ndimage.map_coordinates(
            smooth, np.meshgrid(*axes, indexing="ij"), order=1, mode="nearest"
        )
        there = tuple(slice(a, b) for a, b in zip(first, last, strict=True))
        more = found > best[there]
        best[there][more] = found[more]
        cells[there][more] = label
    return _without_pinches(cells), spacing


def _without_pinches(cells, turns=30):
    """Cells changed until every grain is one piece whose surface does not touch itself.

    Around each corner the cells of a grain, and all others, have to hang together by faces; the
    cell that hangs on least becomes void, or what else is there.
    """
    cells = cells.copy()
    for _ in range(turns):
        for label, where in grains_in(cells):
            part = cells[where]
            pieces, count = scipy.ndimage.label(part == label)
            if count > 1:
                largest = 1 + np.argmax(np.bincount(pieces.ravel())[1:])
                part[(pieces > 0) & (pieces != largest)] = 0
        wrong = _where_cells_pinch(cells)
        if not len(wrong):
            break
        steps = list(np.ndindex(2, 2, 2))
        for at in wrong:
            near = [np.clip(at + step - 1, 0, np.array(cells.shape) - 1) for step in steps]
            values = np.array([cells[tuple(c)] for c in near])
            pattern = (values[None, :] == values[:, None]) @ (1 << np.arange(8))
            bad = np.flatnonzero((values > 0) & ~SOUND[pattern])
            if len(bad) == 0:
                continue
            k = min(bad, key=lambda i: _num_alike(cells, near[i]))
            others = values[values != values[k]]
            cells[tuple(near[k])] = 0 if (others == 0).any() else np.bincount(others).argmax()
    return cells


def _where_cells_pinch(cells):
    """Corners around which the cells of a grain, or all others, do not hang together, (n, 3)."""
    # Outside the image cells go on: only what lies within has to hang together.
    padded = np.pad(cells, 1, mode="edge")
    parts = [padded[tuple(slice(d, d - 1 or None) for d in step)] for step in np.ndindex(2, 2, 2)]
    mixed = np.zeros(parts[0].shape, dtype=bool)
    for part in parts[1:]:
        mixed |= part != parts[0]
    at = np.argwhere(mixed)
    block = [part[mixed] for part in parts]
    wrong = np.zeros(len(at), dtype=bool)
    for mine in block:
        pattern = sum((other == mine).astype(np.uint8) << k for k, other in enumerate(block))
        wrong |= (mine > 0) & ~SOUND[pattern]
    return at[wrong]


def _num_alike(cells, at):
    """Cells with a face in common with one that have its label."""
    count = 0
    for step in (*np.eye(3, dtype=int), *-np.eye(3, dtype=int)):
        next_to = at + step
        if np.all((next_to >= 0) & (next_to < cells.shape)):
            count += int(cells[tuple(next_to)] == cells[tuple(at)])
    return count


def _sound_patterns():
    """For each set of the eight cells around a corner: do they and the others hang together?"""
    sound = np.zeros(256, dtype=bool)
    for pattern in range(256):
        inside = np.array([pattern >> k & 1 for k in range(8)], dtype=bool).reshape(2, 2, 2)
        sound[pattern] = all(scipy.ndimage.label(part)[1] <= 1 for part in (inside, ~inside))
    return sound


#: See `_sound_patterns`.
SOUND = _sound_patterns()
