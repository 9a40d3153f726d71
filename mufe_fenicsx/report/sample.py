"""The states of a run, prepared for pictures: surface, volumes, walls."""

from functools import cached_property

import numpy as np
import pyvista

from mufe_fenicsx.analysis.grain_means import grain_means
from mufe_fenicsx.analysis.mesh_quality import mesh_quality
from mufe_fenicsx.analysis.rows import SEATING
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.output.fields import VTK_TETRA, read_state

FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])


class State:
    """One stored state.

    Args:
        run_folder: The run folder.
        listed: Its entry of :func:`mufe_fenicsx.output.fields.read_states`.
        height: Height of the sample then [m], or None.
        faces: Those of another state of the run, which are the same, or None.
    """

    def __init__(self, run_folder, listed, height, faces=None):
        grid = read_state(run_folder, listed["index"])
        self.strain, self.time, self.stage = listed["strain"], listed["time"], listed["stage"]
        self.height = height
        self._faces = faces
        for name, data in (
            ("displacement", grid.point_data),
            ("von_mises", grid.cell_data),
            ("grain", grid.cell_data),
        ):
            if name not in data:
                raise InputError(f"state {listed['name']} has no field {name}, expected one")
        self.cells = grid.cells_dict[VTK_TETRA]
        self.reference = np.array(grid.points)
        self.points = self.reference + grid.point_data["displacement"]
        self.point_data = {name: np.array(v) for name, v in grid.point_data.items()}
        self.cell_data = {name: np.array(v) for name, v in grid.cell_data.items()}

    @property
    def grain(self):
        return self.cell_data["grain"]

    @property
    def von_mises(self):
        return self.cell_data["von_mises"]

    @cached_property
    def quality(self):
        """Mesh quality of the deformed mesh."""
        return mesh_quality(self.points, self.cells)

    @property
    def faces(self):
        """Outward boundary faces, shape (num_faces, 3), and the cell of each."""
        if self._faces is None:
            self._faces = boundary_faces(self.cells)
        return self._faces

    def surface(self, grain=None):
        """Deformed surface of all grains or of one, as pyvista.PolyData.

        Cell data: ``von_mises``, ``grain``; point data of the state for one grain.
        """
        faces, cell = self.faces
        if grain is not None:
            chosen = self.grain[cell] == grain
            faces, cell = faces[chosen], cell[chosen]
        nodes, faces = np.unique(faces, return_inverse=True)
        surface = pyvista.PolyData.from_regular_faces(self.points[nodes], faces.reshape(-1, 3))
        surface.cell_data["von_mises"] = self.von_mises[cell]
        surface.cell_data["grain"] = self.grain[cell]
        for name, values in self.point_data.items():
            surface.point_data[name] = values[nodes]
        return surface

    def grid(self):
        """The deformed mesh as pyvista.UnstructuredGrid with cell data ``von_mises``."""
        grid = pyvista.UnstructuredGrid({VTK_TETRA: self.cells}, self.points)
        grid.cell_data["von_mises"] = self.von_mises
        return grid

    def most_loaded_grain(self):
        """(label, volume mean of von Mises stress [Pa]) of the grain where that is largest."""
        labels, means = grain_means(self.von_mises, self.quality.volume, self.grain)
        first = int(np.argmax(means))
        return int(labels[first]), float(means[first])

    def box(self, start):
        """Corners of the space between the walls [m], shape (2, 3).

        The test starts with the walls at the outermost nodes of the sample; side walls and
        bottom stay there, the top is one height above the bottom.
        """
        low, high = start.reference.min(axis=0), start.reference.max(axis=0)
        top = low[2] + self.height if self.height else self.points[:, 2].max()
        return np.array([low, [high[0], high[1], top]])


def boundary_faces(cells):
    """Faces of only one tetrahedron, outward, shape (num_faces, 3), and the cell of each."""
    faces = cells[:, FACES].reshape(-1, 3)
    nodes = np.sort(faces, axis=1).astype(np.int64)
    order = np.lexsort(nodes.T)
    same = (nodes[order][1:] == nodes[order][:-1]).all(axis=1)
    single = ~(np.append(False, same) | np.append(same, False))
    chosen = np.sort(order[single])
    return faces[chosen], chosen // 4


def load_states(run_folder, states, history):
    """The states at the start, middle and end of loading; fewer if fewer were stored.

    Args:
        run_folder: The run folder.
        states: List of :func:`mufe_fenicsx.output.fields.read_states`.
        history: dict column -> array, or None.

    Returns:
        List of State in order of time.
    """
    loading = [s for s in states if s["stage"] != SEATING and s["strain"] >= 0]
    # The end of seating is the start of loading.
    seated = [s for s in states if s["stage"] == SEATING][-1:]
    chosen = loading if loading and loading[0]["strain"] < 1e-6 else seated + loading
    first, last = chosen[0], chosen[-1]
    target = 0.5 * (first["strain"] + last["strain"])
    middle = min(chosen, key=lambda s: abs(s["strain"] - target))
    picked = sorted({s["index"]: s for s in (first, middle, last)}.values(), key=_index)
    loaded = []
    for s in picked:
        faces = loaded[0].faces if loaded else None
        loaded.append(State(run_folder, s, _height(history, s["time"]), faces))
    return loaded


def _index(state):
    return state["index"]


def _height(history, time):
    """Height of the sample at a time [m], None without a history."""
    if history is None or not len(history["time"]):
        return None
    return float(np.interp(time, history["time"], history["height"]))
