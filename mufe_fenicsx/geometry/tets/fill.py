"""Tetrahedra inside a closed triangle surface, by gmsh."""

import numpy as np

from ..measure import mean_edges, smallest_altitudes
from ..surface.shells import shells
from .gmsh_model import gmsh_model, tetrahedra
from .slivers import thickened

DELAUNAY, HXT = 1, 10

#: Optimisers. Netgen's takes longer than all the rest; without it the stable time step of whole
#: grains, from their highest frequency, is a fifth shorter at the same smallest altitude. Along
#: sharp edges and in slices it puts nodes into the middle of what is thin; gmsh's own does not.
NETGEN, GMSH = "Netgen", ""


def fill(
    points,
    triangles,
    *,
    algorithm=HXT,
    optimiser=NETGEN,
    size=1.0,
    tolerance=0.02,
    fixed=None,
    along=None,
    inner=1.0,
):
    """Tetrahedra whose size follows the triangles of the surface, which keeps its triangles.

    Args:
        points: Nodes of the surface, about 1 apart (gmsh's tolerances are absolute).
        triangles: Seen from outside, shape (m, 3).
        algorithm: HXT or DELAUNAY.
        size: Length by which altitudes are judged; None: the mean edge of each tetrahedron.
        tolerance: What nodes of the surface may leave it by, to make flat tetrahedra thicker.
        fixed: Nodes of the surface that may not move, or None.
        optimiser: NETGEN or GMSH; None: any tetrahedra will do, flat ones too.
        along: Of nodes on edges of the body, as `thickened` wants them, or None.
        inner: Wanted length of edges far inside; 1: as on the surface around.

    Raises:
        Exception: gmsh fails; its message says where.
    """
    # Renumbered, nodes of several surfaces would not keep their order.
    options = {"Mesh.Algorithm3D": algorithm, "Mesh.Optimize": 0, "Mesh.Renumber": 0}
    if inner > 1:
        options["Mesh.MeshSizeExtendFromBoundary"] = 0
        options["Mesh.MeshSizeMin"] = options["Mesh.MeshSizeMax"] = inner
    with gmsh_model(options) as gmsh:
        part, depth, _ = shells(points, triangles)
        loops = []
        for p in np.argsort(depth, kind="stable"):  # the outer surface first
            own = triangles[part == p]
            nodes = np.unique(own)
            surface = gmsh.model.addDiscreteEntity(2)
            at = np.asarray(points, dtype=float)[nodes]
            gmsh.model.mesh.addNodes(2, surface, nodes + 1, at.ravel())
            gmsh.model.mesh.addElementsByType(surface, 2, [], (own + 1).ravel())
            loops.append(gmsh.model.geo.addSurfaceLoop([surface]))
        gmsh.model.geo.addVolume(loops)
        gmsh.model.geo.synchronize()
        gmsh.model.mesh.generate(3)
        if optimiser is not None:
            gmsh.model.mesh.optimize(optimiser)
        nodes, cells = tetrahedra()
    if smallest_altitudes(nodes, cells).min() <= 0:
        raise RuntimeError("gmsh made a tetrahedron without volume")
    if optimiser is None:
        return nodes, cells
    if size is None:
        size = mean_edges(nodes, cells)
    return thickened(nodes, cells, size, tolerance=tolerance, fixed=fixed, along=along), cells
