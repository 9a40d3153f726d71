"""Watershed of a height function by steepest descent, its basins merged by their depth.

The algorithm of ITK's ``itk::WatershedImageFilter``, which Nadimi & Fonseca (2018) ran on
the inverted distance map, within a mask: voids take part in nothing, so grains never merge across
them.
"""

import numpy as np
import scipy.sparse

#: Axis and side of the neighbours of a voxel, in the order in which the first of equals counts.
WAYS = ((0, -1), (1, -1), (2, -1), (2, 1), (1, 1), (0, 1))


def watershed(height, mask, threshold=0.0, level=0.0, depth=None, relative=0.0, min_voxels=0):
    """Regions of a height function, from which water runs to the same minimum.

    Args:
        height: Height of each voxel, float32, shape (z, y, x).
        mask: True where there is ground.
        threshold: Heights below this part of the whole range, from the bottom, are lifted to it:
            minima deeper than that are one where they touch [-].
        level: Part of the whole range of heights up to which merges are looked at, and then
            part of the largest of these up to which they are made [-]; see `depth_of_level`.
        depth: A region merges with the one across its lowest edge if that edge is at most this
            above its minimum [units of height]; None: as ``level`` says.
        relative: So does one whose edge is at most this part of its depth below the highest voxel
            above its minimum [-].
        min_voxels: So do regions that are smaller, smallest first; one without neighbours stays.

    Returns:
        Regions 1 … n in the order of their first voxel, int32, 0 outside the mask; and the depth
        up to which regions were merged.

    Source: InsightSoftwareConsortium, ITK 5.4, itkWatershedSegmenter.hxx (threshold,
    neighbours across faces, plateaus), itkWatershedSegmentTreeGenerator.hxx (merging).
    """
    if not mask.any():
        return np.zeros(height.shape, dtype=np.int32), 0.0
    low, high = float(height.min()), float(height.max())
    if threshold > 0:
        height = np.maximum(height, np.float32(low + threshold * (high - low)))
    basins, minima = catchment_basins(height, mask)
    pairs, edges = lowest_edges(height, basins)
    if depth is None:
        depth = depth_of_level(minima, pairs, edges, level, high - low)
    least = np.maximum(depth, relative * (high - minima))
    region, _ = merged_by_depth(minima, pairs, edges, least)
    if min_voxels > 0:
        voxels = np.bincount(basins.ravel(), minlength=len(minima) + 1)[1:]
        region = merged_by_size(region, voxels, pairs, edges, min_voxels)
    # Basins are numbered by their first voxels; so are regions.
    number = np.zeros(len(minima) + 1, dtype=np.int32)
    number[1:] = 1 + np.unique(region, return_inverse=True)[1]
    return number[basins], depth


def depth_of_level(minima, pairs, edges, level, whole):
    """Depth up to which ITK merges at a level.

    ITK uses its level twice: it lists merges up to level × (range of heights), and makes those
    up to level × (deepest merge of that list): about level² of the range where merges are many.

    Source: ITK 5.4, itkWatershedSegmentTreeGenerator.hxx, itkWatershedRelabeler.hxx.

    Args:
        minima, pairs, edges: As of `merged_by_depth`.
        level: [-].
        whole: Range of heights.
    """
    _, depths = merged_by_depth(minima, pairs, edges, np.full(len(minima), level * whole))
    return level * max(depths, default=0.0)


def catchment_basins(height, mask):
    """The basin of each voxel, 1 … n, 0 outside the mask; and the height of each minimum.

    Every voxel sends its water to the lowest of its six neighbours; a plateau as a whole
    to the lowest voxel at its edge.
    """
    index = np.int32 if height.size < 2**31 else np.int64
    ground = np.where(mask, height, np.float32(np.inf)).astype(np.float32, copy=False)
    lowest = ground.copy()
    way = np.zeros(height.shape, dtype=np.int8)  # number of the neighbour in ``step``
    step, level = np.zeros(7, dtype=index), []
    for number, (axis, side) in enumerate(WAYS, start=1):
        here, there = _neighbours(axis, side)
        step[number] = side * int(np.prod(height.shape[axis + 1 :]))
        # Outside the mask all is infinitely high.
        below = ground[there] < lowest[here]
        below &= mask[here]
        np.copyto(lowest[here], ground[there], where=below)
        way[here][below] = number
        if side > 0:
            flat = np.zeros(height.shape, dtype=bool)
            np.equal(ground[there], ground[here], out=flat[here])
            flat[here] &= mask[here]
            level.append(np.flatnonzero(flat).astype(index))
    goal = np.arange(height.size, dtype=index)
    goal += step[way.ravel()]
    del way
    lowest, ground = lowest.ravel(), ground.ravel()
    ends = [a + step[number] for number, a in zip((4, 5, 6), level, strict=True)]
    _drain_plateaus(goal, lowest, ground, np.concatenate(level), np.concatenate(ends))
    del lowest
    inside = np.flatnonzero(mask).astype(index)
    now = goal[inside]
    while True:  # the length of the ways that are done doubles each time
        goal[inside] = further = goal[now]
        if np.array_equal(further, now):
            break
        now = further
    bottom = inside[now == inside]
    number = np.zeros(height.size, dtype=np.int32)
    number[bottom] = np.arange(1, len(bottom) + 1)
    basins = np.zeros(height.size, dtype=np.int32)
    basins[inside] = number[now]
    return basins.reshape(height.shape), ground[bottom]


def lowest_edges(height, basins):
    """Pairs of basins that touch, (n, 2), from 0, and the height of the lowest way between them.

    An edge lies between two voxels and is as high as the higher of them.
    """
    base = int(basins.max()) + 1
    keys, heights = [], []
    for axis in range(3):
        here, there = _neighbours(axis, 1)
        at = np.nonzero((basins[here] != basins[there]) & (basins[here] > 0) & (basins[there] > 0))
        a, b = basins[here][at].astype(np.int64), basins[there][at]
        keys.append(np.minimum(a, b) * base + np.maximum(a, b))
        heights.append(np.maximum(height[here][at], height[there][at]))
    key, edge = np.concatenate(keys), np.concatenate(heights)
    order = np.lexsort((edge, key))
    key, edge = key[order], edge[order]
    first = np.flatnonzero(np.diff(key, prepend=-1))
    return np.stack([key[first] // base, key[first] % base], axis=1) - 1, edge[first]


def merged_by_depth(minima, pairs, edges, least):
    """Region of each basin: one of its basins; and how deep each merged region was.

    A region whose lowest edge is at most ``least`` above its minimum merges across
    that edge. Edges taken from the lowest upwards meet each region at its lowest one first.

    Args:
        minima: Height of each basin's minimum.
        pairs, edges: Of `lowest_edges`.
        least: Of each basin; a region has that of its lowest one.
    """
    parent, lowest, least, depths = list(range(len(minima))), minima.tolist(), least.tolist(), []
    order = np.argsort(edges, kind="stable")
    for (a, b), edge in zip(pairs[order].tolist(), edges[order].tolist(), strict=True):
        a, b = _root(parent, a), _root(parent, b)
        if a == b:
            continue
        higher, lower = (a, b) if lowest[a] >= lowest[b] else (b, a)
        if edge - lowest[higher] <= least[higher]:
            depths.append(edge - lowest[higher])
            first, other = min(a, b), max(a, b)
            parent[other] = first
            lowest[first], least[first] = lowest[lower], least[lower]
    return np.array([_root(parent, a) for a in range(len(parent))]), depths


def merged_by_size(region, voxels, pairs, edges, min_voxels):
    """Regions of which those below ``min_voxels`` merge across their lowest edge, smallest first.

    Args:
        region: Region of each basin.
        voxels: Of each basin.
        pairs, edges: Of `lowest_edges`.
        min_voxels: Least size.
    """
    parent, size = region.tolist(), np.bincount(region, voxels, len(region)).tolist()
    around = {}
    for (a, b), edge in zip(region[pairs].tolist(), edges.tolist(), strict=True):
        if a != b:
            for p, q in ((a, b), (b, a)):
                way = around.setdefault(p, {})
                way[q] = min(edge, way.get(q, edge))
    small = [a for a in np.unique(region).tolist() if size[a] < min_voxels]
    while small:
        a = min(small, key=lambda k: (size[k], k))
        small.remove(a)
        ways = around.pop(a, {})
        if not ways:
            continue
        b = min(ways, key=lambda k: (ways[k], k))
        parent[a] = b
        size[b] += size[a]
        for c, edge in ways.items():
            around[c].pop(a)
            if c != b:
                for p, q in ((b, c), (c, b)):
                    around[p][q] = min(edge, around[p].get(q, edge))
        if size[b] >= min_voxels and b in small:
            small.remove(b)
    return np.array([_root(parent, a) for a in range(len(parent))])


def _drain_plateaus(goal, lowest, ground, a, b):
    """Send each plateau, whose voxels are linked by ``a`` and ``b``, to the lowest at its edge."""
    if len(a) == 0:
        return
    voxels, ends = np.unique(np.concatenate([a, b]), return_inverse=True)
    ends = ends.reshape(2, -1)
    links = (np.ones(len(a), dtype=bool), (ends[0], ends[1]))
    graph = scipy.sparse.coo_array(links, shape=(len(voxels),) * 2)
    _, plateau = scipy.sparse.csgraph.connected_components(graph, directed=False)
    # By plateau, then by the lowest neighbour: the first voxel of each speaks for all.
    order = np.lexsort((lowest[voxels], plateau))
    speaker = voxels[order[np.flatnonzero(np.diff(plateau[order], prepend=-1))]]
    exit_ = np.where(lowest[speaker] < ground[speaker], goal[speaker], speaker)
    goal[voxels] = speaker[plateau]
    goal[speaker] = exit_


def _neighbours(axis, side):
    """Slices of voxels that have a neighbour on this side, and of those neighbours."""
    cut = [slice(None)] * 3, [slice(None)] * 3
    cut[0][axis], cut[1][axis] = slice(None, -1), slice(1, None)
    here, there = tuple(cut[0]), tuple(cut[1])
    return (here, there) if side > 0 else (there, here)


def _root(parent, a):
    while parent[a] != a:
        parent[a] = parent[parent[a]]
        a = parent[a]
    return a
