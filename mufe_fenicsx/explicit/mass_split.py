"""A bound of the highest frequency of tetrahedra and springs together, from each of them alone.

Give the tetrahedra a part s p of the mass of each node and the springs the rest. For all motions u

    uᵀ(K_t + K_c) u  <=  λ_t/s uᵀ(s p M) u + λ_c uᵀ((1 - s p) M) u  <=  max(λ_t/s, λ_c) uᵀM u,

λ_t the highest eigenvalue of (p M)⁻¹K_t and λ_c that of ((1 - s p) M)⁻¹K_c. With p near one where
tetrahedra are stiff and springs soft, the bound is not far above the frequency itself, for stiff
tetrahedra and stiff springs are seldom at the same place, as Weyl's inequality takes them to be.
λ_t costs products with all tetrahedra; it changes with their shapes alone, and p may be any, so it
is found once for many states. λ_c costs products with springs.
"""

import math

import numpy as np

from ..state import Stateful

#: A node that tetrahedra hold by k and springs by up to g has p = k/(k + WEIGHT g): in a loaded
#: sand of 204 grains the bound is least there; 0.1 in its place makes it 22 % more, 0.6 18 %.
WEIGHT = 0.25
#: Springs of this times the highest eigenvalue of all of them are taken to be at each node of the
#: surface, where they may come to be: eight of ten later bounds were of use there, six with half.
EVERYWHERE = 1.0
#: Parts are chosen anew after so many bounds in a row that were of no use.
MISSES = 2
#: Part of the mass that is left to either at least.
LEAST = 1e-3


class MassSplit(Stateful):
    """Parts of the nodal masses. Collective, as its methods.

    Args:
        solid: :class:`~mufe_fenicsx.bulk.solid.Solid` of the tetrahedra.
        nodes: Nodes of this rank's surface.
        of_tets: :class:`~.HighestFrequency` of the tetrahedra alone.
        of_springs: That of the springs.
    """

    STATE = {"common": ("square", "misses", "failures", "rest")}

    def __init__(self, solid, nodes, of_tets, of_springs):
        self.solid, self.nodes = solid, nodes
        self._of_tets = of_tets
        self.highest = of_springs.of(None)  #: of springs with their part of the mass
        self.part = None  #: p of each node, shape (num_nodes,); None: not chosen
        self.square = math.nan  #: λ_t [1/s²]
        self.misses = 0  #: bounds in a row that were of no use
        self.failures = 0  #: choices in a row whose first bound was of none
        self.rest = 0  #: bounds that are not asked for yet

    def state_dict(self):
        """The parts of the nodes too, where they are chosen."""
        kept = super().state_dict()
        return kept if self.part is None else kept | {"nodes": {"part": self.part}}

    def load_state_dict(self, kept):
        """Become what :meth:`state_dict` told."""
        kept = dict(kept)
        self.part = kept.pop("nodes", {}).get("part")
        super().load_state_dict(kept)

    def forget(self):
        """Choose the parts anew when they are wanted next. Local."""
        self.part, self.misses = None, 0

    def rests(self):
        """Whether the next bound is left out, which counts it. Local.

        A choice costs as much as products with all that a bound spares. In a loaded sand most are
        of use even soon after one that was not: after k such in a row 2^k - 1 bounds are left out.
        """
        self.rest = max(self.rest - 1, 0)
        return self.rest > 0

    def judge(self, useful, chosen):
        """Say whether the last bound was of use, and whether its parts were new. Local."""
        self.misses = 0 if useful else self.misses + 1
        if chosen:
            self.failures = 0 if useful else self.failures + 1
            self.rest = 0 if useful else 1 << self.failures
        if self.misses == MISSES or (self.misses and chosen):
            self.part, self.misses = None, 0

    def choose(self, x, springs, rate):
        """Choose the parts at the positions ``x``.

        Args:
            x: Positions [m], shape (num_nodes, 3).
            springs: :class:`~mufe_fenicsx.contact.stiffness.springs.Springs`.
            rate: Their highest frequency by themselves [rad/s].
        """
        mass, held = self.solid.mass, np.zeros(len(x))
        held[self.nodes] = EVERYWHERE * rate**2 * mass[self.nodes]
        np.maximum(held, springs.bounds(len(x)), out=held)
        own = self.solid.nodal_stiffness(x)
        self.part = np.maximum(own / (own + WEIGHT * held), LEAST)
        of_tets = self._of_tets  # as well a beginning for one as for the other mass
        of_tets.set_mass(self.part * mass)
        self.square = of_tets() ** 2
        of_tets.set_mass(mass)

    def bound(self, enough, springs):
        """Bound of the square of the highest frequency [1/s²].

        Args:
            enough: What it need not be below, by which s is chosen [1/s²].
            springs: As of :meth:`choose`, the present ones.
        """
        scale = min(self.square / enough, 1.0)
        part = np.minimum(scale * self.part[springs.at], 1.0 - LEAST)
        mass = (1.0 - part) * self.solid.mass[springs.at]
        rate = self.highest(springs.at, springs.add_compact, mass)
        return max(self.square / scale, rate**2)
