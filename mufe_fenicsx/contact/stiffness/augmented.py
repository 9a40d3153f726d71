"""Exact gaps by augmented Lagrangian: normal forces that springs need not be pressed for.

A closed contact carries N = λ + k d, d its depth and k its layer's stiffness (or another law of d).
After an equilibrium is found, λ becomes N and the next one is looked for, until no depth is left
(Uzawa's method; J. C. Simo, T. A. Laursen, Comput. Struct. 42, 1992, 97-116). The layer then sets
how fast depths go, a factor of about three each time, and no longer how deep a contact is.

λ acts as a lift of the pair's offset, the depth at which the law has the force λ, so that forces
and tangents are those of any contact. It is there within an increment only: between increments
offsets are what they were without, and the normal forces, which every pair remembers, are the next
multipliers.

Contact between grains is looked at from both sides: where curved surfaces with other meshes
meet, gaps cannot vanish at all points, and a small tolerance is not reached. Crossings of sharp
edges keep their layer, and so does friction while it sticks.
"""

import numpy as np
from mpi4py import MPI

from ...kernels.contact_law import depths_of


class Augmentation:
    """Multipliers of all pairs of points with facets and walls.

    Args:
        contact: :class:`~mufe_fenicsx.contact.contact.Contact`.
    """

    def __init__(self, contact):
        self.contact = contact
        self._lift = None
        # Springs as stiff as can be: small contacts are softer, but here depths go altogether.
        layers, points, surface = contact.layers, contact.points, contact.surface
        for of in (layers.smooth.curvature, points.curvature, surface.curvature_of_facet):
            of[:] = 0.0
        for pairs in (contact.pairs, contact.walls.pairs):
            pairs.softer[:] = 0.0

    def _parts(self):
        """Pairs with facets and with walls, each with its stiffnesses [N/m].

        And the part of normal forces that works along the gap, which goes along facets.
        """
        contact, points, walls = self.contact, self.contact.points, self.contact.walls.pairs
        of_walls = points.area[walls.node] / points.layer[walls.node]
        pairs = contact.pairs
        straight = np.einsum("pi,pi->p", pairs.facing, pairs.normal)
        return (pairs, pairs.stiffness, straight), (walls, of_walls, np.ones(of_walls.size))

    def begin_increment(self):
        """The normal forces of closed pairs become multipliers, before a mark is made. Local."""
        self._lift, self._next_check = [], []
        for pairs, stiffness, straight in self._parts():
            on = np.flatnonzero(pairs.closed)
            lift = np.zeros(pairs.node.size)
            along_gap = (pairs.normal_force * straight)[on]
            lift[on] = depths_of(along_gap / stiffness[on], pairs.softer[on])
            pairs.offset += lift
            self._lift.append(lift)
            self._next_check.append(pairs.next_check.copy())

    def depth(self):
        """Largest distance of a closed pair from its gap in the last evaluation [m]. Collective."""
        worst = 0.0
        for (pairs, *_), lift in zip(self._parts(), self._lift, strict=True):
            off = (pairs.offset - lift - pairs.gap)[pairs.closed]
            worst = max(worst, float(np.abs(off).max(initial=0.0)))
        return self.contact.comm.allreduce(worst, op=MPI.MAX)

    def update(self, mark):
        """The forces of the last evaluation become multipliers. Local.

        Args:
            mark: :class:`~.rewind.ContactMark` that evaluations start from.
        """
        for k, (pairs, *_) in enumerate(self._parts()):
            old, next_check = self._lift[k], self._next_check[k]
            new = np.zeros_like(old)
            on = pairs.closed
            new[on] = (pairs.offset - pairs.gap)[on]
            offsets, checks = mark.of_points("offset")[k], mark.of_points("next_check")[k]
            offsets += new - old
            # An open pair with a multiplier closes before it touches.
            was_open = ~mark.of_points("closed")[k]
            checks[was_open] = (next_check - new)[was_open]
            self._lift[k] = new

    def end_increment(self, mark):
        """An increment is over: multipliers are what the pairs' forces are. Local.

        Args:
            mark: :class:`~.rewind.ContactMark` at its start.

        Returns:
            What the normal forces took as depths within the tolerance changed, beyond what springs
            of that depth store [J]: by the trapezoidal rule, as the work of walls.
        """
        self._lower()
        taken = 0.0
        for k, (pairs, stiffness, straight) in enumerate(self._parts()):
            depths = [
                np.where(closed, pairs.offset - gap, 0.0)
                for closed, gap in (
                    (mark.of_points("closed")[k], mark.of_points("gap")[k]),
                    (pairs.closed, pairs.gap),
                )
            ]
            normal_force = 0.5 * (mark.of_points("normal_force")[k] + pairs.normal_force)
            taken += (normal_force * straight) @ (depths[1] - depths[0])
            taken -= 0.5 * stiffness @ (depths[1] ** 2 - depths[0] ** 2)
        return float(taken)

    def _lower(self):
        for (pairs, *_), lift in zip(self._parts(), self._lift, strict=True):
            pairs.offset -= lift

    def cancel(self):
        """Back to before :meth:`begin_increment`, once the mark is restored. Local."""
        for (pairs, *_), next_check in zip(self._parts(), self._next_check, strict=True):
            pairs.next_check[:] = next_check
        self._lower()
