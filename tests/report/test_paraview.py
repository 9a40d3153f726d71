"""Files for ParaView: contacts as lines with what the tables say, and a script that is whole."""

import ast
import json

import numpy as np
import pytest
import pyvista

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.output.contacts import ContactWriter
from mufe_fenicsx.report.paraview import write_paraview
from mufe_fenicsx.results import Run
from tests.made_up_run import write_run
from tests.networks import lattice_network
from tests.results.test_results import SCENE

from mpi4py import MPI  # isort: skip  (after the package, which may bring MPI)


def test_lines_of_a_lattice(tmp_path):
    """Upright lines of length D, or D/2 at walls, with the force of the column."""
    write_run(tmp_path, (2, 2, 3), 2, 3)
    (tmp_path / "scene.toml").write_text(SCENE)
    writer = ContactWriter(MPI.COMM_SELF, tmp_path)
    for index in range(2):  # the last state was just stored, its contacts not yet
        writer.write(index, 1e-6 * index, lattice_network(1.0 + index))
    result = write_paraview(Run(tmp_path))
    assert result["contacts"] == 2 and len(result["missing"]) == 1
    series = json.loads((tmp_path / "paraview/contacts.vtp.series").read_text())["files"]
    states = json.loads((tmp_path / "fields/states.vtkhdf.series").read_text())["files"]
    assert [s["time"] for s in series] == [s["time"] for s in states[:2]]
    lines = pyvista.read(tmp_path / "paraview" / series[1]["name"])
    assert lines.n_lines == 16
    force = lines.cell_data["force"]
    wall = lines.cell_data["grain_b"] == 0
    sign = np.sign(force[:, 2])
    assert sign * force[:, 2] == pytest.approx(np.full(16, 2.0))
    assert lines.cell_data["mobilised"] == pytest.approx(np.where(wall, 0.0, 0.5))
    assert not lines.cell_data["sliding"].any()
    ends = lines.points[lines.lines.reshape(-1, 3)[:, 1:]]
    length = np.where(wall, 1e-4, 2e-4)
    along = ends[:, 0] - ends[:, 1]
    # Positions of the file are those of the tables; the force pushes a away from b.
    assert along == pytest.approx(np.outer(sign * length, [0, 0, 1]), abs=1e-12)
    labels = np.column_stack([lines.cell_data["grain_a"], lines.cell_data["grain_b"]])
    grain = lines.point_data["grain"][lines.lines.reshape(-1, 3)[:, 1:]]
    assert np.array_equal(grain, labels)

    text = (tmp_path / "paraview_state.py").read_text()
    found = next(
        ast.literal_eval(node.value)
        for node in ast.parse(text).body
        if isinstance(node, ast.Assign) and node.targets[0].id == "SETTINGS"
    )
    assert [stage["strain"] for stage in found["stages"]] == [0.0, 0.05, 0.1]
    assert all((tmp_path / stage["file"]).exists() for stage in found["stages"])
    mises = Run(tmp_path).state(2).von_mises
    assert np.percentile(mises, 99) <= found["stress"] <= 1.3 * mises.max()


def test_a_run_without_states_is_refused(tmp_path):
    (tmp_path / "run.json").write_text("{}")
    with pytest.raises(InputError, match="no stored states"):
        write_paraview(Run(tmp_path))
