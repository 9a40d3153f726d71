"""Half a ball as a quarter disc (r, z), fine on its surface around the pole."""

import math

from dolfinx.io.gmsh import model_to_mesh
from mpi4py import MPI

from ...geometry.tets.gmsh_model import gmsh_model


def quarter_disc(h, growth, reach, largest):
    """Curved triangles of second order in r >= 0, z >= 0, r² + z² <= 1, the pole at (0, 1).

    Lengths are in radii of the ball.

    Args:
        h: Length of edges on the surface up to ``reach``.
        growth: Increase of the size with the distance from there.
        reach: Distance from the axis up to which the surface can be touched.
        largest: Largest size.

    Returns:
        The mesh, on one rank.
    """

    def size(dim, tag, x, y, z, given):
        distance = math.hypot(1 - math.hypot(x, y), max(x - reach, 0.0))
        return min(h + growth * distance, largest)

    options = {
        "Mesh.MeshSizeFromPoints": 0,
        "Mesh.MeshSizeFromCurvature": 0,
        "Mesh.MeshSizeExtendFromBoundary": 0,
        "Mesh.Algorithm": 6,
    }
    with gmsh_model(options) as gmsh:
        model = gmsh.model
        centre, equator, pole = (model.geo.addPoint(*p, 0) for p in ((0, 0), (1, 0), (0, 1)))
        base, axis = model.geo.addLine(centre, equator), model.geo.addLine(pole, centre)
        arc = model.geo.addCircleArc(equator, centre, pole)
        disc = model.geo.addPlaneSurface([model.geo.addCurveLoop([base, arc, axis])])
        model.geo.synchronize()
        model.addPhysicalGroup(2, [disc])
        model.mesh.setSizeCallback(size)
        model.mesh.generate(2)
        model.mesh.setOrder(2)
        model.mesh.removeSizeCallback()
        return model_to_mesh(model, MPI.COMM_SELF, 0, gdim=2).mesh
