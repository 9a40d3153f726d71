"""Where the walls around a sample stood in scans: at the ends of its grains, moved as tracked.

A wall touches the grain that reaches out furthest. Surfaces of the run's grains at its start, each
moved and turned as its label was tracked, reach as far as the wall of the later scan, but for two
things: the errors of the track, about 0.1 voxels and 1° of half a grain; and what grains are
flattened, which tracks do not see: δ at a wall, in Hertz' theory for a force F, a radius R and
E* = E/(1 - ν²)

    δ = (3 F / (4 E* √R))^(2/3).

Where few grains lie between walls it is much of what these move by. `peers.scan_doubts.about_walls`
holds strains of walls and of centres of grains beside each other.

Other ways are less exact. Ends of labels are known to a voxel. A linear field of displacements,
taken to the walls, counts the middle of the sample more than its ends, where grains turn to lie
along the walls. In a triaxial test on 40 grains, four high, walls' strains along three axes at
axial ones of 0.04 and 0.08 are off by (root mean square)

    voxels a grain      26      17      10
    here             0.003   0.003   0.005
    ends of labels   0.006   0.010   0.010
    linear field     0.011   0.011   0.011
"""

import numpy as np

from ..container import BOTTOM, INNER, SIDE, TOP
from ..errors import InputError
from .scans import start_moment

#: Coordinate of flat walls, and on which side of the sample they are.
PLANES = {
    **{f"{a}_{end}": (k, s) for k, a in enumerate("xyz") for end, s in (("min", -1), ("max", 1))},
    BOTTOM: (2, -1),
    TOP: (2, 1),
}


def wall_places(run, points):
    """Places of the walls of a run's container that touch points from outside.

    Args:
        run: :class:`~mufe_fenicsx.results.run.Run`.
        points: [m], shape (num_points, 3).

    Returns:
        Dictionary {wall: coordinate along its axis, or radius [m]}.

    Raises:
        InputError: Walls are round, and run.json does not say where their axis is.
    """
    found = {}
    for wall in run.container.walls:
        if wall in PLANES:
            axis, side = PLANES[wall]
            reach = points[:, axis]
        else:
            side = {SIDE: 1, INNER: -1}[wall]
            reach = np.linalg.norm(points[:, :2] - _centre(run), axis=1)
        found[wall] = float(reach.max() if side > 0 else reach.min())
    return found


def _centre(run):
    """Of round walls across z [m], shape (2,)."""
    centre = (run.summary.get("container") or {}).get("centre")
    if centre is None:
        raise InputError(f"{run.path}/run.json has no container, expected its shape and centre")
    return np.array(centre)


def places_by_scans(run, start, tracks):
    """Places of walls in the first scan and in each later one, see :func:`wall_places`.

    Args:
        run: :class:`~mufe_fenicsx.results.run.Run`.
        start: :class:`~.scans.Start` of it.
        tracks: List of :class:`~mufe_fenicsx.geometry.tracking.track.Track`. Grains that one has
            lost are left out of what its walls move by; round ones do not turn.
    """
    moment = start_moment(run, start.seated)
    nodes, at = np.unique(moment.state.cells, return_index=True)
    grain = np.repeat(moment.state.grain, 4)[at]
    mine = np.isin(grain, list(start.grains))
    points = moment.points[nodes[mine]]
    label = np.array([start.grains[g] for g in grain[mine].tolist()])
    found = [wall_places(run, points)]
    for track in tracks:
        row = np.minimum(np.searchsorted(track.label, label), len(track.label) - 1)
        known = (track.label[row] == label) & track.found[row]
        row, x = row[known], points[known]
        turn = np.where(np.isfinite(track.rotation[row]), track.rotation[row], np.eye(3))
        off = x - track.centre[row]
        now = track.centre[row] + track.displacement[row] + np.einsum("nij,nj->ni", turn, off)
        before, after = wall_places(run, x), wall_places(run, now)
        found.append({w: place + after[w] - before[w] for w, place in found[0].items()})
    return found
