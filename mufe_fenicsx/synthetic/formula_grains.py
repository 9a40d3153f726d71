"""Grains whose surface is a formula, meshed so that every mesh is the same body.

A grain is star-shaped: its surface is r(v) v over unit vectors v. The level function

    F(x) = |x| / r(x/|x|)

is 1 on the surface and homogeneous of degree one. Normals are its gradient over the length of that,
and the sum of the principal curvatures is the divergence of the normals; both are taken by central
differences, so that a shape is its radius and nothing else.
"""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..geometry.bodies.bulge import bulged
from ..geometry.bodies.contact_mesh import check_tets
from ..geometry.measure import boundary_triangles
from ..geometry.surface.edge_sizes import Sizes
from ..geometry.surface.given_surfaces import body_surface
from ..geometry.tets.fill import fill
from .shapes import harmonics, quadrature
from .triangulated import icosphere

#: Subdivisions of the icosahedron that meshes start from: edges of 0.04 radii.
LEVEL = 5
#: Steps of the central differences over the distance from the centre, for gradients and curvatures.
#: Errors are the squares of these, and round-off over them.
STEP, CURVATURE_STEP = 1e-5, 1e-3


@dataclass(frozen=True)
class Superquadric:
    """|x/a|^p + |y/b|^p + |z/c|^p = 1: an ellipsoid for p = 2, a rounded brick beyond."""

    semi_axes: tuple  #: a, b, c [m]
    exponent: float  #: p >= 2; with less the surface has edges

    def __post_init__(self):
        if len(self.semi_axes) != 3 or not min(self.semi_axes) > 0:
            raise InputError(f"semi_axes = {self.semi_axes}, expected three lengths > 0")
        if not self.exponent >= 2:
            raise InputError(f"exponent = {self.exponent}, expected >= 2")

    def radius(self, v):
        """Distance of the surface from the centre along unit vectors, (..., 3) -> (...)."""
        p = self.exponent
        return (np.abs(v / np.asarray(self.semi_axes)) ** p).sum(axis=-1) ** (-1 / p)


class Harmonics:
    """r = Σ c_k Y_k with the real spherical harmonics Y of degrees 0 … n, orthonormal.

    Args:
        coefficients: c [m], shape ((n + 1)²,), in the order of `shapes.harmonics`: by degree, in
            each the polar one first, then cosine and sine of 1, 2, … turns.
    """

    def __init__(self, coefficients):
        self.coefficients = np.asarray(coefficients, dtype=float)
        self.degree = round(len(self.coefficients) ** 0.5) - 1
        if (self.degree + 1) ** 2 != len(self.coefficients):
            num = len(self.coefficients)
            raise InputError(f"coefficients: {num}, expected a square number, (degree + 1)^2")

    def radius(self, v):
        """Distance of the surface from the centre along unit vectors, (..., 3) -> (...)."""
        v = np.asarray(v, dtype=float)
        basis, _ = harmonics(v.reshape(-1, 3), self.degree, first=0)
        return (basis @ self.coefficients).reshape(v.shape[:-1])


def level(shape, x):
    """F at points, (..., 3) -> (...)."""
    length = np.linalg.norm(x, axis=-1)
    return length / shape.radius(x / length[..., None])


def gradient(shape, x):
    """Gradient of F [1/m] at points, (n, 3) -> (n, 3)."""
    step = STEP * np.linalg.norm(x, axis=1)[:, None]
    difference = [level(shape, x + step * e) - level(shape, x - step * e) for e in np.eye(3)]
    return np.column_stack(difference) / (2 * step)


def normals(shape, x):
    """Outward unit normals of the level surfaces through points, (n, 3) -> (n, 3)."""
    g = gradient(shape, x)
    return g / np.linalg.norm(g, axis=1, keepdims=True)


def curvatures(shape, x):
    """Sum of the principal curvatures [1/m] of the level surfaces through points, > 0: convex."""
    step = CURVATURE_STEP * np.linalg.norm(x, axis=1)
    total = np.zeros(len(x))
    for i, e in enumerate(np.eye(3)):
        to = step[:, None] * e
        total += (normals(shape, x + to) - normals(shape, x - to))[:, i]
    return total / (2 * step)


def distances(shape, x):
    """Signed distances from the surface to first order [m], negative inside, (n, 3) -> (n,)."""
    f = level(shape, x)
    return (f - 1) / np.linalg.norm(gradient(shape, x), axis=1)


def volume(shape):
    """Volume [m³], by two Gauss points in each of 24 intervals along the edges of a cube."""
    directions, solid_angle = quadrature()
    return float(solid_angle @ shape.radius(directions) ** 3 / 3)


def surface_points(shape, directions):
    """Points of the surface along unit vectors, (n, 3) -> (n, 3) [m]."""
    return shape.radius(directions)[:, None] * directions


def mesh_formula(shape, size, *, bulge=True, turn=None, inner=1.0):
    """Tetrahedra of a grain with the nodes of its surface on the formula.

    Args:
        shape: Anything with ``radius(v)``, smooth, positive, and star-shaped about the origin.
        size: Length of edges [m].
        bulge: Move surface nodes outwards until the facets enclose the volume (`bodies.bulge`), as
            all round bodies here; False: leave them on the surface.
        turn: Rotation (3, 3) of the points that the mesh starts from: another mesh of this body.
        inner: Length of edges far inside over that on the surface.

    Returns:
        points (N, 3) [m] and positively oriented cells (M, 4).

    Raises:
        InputError: The size is not > 0.
        SurfaceError: The grain is too small for it.
    """
    if not size > 0:
        raise InputError(f"element size = {size}, expected > 0")
    check_tets(volume(shape), size)
    directions, triangles = icosphere(LEVEL)
    if turn is not None:
        directions = directions @ np.asarray(turn).T
    x, triangles = body_surface(surface_points(shape, directions), triangles, Sizes(size))
    x = x / level(shape, x)[:, None]
    points, cells = fill(x / size, triangles, inner=inner, fixed=np.arange(len(x)))
    points *= size
    if bulge:
        outer = np.unique(boundary_triangles(cells))
        normal, curvature = np.zeros_like(points), np.zeros(len(points))
        normal[outer] = normals(shape, points[outer])
        curvature[outer] = curvatures(shape, points[outer])
        on = np.zeros(len(points), dtype=bool)
        on[outer] = True
        points = bulged(points, cells, on, normal, curvature)
    return points, cells
