"""Which grain of a later scan is which of the first one: the assignment of least cost.

A grain is known by its volume and its three principal second moments, which no rigid motion
changes, and by its place: where its neighbours went, it went as well. Grains are assigned one to
one such that the sum of their costs is least; a grain that costs too much counts as lost.

Sources: E. Andò, S. A. Hall, G. Viggiani, J. Desrues & P. Bésuelle, Acta Geotech. 7, 2012, 1-13,
know grains by their volume; the assignment is that of R. Jonker & A. Volgenant, Computing 38,
1987, 325-340, by SciPy.
"""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import min_weight_full_bipartite_matching
from scipy.spatial import KDTree
from skimage.registration import phase_cross_correlation

#: Deviation of ln(volume) and ln(moments) of the same grain in two scans, and of a grain that the
#: border cuts.
VOLUME, MOMENTS, CUT = 0.06, 0.08, 0.5
#: Distances within which a grain is looked for, round by round [median diameters].
ROUNDS = (1.5, 1.0, 0.6, 0.5)
#: Neighbours whose median motion is expected of a grain.
NEIGHBOURS = 12
#: Largest cost of a pair, in squared deviations of each of the five.
LARGEST_COST = 30.0


def common_shift(first, second):
    """Motion of the sample as a whole, by the correlation of both images [voxels], (x, y, z)."""
    step = max(1, round(max(first.image.shape) / 128))
    part = (slice(None, None, step),) * 3
    solid = [(bodies.image[part] > 0).astype(np.float32) for bodies in (second, first)]
    shift, _, _ = phase_cross_correlation(*(s - s.mean() for s in solid), normalization=None)
    return step * shift[::-1].astype(float)


def match(first, second, expected=None):
    """The grain of the second scan that is each of the first.

    Args:
        first, second: :class:`~.bodies.Bodies`.
        expected: Displacements that are expected [voxels], shape (num_grains, 3); None: that of
            the sample as a whole.

    Returns:
        Place among those of the second scan, -1 for a grain that is lost, shape (num_grains,).
    """
    if expected is None:
        expected = np.tile(common_shift(first, second), (len(first.label), 1))
    for reach in ROUNDS:
        found = _assign(first, second, expected, reach * first.diameter)
        known = np.flatnonzero(found >= 0)
        if known.size == 0:
            return found
        moved = second.centre[found[known]] - first.centre[known]
        count = min(NEIGHBOURS + 1, known.size)
        _, near = KDTree(first.centre[known]).query(first.centre, k=count)
        expected = np.median(moved[near.reshape(len(first.label), count)], axis=1)
    return found


def _assign(first, second, expected, reach):
    """One round of :func:`match`, with the distance [voxels] within which grains are looked for."""
    place = first.centre + expected
    near = KDTree(second.centre).query_ball_point(place, reach)
    i = np.repeat(np.arange(len(near)), [len(n) for n in near])
    j = np.concatenate([np.asarray(n, dtype=np.int64) for n in near])
    away = np.linalg.norm(second.centre[j] - place[i], axis=1) / (0.5 * reach)
    cut = first.cut[i] | second.cut[j]
    volume = np.log(second.volume[j] / first.volume[i]) / np.where(cut, CUT, VOLUME)
    moments = np.log(second.moments[j] / first.moments[i]) / np.where(cut, CUT, MOMENTS)[:, None]
    cost = away**2 + volume**2 + (moments**2).sum(axis=1)
    good = cost < LARGEST_COST
    i, j, cost = i[good], j[good], cost[good]
    # To be lost has its price, too: a column of its own for each grain. No cost is 0, which a
    # sparse array would not keep.
    lost = np.arange(len(place))
    costs = np.concatenate([cost + 1.0, np.full(len(place), LARGEST_COST + 1.0)])
    shape = len(place), len(second.label) + len(place)
    rows, columns = np.append(i, lost), np.append(j, len(second.label) + lost)
    table = coo_array((costs, (rows, columns)), shape=shape).tocsr()
    row, column = min_weight_full_bipartite_matching(table)
    found = np.full(len(place), -1)
    found[row] = np.where(column < len(second.label), column, -1)
    return found
