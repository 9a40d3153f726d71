"""What a packing is: void ratio, coordination, fabric."""

import numpy as np

from ...analysis.fabric import anisotropy, fabric_tensor
from ...kernels.packed_surfaces import label_voxels

#: Points along a mean diameter at which it is asked whether they are solid.
POINTS = 24
#: Distance from walls at which their layers are no longer felt [mean diameters].
MARGIN = 1.5
#: Contacts by which a grain can be held, without friction and with it.
HELD, HELD_WITH_FRICTION = 4, 2


def bearing(num_bodies, pairs, at_walls, least):
    """Grains that bear: those with too few contacts are left out, one after the other.

    Args:
        pairs: That push each other, shape (num_pairs, 2).
        at_walls: Number of walls that each touches, shape (num_bodies,).
        least: Contacts that hold a grain.

    Returns:
        Whether each bears; number of its contacts with such grains and walls.
    """
    bears = np.ones(num_bodies, dtype=bool)
    while True:
        kept = pairs[bears[pairs].all(axis=1)]
        contacts = np.bincount(kept.ravel(), minlength=num_bodies) + at_walls
        out = bears & (contacts < least)
        if not out.any():
            return bears, contacts
        bears &= ~out


def solid_inside(assembly, margin=MARGIN):
    """Solid fraction farther than ``margin`` from all walls, and its standard error.

    That is by the scatter of its eight parts; both are nan where nothing is so far.
    """
    bodies, container = assembly.bodies, assembly.container
    s = bodies.shapes
    low = container.low + margin
    shape = np.floor((container.high - container.low - 2 * margin) * POINTS).astype(int)
    if (shape < POINTS).any():
        return float("nan"), float("nan")
    labels = np.zeros(shape[::-1], dtype=np.int32)
    label_voxels(
        labels, np.zeros(labels.shape), low, 1 / POINTS, s.spheres, bodies.centre, bodies.axes,
        bodies.size, bodies.reach, bodies.shape, s.grid, s.low, s.step,
    )  # fmt: skip
    z, y, x = (np.arange(n) + 0.5 for n in labels.shape)
    grid = np.stack(np.meshgrid(z, y, x, indexing="ij"), axis=-1)[..., ::-1].reshape(-1, 3)
    inside = container.inside(low + grid / POINTS, margin)
    solid, grid = labels.ravel()[inside] > 0, grid[inside]
    part = (grid > 0.5 * shape) @ (1, 2, 4)
    sizes = np.bincount(part, minlength=8)
    parts = np.bincount(part, solid, 8)[sizes > 0] / sizes[sizes > 0]
    return float(solid.mean()), float(parts.std(ddof=1) / np.sqrt(len(parts)))


def void_ratio_inside(assembly):
    """Void ratio away from walls and its standard error, or that of the container and 0."""
    solid, error = solid_inside(assembly)
    if not solid > 0:
        return assembly.void_ratio, 0.0
    return 1 / solid - 1, error / solid**2


def measured(assembly):
    """Numbers of a packing, a dictionary; lengths over the mean diameter."""
    bodies, contacts = assembly.bodies, assembly.contacts
    pairs, normals = contacts.touching()
    at_walls = (contacts.wall_push > 0).sum(axis=1)
    least = HELD_WITH_FRICTION if assembly.friction > 0 else HELD
    bears, count = bearing(bodies.num_bodies, pairs, at_walls, least)
    fabric = fabric_tensor(normals)
    inside, error = solid_inside(assembly)
    return {
        "num_grains": bodies.num_bodies,
        "void_ratio": assembly.void_ratio,
        "solid_fraction": assembly.solid_fraction,
        "void_ratio_inside": 1 / inside - 1 if inside > 0 else float("nan"),
        "void_ratio_inside_error": error / inside**2 if inside > 0 else float("nan"),
        "solid_fraction_inside": inside,
        "num_contacts": len(pairs),
        "coordination_number": 2 * len(pairs) / bodies.num_bodies,
        "bearing_coordination_number": float(count[bears].mean()) if bears.any() else 0.0,
        "rattlers": float(1 - bears.mean()),
        "fabric": fabric.tolist(),
        "fabric_anisotropy": anisotropy(fabric),
        "mean_overlap": contacts.sums.depth,
        "largest_overlap": contacts.sums.deepest,
        "unbalanced": assembly.unbalanced,
        "friction_at_end": assembly.friction,
        "packing_steps": assembly.num_steps,
    }
