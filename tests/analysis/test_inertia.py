"""Inertia of meshes against closed forms, an exact quadrature, and another program's voxels."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mufe_fenicsx.analysis.inertia import grain_inertia, unphysical
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.geometry.measure import tet_volumes
from tests.bodies import sphere

TURN = Rotation.from_rotvec([0.4, -1.1, 0.7]).as_matrix()
FAR = np.array([30.0, -20.0, 50.0])


def bodies():
    """A block, a ball and an ellipsoid, turned and far from the origin, with labels 4, 7, 9."""
    ball, tets = sphere(1.0, 0.4)
    shapes = [box((1.0, 2.0, 3.0), (2, 3, 4)), (ball, tets), (ball * [1.5, 1.0, 0.6], tets)]
    points, cells, grain, at = [], [], [], 0
    for label, (x, c) in zip((4, 7, 9), shapes, strict=True):
        points.append(x @ TURN.T + label * FAR)
        cells.append(c + at)
        grain += [label] * len(c)
        at += len(x)
    return np.concatenate(points), np.concatenate(cells), np.array(grain)


def quadrature(points, cells, grain_of_cell, rho):
    """Mass, centre and inertia by the rule of four points, exact for quadratic functions."""
    a = (5 - np.sqrt(5)) / 20
    rule = a * np.ones((4, 4)) + (1 - 4 * a) * np.eye(4)
    for label in np.unique(grain_of_cell):
        mine = cells[grain_of_cell == label]
        weight = rho * np.repeat(tet_volumes(points, mine) / 4, 4)
        x = (rule @ points[mine]).reshape(-1, 3)
        centre = weight @ x / weight.sum()
        r = x - centre
        tensor = np.einsum("p,pi,pi->", weight, r, r) * np.eye(3) - (weight[:, None] * r).T @ r
        yield weight.sum(), centre, tensor


def test_inertia_is_the_exact_integral_over_the_tetrahedra():
    points, cells, grain = bodies()
    found = grain_inertia(points, cells, grain, rho=2.5)
    assert found.labels.tolist() == [4, 7, 9]
    for k, (mass, centre, tensor) in enumerate(quadrature(points, cells, grain, 2.5)):
        # Round-off: bodies of size 1 lie 500 from the origin.
        assert found.mass[k] == pytest.approx(mass, rel=1e-11)
        assert found.centroid[k] == pytest.approx(centre, rel=1e-12)
        assert np.abs(found.tensor[k] - tensor).max() < 1e-10 * tensor.max()
        turned = found.axes[k] @ tensor @ found.axes[k].T
        assert np.abs(turned - np.diag(found.moments[k])).max() < 1e-10 * tensor.max()
        assert np.linalg.det(found.axes[k]) == pytest.approx(1, abs=1e-12)
    # m/12 (b² + c²) of the block, smallest first: its edges along x, y, z are 1, 2, 3.
    assert found.moments[0] == pytest.approx(2.5 * 6 / 12 * np.array([5, 10, 13]), rel=1e-10)
    assert np.abs(found.axes[0] @ TURN)[::-1] == pytest.approx(np.eye(3), abs=1e-9)
    assert not unphysical(found.moments).any()


def test_moments_of_no_body_are_told():
    """A rod may have I₃ = I₁ + I₂; no body has more, none a negative one."""
    moments = np.array([[1, 2, 3], [1, 2, 3.001], [-0.1, 2, 2], [3, 1, 1], [np.nan, 1, 1]])
    assert unphysical(moments).tolist() == [False, True, True, True, True]


SPAM = """
import sys, numpy, spam.label
moments, axes = spam.label.momentOfInertia(numpy.load(sys.argv[1]))
numpy.savez(sys.argv[2], moments=moments[1], axis=axes[1, 6:9])
"""


@pytest.mark.slow
def test_inertia_agrees_with_that_of_voxels_by_spam(by_spam):
    """An ellipsoid as a mesh, and as voxels a 28th of its longest half-axis wide."""
    half = np.array([28.0, 18.0, 13.0])
    ball, tets = sphere(1.0, 0.12)
    ball *= np.cbrt(4 / 3 * np.pi / tet_volumes(ball, tets).sum())  # the ball's volume
    found = grain_inertia(ball * half @ TURN.T, tets, np.ones(len(tets), int))
    grid = np.stack(np.indices((62, 62, 62)), axis=-1) - 30.5
    labels = (((grid @ TURN / half) ** 2).sum(axis=-1) <= 1).astype(np.uint32)
    theirs = by_spam(SPAM, labels)
    # Voxels of width 1 and facets of h = 0.12 radii change second moments by less than 1 %.
    assert np.sort(theirs["moments"]) == pytest.approx(found.moments[0], rel=0.01)
    assert abs(theirs["axis"] @ found.axes[0, 0]) > np.cos(np.radians(1))
