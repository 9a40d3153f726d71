"""The half ball that is pressed, as every program takes it: mesh, pole, base and a block above."""

from dataclasses import asdict, dataclass

import numpy as np

from mufe_fenicsx.geometry.bodies.half_ball import half_ball
from mufe_fenicsx.verification.plastic_ball import slope_of

E, NU, RADIUS, GROWTH = 100e9, 0.15, 1e-3, 0.3
#: Corners of the faces of a tetrahedron, S1 to S4 of CalculiX.
FACES = ((0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 2, 3))
#: Facets within so many contact radii of the pole may touch.
NEAR = 3.0
#: A hexahedron's six tetrahedra.
SIX = ((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6))


@dataclass(frozen=True)
class Ball:
    """A half ball, pole up, and a flat block that touches it; lengths in m, stresses in Pa."""

    points: np.ndarray  #: shape (num_points, 3)
    cells: np.ndarray  #: positively oriented, shape (num_cells, 4)
    base: np.ndarray  #: nodes that are held
    facets: np.ndarray  #: (cell, face) of those that may touch, shape (num_facets, 2)
    pole: np.ndarray  #: their nodes, normals outwards, shape (num_facets, 3)
    block_points: np.ndarray  #: of the block, edges as long as those of the contact
    block_cells: np.ndarray  #: tetrahedra of them, positively oriented
    plane: np.ndarray  #: facets of the block that may be touched, normals outwards
    top: float  #: height of the pole
    half: float  #: half of the width of the block
    h: float  #: length of edges at the contact
    approach: float  #: way of the block down
    E: float
    nu: float
    yield_stress: float  #: without hardening; infinity: elastic

    def save(self, path):
        """Write all of it for the scripts, as arrays of NumPy."""
        np.savez(path, **asdict(self))


def make_ball(elements_per_radius, a_over_R, approach, yield_stress=np.inf):
    """The :class:`Ball` of a case with the mesh that it has there."""
    a = a_over_R * RADIUS
    h = a / elements_per_radius
    slope = slope_of(GROWTH, elements_per_radius)
    points, cells = half_ball(RADIUS, h, slope, (0.0, 0.0, 1.0), a, 0.4 * RADIUS)
    top = float(points[:, 2].max())
    facets = np.sort(cells[:, FACES].reshape(-1, 3), axis=1)
    _, inverse, count = np.unique(facets, axis=0, return_inverse=True, return_counts=True)
    outer = (count[inverse.ravel()] == 1).reshape(-1, 4)  # of one tetrahedron only
    middle = points[cells[:, FACES]].mean(axis=2)
    near = np.argwhere(outer & (np.linalg.norm(middle - [0, 0, top], axis=2) < NEAR * a))
    pole = cells[near[:, :1], np.array(FACES)[near[:, 1]]]
    block_points, block_cells, plane = _block(top, NEAR * a, h)
    return Ball(
        points=points,
        cells=cells,
        base=np.flatnonzero(points[:, 2] < points[:, 2].min() + 1e-6 * RADIUS),
        facets=near,
        pole=_outwards(points, pole, points[cells[near[:, 0]]].mean(axis=1)),
        block_points=block_points,
        block_cells=block_cells,
        plane=_outwards(block_points, plane, block_points.mean(axis=0)),
        top=top,
        half=NEAR * a,
        h=h,
        approach=approach,
        E=E,
        nu=NU,
        yield_stress=yield_stress,
    )


def _block(top, half, h):
    """One layer of cubes: points, tetrahedra and facets of its lower side."""
    m = int(np.ceil(2 * half / h))
    x, y = np.meshgrid(*[np.linspace(-half, half, m + 1)] * 2, indexing="ij")
    low = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, top)])
    points = np.vstack([low, low + np.array([0, 0, 2 * half / m])])
    i, j = np.meshgrid(np.arange(m), np.arange(m), indexing="ij")
    first = (i * (m + 1) + j).ravel()
    square = np.column_stack([first, first + m + 1, first + m + 2, first + 1])
    cubes = np.hstack([square, square + x.size])
    cells = np.vstack([cubes[:, corners] for corners in SIX])
    corner = points[cells]
    edges = corner[:, 1:] - corner[:, :1]
    turned = np.linalg.det(edges) < 0
    cells[turned] = cells[turned][:, [0, 2, 1, 3]]
    return points, cells, np.vstack([square[:, [0, 1, 2]], square[:, [0, 2, 3]]])


def _outwards(points, facets, inside):
    """Facets whose normals point away from ``inside``."""
    a, b, c = np.moveaxis(points[facets], 1, 0)
    away = np.einsum("ij,ij->i", np.cross(b - a, c - a), (a + b + c) / 3 - inside)
    facets = facets.copy()
    facets[away < 0] = facets[away < 0][:, [0, 2, 1]]
    return facets
