"""One stored state of a run: its arrays, read when they are asked for."""

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

import numpy as np

from ..analysis.by_grain import index_grains
from ..analysis.same_nodes import same_nodes
from ..errors import InputError
from ..geometry.measure import renumbered, tet_volumes
from ..output.fields import read_arrays


class State:
    """One stored state; nodes and cells of grains in the order of its file.

    A run that went on with another number of ranks has another order from there on: compare
    states by grain, or by place, not by number of node.

    Args:
        run_folder: The run folder.
        listed: Its entry of :func:`mufe_fenicsx.output.fields.read_states`.
        no_grains: Labels of bodies in the file that are no grains, and left out here.
    """

    def __init__(self, run_folder: Path, listed: dict, no_grains: Sequence[int] = ()):
        self._folder, self._no_grains = run_folder, tuple(no_grains)
        self.index = listed["index"]
        self.time, self.strain, self.stage = listed["time"], listed["strain"], listed["stage"]

    def __repr__(self):
        return f"State {self.index}: {self.stage}, strain {self.strain:.6g}, time {self.time:.6g} s"

    def _array(self, name):
        values = read_arrays(self._folder, self.index, [name])[name]
        if not self._no_grains:
            return values
        nodes, cells, chosen = self._of_grains
        if name == "Connectivity":
            return cells.ravel()
        return values[chosen] if name.startswith("CellData/") else values[nodes]

    @cached_property
    def _of_grains(self):
        """Nodes of the grains in the file, cells on them in turn, and which cells these are."""
        names = "Connectivity", "CellData/grain"
        cells, grain = read_arrays(self._folder, self.index, names).values()
        chosen = ~np.isin(grain, self._no_grains)
        return *renumbered(cells.reshape(-1, 4)[chosen]), chosen

    @cached_property
    def _shapes(self):
        """Of the arrays in the file, dict name -> shape."""
        return read_arrays(self._folder, self.index)

    @cached_property
    def fields(self) -> dict[str, tuple[int, ...]]:
        """Names of the fields, dict name -> shape; :meth:`field` reads one."""
        found = {}
        for key, shape in self._shapes.items():
            kind, _, name = key.partition("/")
            if kind in ("PointData", "CellData"):
                found[name] = shape
                if self._no_grains:
                    num = len(self.reference if kind == "PointData" else self.cells)
                    found[name] = (num, *shape[1:])
        return found

    def field(self, name: str) -> np.ndarray:
        """A field at nodes or of cells by its name, in SI units.

        Raises:
            InputError: There is none, or it cannot be read.
        """
        for place in ("PointData", "CellData"):
            if f"{place}/{name}" in self._shapes:
                return self._array(f"{place}/{name}")
        raise InputError(
            f"state {self.index} has no field {name}, expected one of {', '.join(self.fields)}"
        )

    @cached_property
    def reference(self) -> np.ndarray:
        """Nodes in the reference configuration [m], shape (num_nodes, 3)."""
        return self._array("Points")

    @cached_property
    def cells(self) -> np.ndarray:
        """Nodes of the tetrahedra, shape (num_cells, 4)."""
        return self._array("Connectivity").reshape(-1, 4)

    @cached_property
    def grain(self) -> np.ndarray:
        """Label of each cell's grain, shape (num_cells,)."""
        return self.field("grain")

    @cached_property
    def displacement(self) -> np.ndarray:
        """[m], shape (num_nodes, 3)."""
        return self.field("displacement")

    @property
    def points(self) -> np.ndarray:
        """Nodes now [m], shape (num_nodes, 3)."""
        return self.reference + self.displacement

    def points_of(self, other: "State") -> np.ndarray:
        """Nodes of another state of the run, in the order of these [m], shape (num_nodes, 3)."""
        meshes = [(s.reference, s.cells, s.grain) for s in (self, other)]
        return other.points[same_nodes(*meshes)]

    @cached_property
    def stress(self) -> np.ndarray:
        """Cauchy stress xx, yy, zz, xy, yz, xz, tension positive [Pa], shape (num_cells, 6)."""
        return self.field("stress")

    @cached_property
    def von_mises(self) -> np.ndarray:
        """[Pa], shape (num_cells,)."""
        return self.field("von_mises")

    @cached_property
    def plastic_strain(self) -> np.ndarray:
        """Equivalent plastic strain [-], shape (num_cells,)."""
        return self.field("plastic_strain")

    @cached_property
    def contact_pressure(self) -> np.ndarray:
        """[Pa], shape (num_nodes,)."""
        return self.field("contact_pressure")

    @cached_property
    def volume(self) -> np.ndarray:
        """Volumes of the tetrahedra now [m³], shape (num_cells,)."""
        return tet_volumes(self.points, self.cells)

    @cached_property
    def labels(self) -> np.ndarray:
        """Labels of the grains, increasing, shape (num_grains,)."""
        return index_grains(self.grain)[0]
