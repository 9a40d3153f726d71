"""Forces of contacts: how they are spread, who carries them, who slides.

A contact is one of the tables that a run stores: a pair of grains, or a grain and a wall, with
the sum of the forces over their common points.
"""

from dataclasses import dataclass

import numpy as np

from mufe_fenicsx.errors import InputError

#: Mobilised friction from which on a contact counts as sliding.
SLIDING = 0.99


@dataclass(frozen=True)
class ForceDistribution:
    """Histogram of forces over their mean."""

    mean: float  #: of the forces [N]; nan without forces
    edges: np.ndarray  #: of the bins of f/<f> [-], shape (num_bins + 1,)
    density: np.ndarray  #: P(f/<f>): its integral over the bins is 1, shape (num_bins,)
    count: np.ndarray  #: forces in each bin, shape (num_bins,)


def force_distribution(force, num_bins=20, largest=None):
    """P(f/<f>), the probability density of forces over their mean.

    Args:
        force: Normal forces of active contacts [N], shape (num_contacts,).
        num_bins: Number of bins of equal width.
        largest: f/<f> where the bins end; what lies above still counts in the integral. None:
            the largest force.

    Returns:
        :class:`ForceDistribution`.
    """
    force = np.asarray(force, dtype=float)
    mean = force.mean() if force.size else np.nan
    if not mean > 0:
        nothing = np.full(num_bins, np.nan), np.zeros(num_bins, dtype=int)
        return ForceDistribution(np.nan, np.linspace(0, 1, num_bins + 1), *nothing)
    ratio = force / mean
    edges = np.linspace(min(0.0, ratio.min()), largest or ratio.max(), num_bins + 1)
    counts = np.histogram(ratio, edges)[0]
    return ForceDistribution(float(mean), edges, counts / (force.size * np.diff(edges)), counts)


def mobilised_friction(force, friction, mu):
    """Friction over what Coulomb's law allows, |t|/(μ |f - t|) [-], shape (num_contacts,).

    Sums over a contact reach 1 where all its points slide one way; where only some slide, or
    they turn about each other, they stay below. nan without friction or force.

    Args:
        force: On one side of each contact [N], shape (num_contacts, 3).
        friction: The part of it that is friction [N], shape (num_contacts, 3).
        mu: Coefficients of friction, a number or shape (num_contacts,).
    """
    force, friction = (np.asarray(v, dtype=float).reshape(-1, 3) for v in (force, friction))
    allowed = mu * np.linalg.norm(force - friction, axis=1)
    size = np.linalg.norm(friction, axis=1)
    return np.divide(size, allowed, out=np.full(size.shape, np.nan), where=allowed > 0)


def sliding_fraction(mobilised, limit=SLIDING):
    """Share of contacts that slide: the mobilised friction reaches the limit; nan without any."""
    known = np.asarray(mobilised)[np.isfinite(mobilised)]
    return float((known >= limit).mean()) if known.size else np.nan


def active_contacts(first, second, num_grains):
    """N_cA of each grain: how many neighbours it has active contact with, shape (num_grains,).

    A contact is active where there is pressure at one of its points, as with Nadimi & Fonseca
    (2018), whose image has more contacts than carry load. Walls are no neighbours.

    Args:
        first, second: Indices of the two grains of each active contact, shape (num_contacts,).
        num_grains: Number of grains.
    """
    return np.bincount(first, minlength=num_grains) + np.bincount(second, minlength=num_grains)


def mechanical_coordination(num_contacts):
    """Mean number of contacts of the grains that carry load, (2C - N₁)/(N - N₀ - N₁).

    Grains with no contact or one are left out (C. Thornton, Géotechnique 50, 2000, 43-53); nan
    where all are.

    Args:
        num_contacts: Active contacts of each grain, shape (num_grains,).
    """
    count = np.asarray(num_contacts)
    kept = count[count > 1]
    return float(kept.sum() / kept.size) if kept.size else np.nan


def contact_stress_of_grains(first, second, force, centroid, centre, volume):
    """Mean stress of each grain from its contacts, Σ f ⊗ (x_grain - x_contact)/V [Pa].

    Symmetric part, compression positive. It is the mean stress in the grain where the grain is
    at rest (Love, Weber).

    Args:
        first: Index of the grain that ``force`` acts on, shape (num_contacts,).
        second: Index of the other grain, which feels the opposite, or -1 for a wall.
        force: [N], shape (num_contacts, 3).
        centroid: Where it acts [m], shape (num_contacts, 3).
        centre: Centres of the grains [m], shape (num_grains, 3).
        volume: Of the grains [m³], shape (num_grains,).

    Returns:
        Shape (num_grains, 3, 3).
    """
    total = np.zeros((len(volume), 3, 3))
    on = np.asarray(second) >= 0
    for grain, f, x in ((first, force, centroid), (second[on], -force[on], centroid[on])):
        np.add.at(total, grain, f[:, :, None] * (centre[grain] - x)[:, None, :])
    total /= np.asarray(volume)[:, None, None]
    return 0.5 * (total + np.swapaxes(total, 1, 2))


@dataclass(frozen=True)
class ForceChains:
    """Grains that pass on a force along a line."""

    major: np.ndarray  #: major principal stress of each grain [Pa], shape (num_grains,)
    direction: np.ndarray  #: its unit direction, shape (num_grains, 3)
    chain: np.ndarray  #: number of the chain that each grain is part of, -1: none
    links: np.ndarray  #: contacts within chains, shape (num_contacts,)

    @property
    def num_chains(self):
        """How many chains there are."""
        return int(self.chain.max(initial=-1)) + 1


def force_chains(stress, centre, first, second, angle=45.0, least=3, force=None):
    """Force chains as defined by Peters and others (2005).

    A grain may be part of one if its major (most compressive) principal stress is above the
    mean of all grains. Two such grains in contact are linked if what they pass on is within
    ``angle`` of the direction of that stress in both. Peters takes the line between the centres of
    balls; the force along it is taken here, as centres say little where grains are long or cut.
    Chains are the sets of linked grains, branches included, with at least ``least`` of them.

    Args:
        stress: Mean stress of each grain, compression positive [Pa], shape (num_grains, 3, 3).
        centre: Centres of the grains [m], shape (num_grains, 3).
        first, second: Indices of the two grains of each active contact, shape (num_contacts,).
        angle: [degrees], 0 to 90.
        least: Grains that make a chain.
        force: Of the contacts [N], shape (num_contacts, 3); None: along lines between centres.

    Returns:
        :class:`ForceChains`; chains in the order of their first grain.

    Raises:
        InputError: The angle.

    Source: J. F. Peters, M. Muthuswamy, J. Wibowo & A. Tordesillas, Phys. Rev. E 72, 2005,
    041307.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    if not 0 < angle <= 90:
        raise InputError(f"angle of force chains = {angle} degrees, expected 0 < angle <= 90")
    first, second = np.asarray(first, dtype=np.int64), np.asarray(second, dtype=np.int64)
    n = len(centre)
    values, vectors = np.linalg.eigh(stress)
    major, direction = values[:, 2], vectors[:, :, 2]
    strong = major > major.mean() if n else np.zeros(0, dtype=bool)
    line = centre[first] - centre[second] if force is None else np.asarray(force)
    length = np.linalg.norm(line, axis=1)
    links = strong[first] & strong[second]
    for end in (first, second):
        along = np.abs(np.einsum("ci,ci->c", direction[end], line))
        links &= along >= np.cos(np.radians(angle)) * length
    graph = coo_array((np.ones(links.sum()), (first[links], second[links])), shape=(n, n))
    _, part = connected_components(graph, directed=False)
    size = np.bincount(part, minlength=1)
    long = size[part] >= least
    chain = np.full(n, -1)
    if long.any():
        _, at, number = np.unique(part[long], return_index=True, return_inverse=True)
        chain[long] = np.argsort(np.argsort(at))[number]
    return ForceChains(major, direction, chain, links & (chain[first] >= 0))
