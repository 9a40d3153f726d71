"""Polyhedral grains: the same bodies on all meshes."""

import numpy as np
import pytest

from mufe_fenicsx.geometry.measure import boundary_triangles
from mufe_fenicsx.verification.polyhedra import polyhedral_grains

BOX = (4.0, 4.0, 4.0)


def volumes(bodies):
    return np.array([
        (np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]]) / 6).sum()
        for points, cells in bodies
    ])  # fmt: skip


def test_polyhedra_fill_their_box_and_keep_their_shape_on_finer_meshes():
    """Cells of 0.97 to 0.995 of the size of those that fill the box; flat faces stay flat."""
    coarse, fine = (polyhedral_grains(h, 6, BOX, radius=1.0) for h in (1.5, 0.7))
    assert sum(len(c) for _, c in fine) > 2 * sum(len(c) for _, c in coarse)
    # Corners are rounded to 1e-9 of the radius.
    assert volumes(fine) == pytest.approx(volumes(coarse), rel=1e-7)
    assert 0.97**3 < volumes(fine).sum() / np.prod(BOX) < 0.995**3
    for (points, cells), (first, _) in zip(fine, coarse, strict=True):
        normals = set()
        for a, b, c in points[boundary_triangles(cells)]:
            normal = np.cross(b - a, c - a)
            normals.add(tuple(np.round(normal / np.linalg.norm(normal), 5) + 0.0))
        # A face of a Voronoi cell has one normal: the six of the box's sides' cells among them.
        assert 4 <= len(normals) <= 6 + 5
        assert points.max(axis=0) == pytest.approx(first.max(axis=0), abs=1e-12)
