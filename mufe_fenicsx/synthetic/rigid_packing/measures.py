"""What a packing is: void ratio, coordination, fabric."""

import numpy as np

from ...analysis.fabric import anisotropy, fabric_tensor
from ...analysis.voids import MARGIN, OCTANTS, inner_lengths, inner_void_ratio
from ...geometry.form.proportions import median_diameter
from ...kernels.packing.packed_surfaces import label_voxels

#: Points along a mean diameter at which it is asked whether they are solid.
POINTS = 24
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


def void_ratio_inside(assembly):
    """Void ratio away from walls and its standard error, as of histories; zeros: too narrow."""
    bodies, container = assembly.bodies, assembly.container
    s, diameter = bodies.shapes, median_diameter(np.pi / 6 * bodies.size**3)
    inner = inner_lengths(container.high - container.low, diameter)
    if inner is None:
        return 0.0, 0.0
    margin = MARGIN * diameter
    low = container.low + margin
    shape = np.floor(inner * POINTS).astype(int)
    labels = np.zeros(shape[::-1], dtype=np.int32)
    label_voxels(
        labels, np.zeros(labels.shape), low, 1 / POINTS, s.spheres, bodies.centre, bodies.axes,
        bodies.size, bodies.reach, bodies.shape, s.grid, s.low, s.step,
    )  # fmt: skip
    z, y, x = (np.arange(n) + 0.5 for n in labels.shape)
    grid = np.stack(np.meshgrid(z, y, x, indexing="ij"), axis=-1)[..., ::-1].reshape(-1, 3)
    inside = container.inside(low + grid / POINTS, margin)
    solid, grid = labels.ravel()[inside] > 0, grid[inside]
    octant = (grid > 0.5 * shape) @ (1, 2, 4)
    return inner_void_ratio(np.bincount(octant, solid, OCTANTS), float(inside.sum()))


def measured(assembly):
    """Numbers of a packing, a dictionary; lengths over the mean diameter."""
    bodies, contacts = assembly.bodies, assembly.contacts
    pairs, normals = contacts.touching()
    at_walls = (contacts.wall_push > 0).sum(axis=1)
    least = HELD_WITH_FRICTION if assembly.friction > 0 else HELD
    bears, count = bearing(bodies.num_bodies, pairs, at_walls, least)
    fabric = fabric_tensor(normals)
    inside, error = void_ratio_inside(assembly)
    return {
        "num_grains": bodies.num_bodies,
        "void_ratio": assembly.void_ratio,
        "solid_fraction": assembly.solid_fraction,
        **({"void_ratio_inside": inside, "void_ratio_error": error} if inside else {}),
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
