"""Mass added to the worst elements for a longer time step, bounded and accounted for.

The stable step of one element is proportional to the root of its density. Elements whose own step
t_e lies below a wanted one t get the density

    rho_e' = rho_e (t/t_e)²

(conventional mass scaling). Springs of contact that hold a node of the surface by up to k in all
have a stable step of their own there, T = sqrt(2 m/k): contacts that open and close need
(w T)² <= 2. Such a node gets the mass k T²/2 of the step T = 1.5 t that the assembled tetrahedra
allow where the worst of them have the step t, so that neither side gets mass that the other makes
useless. Nodes along the sharp edges of a grain that walls hold are those: they have little mass,
and two or three walls.

Mass only lowers the frequencies of the assembled system: its stable step, which is estimated anew
with the new mass, can but grow. Inertia is changed, statics is not. Since each grain becomes
heavier by a share a_g, the speed of waves falls by up to 1/sqrt(1 + a_g), and its kinetic energy at
a given speed grows by 1 + a_g.

Two bounds hold at all times: added mass over the mass of all grains, and that of each grain over
its own, or over that of a mean grain if it is lighter. For a shaving, which the border of an image
cuts off, bears forces like its neighbours: what its inertia adds is measured by theirs. t is the
longest step that meets both, or the one asked for if that is shorter. A grain that breaks into
small pieces has no bound of its own, unless one is stated: else the first would keep all steps
short.

Where grains break, springs of cracks shorten the step to a fourth. What was added before for a
longer one would be of no use then: nothing is added at the start, t is at most half of the step of
the worst element of then, and each addition takes half of what is left at most, for there are
further cracks.

Added mass never goes away. Where mass is added later to nodes that move, they keep their
velocities; the kinetic energy that this takes is booked as negative damping.

The selective form (L. Olovsson, K. Simonsson, M. Unosson, Int. J. Numer. Meth. Engng 63, 2005,
1436-1445) keeps the mass of each element's translation, at the price of a mass matrix that has to
be solved with in every step. What limits the step here are springs of contact on nodes of little
mass; they ask for translational mass, of which a thousandth of the sample's does most of the work.
"""

import math

import numpy as np
from mpi4py import MPI

from ..kernels.bulk.element_step import element_steps
from ..state import Stateful

#: Stable step of the assembled tetrahedra over that of the worst one where some were given mass:
#: 1.5 and 1.65 in two sands of 612 and 63 grains (2.3 to 3.4 where none is). Their steps with 2 %
#: added are 0.60 and 0.55 ns with 2.3 in its place, 0.68 and 0.60 with 1.8, 0.77 and 0.65 with 1.5,
#: 0.81 and 0.68 with 1.2, where limits with more closed contacts begin to fall below the tets'.
ASSEMBLED = 1.5
#: The wanted step is looked for to this part of itself; the share grows some ten times as fast.
RESOLVED = 1e-5
#: What is held of the step of the worst element where grains break. Nodes of small pieces ask for
#: mass as the square of it: of 200 balls at a strain of 0.008 for 2.4 %, with the whole for 16 %.
HELD = 0.5
#: Mass is adjusted when the stable step falls below this part of what it was.
FALLEN = 0.95


class MassScaling(Stateful):
    """Added densities of the elements of one rank. Collective, as its methods.

    Args:
        solid: :class:`~mufe_fenicsx.bulk.solid.Solid`, its masses those of the material.
        settings: :class:`~mufe_fenicsx.scene.MassScaling`.
        hold: Whether mass is left for what shortens the step later, as cracks do.
    """

    STATE = {
        "cells": ("added",),
        "nodes": ("added_to_node",),
        "common": ("wanted", "reached"),
    }
    SHARED = ("added_to_node",)

    def __init__(self, solid, settings, hold=False):
        self.solid, self.mesh, self.settings, self.hold = solid, solid.mesh, settings, hold
        self.comm = solid.mesh.comm
        mesh = self.mesh
        self.first_mass = solid.mass.copy()  #: of the nodes, without additions [kg]
        self._rho = rho = np.array([material.rho for material in solid.materials])
        grain_mass = rho * self._of_grains(solid.volume0)
        total = self.comm.allreduce(np.array([grain_mass.sum(), grain_mass.size]))
        self._total = float(total[0])
        #: What the share of each grain is over [kg].
        self._at_least_mean = np.maximum(grain_mass, total[0] / total[1])
        self._some, self._added = np.empty(0, dtype=int), np.empty(0)  # elements with added mass
        self.added_to_node = np.zeros(mesh.num_nodes)  #: mass added for springs of contact [kg]
        self.wanted = 0.0  #: step of the worst element that it was last adjusted to [s]
        self.reached = 0.0  #: stable step after the last adjustment [s]

    @property
    def added(self):
        """Added density over that of the material, shape (num_cells,); made anew."""
        added = np.zeros(self.mesh.num_cells)
        added[self._some] = self._added
        return added

    @added.setter
    def added(self, values):
        self._some = np.flatnonzero(values)
        self._added = values[self._some]

    def load_state_dict(self, kept):
        """Become what :meth:`state_dict` told, and give the nodes their masses."""
        super().load_state_dict({"nodes": kept["nodes"], "common": kept["common"]})
        self.added = kept["cells"]["added"]
        self.set_masses()

    def _of_grains(self, values):
        return np.add.reduceat(values, self.mesh.cell_offset[:-1])

    def _most_of_a_grain(self):
        """Bound of the share of each grain."""
        if self.settings.added_to_grain is not None:
            return self.settings.added_to_grain
        return math.inf if self.hold else min(10.0 * self.settings.added, 1.0)

    def shares(self):
        """Added mass over that of all grains, and the largest share of a grain, as of its bound."""
        return self._shares(self.added, self.added_to_node)

    def _shares(self, added, added_to_node):
        of_grains = self._rho * self._of_grains(added * self.solid.volume0)
        of_grains += np.bincount(self.mesh.grain_of_node, added_to_node, of_grains.size)
        total = self.comm.allreduce(float(of_grains.sum()))
        largest = float((of_grains / self._at_least_mean).max(initial=0.0))
        return total / self._total, self.comm.allreduce(largest, op=MPI.MAX)

    def adjust(self, x, springs=None):
        """Add what elements and springs want at the positions ``x``; whether any mass was added.

        Args:
            x: Positions [m], shape (num_nodes, 3).
            springs: Nodes that contact may hold and bounds of its springs there [N/m]; or None.
        """
        s = self.settings
        own = element_steps(x, self.mesh.cells, self.solid.wave_speed[self.mesh.grain_of_cell])
        nodes, stiffness = (np.empty(0, int), np.empty(0)) if springs is None else springs
        held = stiffness > 0.0
        nodes, stiffness = nodes[held], stiffness[held]
        of_springs = np.sqrt(2.0 * self.first_mass[nodes] / stiffness) / ASSEMBLED
        worst, low = (
            self.comm.allreduce(float(steps.min(initial=math.inf)), op=MPI.MIN)
            for steps in (own, np.append(own, of_springs))
        )
        high = self.comm.allreduce(float(own.max(initial=0.0)), op=MPI.MAX)
        if s.time_step is not None:
            high = min(high, s.time_step)
        most, most_of_a_grain = s.added, self._most_of_a_grain()
        if self.hold:
            if not self.wanted:
                self.wanted = HELD * worst if s.time_step is None else s.time_step
                return False
            high, most = min(high, self.wanted), 0.5 * (s.added + self.shares()[0])
        if not 0.0 < low < high:
            return False

        before = self.added

        def at(step):
            to_elements = step / own
            to_elements *= to_elements
            to_elements -= 1.0
            np.maximum(before, to_elements, out=to_elements)
            wanted = 0.5 * stiffness * (ASSEMBLED * step) ** 2
            # What the elements around a node get counts for it.
            there = self.first_mass + self._at_nodes(to_elements)
            to_nodes = self.added_to_node.copy()
            to_nodes[nodes] = np.maximum(to_nodes[nodes], wanted - there[nodes])
            return to_elements, to_nodes

        def allowed(step):
            share, largest = self._shares(*at(step))
            return share <= most and largest <= most_of_a_grain

        if not allowed(high):
            while high > (1.0 + RESOLVED) * low:
                middle = math.sqrt(low * high)
                low, high = (middle, high) if allowed(middle) else (low, middle)
            high = low
        if not allowed(high):  # what is there already takes all that is allowed
            return False
        added, to_nodes = at(high)
        more = (added > before).any() or (to_nodes > self.added_to_node).any()
        changed = self.comm.allreduce(bool(more), op=MPI.LOR)
        self.added, self.added_to_node = added, to_nodes
        if not self.hold:
            self.wanted = high
        self.set_masses()
        return changed

    def set_masses(self):
        """Give the nodes their masses, those of the material and what was added."""
        self.solid.mass[:] = self.first_mass + self._at_nodes(self.added) + self.added_to_node

    def _at_nodes(self, added):
        """Mass that added densities of elements bring to the nodes [kg]."""
        some = np.flatnonzero(added)
        of_elements = self._rho[self.mesh.grain_of_cell[some]] * self.solid.volume0[some]
        share, mass = 0.25 * added[some] * of_elements, np.zeros(self.mesh.num_nodes)
        for corner in self.mesh.cells.T:
            mass += np.bincount(corner[some], share, mass.size)
        return mass

    def summary(self, limits):
        """What was added and what it is worth, for run.json.

        Args:
            limits: Stable steps of the present state with and without the added mass [s].
        """
        share, largest = self.shares()
        return {
            "added": share,
            "added_to_grain": largest,
            "num_elements": self.comm.allreduce(self._some.size),
            "num_contact_nodes": self.comm.allreduce(int(np.count_nonzero(self.added_to_node))),
            "element_step": self.wanted,
            "stable_step": limits[0],
            "stable_step_without": limits[1],
            "gain": limits[0] / limits[1],
        }
