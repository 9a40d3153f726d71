"""Stops a computation whose energy balance no longer closes."""

import numpy as np
from mpi4py import MPI

from ..analysis.energy_check import put_in
from ..errors import SolverError, UnstableError
from ..units import with_unit

#: A sample counts as loaded once its energies are those of this strain throughout. Below it,
#: at the first touch, round-off of the terms is all there is.
LEAST_STRAIN = 1e-6


class EnergyGuard:
    """Compares what the energy balance cannot explain with what has gone through it. Collective.

    That is its residual, and what contacts lost as they switched.

    A wall or a tool that meets grains at rest closes contacts somewhere within a step, and until
    then next to no work is done that this could be compared with. What goes missing is the same
    in all frames of reference, and so counts against the energy of the grains as seen from what
    moves. In increments it may be all of the work of one.

    Args:
        simulation: :class:`~mufe_fenicsx.explicit.simulation.Simulation`.
        limit: Largest sum of both over the larger of the work done so far, with the initial
            kinetic energy, and all energy that is stored and dissipated; that of a touch added.
    """

    def __init__(self, simulation, limit):
        self.simulation, self.limit = simulation, limit
        self._static = simulation.static
        solid, volume = simulation.solid, simulation.solid.volume0
        modulus = solid.contact_modulus[simulation.mesh.grain_of_cell]
        self._least = LEAST_STRAIN**2 * simulation.comm.allreduce(float(volume @ modulus))

    def check(self, energies, where, loaded=True):
        """Stop where the residual is beyond the limit. Collective.

        Args:
            energies: Of :meth:`~mufe_fenicsx.explicit.simulation.Simulation.energies`, the same on
                all ranks.
            where: How far the test has come, for the message.
            loaded: Whether the sample carries its load. Before, only a gain counts: the first
                touch is a blow that few steps resolve, and small in the end. Static increments
                cannot blow up: there neither counts before, for work is a trapezium over each
                increment, and a contact that closes within one stores less.

        Raises:
            SolverError: The balance is off by contacts that switched at the edge of a tool, which
                they do at any time step; on all ranks.
            UnstableError: It is off otherwise, or not a number; on all ranks.
        """
        residual = energies["residual"] + energies["switching"]
        first = self.simulation.initial_kinetic
        scale = max(first + put_in(energies), first + energies["work"] - residual)
        if scale < self._least or abs(residual) <= self.limit * scale:
            return
        touch = self.simulation.energy_of_touch()
        allowed = touch if self.simulation.increments else self.limit * touch
        if abs(residual) <= self.limit * scale + allowed:
            return
        if not loaded and (residual > 0 or self._static):
            return
        way = "came from nowhere" if residual < 0 else "went missing"
        lost = (
            f"{abs(residual):.3g} J {way} {where}, {abs(residual) / scale:.0%} of all energy "
            f"(solver.energy_limit = {self.limit:g})"
        )
        if abs(energies["switching"]) > 0.5 * abs(residual):
            self._stop_at_an_edge_of_a_tool(lost)
        part, grain, cell = self._most_agitated()
        raise UnstableError(
            f"{lost}; {part:.0%} of the motion is in grain "
            f"{grain}, fastest at element {cell} of its rank: reduce solver.time_step_factor or "
            "the speed of loading, or refine the mesh of that grain where it is coarse"
        )

    def _stop_at_an_edge_of_a_tool(self, lost):
        """Raise SolverError where a tool has sharp edges at grains that are longer than theirs."""
        mesh, contact = self.simulation.mesh, self.simulation.contact
        length = np.zeros(len(mesh.tools))
        surface, near = contact.surface, np.unique(contact.pairs.candidate)
        near = near[surface.grain_of_facet[near] >= mesh.first_tool]
        x = contact.ghosts.positions.array[contact.ghosts.num_before :][surface.facets[near]]
        edges = np.linalg.norm(np.roll(x, -1, axis=1) - x, axis=2) * surface.sharp_edge[near]
        tool = surface.grain_of_facet[near] - mesh.first_tool
        np.maximum.at(length, tool, edges.max(axis=1, initial=0.0))
        length = self.simulation.comm.allreduce(length, op=MPI.MAX)
        if length.max(initial=0.0) <= contact.edge:
            return
        raise SolverError(
            f"{lost}: contacts switched at a sharp edge of tool {mesh.tools[length.argmax()]}, "
            f"where its facets are {with_unit(length.max(), 'm')} long, expected no longer than "
            f"those of the grains, {with_unit(contact.edge, 'm')}: no time step helps; give it a "
            "finer surface there or a blunter edge"
        )

    def _most_agitated(self):
        """Part of the kinetic energy, label and fastest element of the grain with most of it."""
        s = self.simulation
        mesh, v = s.mesh, s.state.v
        square = np.nan_to_num((v**2).sum(axis=1), nan=np.inf)
        square = np.minimum(square, 1e200)
        kinetic = np.bincount(mesh.grain_of_node, s.solid.mass * square, mesh.num_grains)
        kinetic[mesh.is_tool] = 0.0
        grain = int(kinetic.argmax())
        begin, end = mesh.cell_offset[grain], mesh.cell_offset[grain + 1]
        cell = int(begin + square[mesh.cells[begin:end]].sum(axis=1).argmax())
        label = int(mesh.labels[mesh.grains[grain]])
        found = s.comm.allgather((float(kinetic[grain]), label, cell))
        total = s.comm.allreduce(float(kinetic.sum()))
        most, label, cell = max(found)
        return most / total if total > 0 else 0.0, label, cell
