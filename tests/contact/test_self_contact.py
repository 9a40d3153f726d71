"""A grain that closes on itself."""

import mufe_fenicsx  # noqa: F401, before dolfinx: it loads MPI

# isort: split
import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.contact.laws import COMPLIANCE
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.run.from_bodies import build, drive, settle
from mufe_fenicsx.verification.tets import rotation

SIZE, OPENING = 1e-3, 8e-6
QUARTZ = Elastic(100e9, 0.15, 2650.0)


def horseshoe():
    """A block of 1.5 x 0.5 x 1 slit in the middle from one end to a third, a little open there."""
    points, cells = box((1.5, 0.5, 1.0), (6, 2, 4))
    upper = points[cells].mean(axis=1)[:, 2] > 0.5
    slit = np.flatnonzero((np.abs(points[:, 2] - 0.5) < 1e-9) & (points[:, 0] > 0.51))
    double = np.arange(len(points))
    double[slit] = len(points) + np.arange(slit.size)
    cells[upper] = double[cells[upper]]
    points = SIZE * np.vstack([points, points[slit]])
    above = np.zeros(len(points), dtype=bool)
    above[np.unique(cells[upper])] = True
    along = np.maximum(points[:, 0] / SIZE - 0.5, 0.0)
    points[above, 2] += OPENING * along[above]
    # Along the middle: at the rims nodes can pass beside each other, and edges do not meet here.
    middle = slit[np.abs(points[slit, 1] - 0.25 * SIZE) < 1e-9]
    return points, cells, middle, double[middle]


@pytest.mark.parametrize("self_contact", [pytest.param(False, marks=pytest.mark.slow), True])
def test_horseshoe_closes_on_itself(self_contact):
    """Pressed until its slit would be closed three times: the arms meet, or pass each other."""
    points, cells, lower, upper = horseshoe()
    low, high = points.min(axis=0) - 1e-9, points.max(axis=0) + 1e-9
    s = build(
        MPI.COMM_SELF, [(points, cells)], QUARTZ, low, high, axes="z", friction=0.3,
        damping=np.pi * QUARTZ.wave_speed / (3 * SIZE), self_contact=self_contact,
        points="nodes",
    )  # fmt: skip
    assert s.contact.overlaps.num_accepted == 0
    place = [np.argmin(np.linalg.norm(s.mesh.x - points[n], axis=1)) for n in (*lower, *upper)]
    drive(s, {"z_max": (0, 0, -3 * OPENING)}, 40 * SIZE / QUARTZ.wave_speed)
    settle(s, 1e-8, max_steps=4000)
    z = s.state.x[place, 2]
    closing = z[lower.size :] - z[: lower.size]
    closed = s.contact.pairs.closed
    if not self_contact:
        assert not closed.any() and closing.min() < -0.5 * OPENING
        return
    # The layers of both sides give 2 c h p/E*, p less than the load on a closed block.
    assert closed.sum() > 10
    assert closing.min() > -2 * COMPLIANCE * s.contact.edge * 3 * OPENING / SIZE
    assert s.num_contacts > 0
    f = s.force.x.array.reshape(-1, 3)
    on_walls = s.walls.force.sum(axis=0)
    # Forces of a grain on itself add up to nothing: round-off of the sums.
    assert np.abs(f.sum(axis=0) + on_walls).max() < 1e-12 * np.abs(s.wall_forces()).sum()
    bottom, top = s.wall_forces()
    assert top == pytest.approx(bottom, rel=1e-3)
    energy = s.energies()
    # At strains of 2 % the incremental law of the bulk itself misses 2.5e-3, with the slit open.
    assert abs(energy["residual"]) < 4e-3 * energy["work"]


def test_a_convex_body_never_meets_itself():
    """Whichever way it is turned: sharp edges and thin parts are no voids."""
    points, cells = box((1.0, 1.0, 0.1), (5, 5, 1))
    points = SIZE * points @ rotation([1, 2, 3], 0.7).T
    corner = np.full(3, 2 * SIZE)
    s = build(
        MPI.COMM_SELF, [(points, cells)], QUARTZ, -corner, corner, self_contact=True, points="nodes"
    )
    assert s.contact.pairs.node.size == 0
