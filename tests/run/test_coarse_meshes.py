"""Grains whose edges are sharp all over are said at the start of a run."""

import mufe_fenicsx  # noqa: F401, before dolfinx: it loads MPI

# isort: split
import pytest
from mpi4py import MPI

from mufe_fenicsx.bulk.tools import Tool
from mufe_fenicsx.geometry.bodies.shapes import box, sphere
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.run.coarse_meshes import MOST_SHARP, warning_of_coarse_meshes
from mufe_fenicsx.run.from_bodies import build

SIZE = 1e-3
BOX = (0, 0, 0), (SIZE,) * 3
COUNT = max(MPI.COMM_WORLD.size, 2)


def warning(body, **more):
    bodies = [(body[0] + [3 * k * SIZE, 0, 0], body[1]) for k in range(COUNT)]
    length = 3 * COUNT * SIZE
    rock = Elastic(1e9, 0.2, 2500.0)
    return warning_of_coarse_meshes(
        build(MPI.COMM_WORLD, bodies, rock, (0, 0, 0), (length,) * 3, "", **more)
    )


@pytest.mark.mpi
def test_cubes_of_two_facets_a_face_are_coarse_and_of_eight_are_not():
    """12 of 18 edges are sharp, and 24 of 72; a tool of the first kind does not count.

    Facets of a²/2 have edges of 1.075 a, the ball of a cube the radius 0.620 a: 1.7.
    """
    line = warning(box((SIZE,) * 3, (1, 1, 1)))
    assert "67% of the edges" in line and "edges are 1.075 mm, 1.7 of the radius" in line
    tool = Tool("block", *box((SIZE,) * 3, (1, 1, 1), (0, 0, 3 * SIZE)))
    assert warning(box((SIZE,) * 3, (2, 2, 2)), tools=[tool]) is None


def test_a_ball_is_smooth_up_to_the_edges_that_the_line_asks_for():
    """Facets of edges h turn by 0.6 h/R in the mean: by 20° at h = 0.58 R."""
    points, cells = sphere(SIZE, 0.7 * SIZE)
    line = warning((points, cells))
    wanted = float(line.split("with ")[-1].split(" µm")[0]) * 1e-6
    # The mesh has a little less volume than the ball.
    assert wanted == pytest.approx(0.45 * SIZE, rel=0.06)
    assert warning(sphere(SIZE, wanted)) is None


def test_faces_of_cracks_are_not_counted_as_a_run_goes_on():
    """All edges of a brick that is cut into its cells are sharp, and say nothing of its mesh."""
    s = build(MPI.COMM_SELF, [box((SIZE,) * 3, (2, 2, 2))], Elastic(1e9, 0.2, 2500.0), *BOX, "")
    s.grow(s.mesh.inner_facets()[1])
    own = s.contact.own
    assert own.sharp_edge.mean() > MOST_SHARP and warning_of_coarse_meshes(s) is None
