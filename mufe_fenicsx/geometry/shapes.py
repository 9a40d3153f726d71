"""Bodies of simple shape, as tetrahedra: nodes [m] (N, 3) and cells (M, 4).

All cells are positively oriented and every node belongs to a cell.
"""

import itertools

import numpy as np

from ..errors import InputError
from .bulge import bulged
from .gmsh_model import gmsh_model, tetrahedra
from .measure import positively_oriented


def box(lengths, divisions, origin=(0.0, 0.0, 0.0)):
    """A block of bricks of six tetrahedra each, which share a diagonal (Kuhn 1960).

    Args:
        lengths: Edges along x, y, z [m].
        divisions: Bricks along x, y, z.
        origin: The corner with the smallest coordinates [m].
    """
    _positive("edge of box", *lengths)
    _positive("divisions of box", *divisions)
    n = np.asarray(divisions, dtype=np.int64)
    axes = [
        np.linspace(o, o + length, k + 1) for o, length, k in zip(origin, lengths, n, strict=True)
    ]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)

    stride = np.array([(n[1] + 1) * (n[2] + 1), n[2] + 1, 1])
    bricks = np.stack(np.meshgrid(*map(np.arange, n), indexing="ij"), axis=-1).reshape(-1, 3)
    first = bricks @ stride
    paths = []
    for a, b, c in itertools.permutations(stride):
        paths.append(np.column_stack([first, first + a, first + a + b, first + a + b + c]))
    cells = np.stack(paths, axis=1).reshape(-1, 4)
    return points, positively_oriented(points, cells)


def tetrahedron(edge):
    """One regular tetrahedron of the given edge [m], its centre at the origin."""
    _positive("edge of tetrahedron", edge)
    corners = np.array([[1, 1, 1], [-1, 1, -1], [1, -1, -1], [-1, -1, 1]], dtype=float)
    points = corners * edge / np.sqrt(8)
    return points, positively_oriented(points, np.array([[0, 1, 2, 3]]))


def sphere(radius, h, center=(0.0, 0.0, 0.0)):
    """A ball of edges of length ``h`` [m]; its surface nodes lie on the sphere."""
    _positive("radius of sphere", radius)
    _positive("element size", h)
    with gmsh_model(_even(h / radius)) as gmsh:
        gmsh.model.occ.addSphere(0, 0, 0, 1)
        gmsh.model.occ.synchronize()
        points, cells = _tets(gmsh)
    return points * radius + np.asarray(center), cells


def cylinder(radius, height, h):
    """An upright cylinder on z = 0 around the z axis, edges of length ``h`` [m]."""
    _positive("radius of cylinder", radius)
    _positive("height of cylinder", height)
    _positive("element size", h)
    with gmsh_model(_even(h / radius)) as gmsh:
        gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, height / radius, 1)
        gmsh.model.occ.synchronize()
        points, cells = _tets(gmsh)
    return points * radius, cells


def sphere_near_contact(
    radius,
    h_contact,
    growth=0.1,
    direction=(0.0, 0.0, -1.0),
    contact_radius=None,
    *,
    both_poles=False,
    h_max=None,
):
    """A ball that is fine where it will be touched.

    The size is ``h_contact`` within 1.5 contact radii of the pole and grows
    from there by ``growth`` per unit distance. The pole itself is a node. The facets
    enclose the volume of the ball, so the nodes lie a little outside of it.

    Args:
        radius: Radius of the ball, its centre at the origin [m].
        h_contact: Length of edges at the contact [m].
        growth: Increase of the size with the distance [-].
        direction: From the centre to the pole.
        contact_radius: Largest radius of the contact [m]; ``4 h_contact`` if None.
        both_poles: Fine at the opposite pole too.
        h_max: Largest size [m]; a third of the radius if None.
    """
    contact_radius = 4 * h_contact if contact_radius is None else contact_radius
    h_max = radius / 3 if h_max is None else h_max
    for name, value in {
        "radius of sphere": radius,
        "element size at the contact": h_contact,
        "growth of the element size": growth,
        "contact radius": contact_radius,
        "largest element size": h_max,
    }.items():
        _positive(name, value)
    axis = np.asarray(direction, dtype=float)
    _positive("length of direction", np.linalg.norm(axis))

    h, fine = h_contact / radius, 1.5 * contact_radius / radius
    # gmsh's sphere has its seam at +x and degenerate points at ±z, so the
    # fine regions are put at ±y and turned afterwards.
    with gmsh_model(_even(h_max / radius, smallest=h)) as gmsh:
        ball = gmsh.model.occ.addSphere(0, 0, 0, 1)
        poles = [(1, gmsh.model.occ.addPoint(0, 1, 0))]
        if both_poles:
            poles.append((-1, gmsh.model.occ.addPoint(0, -1, 0)))
        gmsh.model.occ.synchronize()
        (surface,) = [tag for _, tag in gmsh.model.getBoundary([(3, ball)], oriented=False)]
        gmsh.model.mesh.embed(0, [tag for _, tag in poles], 2, surface)

        _refine_at(gmsh, [y for y, _ in poles], h, growth, fine)
        points, cells = _tets(gmsh)
    points = bulged_ball(points, cells)
    return radius * points @ _rotation_from_y(axis / np.linalg.norm(axis)).T, cells


def bulged_ball(points, cells, low=-np.inf):
    """A unit ball, cut at y = ``low``, whose facets enclose its volume."""
    distance = np.linalg.norm(points, axis=1)
    curved = (distance > 1 - 1e-9) & (points[:, 1] > low + 1e-9)
    return bulged(points, cells, curved, points, 2.0)


def _refine_at(gmsh, heights, smallest, growth, fine, line=False):
    """Size ``smallest`` within ``fine`` of points on the y axis, growing from there.

    With ``line`` of the lines through them along z.
    """
    field = gmsh.model.mesh.field
    # gmsh reads plain numbers only: the text of NumPy's would end the program.
    smallest, growth, fine = float(smallest), float(growth), float(fine)
    sides = []
    for y in heights:
        distance = f"Sqrt(x^2+(y-({y}))^2{'' if line else '+z^2'})"
        sides.append(field.add("MathEval"))
        field.setString(sides[-1], "F", f"{smallest!r}+{growth!r}*({distance}-{fine!r})")
    nearest = field.add("Min")
    field.setNumbers(nearest, "FieldsList", sides)
    least = field.add("MathEval")
    field.setString(least, "F", repr(smallest))
    size = field.add("Max")
    field.setNumbers(size, "FieldsList", [nearest, least])
    field.setAsBackgroundMesh(size)


def _even(largest, smallest=0.0):
    return {
        "Mesh.MeshSizeMin": smallest,
        "Mesh.MeshSizeMax": largest,
        "Mesh.MeshSizeFromPoints": 0,
        "Mesh.MeshSizeFromCurvature": 0,
        "Mesh.MeshSizeExtendFromBoundary": 0,
        "Mesh.Algorithm": 6,
        "Mesh.Algorithm3D": 1,
    }


def _tets(gmsh):
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.optimize("Netgen")
    return tetrahedra()


def _rotation_from_y(axis):
    """A rotation that takes the unit vector of y to ``axis``."""
    y = np.array([0.0, 1.0, 0.0])
    if axis[1] < -1 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    v = np.cross(y, axis)
    K = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + K + K @ K / (1 + axis[1])


def _positive(name, *values):
    for value in values:
        if not value > 0:
            raise InputError(f"{name} = {value}, expected > 0")
