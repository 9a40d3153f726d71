"""Bodies of tools from closed and from open surfaces."""

import meshio
import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.shapes import box, sphere
from mufe_fenicsx.geometry.bodies.tool_body import read_tool, tool_body
from mufe_fenicsx.geometry.measure import boundary_triangles


def volume(points, cells):
    x = points[cells]
    return np.linalg.det(x[:, 1:] - x[:, :1]) / 6


def funnel(sides=24):
    """An open cone: two rings, normals inward."""
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    points = np.vstack([0.3 * ring, ring + np.eye(3)[2]])
    k, n = np.arange(sides), (np.arange(sides) + 1) % sides
    return points, np.vstack([np.column_stack([k, k + sides, n]),
                              np.column_stack([n, k + sides, n + sides])])  # fmt: skip


def test_a_closed_surface_is_filled_and_keeps_its_triangles(tmp_path):
    """Of an STL, which repeats its points, in millimetres and inside out."""
    points, cells = box((2.0, 1.0, 0.5), (2, 1, 1))
    triangles = boundary_triangles(cells)[:, ::-1]
    corners = points[triangles].reshape(-1, 3)
    file = tmp_path / "brick.stl"
    meshio.write_points_cells(file, corners, [("triangle", np.arange(len(corners)).reshape(-1, 3))])
    found, tets = read_tool(file, 1e-3)
    assert volume(found, tets).min() > 0
    assert volume(found, tets).sum() == pytest.approx(1e-9, rel=1e-6)
    assert len(boundary_triangles(tets)) == len(triangles)
    with pytest.raises(InputError, match="is closed, expected no thickness"):
        read_tool(file, 1e-3, 1e-4)


def test_a_fine_surface_takes_few_tetrahedra():
    """They grow inwards, and none is mended: 20 480 facets took two minutes, and now one second."""
    points, cells = sphere(1.0, 0.12)
    triangles = boundary_triangles(cells)
    found, tets = tool_body(points, triangles)
    assert len(triangles) > 1000 and len(tets) < 4 * len(triangles)
    assert volume(found, tets).min() > 0
    assert volume(found, tets).sum() == pytest.approx(volume(points, cells).sum(), rel=1e-9)
    assert len(boundary_triangles(tets)) == len(triangles)


def test_an_open_surface_becomes_a_sheet_behind_it():
    """A funnel: its given side stays, and the sheet has its area times its thickness."""
    points, triangles = funnel()
    thickness = 0.01
    found, cells = tool_body(points, triangles, thickness)
    a, b, c = points[triangles].transpose(1, 0, 2)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    assert volume(found, cells).min() > 0
    # The other side is wider, by the thickness over the radius.
    assert volume(found, cells).sum() == pytest.approx(area * thickness, rel=0.02)
    given = {tuple(point) for point in points.round(12).tolist()}
    assert given <= {tuple(point) for point in found.round(12).tolist()}
    outside = found[[tuple(p) not in given for p in found.round(12).tolist()]]
    assert np.hypot(*outside[:, :2].T).min() > 0.3


def test_surfaces_that_are_no_tool():
    points, triangles = funnel()
    with pytest.raises(InputError, match="is open, expected a closed one, or a thickness"):
        tool_body(points, triangles)
    turned = triangles.copy()
    turned[0] = turned[0, ::-1]
    with pytest.raises(InputError, match="expected all normals on one side"):
        tool_body(points, turned, 0.01)
    with pytest.raises(InputError, match="is more than surface has room for where it bends"):
        tool_body(points[:, [0, 1, 2]], triangles[:, ::-1], 2.0)
    with pytest.raises(InputError, match="thickness = -1 m, expected > 0"):
        tool_body(points, triangles, -1)
