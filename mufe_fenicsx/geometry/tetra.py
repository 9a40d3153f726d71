"""Tetrahedra inside a closed triangle surface, by gmsh."""

import numpy as np

from .gmsh_model import gmsh_model, tetrahedra
from .measure import smallest_altitudes

DELAUNAY, HXT = 1, 10


def fill(points, triangles, *, algorithm=DELAUNAY, rounds=2):
    """Tetrahedra whose size follows the triangles of the surface, which stays as it is.

    Args:
        points: Nodes of the surface, about 1 apart (gmsh's tolerances are absolute).
        triangles: Seen from outside, shape (m, 3).
        algorithm: DELAUNAY or HXT.
        rounds: Times that the optimiser is run.

    Raises:
        Exception: gmsh fails; its message says where.
    """
    options = {"Mesh.Algorithm3D": algorithm, "Mesh.Optimize": 1}
    with gmsh_model(options) as gmsh:
        surface = gmsh.model.addDiscreteEntity(2)
        tags = np.arange(1, len(points) + 1)
        gmsh.model.mesh.addNodes(2, surface, tags, np.asarray(points, dtype=float).ravel())
        gmsh.model.mesh.addElementsByType(surface, 2, [], (triangles + 1).ravel())
        loop = gmsh.model.geo.addSurfaceLoop([surface])
        gmsh.model.geo.addVolume([loop])
        gmsh.model.geo.synchronize()
        gmsh.model.mesh.generate(3)
        for _ in range(rounds):
            gmsh.model.mesh.optimize("Netgen")
            gmsh.model.mesh.optimize("Relocate3D", niter=3)
        nodes, cells = tetrahedra()
    if smallest_altitudes(nodes, cells).min() <= 0:
        raise RuntimeError("gmsh made a tetrahedron without volume")
    return nodes, cells
