"""Where the walls around a sample stood in scans: platens at ends of grains, cuts with centres.

**Platens.** Labels end at whole voxels: all grains that a platen touches do at the same one where
it lies along voxels, so neither their number nor the first scan takes half a voxel of doubt off.
Tracks are exact to 0.1 voxels, but do not see what grains are flattened. The run does, which holds
the same grains pressed as much. Its surfaces beside the scan go, as they are, as the scan's grains
do: a node at x of a grain with the centre C in the first scan is in the later one at

    z = C + U + Q Rᵀ (x - C - u),

u and R being the grain's motion in the run, U and Q in the scan. Let e and e' be the ends of a
grain along the normal of a wall by x and z, and w the place of the wall in the run. It stood at

    w' = w + median of (e' - e) over the grains that touch it in the run,

which end within the error of a track from the outermost. Nodes stand out beyond walls that press on
facets, the more the harder. So w follows from the distance of both walls in the history, and the
ends stand out alike at both. How much grains are flattened follows from how near
they come, hardly from what they are made of: ten times softer balls without plastic flow do.

**Cuts** are walls of the run where the scan goes on through the sand. Grains go on there, too, and
others are seen later: the wall goes as the linear field that fits motions of all centres best.
A plane through sand cuts the same share of solid as there is in the volume (A. Delesse, 1847), one
that touches it none: a wall is a cut if the layer of voxels inside it has over half of the share
of the sample.

Errors of strains, against the ends of the run's nodes, along three axes (root mean square) at
strains of 0.03 and 0.05 to 0.06:

    grains high; voxels a grain     2.3; 26  2.3; 20  7.8; 26  7.8; 17
    here, beside the same run        0.0006   0.0006   0.0002   0.0003
    beside one ten times softer      0.0012   0.0015   0.0013   0.0012
    surfaces as in the first scan    0.0133   0.0133   0.0089   0.0091
    linear field                     0.0026   0.0026   0.0041   0.0040
    ends of labels                   0.0047   0.0040   0.0031   0.0013

This fails where the run is pressed much less than the scan, where a grain has broken in one of both
only, where faces of grains lie on walls, which count as cuts, and where grains that were cut have
been left out: the others end at no platen. `peers.scan_doubts.about_walls` holds strains of walls
and of centres of grains beside each other.
"""

import numpy as np

from ..analysis.kinematics import grain_motion
from ..container import BOTTOM, INNER, SIDE, TOP
from ..errors import InputError
from .scans import linear_field, start_moment, start_points

#: Coordinate of flat walls, and on which side of the sample they are.
PLANES = {
    **{f"{a}_{end}": (k, s) for k, a in enumerate("xyz") for end, s in (("min", -1), ("max", 1))},
    BOTTOM: (2, -1),
    TOP: (2, 1),
}
#: On which side of the sample walls are: 1 around it.
ROUND = {SIDE: 1, INNER: -1}
SIDES = {**{wall: side for wall, (_, side) in PLANES.items()}, **ROUND}
#: Share of solid at a cut over that in the volume: in the middle between theory's 1 and a wall's 0.
SOLID_IN_CUTS = 0.5
#: Grains that end so near to a wall touch it: the error of a track [voxels].
TOUCHING = 0.1


def grain_ends(run, points, grain):
    """How far each grain reaches out to each wall of a run's container.

    Args:
        run: :class:`~mufe_fenicsx.results.run.Run`.
        points: [m], shape (num_points, 3).
        grain: Number of the grain of each point, all from 0 on, shape (num_points,).

    Returns:
        Dictionary {wall: side times coordinate along its axis, or times radius [m], (num_grains,)}.

    Raises:
        InputError: Walls are round, and run.json does not say where their axis is.
    """
    found = {}
    for wall in run.container.walls:
        if wall in PLANES:
            axis, side = PLANES[wall]
            reach = side * points[:, axis]
        else:
            reach = ROUND[wall] * np.linalg.norm(points[:, :2] - _centre(run), axis=1)
        found[wall] = np.full(grain.max() + 1, -np.inf)
        np.maximum.at(found[wall], grain, reach)
    return found


def _centre(run):
    """Of round walls across z [m], shape (2,)."""
    centre = (run.summary.get("container") or {}).get("centre")
    if centre is None:
        raise InputError(f"{run.path}/run.json has no container, expected its shape and centre")
    return np.array(centre)


def cut_walls(run, labels, places, voxel_size):
    """Names of the walls at which a scan goes on through the sand, in their order.

    Args:
        run: :class:`~mufe_fenicsx.results.run.Run`.
        labels: Of the scan, (z, y, x).
        places: Of the walls in it, see :func:`first_places`.
        voxel_size: [m].
    """
    z, y, x = (voxel_size * (at + 0.5) for at in np.ogrid[tuple(slice(n) for n in labels.shape)])
    depths = {}
    for wall, place in places.items():
        if wall in PLANES:
            axis, side = PLANES[wall]
            depths[wall] = side * (place - (x, y, z)[axis])
        else:
            centre = _centre(run)
            depths[wall] = ROUND[wall] * (place - np.hypot(x - centre[0], y - centre[1]))
    inside, solid = np.ones(labels.shape, dtype=bool), labels > 0
    for depth in depths.values():
        inside &= depth > 0
    least = SOLID_IN_CUTS * _share(solid[inside])
    return [
        w for w, depth in depths.items() if _share(solid[inside & (depth < voxel_size)]) > least
    ]


def _share(solid):
    """Share of the voxels that are solid; 0 where there are none."""
    return float(solid.mean()) if solid.size else 0.0


def places_by_scans(run, start, tracks, moments, voxel_size, cut=()):
    """Places of walls in the first scan and in each later one.

    Args:
        run: :class:`~mufe_fenicsx.results.run.Run`.
        start: :class:`~.scans.Start` of it.
        tracks: List of :class:`~mufe_fenicsx.geometry.tracking.track.Track`. Grains that one has
            lost are left out of what its walls move by; round ones turn as in the run.
        moments: List of :class:`~.scans.Moment`, of the run beside each.
        voxel_size: [m].
        cut: Walls that go with the centres of grains, see :func:`cut_walls`.

    Returns:
        List of dictionaries {wall: coordinate along its axis, or radius [m]}.
    """
    found = [first_places(run, start)]
    for track, moment in zip(tracks, moments, strict=True):
        ours, theirs = _ends(run, start, track, moment)
        beyond_walls = _beyond_walls(run, moment.time, {w: of.max() for w, of in ours.items()})
        now = {}
        for wall, place in found[0].items():
            if wall in cut:
                now[wall] = _with_centres(wall, place, track)
            else:
                end = ours[wall].max()
                beyond = (theirs[wall] - ours[wall])[ours[wall] >= end - TOUCHING * voxel_size]
                now[wall] = float(SIDES[wall] * (end - beyond_walls[wall] + np.median(beyond)))
        found.append(now)
    return found


def first_places(run, start):
    """Places of walls in the first scan, a dictionary: they touch the run's grains at its start."""
    moment = start_moment(run, start.seated)
    mine = np.isin(moment.state.grain, list(start.grains))
    points = moment.points[np.unique(moment.state.cells[mine])]
    ends = grain_ends(run, points, np.zeros(len(points), dtype=int))
    ends = {wall: reach[0] for wall, reach in ends.items()}
    time = moment.time if start.seated else float(run.history["time"].iloc[0])
    beyond = _beyond_walls(run, time, ends)
    return {wall: float(SIDES[wall] * (reach - beyond[wall])) for wall, reach in ends.items()}


def _beyond_walls(run, time, ends):
    """How far ends of all grains stand out beyond each wall, alike at both of an axis [m].

    Args:
        run: :class:`~mufe_fenicsx.results.run.Run`.
        time: Of the run [s].
        ends: Dictionary {wall: how far the outermost grain reaches, see :func:`grain_ends`}.
    """
    history, container, found = run.history, run.container, {}
    names = list(container.walls)
    for length, of in zip(run.lengths(history).T, container.walls_of_axis, strict=True):
        now, walls = np.interp(time, history["time"], length), [names[k] for k in of]
        for wall in walls:
            if len(walls) == 1:  # whose length is its diameter
                found[wall] = ends[wall] - 0.5 * SIDES[wall] * now
            else:
                found[wall] = 0.5 * (sum(ends[each] for each in walls) - now)
    return found


def _ends(run, start, track, moment):
    """Ends of tracked grains in the run, and in a later scan, see :func:`grain_ends`."""
    cells, grain = moment.state.cells, moment.state.grain
    first = start_points(run, moment.state, start.seated)
    own = grain_motion(first, moment.points, cells, grain)
    nodes, at = np.unique(cells, return_index=True)
    k = np.searchsorted(own.labels, np.repeat(grain, 4)[at])
    label = np.array([start.grains.get(g, -1) for g in own.labels.tolist()])[k]
    row = np.minimum(np.searchsorted(track.label, label), len(track.label) - 1)
    known = (track.label[row] == label) & track.found[row]
    nodes, row, k = nodes[known], row[known], k[known]
    turn = np.where(np.isfinite(track.rotation[row]), track.rotation[row], own.rotation[k])
    off = moment.points[nodes] - own.centre[k] - own.translation[k]
    off = np.einsum("nji,nj->ni", own.rotation[k], off) + own.centre[k] - track.centre[row]
    now = track.centre[row] + track.displacement[row] + np.einsum("nij,nj->ni", turn, off)
    grain = np.unique(k, return_inverse=True)[1]
    return (grain_ends(run, x, grain) for x in (moment.points[nodes], now))


def _with_centres(wall, place, track):
    """Where a wall goes with the linear field of the displacements of all centres."""
    field = linear_field(track.centre, track.displacement)
    if wall not in PLANES:
        return float(place * (1 + 0.5 * (field[0, 0] + field[1, 1])))
    axis, at = PLANES[wall][0], track.centre[track.found].mean(axis=0)
    at[axis] = place
    return float(place + (at @ field[:3] + field[3])[axis])
