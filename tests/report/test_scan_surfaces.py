"""Surfaces of scans beside those of a run: how far they are apart, what a page and ParaView get."""

import json
from types import SimpleNamespace

import numpy as np
import pandas
import pytest
import pyvista

from mufe_fenicsx.container import BOX
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.report.packing import GRID_STEPS
from mufe_fenicsx.report.scan_surfaces import (
    NODES,
    grains_shown,
    stage_of,
    view_of,
    write_surfaces,
)
from mufe_fenicsx.results.scans import Moment, voxels_of
from tests.bodies import RADIUS, sphere
from tests.report.test_view import unpack

VOXEL, SHIFT = RADIUS / 12.5, 3


@pytest.fixture(scope="module")
def stages():
    """A run's own image of two balls of 25 voxels, and one in which they are 3 voxels higher."""
    ball, cells = sphere(RADIUS, RADIUS / 4)
    points = np.concatenate([ball + RADIUS * np.array([1.2, 1.2, z]) for z in (1.1, 3.3)])
    state = SimpleNamespace(
        cells=np.concatenate([cells, cells + len(ball)]), grain=np.repeat([10, 11], len(cells))
    )
    moment = Moment(0.0, 2e-6, (0, 0), 1.0, points, state)
    labels = voxels_of(moment, (60, 30, 30), VOXEL)
    higher = np.roll(labels, SHIFT, axis=0)
    of_stage = {"a.tif": (labels, {10: 10, 11: 11}), "b.tif": (higher, {10: 10, 11: 0})}
    return [stage_of(name, moment, *of, VOXEL) for name, of in of_stage.items()]


def test_surfaces_of_labels_are_those_that_were_imaged(stages):
    """Voxels hide half of an edge. Nodes of the run's facets are outside of what they enclose."""
    for run, scan in stages[0].pairs.values():
        for mesh in (run, scan):
            assert np.sqrt(np.mean((mesh["distance"] / VOXEL) ** 2)) < 0.5
        # Both enclose the same: the mean over the surface is what volumes differ by.
        assert abs(scan["distance"].mean()) < 0.1 * VOXEL
        assert scan.volume == pytest.approx(run.volume, rel=0.01)


def test_outside_is_positive(stages):
    """A shift s ahead of a smooth surface's normal n leaves the distance s·n; to half a voxel."""
    assert list(stages[1].pairs) == [10]  # the other one has no label there
    for mesh, sign in zip(stages[1].pairs[10], (-1, 1), strict=True):
        upright = mesh.point_normals[:, 2]
        off = mesh["distance"] / VOXEL - sign * SHIFT * upright
        assert np.sqrt(np.mean(off**2)) < 0.5


def test_the_page_has_each_surface_at_its_scan(stages):
    """Positions to half a step, distances to a byte; surfaces of labels are thinned."""
    view = view_of(stages, BOX)
    header = json.loads(view.section.split('id="view-header">')[1].split("</script>")[0])
    data = view.section.split('id="view-data">')[1].split("</script>")[0]
    arrays = unpack(data, header["arrays"])
    sources = header["sources"]
    kinds = [(n, s["kind"], s["stage"]) for n, s in zip(header["labels"], sources, strict=True)]
    assert kinds == [(10, "run", 0), (10, "scan", 0), (11, "run", 0), (11, "scan", 0),
                     (10, "run", 1), (10, "scan", 1)]  # fmt: skip
    assert [stage["stage"] for stage in header["stages"]] == ["a.tif", "b.tif"]
    counts = arrays["num_of_grain"]
    wholes = [stage.pairs[label][kind == "scan"] for label, kind, n in kinds
              for stage in [stages[n]]]  # fmt: skip
    assert counts.max() <= 1.05 * NODES < min(w.n_points for w in wholes[1::2])
    low, high = (np.array(header[name]) for name in ("low", "high"))
    points = low + arrays["points.0"].reshape(3, -1).T / GRID_STEPS * (high - low)
    (field,) = header["fields"]
    away = field["low"] + arrays["field.distance.1"] / 255 * (field["high"] - field["low"])
    for k, whole in enumerate(wholes):
        mine = slice(counts[:k].sum(), counts[: k + 1].sum())
        node = [whole.find_closest_point(p) for p in points[mine]]
        assert np.abs(whole.points[node] - points[mine]).max() <= (high - low).max() / GRID_STEPS
        # Half of a step of 255, and single precision of the distances.
        byte = 0.51 * (field["high"] - field["low"]) / 255
        assert np.abs(whole["distance"][node] - away[mine]).max() <= byte
    assert not any(arrays[f"points.{n}"].any() for n in (1, 2))
    assert view_of([], BOX) is None


def test_paraview_gets_all_of_them(stages, tmp_path):
    write_surfaces(tmp_path, stages)
    for k, kind in enumerate(("run", "scan")):
        series = json.loads((tmp_path / "surfaces" / f"{kind}.vtp.series").read_text())
        assert [f["name"] for f in series["files"]] == [f"{kind}_0000.vtp", f"{kind}_0001.vtp"]
        assert [f["time"] for f in series["files"]] == [2e-6, 2e-6]  # of the run, as its states
        mesh = pyvista.read(tmp_path / "surfaces" / f"{kind}_0000.vtp")
        assert set(mesh["grain"]) == {10, 11}
        assert mesh.n_points == sum(pair[k].n_points for pair in stages[0].pairs.values())
        assert np.abs(mesh["distance"]).max() < VOXEL


def test_those_that_differ_most_are_shown():
    table = pandas.DataFrame({"grain": range(3, 11), "displacement_difference": [*range(7), 9.5]})
    assert grains_shown(table) == [5, 6, 7, 8, 9, 10] and grains_shown(table, (8, 3)) == [3, 8]
    with pytest.raises(InputError, match="grain 2 is not compared, expected one of 3 to 10"):
        grains_shown(table, (2,))
