"""Equilibria with exact gaps: augmentations until closed contacts are at their gaps."""

from ..contact.stiffness.augmented import Augmentation


class ExactGaps(Augmentation):
    """Augmentations of increments, one after the other. Collective.

    Args:
        contact: :class:`~mufe_fenicsx.contact.contact.Contact`.
        tolerance: Largest distance of a closed contact from its gap, over the mean facet edge.
        max_augmentations: Times that multipliers are renewed in an increment, at most.

    Attributes:
        report: Of each increment: (how many, largest distance left [m]).
        unmet: What the last increment fell short of, in words; empty where it did not.
    """

    def __init__(self, contact, tolerance, max_augmentations):
        super().__init__(contact)
        self.tolerance, self.max_augmentations = tolerance * contact.edge, max_augmentations
        self.report, self.unmet = [], ""

    def augment(self, found, solve, equations):
        """From the equilibrium ``found`` to one with exact gaps; None where there is none.

        Args:
            found: Displacements [m], shape (num_nodes, 3), or None.
            solve: Gives the next equilibrium from a guess.
            equations: :class:`~.increment.IncrementEquations`, whose mark evaluations start from.
        """
        count, self.unmet = 0, ""
        while found is not None:
            left = self.depth()
            if left <= self.tolerance:
                self.report.append((count, left))
                break
            if count == self.max_augmentations:
                self.unmet = (
                    f"{count} augmentations, {left:.1e} m from the exact gap, wanted "
                    f"{self.tolerance:.1e} m"
                )
                return None
            self.update(equations.mark)
            found = solve(found)
            count += 1
        return found
