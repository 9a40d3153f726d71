"""Contact stiffness matched to the mesh, and the coefficients of friction.

A gap enforced at the nodes makes contact too stiff, by an error of the order of
the element size h. A layer of compliance c h/E* [m/Pa] on each side takes out
this leading error; E* = E/(1 - nu²) of that side. The constant c belongs to the
element, not to the problem.
"""

import math

import numpy as np

from ..errors import InputError


def edge_of_area(area, num_triangles):
    """Edge [m] of equilateral triangles of which ``num_triangles`` cover ``area`` [m²]."""
    return np.sqrt(4 / np.sqrt(3) * area / num_triangles)


def layer_of_nodes(nodal_area, contact_modulus, c):
    """Compliance c h/E* [m/Pa] of nodes; a nodal area is that of two triangles.

    Args:
        nodal_area: A third of the facets around each node [m²], shape (num_nodes,).
        contact_modulus: E/(1 - nu²) of their grains [Pa], shape (num_nodes,).
        c: The constant of the layer.
    """
    return c * edge_of_area(nodal_area, 2) / contact_modulus


def layer_of_facets(facet_area, contact_modulus, c):
    """Compliance c h/E* [m/Pa] of facets, arguments as for nodes."""
    return c * edge_of_area(facet_area, 1) / contact_modulus


def kinetic_of(static, kinetic, where):
    """The kinetic coefficient of friction; ``static`` where it is None.

    Args:
        static: Coefficient that a contact has to overcome to slip.
        kinetic: Coefficient while it slips, or None.
        where: For the message.

    Raises:
        InputError: Not 0 <= kinetic <= static, or static not a finite number.
    """
    if not 0 <= static < math.inf:
        raise InputError(f"friction {where} = {static}, expected >= 0")
    if kinetic is None:
        return static
    if not 0 <= kinetic <= static:
        raise InputError(
            f"kinetic friction {where} = {kinetic}, expected 0 <= kinetic <= friction = {static}"
        )
    return float(kinetic)
