"""Random star-shaped grains with given size, form and roundness."""

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
import scipy.special

from ..kernels.packing.radial import fill_radii

#: Intervals of the table of radii along an edge of the cube.
INTERVALS = 24


@dataclass
class RadialGrains:
    """Shapes of n grains; `kernels.packing.radial` says what the arrays mean.

    The axes of a grain are its principal ones, L, I, S in this order.
    """

    table: np.ndarray  #: (n, 6, INTERVALS + 1, INTERVALS + 1)
    matrix: np.ndarray  #: from v to the body's axes [m], (n, 3, 3)
    inverse: np.ndarray  #: of ``matrix`` [1/m], (n, 3, 3)
    offset: np.ndarray  #: v of the centre of volume, (n, 3)
    volume: np.ndarray  #: [m³], (n,)
    semi_axes: np.ndarray  #: of the ellipsoid of equal second moments, L, I, S halved [m], (n, 3)
    reach: np.ndarray  #: largest distance of the surface from the centre [m], (n,)

    @cached_property
    def bound(self):
        """Largest radius in each table, (n,)."""
        return self.table.max(axis=(1, 2, 3))

    @property
    def num_grains(self):
        """Number of grains."""
        return len(self.volume)

    @property
    def diameter(self):
        """Of the sphere of equal volume [m]."""
        return np.cbrt(6 / np.pi * self.volume)

    def part(self, which):
        """The grains with these numbers."""
        return RadialGrains(*(getattr(self, field.name)[which] for field in fields(self)))

    def surface(self, directions):
        """Points of the surfaces along unit vectors v, in the grains' axes, (n, m, 3) [m]."""
        out = np.empty((self.num_grains, len(directions), 3))
        for g in range(self.num_grains):
            v = radii(self.table[g], directions)[:, None] * directions
            # Not by the linear algebra, whose last bits hang on the processor (`make_grains`).
            out[g] = np.einsum("mj,ij->mi", v - self.offset[g], self.matrix[g])
        return out


def sizes(rng, n, d50, uniformity):
    """Diameters [m] of n grains, log-normal with median ``d50`` by mass and d60/d10 given.

    By number the median of ln d lies 3 sigma² lower (Hatch and Choate 1929). Sizes end at 2.5 sigma
    from the median by mass. Each stands for an n-th part of all grains by the root of their mean
    cube, so that few grains have the mass of the large ones too. Their order is chance.
    """
    sigma = np.log(uniformity) / (scipy.special.ndtri(0.6) - scipy.special.ndtri(0.1))
    # Deviates by number; those by mass are 3 sigma lower.
    low, high = 3 * sigma + np.array([-2.5, 2.5])
    share = np.linspace(*scipy.special.ndtr([low, high]), n + 1)
    z = scipy.special.ndtri(share)
    z[[0, -1]] = low, high
    cube = np.diff(scipy.special.ndtr(z - 3 * sigma)) / np.diff(share)
    return rng.permutation(d50 * np.exp(-1.5 * sigma**2) * np.cbrt(cube))


def sizes_by_mass(diameters):
    """Of grains: d50 [m] and uniformity d60/d10, half of each grain on both sides of its size."""
    d = np.sort(diameters)
    mass = d**3
    d10, d50, d60 = np.interp([0.1, 0.5, 0.6], (np.cumsum(mass) - 0.5 * mass) / mass.sum(), d)
    return float(d50), float(d60 / d10)


def make_grains(rng, diameters, elongation, flatness, roughness, falloff, max_degree):
    """Random grains whose sizes and forms are as asked.

    Args:
        rng: NumPy generator.
        diameters: Of the spheres of equal volume [m], shape (n,).
        elongation, flatness: W/L and T/W of each grain, shape (n,).
        roughness, falloff, max_degree: As of `SynthesisSettings`.

    What a packing comes to hangs on the last bit of its grains, and that on the processor and the
    number of threads of the linear algebra. So radii are rounded to a millionth, all else to single
    precision, and no kernel of the linear algebra changes them.

    Returns:
        `RadialGrains`.
    """
    diameters, elongation, flatness = map(np.asarray, (diameters, elongation, flatness))
    n = len(diameters)
    nodes = cube_directions(np.linspace(-1, 1, INTERVALS + 1))
    basis, degree = harmonics(nodes.reshape(-1, 3), max_degree)
    rms = np.arange(3, max_degree + 1.0) ** -falloff
    rms *= roughness / np.sqrt((rms**2).sum())
    spread = rms[degree - 3] * np.sqrt(4 * np.pi / (2 * degree + 1))
    field = basis @ (spread[:, None] * rng.standard_normal((len(degree), n)))
    table = np.round(np.exp(field.T), 6).reshape(n, 6, INTERVALS + 1, INTERVALS + 1)

    directions, solid_angle = quadrature()
    matrix, offset = np.empty((n, 3, 3)), np.empty((n, 3))
    volume, reach = np.empty(n), np.empty(n)
    long_axis = np.cbrt(1 / (elongation**2 * flatness))
    semi = (
        0.5
        * diameters[:, None]
        * np.column_stack([long_axis, long_axis * elongation, long_axis * elongation * flatness])
    )
    for g in range(n):
        r = radii(table[g], directions)
        v0 = solid_angle @ r**3 / 3
        offset[g] = (solid_angle * r**4 / 4) @ directions / v0
        second = directions.T @ (directions * (solid_angle * r**5 / 5)[:, None]) / v0
        second -= np.outer(offset[g], offset[g])
        # diag(a) second^(-1/2)/sqrt(5) gives the second moments a²/5 of the ellipsoid.
        values, vectors = np.linalg.eigh(second)
        root = vectors / np.sqrt(values) @ vectors.T
        matrix[g] = np.diag(semi[g]) @ root / np.sqrt(5)
        # The ellipsoid of equal moments has another volume than the grain; sizes are by volume.
        scale = np.cbrt(np.pi / 6 * diameters[g] ** 3 / (v0 * np.linalg.det(matrix[g])))
        matrix[g] *= scale
        semi[g] *= scale
        volume[g] = v0 * np.linalg.det(matrix[g])
        x = (table[g].reshape(-1, 1) * nodes.reshape(-1, 3) - offset[g]) @ matrix[g].T
        reach[g] = 1.01 * np.linalg.norm(x, axis=1).max()
    matrix = _single(matrix)
    inverse = _single(np.linalg.inv(matrix))
    return RadialGrains(table, matrix, inverse, *map(_single, (offset, volume, semi, reach)))


def _single(values):
    """The same in single precision, kept in double."""
    return values.astype(np.float32).astype(float)


def harmonics(directions, max_degree, first=3):
    """Real spherical harmonics of degrees ``first`` … max_degree, orthonormal on the sphere.

    Returns:
        Values (m, k) and the degree of each of the k functions.
    """
    x, y, z = directions.T
    phi = np.arctan2(y, x)
    columns, degrees = [], []
    for n in range(first, max_degree + 1):
        for m in range(n + 1):
            ratio = np.exp(scipy.special.gammaln(n - m + 1) - scipy.special.gammaln(n + m + 1))
            polar = np.sqrt((2 * n + 1) / (4 * np.pi) * ratio) * scipy.special.lpmv(m, n, z)
            if m == 0:
                columns.append(polar)
            else:
                columns += [np.sqrt(2) * polar * np.cos(m * phi)]
                columns += [np.sqrt(2) * polar * np.sin(m * phi)]
        degrees += [n] * (2 * n + 1)
    return np.column_stack(columns), np.array(degrees)


def cube_directions(ticks):
    """Unit vectors through the points (s, t) of the faces of a cube, (6, m, m, 3)."""
    s, t = np.meshgrid(ticks, ticks, indexing="ij")
    out = np.empty((6, len(ticks), len(ticks), 3))
    for face in range(6):
        axis, sign = face // 2, 1 - 2 * (face % 2)
        # s and t are quotients by the main component, so both turn with its sign.
        for k, part in enumerate((np.ones_like(s), s, t)):
            out[face, ..., (axis + k) % 3] = sign * part
    return out / np.linalg.norm(out, axis=-1, keepdims=True)


def quadrature():
    """Directions and solid angles, two Gauss points in each interval of the table.

    Returns:
        Unit vectors (m, 3) and weights (m,) with the sum 4 pi, to 1e-6.
    """
    h = 2 / INTERVALS
    ticks = -1 + h * (np.arange(INTERVALS)[:, None] + 0.5 + np.array([-1, 1]) / np.sqrt(12))
    directions = cube_directions(ticks.ravel())
    s, t = np.meshgrid(ticks.ravel(), ticks.ravel(), indexing="ij")
    weight = (h / 2) ** 2 / (1 + s**2 + t**2) ** 1.5
    return directions.reshape(-1, 3), np.tile(weight.ravel(), 6)


def radii(table, directions):
    """Radius of one grain along unit vectors v, as the kernels read its table."""
    out = np.empty(len(directions))
    fill_radii(out, table, directions)
    return out
