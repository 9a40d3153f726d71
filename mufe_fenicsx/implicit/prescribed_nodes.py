"""Nodes whose displacement is prescribed along some directions, in vectors and matrices."""

from dataclasses import replace

import numpy as np

from ..kernels.build.blocks import project_blocks, project_pairs


class HeldNodes:
    """Takes the directions along which nodes are held out of vectors and tangents. Collective.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        held: Pairs (nodes of this rank, unit vector (3,)).
        fixed: Nodes of this rank that are held in all directions.
        contact_tangent: :class:`~mufe_fenicsx.contact.stiffness.tangent.ContactTangent`.
    """

    def __init__(self, mesh, held, fixed, contact_tangent):
        n = mesh.num_nodes
        self._contact_tangent, self._searched = contact_tangent, -1
        self._projector = np.tile(np.eye(3), (n, 1, 1))
        count = np.zeros(n, dtype=np.int64)
        for nodes, d in held:
            nodes = np.atleast_1d(nodes)
            count[nodes] += 1
            self._projector[nodes] -= np.outer(d, d)
        several, directions = count > 1, {}
        several[fixed] = False
        for nodes, d in held:
            nodes = np.atleast_1d(nodes)
            for node in nodes[several[nodes]]:  # along edges between mirrors
                directions.setdefault(int(node), []).append(d)
        for node, along in directions.items():
            basis, size = np.linalg.svd(np.array(along))[2], np.linalg.matrix_rank(along)
            self._projector[node] = np.eye(3) - basis[:size].T @ basis[:size]
        self._projector[fixed] = 0.0
        self._is_held = count > 0
        self._is_held[fixed] = True
        self._any = mesh.comm.allreduce(int(self._is_held.any())) > 0

    def project(self, values):
        """The free part of nodal vectors, shape (num_nodes, 3), in place. Local."""
        held = self._is_held
        values[held] = np.einsum("nij,nj->ni", self._projector[held], values[held])
        return values

    def project_tangent(self, tangent, blocks, rows, columns, contact):
        """The free part of a tangent, in place; held directions get the largest diagonal entry.

        Args:
            tangent: :class:`~.tangent.SolidTangent`, whose pattern ``blocks`` has.
            blocks: Shape (num_blocks, 3, 3).
            rows, columns: Surface nodes of the blocks of contact, shape (n,).
            contact: These blocks, shape (n, 3, 3).
        """
        self.project_blocks(tangent, blocks)
        self.project_contact(rows, columns, contact)

    def project_blocks(self, tangent, blocks):
        """As :meth:`project_tangent`, the blocks of the grains alone. Local."""
        if not self._is_held.any():
            return
        largest = float(np.abs(blocks[tangent.diagonal]).max(initial=0.0))
        project_blocks(blocks, tangent.offset, tangent.columns, self._projector, self._is_held)
        blocks[tangent.diagonal] += largest * (np.eye(3) - self._projector)

    def project_contact(self, rows, columns, contact):
        """As :meth:`project_tangent`, the blocks of contact alone. Collective after a search."""
        if self._any:
            project_pairs(contact, rows, columns, *self._at_surface())

    def project_nodes(self, rows, columns, blocks):
        """The free part of further blocks of two nodes of this rank, in place. Local."""
        if self._is_held.any():
            project_pairs(blocks, rows, columns, self._projector, self._is_held)

    def _at_surface(self):
        """Projectors at surface nodes and ghosts, and where they differ from one."""
        contact = self._contact_tangent.contact
        if self._searched != contact.num_searches:
            self._searched = contact.num_searches
            own = self._projector[contact.own.nodes]
            forward = self._contact_tangent.forward
            projector = np.stack([forward(own[:, i]) for i in range(3)], axis=1)
            held = np.abs(projector - np.eye(3)).max(axis=(1, 2)) > 0
            self._of_surface = projector, held
        return self._of_surface


def lead_nodes(specimen, prescribed, dt):
    """Let constraints tell where their nodes go in ``dt`` [s]; how far at most [m]. Local.

    Nodes have to go there with those of the grains: contact pairs see both move.

    Args:
        specimen: :class:`~mufe_fenicsx.specimen.Specimen`.
        prescribed: Displacements of nodes [m], shape (num_nodes, 3), set for those of constraints.
    """
    s, constraints, farthest = specimen.state, specimen.constraints, 0.0
    if not constraints:
        return 0.0
    there = replace(s, x=s.x.copy(), u=s.u.copy(), v=s.v.copy())
    moves, field = np.zeros(specimen.mesh.num_grains), np.zeros((4, 3))
    for constraint in constraints:
        constraint.lead(s.t, dt)
    for constraint in constraints:
        farthest = max(farthest, constraint.drift(there, dt, 0.0, moves, field))
        constraint.complete(there)
    for nodes in (specimen.glued.nodes, specimen.rigid.lists.nodes):
        prescribed[nodes] = (there.x - s.x)[nodes]
    return farthest
