"""Grains turned at random on a lattice in which none reaches its neighbour, in a container."""

import numpy as np

from .bodies import bodies_at, random_turns
from .container import CYLINDER, Container
from .ways import AGITATION

#: Spacing of the lattice over the largest diameter around a body, and shift from it at random.
SPACING, JITTER = 1.15, 0.07


def loose(shapes, shape, size, rng, kind, proportions):
    """Bodies on a lattice in a container of given proportions, which is as large as they need.

    Args:
        shapes: `shapes.Shapes`.
        shape, size: Of each body, in mean diameters.
        rng: NumPy generator.
        kind: Of the container.
        proportions: Its edges, to a factor, shape (3,).

    Returns:
        `Bodies`, `Container`.
    """
    spacing = SPACING * 2 * (shapes.reach[shape] * size).max()
    proportions = np.asarray(proportions, dtype=float)
    edges = proportions * np.cbrt(len(size) / np.prod(proportions)) * spacing
    sites = _sites(kind, edges, spacing)
    while len(sites) < len(size) or edges.min() < spacing:
        edges *= 1.02
        sites = _sites(kind, edges, spacing)
    sites = sites[np.sort(rng.permutation(len(sites))[: len(size)])]
    return _placed(shapes, shape, size, rng, sites, spacing, Container(kind, np.zeros(3), edges))


def column(shapes, shape, size, rng, kind, base):
    """Bodies on a lattice above a base of given edges, in a container with an open top.

    Args:
        base: Edges of the container along x and y, in mean diameters, shape (2,).
    """
    spacing = SPACING * 2 * (shapes.reach[shape] * size).max()
    layer = _sites(kind, np.array([*base, spacing]), spacing)
    count = max(1, -(-len(size) // max(len(layer), 1)))
    height = count * spacing
    sites = (layer[None] + np.arange(count)[:, None, None] * [0.0, 0.0, spacing]).reshape(-1, 3)
    held = Container(kind, np.zeros(3), np.array([*base, height]), open_top=True)
    return _placed(shapes, shape, size, rng, sites[: len(size)], spacing, held)


def fits(shapes, shape, size, base):
    """Whether the largest body has room on a base of given edges."""
    return min(base) >= SPACING * 2 * (shapes.reach[shape] * size).max()


def _sites(kind, edges, spacing):
    """Places of a lattice in a container, layer after layer from below, shape (num_sites, 3)."""
    counts = np.maximum((edges / spacing + 1e-9).astype(int), 1)
    axes = [(np.arange(n) + 0.5) * edge / n for n, edge in zip(counts, edges, strict=True)]
    z, y, x = np.meshgrid(*axes[::-1], indexing="ij")
    sites = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    if kind == CYLINDER:
        off = np.linalg.norm(sites[:, :2] - 0.5 * edges[:2], axis=1)
        sites = sites[off <= 0.5 * (edges[0] - spacing) + 1e-9]
    return sites


def _placed(shapes, shape, size, rng, sites, spacing, container):
    n = len(size)
    # Which body stands where is chance, so that sizes and shapes are mixed.
    sites = sites[rng.permutation(n)]
    centre = sites + JITTER / SPACING * spacing * rng.uniform(-1, 1, (n, 3))
    bodies = bodies_at(shapes, shape, size, centre, random_turns(rng, n))
    bodies.velocity[:] = AGITATION * rng.standard_normal((n, 3)) / np.sqrt(3)
    return bodies, container
