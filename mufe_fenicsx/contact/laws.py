"""How stiff a contact is, by a layer on each side [m/Pa]; and coefficients of friction.

"matched" to the mesh: a gap enforced at points of the mesh makes contact too stiff, by
an error of the order of the element size h. A layer of compliance c h/E* on each side
takes out this leading error; E* = E/(1 - nu²) of that side. The constant c belongs to the
element, not to the problem, and to meshes whose facets enclose the volume of the body,
as those of grains from images do: nodes on a curved surface with the facets inside it
would ask for a third of it. A small one is a plain stiff
penalty.

"kinematic": a predictor without contact gives the gaps at the end of the step, and the
corrector pushes apart what would overlap there, as hard as their inertia asks for:
masses of m/A per area that have to move by the depth within a step need the pressure
(m/A) depth/Δt² on each side. That is a layer Δt² A/m. It holds no energy, takes what
the nodes bring along when they meet, and leaves the stable time step as it is. At nodes an
even overlap is gone at once; a point of a facet spreads its correction over three nodes, so
at rest an overlap remains wherever force over mass varies from node to node.
"""

import numpy as np

from ..arguments import finite_number
from ..errors import InputError

KINEMATIC = "kinematic"
#: c of the layer, for tetrahedra with averaged pressure and contact at facets.
COMPLIANCE = 0.25
#: The force of a contact grows no more beyond this depth, over the mean of both sides' edges.
LARGEST_DEPTH = 0.1


def edge_of_area(area, num_triangles):
    """Edge [m] of equilateral triangles of which ``num_triangles`` cover ``area`` [m²]."""
    return np.sqrt(4 / np.sqrt(3) * area / num_triangles)


def matched_layers(own, node_modulus, facet_modulus, c):
    """Compliance c h/E* of nodes and of facets [m/Pa].

    Args:
        own: :class:`~mufe_fenicsx.contact.surface.surface.OwnSurface`.
        node_modulus, facet_modulus: E/(1 - nu²) of their grains [Pa].
        c: The constant of the layer.
    """
    # A nodal area is that of two triangles.
    node = c * edge_of_area(own.whole_area, 2) / node_modulus
    return node, c * edge_of_area(own.facet_area, 1) / facet_modulus


#: Layers by the name of their law.
LAYERS = {"matched": matched_layers}


def law_names():
    """Names of all normal laws."""
    return (*LAYERS, KINEMATIC)


def register_law(name, layers):
    """Let scene files say ``contact.law = name`` for layers of one's own.

    A pair of a point and a facet that overlap by d carries the pressure d/(l1 + l2), l1 the layer
    of the point's side and l2 that of the facet's. As with "matched" the overlap is that of smooth
    surfaces, less the dent; a deep contact of few points is softer. Energies, friction and the
    time step follow.

    Args:
        name: Its name in scene files.
        layers: Called as :func:`matched_layers`; its answer is as well the compliance of nodes
            and of facets [m/Pa], each > 0. ``contact.compliance`` of the scene is its last
            argument.

    Raises:
        InputError: The name is taken.
    """
    if name == KINEMATIC or LAYERS.get(name, layers) is not layers:
        raise InputError(f'contact law "{name}" is there already, expected a new name')
    LAYERS[name] = layers


def replace_layers(mesh, own, layers, rigid_layer):
    """Put the layers of rigid grains in place of those matched to the mesh.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        own: Its :class:`~mufe_fenicsx.contact.surface.surface.OwnSurface`.
        layers: Compliance of its nodes and of its facets [m/Pa], changed in place.
        rigid_layer: Compliance of rigid grains [m/Pa], nan for others, shape (num_grains,).
    """
    grains = mesh.grain_of_node[own.nodes], own.local_grain_of_facet
    for layer, grain in zip(layers, grains, strict=True):
        rigid = ~np.isnan(rigid_layer[grain])
        layer[rigid] = rigid_layer[grain[rigid]]


def largest_depths(mesh, own, modulus, rigid_layer=None):
    """Parts of nodes and of facets in the depth from which the force of a pair grows no more [m].

    Both sides add: of deformable grains half of ``LARGEST_DEPTH`` h each, where the pressure is
    that part of E*/(2 c); of rigid ones what reaches the same pressure with their layer, if more;
    of tools that alone, next to nothing. Nothing but the two sides of a pair takes part.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        own: Its :class:`~mufe_fenicsx.contact.surface.surface.OwnSurface`.
        modulus: E/(1 - nu²) of this rank's grains [Pa], shape (num_grains,).
        rigid_layer: Compliance of grains that do not deform [m/Pa], nan for others; None: all do.
    """
    edges = edge_of_area(own.whole_area, 2), edge_of_area(own.facet_area, 1)
    depths = tuple(0.5 * LARGEST_DEPTH * edge for edge in edges)
    if rigid_layer is not None:
        of_rigid = np.nan_to_num(0.5 * LARGEST_DEPTH / COMPLIANCE * rigid_layer * modulus)
        grains = mesh.grain_of_node[own.nodes], own.local_grain_of_facet
        for depth, grain in zip(depths, grains, strict=True):
            depth[mesh.is_tool[grain]] = 0.0
            np.maximum(depth, of_rigid[grain], out=depth)
    return depths


def inertial_layers(own, mass):
    """Area over mass of nodes and of facets [m²/kg]; times Δt² that is their layer [m/Pa].

    Args:
        own: :class:`~mufe_fenicsx.contact.surface.surface.OwnSurface`.
        mass: Masses of its nodes [kg], shape (num_nodes,).
    """
    node = own.area / mass
    return node, node[own.facets].mean(axis=1)


def kinetic_of(static, kinetic, where):
    """The kinetic coefficient of friction; ``static`` where it is None.

    Args:
        static: Coefficient that a contact has to overcome to slip.
        kinetic: Coefficient while it slips, or None.
        where: For the message.

    Raises:
        InputError: Not 0 <= kinetic <= static, or static not a finite number.
    """
    static = finite_number(f"friction {where}", static, ge=0)
    if kinetic is None:
        return static
    kinetic = finite_number(f"kinetic friction {where}", kinetic)
    if not 0 <= kinetic <= static:
        raise InputError(
            f"kinetic friction {where} = {kinetic}, expected 0 <= kinetic <= friction = {static}"
        )
    return kinetic
