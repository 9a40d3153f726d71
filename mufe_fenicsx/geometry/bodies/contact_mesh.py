"""What meshes of bodies of simple shape share, and those that are fine at a point of contact."""

import numpy as np

from ...errors import InputError
from ...machine.memory import check_room
from ..tets.gmsh_model import tetrahedra
from ..tets.work import TETS_A_CUBE

#: Least and largest length of a body [m], and number of its parts.
LEAST, MOST = 1e-12, 1e6
#: What gmsh takes for a tetrahedron [bytes].
A_TET = 600


def require_positive(name, *values):
    """Raise InputError unless all values are > 0, from LEAST to MOST."""
    for value in values:
        if not value > 0:
            raise InputError(f"{name} = {value}, expected > 0")
        if not LEAST <= value <= MOST:
            raise InputError(f"{name} = {value:g}, expected {LEAST:g} to {MOST:g}")


def checked_contact(h_contact, growth, contact_radius, h_max):
    """Largest radius of a contact [m], four edges where it is None.

    Args:
        h_contact: Length of edges at the contact [m].
        growth: Increase of the size with the distance [-].
        contact_radius: As stated [m], or None.
        h_max: Largest size [m].

    Raises:
        InputError: One of them is not > 0.
    """
    contact_radius = 4 * h_contact if contact_radius is None else contact_radius
    require_positive("element size at the contact", h_contact)
    require_positive("growth of the element size", growth)
    require_positive("contact radius", contact_radius)
    require_positive("largest element size", h_max)
    return contact_radius


def refine_at(gmsh, heights, smallest, growth, fine, line=False):
    """Size ``smallest`` within ``fine`` of points on the y axis, growing from there.

    With ``line`` of the lines through them along z.
    """
    field = gmsh.model.mesh.field
    # gmsh reads plain numbers only: the text of NumPy's would end the program.
    smallest, growth, fine = float(smallest), float(growth), float(fine)
    _check_number(_num_around_points(gmsh, smallest, growth, fine, line))
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


def _num_around_points(gmsh, smallest, growth, fine, line):
    """Tetrahedra around a point of :func:`refine_at`, in a quarter of what may be there."""
    box = gmsh.model.getBoundingBox(-1, -1)
    length = np.subtract(box[3:], box[:3]).min()
    r = np.append(0.0, np.geomspace(min(1e-3 * smallest, 1e-3 * length), length, 2000))
    h = np.clip(smallest + growth * (r - fine), smallest, _largest_edge(gmsh))
    around = 0.25 * np.pi * r * length if line else 0.5 * np.pi * r**2
    return TETS_A_CUBE * np.trapezoid(around / h**3, r)


def _largest_edge(gmsh):
    """What :func:`even_edges` set."""
    return gmsh.option.getNumber("Mesh.MeshSizeMax")


def check_tets(volume, size):
    """Raise InputError where a body [m³] of edges of a size [m] has no room in the memory."""
    _check_number(TETS_A_CUBE * volume / size**3)


def _check_number(num):
    check_room(A_TET * num, f"a mesh of {num:.2g} tetrahedra", ": expected longer edges")


def even_edges(largest, smallest=0.0):
    """Options of gmsh for edges of a length that only a size field makes shorter."""
    return {
        "Mesh.MeshSizeMin": smallest,
        "Mesh.MeshSizeMax": largest,
        "Mesh.MeshSizeFromPoints": 0,
        "Mesh.MeshSizeFromCurvature": 0,
        "Mesh.MeshSizeExtendFromBoundary": 0,
        "Mesh.Algorithm": 6,
        "Mesh.Algorithm3D": 1,
    }


def tets(gmsh):
    """Mesh the model: nodes (N, 3) and positively oriented cells (M, 4).

    Raises:
        InputError: The memory has no room for them, by an estimate from below.
    """
    volume = sum(gmsh.model.occ.getMass(3, tag) for _, tag in gmsh.model.getEntities(3))
    check_tets(volume, _largest_edge(gmsh))
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.optimize("Netgen")
    return tetrahedra()


def rotation_from_y(axis):
    """A rotation that takes the unit vector of y to ``axis``."""
    y = np.array([0.0, 1.0, 0.0])
    if axis[1] < -1 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    v = np.cross(y, axis)
    K = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + K + K @ K / (1 + axis[1])
