"""What dents dissipated, of bodies that yield under a contact smaller than an element."""

import numpy as np

from ...state import Stateful


class Dents(Stateful):
    """Plastic work of the dents of all points, kept at the cells beneath them. Local.

    A point that meets another body counts at its own cell, whichever of the two yields.

    Args:
        num_cells: Of this rank.
        any: Whether some body yields, on all ranks; else nothing is kept.
    """

    STATE = {"cells": ("work",)}

    def __init__(self, num_cells, any):
        self.any = any
        #: So far [J], shape (num_cells,); empty where no body yields.
        self.work = np.zeros(num_cells if any else 0)

    def of_grains(self, mesh):
        """Work of each grain [J], shape (num_grains,). Local."""
        if not self.any:
            return np.zeros(mesh.num_grains)
        return np.add.reduceat(self.work, mesh.cell_offset[:-1])
