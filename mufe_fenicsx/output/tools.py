"""Surfaces of the tools at the stored states, a VTKHDF file each, for ParaView.

In the folder ``tools``, numbered as the states in ``fields``: ``0003.vtkhdf`` and
``states.vtkhdf.series``. Each triangle has the number of its tool, from 0 in the order of run.json,
and the force [N] and torque [N m] of the grains on it.
"""

import json
from pathlib import Path

import numpy as np

from mufe_fenicsx.errors import raise_together
from mufe_fenicsx.machine.files import attempt, own_folder, write_atomically
from mufe_fenicsx.output.contacts import write_poly_data
from mufe_fenicsx.output.run_folder import remove_states_after

SERIES = "states.vtkhdf.series"


class ToolWriter:
    """Writes the tools of stored states into the folder ``tools``. Collective.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh` with tools.
        folder: The run folder, which exists.
        kept: What :attr:`kept` was, where a run goes on: later states are removed.

    Raises:
        InputError: The folder cannot be made; on all ranks together.
    """

    def __init__(self, mesh, folder, kept=()):
        self.comm, self.folder, self._states = mesh.comm, Path(folder) / "tools", list(kept)
        mine = np.flatnonzero(mesh.is_tool[mesh.grain_of_facet])
        self._nodes, facets = np.unique(mesh.facets[mine], return_inverse=True)
        self._facets = facets.reshape(-1, 3)
        self._tool = mesh.grains[mesh.grain_of_facet[mine]] - mesh.first_tool
        message = None
        if self.comm.rank == 0:
            message, _ = attempt(self.folder, lambda: own_folder(self.folder))
            message = message or remove_states_after(self.folder, self._states, "*.vtkhdf")
        raise_together(self.comm, message)

    @property
    def kept(self):
        """What a writer that goes on from here has to know, fit for JSON."""
        return list(self._states)

    def write(self, index, time, x, loads):
        """Write one state.

        Args:
            index: Its number.
            time: Time [s].
            x: Positions of this rank's nodes [m], shape (num_nodes, 3).
            loads: Force and torque on each tool, shape (num_tools, 6).

        Returns:
            Name of the file in the run folder.

        Raises:
            InputError: It cannot be written; on all ranks together.
        """
        name, parts = (
            f"{index:04d}.vtkhdf",
            self.comm.gather((x[self._nodes], self._facets, self._tool)),
        )
        message = None
        if self.comm.rank == 0:
            path = self.folder / name
            message, _ = attempt(path, lambda: self._write(path, float(time), parts, loads))
        raise_together(self.comm, message)
        return f"tools/{name}"

    def _write(self, path, time, parts, loads):
        first = np.cumsum([0] + [len(points) for points, *_ in parts])
        points = np.concatenate([points for points, *_ in parts])
        facets = np.concatenate([f + k for (_, f, _), k in zip(parts, first[:-1], strict=True)])
        tool = np.concatenate([tool for *_, tool in parts])
        data = {"tool": tool.astype(np.int64), "force": loads[tool, :3], "torque": loads[tool, 3:]}
        write_poly_data(path, time, points, {"Polygons": facets}, data, {})
        self._states = [state for state in self._states if state["name"] != path.name]
        self._states.append({"name": path.name, "time": time})
        series = {"file-series-version": "1.0", "files": self._states}
        write_atomically(self.folder / SERIES, json.dumps(series, indent=1) + "\n")
