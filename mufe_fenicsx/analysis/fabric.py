"""Directions of contacts: fabric tensor, rose diagrams, anisotropy."""

from dataclasses import dataclass

import numpy as np

from mufe_fenicsx.errors import InputError

AXES = "xyz"


def fabric_tensor(normals, weights=None):
    """Φ = Σ w n nᵀ / Σ w [-], trace 1: a third in each direction where directions are isotropic.

    Args:
        normals: Unit normals of contacts, either sign, shape (num_contacts, 3).
        weights: Of the contacts (1 if None), as their area or normal force, shape (num_contacts,).

    Returns:
        Shape (3, 3); nan without contacts.

    Source: M. Satake, in Deformation and Failure of Granular Materials, 1982, 63-68; M. Oda,
    Soils Found. 22(4), 1982, 96-108.
    """
    normals, weights = _directions(normals, weights)
    if not weights.sum() > 0:
        return np.full((3, 3), np.nan)
    return np.einsum("c,ci,cj->ij", weights, normals, normals) / weights.sum()


def deviatoric_fabric(fabric):
    """a = 15/2 (Φ - 1/3), so that directions are spread as (1 + nᵀ a n)/4π [-], shape (3, 3).

    Source: K. Kanatani, Int. J. Eng. Sci. 22, 1984, 149-164, second rank.
    """
    return 7.5 * (np.asarray(fabric) - np.eye(3) / 3)


def anisotropy(fabric):
    """√(3/2 a:a) of the deviatoric fabric a [-]: 0 where directions are isotropic.

    Where they are symmetric about an axis it is |a_axial - a_radial|. Sources as for
    :func:`deviatoric_fabric`; L. Rothenburg & R. J. Bathurst, Géotechnique 39, 1989, 601-614.
    """
    a = deviatoric_fabric(fabric)
    return float(np.sqrt(1.5 * np.sum(a * a)))


@dataclass(frozen=True)
class Rose:
    """Histogram of the directions of contacts in a plane."""

    plane: str  #: "xy", "yz" or "xz"
    edges: np.ndarray  #: of the bins, from the first axis of the plane [rad], 0 to 2π
    density: np.ndarray  #: share of the contacts for a radian, shape (num_bins,)
    projected: float  #: weight that counts, over all: normals across the plane have no direction

    @property
    def angle(self):
        """Middle of each bin [rad]."""
        return 0.5 * (self.edges[1:] + self.edges[:-1])


def rose(normals, plane="xz", num_bins=36, weights=None):
    """Directions of normals projected on a plane; the density of isotropic ones is 1/2π.

    A contact counts with n and with -n, half each.

    Args:
        normals: Unit normals, shape (num_contacts, 3).
        plane: Two of the letters x, y, z: the first is where angles start.
        num_bins: Even, so that a bin and its opposite are alike.
        weights: Of the contacts (1 if None), shape (num_contacts,).

    Returns:
        :class:`Rose`; density nan where no normal has a direction in the plane.

    Raises:
        InputError: The plane, or the number of bins.
    """
    if len(plane) != 2 or len(set(plane)) != 2 or not set(plane) <= set(AXES):
        raise InputError(f"plane of the rose = {plane!r}, expected two of x, y, z, as 'xz'")
    if num_bins < 2 or num_bins % 2:
        raise InputError(f"bins of the rose = {num_bins}, expected an even number")
    normals, weights = _directions(normals, weights)
    u, v = (normals[:, AXES.index(axis)] for axis in plane)
    flat = np.hypot(u, v) > 1e-12
    angle = np.arctan2(v[flat], u[flat])
    both = np.concatenate([angle, angle + np.pi]) % (2 * np.pi)
    edges = np.linspace(0, 2 * np.pi, num_bins + 1)
    weight = np.tile(weights[flat], 2)
    counts = np.histogram(both, edges, weights=weight)[0]
    total = weight.sum()
    density = counts / (total * np.diff(edges)) if total > 0 else np.full(num_bins, np.nan)
    everything = 2 * weights.sum()
    return Rose(plane, edges, density, total / everything if everything > 0 else np.nan)


def _directions(normals, weights):
    normals = np.asarray(normals, dtype=float).reshape(-1, 3)
    if weights is None:
        return normals, np.ones(len(normals))
    return normals, np.asarray(weights, dtype=float)
