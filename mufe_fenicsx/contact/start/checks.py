"""What contact cannot work with, said before a test begins; on all ranks together."""

import numpy as np
from mpi4py import MPI

from ...errors import InputError

#: Bounds of the compliance.
LEAST, MOST = 1e-12, 1e12


def check_law(friction, compliance):
    """Coefficients of the contact law.

    Raises:
        InputError: friction < 0, or a compliance that gives no stiffness or no finite one.
    """
    if not 0 <= friction < np.inf:
        raise InputError(f"friction = {friction}, expected >= 0")
    if not LEAST <= compliance <= MOST:
        raise InputError(
            f"compliance = {compliance}, expected > 0, from {LEAST:g} to {MOST:g}: beyond, contact "
            "has no stiffness, or one of no finite eigenvalue"
        )


def check_surface(mesh, own):
    """Each grain has a closed surface of its own. Collective.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        own: :class:`~mufe_fenicsx.contact.surface.surface.OwnSurface`.

    Raises:
        InputError: A grain without surface nodes, or one that shares nodes with another.
    """
    num_grains = mesh.labels.size
    facets = np.bincount(own.grain_of_facet, minlength=num_grains)
    across = own.neighbour
    open_edges = (across < 0) & (own.mirror < 0)
    open_edges |= (across >= 0) & (own.grain_of_facet[across] != own.grain_of_facet[:, None])
    edges = np.bincount(own.grain_of_facet, open_edges.sum(axis=1), num_grains)
    facets, edges = mesh.comm.allreduce(np.array([facets, edges]).astype(np.int64))
    if (facets == 0).any():
        label = mesh.labels[np.argmax(facets == 0)]
        raise InputError(f"grain {label} has 0 surface nodes, expected a surface of its own")
    if (edges > 0).any():
        grain = np.argmax(edges > 0)
        raise InputError(
            f"grain {mesh.labels[grain]} has a surface with {edges[grain]} open edges, expected a "
            "closed one: grains share no nodes"
        )


def check_stiffness(mesh, contact_modulus):
    """Each grain can carry a contact. Collective.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        contact_modulus: E/(1 - nu²) of this rank's grains [Pa], shape (num_grains,).

    Raises:
        InputError: A grain without stiffness, so that its pairs have none.
    """
    modulus = np.zeros(mesh.labels.size)
    modulus[mesh.grains] = contact_modulus
    modulus = mesh.comm.allreduce(modulus, op=MPI.SUM)
    bad = ~((modulus > 0) & np.isfinite(modulus))
    if bad.any():
        grain = np.argmax(bad)
        raise InputError(
            f"contact modulus of grain {mesh.labels[grain]} = {modulus[grain]} Pa, expected > 0: "
            "its pairs have no stiffness"
        )


def check_walls(comm, walls, x, largest):
    """No wall stands inside the sample, by more than overlaps of a mesh explain. Collective.

    Args:
        comm: MPI communicator.
        walls: :class:`~mufe_fenicsx.contact.walls.Walls`.
        x: Positions of this rank's nodes [m], shape (num_nodes, 3).
        largest: Depth of nodes behind a wall that is accepted, as an offset [m].

    Raises:
        InputError: Nodes lie deeper behind a wall.
    """
    for w, name in enumerate(walls.names):
        gap, _ = walls.gaps(x, np.full(len(x), w, dtype=np.int32))
        deepest = comm.allreduce(-float(gap.min(initial=np.inf)), op=MPI.MAX)
        if deepest > largest:
            raise InputError(
                f"wall {name} is {deepest:.3g} m inside the sample, expected outside it, or less "
                f"than a mean facet edge inside, {largest:.3g} m"
            )
