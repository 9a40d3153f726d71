"""Bodies that several tests use."""

import functools

import numpy as np

from mufe_fenicsx.explicit.simulation import Simulation
from mufe_fenicsx.geometry.bodies import half_ball as half_balls
from mufe_fenicsx.geometry.bodies import shapes
from mufe_fenicsx.geometry.grains import Grains
from mufe_fenicsx.mesh import create_grain_mesh, partition_grains

RADIUS = 1e-3


def meshed_once(make):
    """Such a maker of bodies, which meshes equal ones once in a process and gives copies."""
    kept = functools.cache(make)

    def body(*args, **options):
        return tuple(part.copy() for part in kept(*args, **options))

    return body


sphere = meshed_once(shapes.sphere)
cylinder = meshed_once(shapes.cylinder)
sphere_near_contact = meshed_once(shapes.sphere_near_contact)
half_ball = meshed_once(half_balls.half_ball)


def sphere_centres(counts, gap=0.0):
    """Centres of touching spheres of radius ``RADIUS`` in a block, ``gap`` in radii between."""
    spacing = (2.0 + gap) * RADIUS
    grid = np.stack(np.meshgrid(*(np.arange(n) for n in counts), indexing="ij"), axis=-1)
    return grid.reshape(-1, 3) * spacing + (1.0 + gap / 2) * RADIUS


def packed_grains(counts, gap=0.0, h=0.45 * RADIUS):
    """:class:`Grains` of such spheres."""
    points, cells = sphere(RADIUS, h)
    centres = sphere_centres(counts, gap)
    meshes = [(points + centre, cells) for centre in centres]
    return Grains.from_list(np.arange(1, len(centres) + 1), meshes, h)


def packed_spheres(comm, counts, gap=0.0, h=0.45 * RADIUS):
    """Distributed mesh of such spheres. Collective."""
    points, cells = sphere(RADIUS, h)
    centres = sphere_centres(counts, gap)
    rank_of_grain = partition_grains(np.ones(len(centres)), centres, comm.size)
    mine = np.flatnonzero(rank_of_grain == comm.rank)
    return create_grain_mesh(
        comm,
        np.concatenate([points + centres[g] for g in mine]),
        np.concatenate([cells + k * len(points) for k in range(mine.size)]),
        np.repeat(mine, len(cells)),
        np.arange(1, len(centres) + 1),
        rank_of_grain,
    )


def simulation_of(mesh, material, walls=(), **options):
    """A simulation with the same material in all grains."""
    return Simulation(mesh, [material] * mesh.num_grains, walls, **options)


def euler_characteristic(triangles):
    """Vertices - edges + faces: 2 for a surface like a sphere, 0 for a torus."""
    edges = np.sort(
        np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    )
    return (
        len(np.unique(triangles)) - len(np.unique(np.sort(edges, axis=1), axis=0)) + len(triangles)
    )
