"""The states of a run, prepared for pictures: surface, volumes, walls."""

from functools import cached_property

import numpy as np
import pyvista

from mufe_fenicsx.analysis.grain_means import grain_means
from mufe_fenicsx.analysis.mesh_quality import mesh_quality
from mufe_fenicsx.analysis.rows import SEATING, TURN
from mufe_fenicsx.container import BOX, container_of_history
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.measure import renumbered
from mufe_fenicsx.output.fields import VTK_TETRA

FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])


class State:
    """One stored state.

    Args:
        stored: :class:`mufe_fenicsx.results.State`, which reads its arrays when asked for.
        height: Height of the sample then [m], or None.
        sides: Distances of its side walls then [m], where these moved, or None; diameters.
        like: Another State of the run with the same mesh, whose faces are taken, or None.
        centre: Of the cylinder that holds it [m], shape (2,); None: it is in a box.
        tilt: Way of the top of that box along x over the height.
    """

    def __init__(self, stored, height, like=None, sides=None, centre=None, tilt=0.0):
        self.stored, self.height, self.sides, self.centre = stored, height, sides, centre
        self.tilt = tilt
        self.index, self.time = stored.index, stored.time
        self.strain, self.stage = stored.strain, stored.stage
        for name in ("displacement", "von_mises", "grain"):
            if not self.has(name):
                raise InputError(f"state {self.index} has no field {name}, expected one")
        self._like = like

    def has(self, name):
        """Whether the state has a field."""
        return name in self.stored.fields

    def field(self, name):
        """A field at nodes or of cells."""
        return self.stored.field(name)

    @cached_property
    def cells(self):
        """Nodes of the tetrahedra, shape (num_cells, 4)."""
        return self._shared("cells")

    @cached_property
    def reference(self):
        """Nodes at the start [m], shape (num_nodes, 3)."""
        return self._shared("reference")

    @cached_property
    def grain(self):
        """Label of the grain of each cell, shape (num_cells,)."""
        return self._shared("grain")

    def _shared(self, name):
        """An array of the mesh, kept once where the other state has the same."""
        if self._like is not None:
            theirs = getattr(self._like, name)
            if np.array_equal(theirs, getattr(self.stored, name)):
                setattr(self.stored, name, theirs)
        return getattr(self.stored, name)

    @cached_property
    def points(self):
        """Nodes now [m], shape (num_nodes, 3)."""
        return self.stored.points

    @property
    def von_mises(self):
        """Equivalent stress of von Mises in each cell [Pa], shape (num_cells,)."""
        return self.stored.von_mises

    @property
    def volume(self):
        """Of the tetrahedra now [m³]."""
        return self.stored.volume

    @cached_property
    def quality(self):
        """Mesh quality of the deformed mesh."""
        return mesh_quality(self.points, self.cells)

    @cached_property
    def faces(self):
        """Outward boundary faces, shape (num_faces, 3), and the cell of each."""
        if self._like is not None and np.array_equal(self._like.cells, self.cells):
            return self._like.faces
        return boundary_faces(self.cells)

    @cached_property
    def grain_means(self):
        """Labels, increasing, and volume means of von Mises stress [Pa], shape (num_grains,)."""
        return grain_means(self.von_mises, self.volume, self.grain)

    def surface(self, grain=None):
        """Deformed surface of all grains or of one, as pyvista.PolyData.

        Cell data: ``von_mises``, ``grain``; point data ``node``, the number of the node.
        """
        faces, cell = self.faces
        if grain is not None:
            chosen = self.grain[cell] == grain
            faces, cell = faces[chosen], cell[chosen]
        nodes, faces = renumbered(faces)
        surface = pyvista.PolyData.from_regular_faces(self.points[nodes], faces)
        surface.cell_data["von_mises"] = self.von_mises[cell]
        surface.cell_data["grain"] = self.grain[cell]
        surface.point_data["node"] = nodes
        return surface

    def grid(self, chosen, **cell_data):
        """Some of the deformed cells as pyvista.UnstructuredGrid with cell data.

        Args:
            chosen: Which cells, booleans, shape (num_cells,).
            cell_data: Arrays, shape (num_cells,).
        """
        nodes, cells = renumbered(self.cells[chosen])
        grid = pyvista.UnstructuredGrid({VTK_TETRA: cells}, self.points[nodes])
        for name, values in cell_data.items():
            grid.cell_data[name] = values[chosen]
        return grid

    def most_loaded_grain(self):
        """(label, volume mean of von Mises stress [Pa]) of the grain where that is largest."""
        labels, means = self.grain_means
        first = int(np.argmax(means))
        return int(labels[first]), float(means[first])

    def corners(self, start):
        """Corners of the space between the walls, tilted ones too [m], shape (8, 3).

        Args:
            start: As of :meth:`box`.
        """
        box = self.box(start)
        found = box_corners(box)
        found[:, 0] += self.tilt * (found[:, 2] - box[0, 2])
        return found

    def outline(self, start):
        """Lines of the walls, pyvista.PolyData; ``start`` as of :meth:`box`."""
        hole = self.sides[1] if self.sides is not None and len(self.sides) > 1 else 0.0
        return outline_of(self.box(start), self.centre is not None, 0.5 * hole, tilt=self.tilt)

    def box(self, start):
        """Corners of the space between the walls [m], shape (2, 3).

        The test starts with the walls at the outermost nodes of the sample. In an oedometer
        side walls and bottom stay there, the top is one height above the bottom. Where all walls
        may move only their distances are known: they are drawn around the middle of the start,
        or so far beside it that the grains lie between them.
        """
        low, high = start.reference.min(axis=0), start.reference.max(axis=0)
        if self.sides is not None and self.height:
            across = self.sides[0] if self.centre is not None else self.sides[1]
            size = np.array([self.sides[0], across, self.height])
            first, last = self.points.min(axis=0), self.points.max(axis=0)
            # Grains that are pressed reach into the walls by a little, on both sides alike.
            least, most = np.minimum(last - size, first), np.maximum(last - size, first)
            inside = last - first <= size
            corner = np.where(
                inside, np.clip(0.5 * (low + high - size), least, most), 0.5 * (least + most)
            )
            if self.tilt:  # tilted walls do not touch the box around the grains
                corner[0] = 0.5 * (first[0] + last[0] - size[0] - self.tilt * size[2])
            if self.centre is not None:
                corner[:2] = self.centre - 0.5 * size[:2]
            return np.array([corner, corner + size])
        top = low[2] + self.height if self.height else self.points[:, 2].max()
        return np.array([low, [high[0], high[1], top]])


def box_corners(box):
    """The eight corners of a box given by two, shape (8, 3)."""
    return np.array([[x, y, z] for x in box[:, 0] for y in box[:, 1] for z in box[:, 2]])


def outline_of(box, is_round, hole=0.0, tilt=0.0):
    """Edges of a box, or of the cylinders in it with four of their lines, pyvista.PolyData.

    Args:
        box: Its corners [m], shape (2, 3), those of its bottom where it is tilted.
        is_round: Whether it is the cylinder.
        hole: Radius of the inner one of a hollow cylinder [m].
        tilt: Way of the top of a box along x over the height.
    """
    if not is_round:
        edges = pyvista.Box(np.asarray(box).T.ravel()).extract_feature_edges()
        edges.points[:, 0] += tilt * (edges.points[:, 2] - box[0][2])
        return edges
    (x, y, bottom), (top_x, _, top) = box
    radius = 0.5 * (top_x - x)
    middle = np.array([x + radius, y + radius])
    lines = _outline_of_cylinder(middle, radius, bottom, top)
    return lines + _outline_of_cylinder(middle, hole, bottom, top) if hole else lines


def _outline_of_cylinder(middle, radius, bottom, top):
    lines = pyvista.PolyData()
    for z in (bottom, top):
        lines += pyvista.Circle(radius, 96).extract_feature_edges().translate((*middle, z))
    for angle in np.arange(4) * 0.5 * np.pi:
        at = middle + radius * np.array([np.cos(angle), np.sin(angle)])
        lines += pyvista.Line((*at, bottom), (*at, top))
    return lines


def boundary_faces(cells):
    """Faces of only one tetrahedron, outward, shape (num_faces, 3), and the cell of each."""
    faces = np.asarray(cells)[:, FACES].reshape(-1, 3)
    nodes = np.sort(faces, axis=1).astype(np.int64)
    n = int(nodes.max()) + 1
    if n < 2**21:  # the three numbers fit into one
        key = (nodes[:, 0] * n + nodes[:, 1]) * n + nodes[:, 2]
        order = np.argsort(key)
        same = key[order][1:] == key[order][:-1]
    else:
        order = np.lexsort(nodes.T)
        same = (nodes[order][1:] == nodes[order][:-1]).all(axis=1)
    single = ~(np.append(False, same) | np.append(same, False))
    chosen = np.sort(order[single])
    return faces[chosen], chosen // 4


def load_states(run, history):
    """The states at the start, middle and end of loading; fewer if fewer were stored.

    Args:
        run: :class:`mufe_fenicsx.results.Run` with at least one state.
        history: dict column -> array, or None.

    Returns:
        List of State in order of time.
    """
    states = [{"index": int(i), **row} for i, row in run.states.to_dict("index").items()]
    loading = [s for s in states if s["stage"] != SEATING]
    # Strain only grows, but for what the platen gives way as seating ends; or it turns back.
    strains = np.array([s["strain"] for s in loading])
    forward = bool((np.diff(strains) >= -TURN * np.ptp(strains)).all()) if loading else True
    loading = [s for s in loading if not forward or s["strain"] >= 0] or loading
    # The end of seating is the start of loading.
    seated = [s for s in states if s["stage"] == SEATING][-1:]
    chosen = loading if loading and abs(loading[0]["strain"]) < 1e-6 else seated + loading
    first, last = chosen[0], chosen[-1]
    target = 0.5 * (first["strain"] + last["strain"])
    middle = chosen[len(chosen) // 2]
    if forward:
        middle = min(chosen, key=lambda s: abs(s["strain"] - target))
    picked = sorted({s["index"]: s for s in (first, middle, last)}.values(), key=_index)
    loaded = []
    for s in picked:
        like = loaded[0] if loaded else None
        loaded.append(state_at(run, s, history, like))
    return loaded


def _index(state):
    return state["index"]


def state_at(run, listed, history, like=None):
    """A state with the distances of the walls at its time, :class:`State`.

    Args:
        run: :class:`mufe_fenicsx.results.Run`.
        listed: Its dict of ``index`` and ``time``.
        history: dict column -> array, or None: the distances are not known.
        like: Of :class:`State`.
    """
    height, sides, tilt = None, None, 0.0
    if history is not None and len(history["time"]):
        height = float(np.interp(listed["time"], history["time"], history["height"]))
        names = container_of_history(history).widths
        if any(np.ptp(history.get(name, 0.0)) > 0 for name in names) or names != BOX.widths:
            sides = [
                float(np.interp(listed["time"], history["time"], history[name])) for name in names
            ]
        if "gamma_xz" in history:
            tilt = float(np.interp(listed["time"], history["time"], history["gamma_xz"]))
    return State(run.state(listed["index"]), height, like, sides, _centre(run), tilt)


def _centre(run):
    """Of the cylinder that holds the sample [m], shape (2,); None of a box."""
    try:
        kept = (run.summary.get("container") or {}).get("centre")
    except InputError:
        return None
    return None if kept is None else np.array(kept)
