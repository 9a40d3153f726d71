"""The judge of intrusion is judged: known depths, and VTK's signed distance."""

import numpy as np
import pytest
import pyvista

from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.verification.intrusion import find_intrusion, is_inside, what_is_missing
from tests.bodies import sphere


@pytest.fixture
def judge():
    """The test is skipped where the library is absent, or built for other processors."""
    if why := what_is_missing():
        pytest.skip(why)


def surface(points, cells):
    """Nodes and outward facets of a body."""
    faces = np.concatenate([cells[:, [1, 2, 3]], cells[:, [0, 3, 2]]])
    faces = np.concatenate([faces, cells[:, [0, 1, 3]], cells[:, [0, 2, 1]]])
    _, first, count = np.unique(
        np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True
    )
    nodes, facets = np.unique(faces[first[count == 1]], return_inverse=True)
    return points[nodes], facets.reshape(-1, 3)


def together(*bodies):
    first = np.cumsum([0] + [len(x) for x, _ in bodies])
    x = np.concatenate([x for x, _ in bodies])
    facets = np.concatenate([f + k for (_, f), k in zip(bodies, first, strict=False)])
    return x, facets, np.repeat(np.arange(len(bodies)), [len(x) for x, _ in bodies])


def turned(points, axis):
    """By 45° about an axis: a cube stands on an edge."""
    i, j = (k for k in range(3) if k != axis)
    R = np.eye(3)
    R[[i, j, i, j], [i, j, j, i]] = np.sqrt(0.5) * np.array([1, 1, -1, 1])
    return points @ R.T


@pytest.mark.parametrize("depth", [-0.01, 0.003, 0.02, 0.05])
def test_edge_across_edge(judge, depth):
    """Two right-angled edges cross, d deep: no node is inside, the deepest point is d/√2 deep."""
    points, facets = surface(*box((1, 1, 1), (4, 4, 4), (-0.5, -0.5, -0.5)))
    lower = turned(points, 0) - np.array([0.013, 0, np.sqrt(0.5)])
    upper = turned(points, 1) + np.array([0, 0.017, np.sqrt(0.5) - depth])
    x, facets, body = together((1e-3 * lower, facets), (1e-3 * upper, facets))
    found = find_intrusion(x, facets, body, 2.5e-4)
    # Points on the edges are a tenth of the intruding part apart.
    assert found.depth == pytest.approx(1e-3 * max(depth, 0) / np.sqrt(2), rel=0.1)
    assert (found.num_edges > 0) == (depth > 0)


def test_ball_in_ball_against_vtk(judge):
    """The deepest node of either ball below the other's facets, as VTK's signed distance has it."""
    first = surface(*sphere(1.0, 0.3))
    second = turned(turned(first[0], 0), 1) + np.array([1.85, 0.1, 0.2]), first[1]
    x, facets, body = together(first, second)
    found = find_intrusion(x, facets, body, 0.3)
    deepest, count = 0.0, 0
    for (points, _), (others, faces) in ((first, second), (second, first)):
        other = pyvista.PolyData(others, np.insert(faces, 0, 3, axis=1).ravel())
        distance = pyvista.PolyData(points).compute_implicit_distance(other)["implicit_distance"]
        deepest, count = max(deepest, -distance.min()), count + np.sum(distance < 0)
        inside = is_inside(points, others[faces])
        assert np.array_equal(inside, distance < 0)
    assert count > 4 and found.num_vertices == count
    # Between nodes an edge may be deeper, by its sagitta h²/8R at most.
    assert deepest * (1 - 1e-12) <= found.depth <= deepest + 0.3**2 / 8
