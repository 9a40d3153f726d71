"""Grain meshes that leave for another program come back as they were."""

import meshio
import numpy as np
import pytest

from mufe_fenicsx.cli.main import main
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.geometry.grains import Grains
from mufe_fenicsx.geometry.measure import boundary_triangles, compact
from mufe_fenicsx.geometry.mesh import _given_surfaces
from mufe_fenicsx.geometry.settings import MeshSettings
from mufe_fenicsx.geometry.tets.foreign_meshes import FORMATS, export_grains, import_grains
from tests.bodies import sphere


def three_grains():
    ball, cells = sphere(1e-3 / 3, 2e-4)
    brick, tets = box((1e-3, 1e-3, 1e-3), (2, 1, 1), (2e-3, 0, 0))
    return Grains.from_list(
        [7, 3, 12], [(ball, cells), (brick, tets), (np.add(ball, [0, 3e-3, 0]), cells)], 2e-4
    )


@pytest.mark.parametrize("ending", FORMATS)
def test_a_mesh_comes_back_identical(tmp_path, ending):
    grains = three_grains()
    export_grains(tmp_path / f"a{ending}", grains)
    back = import_grains(tmp_path / f"a{ending}", element_size=grains.element_size)
    for name in ("points", "cells", "labels", "node_offset", "cell_offset"):
        assert np.array_equal(getattr(back, name), getattr(grains, name)), name
    with pytest.raises(InputError, match="expected a new file"):
        export_grains(tmp_path / f"a{ending}", grains)


def test_bodies_without_labels_are_told_apart_and_shared_nodes_doubled(tmp_path):
    points, cells = box((2.0, 1.0, 1.0), (2, 1, 1))
    middle = points[cells].mean(axis=1)[:, 0] > 1.0
    shared = meshio.Mesh(
        points, [("tetra", cells[:, [0, 1, 3, 2]])], cell_data={"label": [1 + middle.astype(int)]}
    )
    shared.write(tmp_path / "a.vtu")
    grains = import_grains(tmp_path / "a.vtu", scale=1e-3)
    assert grains.num_grains == 2 and len(grains.points) == len(points) + 4
    assert np.allclose(grains.volumes, 1e-9)
    far = np.concatenate([points, np.add(points, [5.0, 0, 0])])
    meshio.Mesh(far, [("tetra", np.concatenate([cells, cells + len(points)]))]).write(
        tmp_path / "b.vtk"
    )
    assert import_grains(tmp_path / "b.vtk").num_grains == 2


def test_what_cannot_be_taken(tmp_path):
    with pytest.raises(InputError, match="ends with"):
        export_grains(tmp_path / "a.step", three_grains())
    meshio.Mesh(np.eye(3), [("triangle", np.array([[0, 1, 2]]))]).write(tmp_path / "a.vtk")
    with pytest.raises(InputError, match="expected linear tetrahedra"):
        import_grains(tmp_path / "a.vtk")
    (tmp_path / "a.msh").write_text("no mesh")
    with pytest.raises(InputError, match="cannot be read"):
        import_grains(tmp_path / "a.msh")
    points, cells = box((1.0, 1.0, 1.0), (1, 1, 1))
    far = np.concatenate([points, points + 5.0])
    both = [("tetra", np.concatenate([cells, cells + len(points)]))]
    data = {"label": [np.ones(2 * len(cells), int)]}
    meshio.Mesh(far, both, cell_data=data).write(tmp_path / "c.vtk")
    with pytest.raises(InputError, match=r"grain 1 by label is in 2 pieces, .* --labels pieces"):
        import_grains(tmp_path / "c.vtk")


def test_a_length_unit_that_is_assumed_is_told(tmp_path, capsys):
    """With the size that the grains then have; a stated unit is not told."""
    source = tmp_path / "a.vtu"
    meshio.Mesh(np.eye(4, 3) * [2.0, 3.0, 4.0], [("tetra", [[3, 0, 1, 2]])]).write(source)
    said = f"lengths in {source} are taken as metres: the grains fill 2 m × 3 m × 4 m"
    for number, scale in enumerate(([], ["--scale", "1 mm"])):
        with pytest.raises(SystemExit) as end:
            main(["import", str(source), "-o", str(tmp_path / f"g{number}"), *scale])
        assert end.value.code == 0 and (said in capsys.readouterr().out) is not bool(scale)


def test_so_is_that_of_surfaces(tmp_path):
    points, cells = box((2.0, 3.0, 4.0), (1, 1, 1))
    points, triangles = compact(points, boundary_triangles(cells))
    meshio.write_points_cells(tmp_path / "a.stl", points, [("triangle", triangles)])
    (said,) = _given_surfaces(tmp_path / "a.stl", MeshSettings(size=1.0)).notices
    assert "taken as metres: the grains fill 2 m × 3 m × 4 m" in said
    assert not _given_surfaces(tmp_path / "a.stl", MeshSettings(size=1e-3, scale=1e-3)).notices
