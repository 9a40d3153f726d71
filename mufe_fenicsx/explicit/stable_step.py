"""Limit of stability of explicit time steps, from the assembled system with contact."""

import math

import numpy as np
from mpi4py import MPI

from ..bulk.rigid_rows import FreeRows
from ..contact.stiffness.springs import AllSprings, all_springs, list_edge_springs
from ..errors import InputError
from ..solvers.highest_frequency import HighestFrequency
from ..state import Stateful
from .mass_split import MassSplit

#: The tets are looked at again when the bound of single ones falls by this, or after so many
#: steps: their frequency changes with their shapes alone.
WORSE, RARELY = 0.97, 1500
#: A step shorter by this part costs less than the products of springs and tets together, which took
#: 6 % of the time of a loaded packing (docs/record/2026-11-performance.md).
LITTLE = 0.03


class StableStep(Stateful):
    """The limit at the present state of a specimen. Collective, as its methods.

    Two bounds hold. The highest frequency w of tetrahedra and springs of contact together allows
    2/w. And a node that meets a spring of rate w_c at speed v leaves it one step later at up to
    |1 - (w_c dt)²| v: contacts that open and close need (w_c dt)² <= 2 of the springs alone.

    Args:
        specimen: :class:`~mufe_fenicsx.specimen.Specimen`. The stiffness of its added terms counts
            as that of the tetrahedra.
        assembled: From the assembled system (True) or from single elements.
        factor: What part of the limit will be used.
    """

    STATE = {"common": ("rate_of_tets", "tets_at", "element_step_then")}

    def __init__(self, specimen, assembled, factor):
        self.specimen, self.comm = specimen, specimen.comm
        self.solid, self.contact = specimen.solid, specimen.contact
        self.rigid, self.state = specimen.rigid, specimen.state
        self._of_terms = []  # what added terms have of stiffness now
        self.assembled, self.factor = assembled, factor
        self._springs = None
        self.rows = FreeRows(self.rigid)
        contact_step = self.rigid.contact_step(self.contact.points)
        self._contact_step = self.comm.allreduce(contact_step, op=MPI.MIN)
        self.highest, self.highest_of_springs, self.highest_of_tets = self._frequencies()
        #: Highest frequency of the tets [rad/s], when it was found, and the step of the worst
        #: single one then [s].
        self.rate_of_tets, self.tets_at, self.element_step_then = math.nan, 0, math.nan
        #: The bound by contacts that open and close over the limit that was found last.
        self.slack = 1.0
        #: Mass that tets and springs share, for a bound of both together.
        self.shared = MassSplit(
            self.solid, self.contact.own.nodes, self.highest_of_tets, self.highest_of_springs
        )

    def _frequencies(self):
        """Iterations for the highest frequencies of all, springs and tets, from the start."""
        mass, turned = self.rows.masses(self.solid.mass), self.rows.turned()
        adds = self._add_stiffness, self.add_springs, self._add_tets
        first, *others = (self.rows.constrained(add, self.state) for add in adds)
        highest = HighestFrequency(self.comm, *mass, first, turned=turned)
        return [highest, *(highest.of(add) for add in others)]

    def frequencies(self):
        """All iterations for highest frequencies, by name."""
        return {
            "highest": self.highest,
            "highest_of_springs": self.highest_of_springs,
            "highest_of_tets": self.highest_of_tets,
            "of_shares": self.shared.highest,
        }

    def state_dict(self):
        """Vectors that iterations begin from too, at nodes and of rigid grains."""
        kept = super().state_dict() | {"nodes": {}, "rigid": {}}
        kept["common"]["num_products"] = {n: h.num_products for n, h in self.frequencies().items()}
        for name, highest in self.frequencies().items():
            if highest.vector is not None:
                at_nodes, of_grains = self.rows.unpacked(highest.vector)
                kept["nodes"][name], kept["rigid"][name] = at_nodes, of_grains
        return kept

    def load_state_dict(self, kept):
        """Become what :meth:`state_dict` told."""
        common = dict(kept["common"])
        num_products = common.pop("num_products")
        super().load_state_dict({"common": common})
        for name, highest in self.frequencies().items():
            highest.num_products = num_products[name]
            known = name in kept.get("nodes", {})  # else none was needed so far
            highest.vector = (
                self.rows.packed(kept["nodes"][name], kept["rigid"][name]) if known else None
            )

    def destroy(self):
        """Free the PETSc vectors, and what refers back to this. Collective."""
        self._springs.destroy()
        del self.highest, self.highest_of_springs, self.highest_of_tets, self.shared

    def set_mass(self, mass):
        """Take other nodal masses [kg], shape (num_nodes,)."""
        shared = self.shared
        others = self.highest_of_springs, self.highest_of_tets, shared.highest
        for highest in (self.highest, *others):
            highest.set_mass(mass)
        self.element_step_then = math.inf  # that of the tets is to be found again
        shared.forget()

    def follow_parts(self, mass):
        """Go on where nodes have parted, with the state of before. Collective.

        The frequency of the other grains is what it was: what is found is that of those.

        Args:
            mass: Nodal masses now [kg], shape (num_nodes,).
        """
        then, grains = self.element_step_then, self.specimen.mesh.parted_grains
        self.set_mass(mass)
        if not self.rows.are_nodes:
            return
        nodes = np.flatnonzero(np.isin(self.specimen.mesh.grain_of_node, grains))
        from_all, to_all = np.zeros((2, len(mass), 3))

        def add(y, q):
            from_all[nodes], to_all[nodes] = q, 0.0
            self.solid.kernel.add_stiffness(to_all, from_all, self.state.x, grains)
            y += to_all[nodes]

        of_parts = self.highest_of_tets.of(None)
        of_parts.vector = self.highest_of_tets.vector
        self.element_step_then = then
        self.rate_of_tets = max(self.rate_of_tets, of_parts(nodes, add))

    def of_elements(self, own=None):
        """Bound from single elements [s]; what does not deform has one by contact alone.

        Args:
            own: That of this rank's elements now, where it is known.
        """
        if own is None:
            own = self.solid.element_time_step(self.state.x)
        return min(self.comm.allreduce(own, op=MPI.MIN), self._contact_step)

    def __call__(self, margin, element_step):
        """Limit of stability [s].

        Args:
            margin: All pairs within it [m] count as closed, but for those of two grains that are
                not expected to move so far (:class:`~.contact.pairs.motion_bounds.MotionBounds`).
            element_step: Present value of :meth:`of_elements` [s].
        """
        self._take_stiffness_of_terms()
        springs = all_springs(self.specimen, margin, expected=True)
        limit, of_contact = self._limit(
            springs, margin, element_step, self.highest, self.highest_of_springs,
            lambda: self._recent_rate_of_tets(element_step), self._square_by_shares,
        )  # fmt: skip
        self.slack = of_contact / limit
        return limit

    def afresh(self, margin, element_step, mass=None):
        """The same from scratch, of all pairs within the margin.

        Where given with other nodal masses [kg], shape (num_nodes,).
        """
        self._take_stiffness_of_terms()
        all_of_them = self.highest, self.highest_of_springs, self.highest_of_tets
        frequencies = [highest.of(highest.add_stiffness) for highest in all_of_them]
        if mass is not None:
            for highest in frequencies:
                highest.set_mass(mass)
        springs = all_springs(self.specimen, margin)
        return self._limit(springs, margin, element_step, *frequencies)[0]

    def _take_stiffness_of_terms(self):
        """Stiffness of the added terms at the present state.

        Raises:
            InputError: There is one, and the step is to come from single elements.
        """
        specimen, state = self.specimen, self.state
        found = [specimen.ask(term, "stiffness", state) for term in specimen.added_terms]
        self._of_terms = [of_term for of_term in found if of_term is not None]
        if self._of_terms and not self.assembled:
            raise InputError(
                'time step = by element, expected "assembled" where forces of their own have '
                "a stiffness"
            )

    def of_tets(self):
        """Limit [s] of the tetrahedra without contact; inf for rigid grains."""
        rate = HighestFrequency(self.comm, self.solid.mass, self.specimen.mesh.x, self._add_tets)()
        return 2.0 / rate if rate > 0.0 else math.inf

    def _limit(
        self, listed, margin, element_step, highest, highest_of_springs, rate_of_tets, better=None
    ):
        """Limit of stability, and the bound by contact that opens and closes alone [s]."""
        if self._springs is not None:
            self._springs.destroy()
        self._springs = listed
        knows = self.assembled and not self.contact.layers.kinematic
        if isinstance(listed, AllSprings) and not knows:
            raise InputError(
                "force terms with springs of their own, expected a time step from the assembled "
                "system and contact by penalties"
            )
        springs = 0.0
        if not self.contact.layers.kinematic:
            # All ranks alike, for others start the iteration from rows that no spring touches too.
            among = (listed.at, listed.add_compact) if self.rows.are_nodes else ()
            springs = highest_of_springs(*among)
        limit = self._contact_step
        if springs > 0.0:
            limit = min(limit, math.sqrt(2.0) / springs)
        if not self.assembled:
            stiffest = self.comm.allreduce(self._stiffest_contact(margin), op=MPI.MAX)
            both = 2.0 / math.sqrt((2.0 / element_step) ** 2 + 2.0 * stiffest)
            return min(limit, both), limit
        # The squares of springs and tets add up at most (Weyl), and less with a closer look. Where
        # a bound takes little from what contacts that open and close ask for, the costly products
        # with both are not needed. Half of what the factor takes off is not taken off a bound.
        if springs > 0.0:
            safe = 2.0 / (0.5 * (1.0 + self.factor))
            of_tets, enough = rate_of_tets(), (safe / limit) ** 2
            square, most = springs**2 + of_tets**2, enough / (1.0 - LITTLE) ** 2
            if better and square > enough and of_tets**2 <= most:
                square = min(square, better(enough, most, springs))
            if square <= most:
                return min(limit, safe / math.sqrt(square)), limit
        rate = highest()
        return min(limit, 2.0 / rate) if rate > 0.0 else limit, limit

    def _recent_rate_of_tets(self, element_step):
        """Highest frequency of the tetrahedra [rad/s], from not long ago."""
        waited = self.state.num_steps - self.tets_at
        often = waited >= RARELY or self._of_terms
        if often or not element_step >= WORSE * self.element_step_then:
            self.rate_of_tets = self.highest_of_tets()
            self.tets_at, self.element_step_then = self.state.num_steps, element_step
            self.shared.forget()
        return self.rate_of_tets

    def _square_by_shares(self, enough, most, rate_of_springs):
        """Bound of the square of the highest frequency by shares of mass [1/s²], inf for none.

        Args:
            enough: What it need not be below.
            most: What is of no use any more.
            rate_of_springs: Highest frequency of springs alone [rad/s].
        """
        shared = self.shared
        if not self.rows.are_nodes or self._of_terms or shared.rests():
            return math.inf
        chosen = shared.part is None
        if chosen:
            shared.choose(self.state.x, self._springs, rate_of_springs)
        square = shared.bound(enough, self._springs)
        shared.judge(square <= most, chosen)
        return square

    def _add_stiffness(self, y, q):
        self._add_tets(y, q)
        self.add_springs(y, q)

    def _add_tets(self, y, q):
        self.solid.add_stiffness(y, q, self.state.x)
        for rows, columns, blocks in self._of_terms:
            np.add.at(y, rows, np.einsum("bij,bj->bi", blocks, q[columns]))

    def add_springs(self, y, q):
        """Add the forces that springs resist ``q`` with to ``y``, both of shape (num_nodes, 3)."""
        if not self.contact.layers.kinematic:
            self._springs.add(y, q)

    def _stiffest_contact(self, margin):
        """Largest sum over mass of a node's contact springs [1/s²], all closed. Local.

        A spring between two nodes adds at most twice its stiffness over the mass
        (Gershgorin); a surface node carries its own spring and those of the facets.
        """
        c = self.contact
        if c.layers.kinematic:
            return 0.0
        mass = self.solid.mass[c.own.nodes]
        spring = c.points.to_nodes((c.points.area / c.points.layer)[:, None], mass.size)[:, 0]
        listed = list_edge_springs(c, margin)
        edges = listed.bounds(self.specimen.mesh.num_nodes)[c.own.nodes]
        listed.destroy()
        return float(((2.0 * spring + edges) / mass).max(initial=0.0))
