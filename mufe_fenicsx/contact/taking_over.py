"""Faces of a crack whose pieces have come apart: contact begins with what the crack bore there."""

import numpy as np

from ..kernels.geometry.topology import rows_of


def take_over(contact, sides, traction, held, x):
    """Let pairs of faces bear what is pressed on them, between pieces that lie on each other.

    Contact knows these faces already, each without force where they overlap. A pair of a point in
    one of them with the body across gets the offset with which it bears the pressure, and its
    spring of friction the stretch for the shear. What its springs hold then, less what those of the
    crack held, counts as switched. Collective.

    Args:
        contact: :class:`~mufe_fenicsx.contact.contact.Contact`, evaluated at ``x``.
        sides: Numbers of the sides of cells that the two faces are, shape (num, 2).
        traction: On the first ones [Pa], shape (num, 3).
        held: Energy of the springs that bore it [J].
        x: Present positions [m], shape (num_nodes, 3).
    """
    done = contact.dissipation
    before = contact.energy()[0] + done.total + done.switched + held
    pairs, face, bears = _pairs_across(contact, sides, traction)
    p, surface, points = contact.pairs, contact.surface, contact.points
    layers = points.layer[p.node[pairs]] + surface.layer_of_facet[face]
    pressure = np.einsum("ni,ni->n", bears, p.normal[pairs])
    pressed = pressure > 0.0
    pairs, layers, bears, pressure = (of[pressed] for of in (pairs, layers, bears, pressure))
    p.offset[pairs] = p.gap[pairs] + pressure * layers
    p.next_check[pairs] = -np.inf  # they neither wait nor came in from the side
    contact.evaluate(np.zeros_like(x))
    facing = p.facing[pairs]
    shear = bears - np.einsum("ni,ni->n", bears, facing)[:, None] * facing
    spring = -(layers / p.ratio[pairs])[:, None] * shear
    a, b, c = contact.ghosts.positions.array[contact.ghosts.num_before :][
        p.vertices[pairs] - contact.ghosts.num_before
    ].transpose(1, 0, 2)
    edges = np.stack([b - a, c - a], axis=2)
    along = np.einsum("nij,nj->ni", np.linalg.pinv(edges), spring)
    p.stick_point[pairs] -= np.column_stack([-along.sum(axis=1), along])
    p.shear[pairs] = (p.stiffness[pairs] * layers)[:, None] * shear
    done.switched += before - contact.energy()[0] - done.total - done.switched


def _pairs_across(contact, sides, traction):
    """Pairs of points in the faces with the bodies across, their facets there, and tractions."""
    own, p, points = contact.own, contact.pairs, contact.points
    if not len(sides):
        none = np.empty(0, dtype=np.int64)
        return none, none, np.empty((0, 3))
    rows = rows_of(own.side, sides.ravel()).reshape(-1, 2)
    bears = np.zeros((len(own.facets), 3))
    across = np.full(len(own.facets), -1)
    bears[rows[:, 0]], bears[rows[:, 1]] = traction, -traction
    across[rows] = own.body_of_facet[rows[:, ::-1]]
    facet = points.ring[points.ring_offset[p.node]]
    wanted = (p.node < points.num_in_facets) & (p.body == across[facet]) & (p.closest >= 0)
    pairs = np.flatnonzero(wanted & np.isfinite(p.gap) & ~p.closed)
    return pairs, p.candidate[p.closest[pairs]], bears[facet[pairs]]
