"""Whatever a file of meshes or surfaces holds: its grains, or one line that refuses it."""

import os
import random

import meshio
import numpy as np
import pytest
import pyvista

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.geometry.measure import surface_volume
from mufe_fenicsx.geometry.surface.given_surfaces import read_bodies
from mufe_fenicsx.geometry.tets import foreign
from mufe_fenicsx.geometry.tets.foreign_meshes import import_grains
from mufe_fenicsx.geometry.tets.gmsh_model import gmsh_model
from tests.geometry.image.test_image_door import damaged, in_time

#: Files of tetrahedra: their name, and how meshio writes them.
MESHES = {
    "a.vtu": {},
    "ascii.vtu": {"binary": False},
    "a.vtk": {},
    "ascii.vtk": {"binary": False},
    "old.vtk": {"file_format": "vtk42"},
    "two.msh": {"file_format": "gmsh22"},
    "two_ascii.msh": {"file_format": "gmsh22", "binary": False},
    "a.inp": {},
    "a.bdf": {},
    "a.mesh": {},
    "a.meshb": {},
    "a.xdmf": {},
    "xml.xdmf": {"data_format": "XML"},
    "a.med": {},
    "a.avs": {},
    "a.f3grid": {},
    "a.mdpa": {},
    "a.vol": {},
    "a.post": {},
    "a.tec": {},
    "a.node": {},
    "a.xml": {},
    "a.cgns": {},
    "a.hmf": {},
    "a.su2": {},
}
#: Files of surfaces.
SURFACES = {"a.stl": {"binary": True}, "ascii.stl": {"binary": False}, "a.ply": {"binary": True},
            "ascii.ply": {"binary": False}, "a.obj": {}, "a.off": {}, "a.npz": {}}  # fmt: skip


@pytest.fixture(scope="module")
def samples(tmp_path_factory):
    return write_meshes(tmp_path_factory.mktemp("meshes"))


def write_meshes(folder):
    """Write two cubes, and one as a surface, in every format: a list of a file and its reader."""
    points, cells = map(np.asarray, box((2.0, 1.0, 1.0), (2, 1, 1)))
    cube = np.floor(points[cells].mean(axis=1)[:, 0]).astype(np.int32) + 1
    made = []
    for name, how in MESHES.items():
        data = {"label": [cube]}
        if name.endswith(".msh"):
            data = {"gmsh:physical": [cube], "gmsh:geometrical": [cube]}
        elif not name.endswith((".vtu", ".vtk", ".xdmf")):
            data = {}
        meshio.Mesh(points, [("tetra", cells)], cell_data=data).write(folder / name, **how)
        made.append((folder / name, import_grains))
    for binary in (0, 1):
        path = folder / f"four_{binary}.msh"
        with gmsh_model() as gmsh:
            gmsh.merge(str(folder / "two.msh"))
            gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
            gmsh.option.setNumber("Mesh.Binary", binary)
            gmsh.write(str(path))
        made.append((path, import_grains))
    surface = pyvista.Box((0, 1, 0, 1, 0, 1), quads=False).clean()
    triangles = surface.faces.reshape(-1, 4)[:, 1:]
    for name, how in SURFACES.items():
        if name == "a.npz":
            number = np.ones(len(triangles), int)
            np.savez(folder / name, vertices=surface.points, faces=triangles, grain_of_face=number)
        else:
            meshio.Mesh(surface.points, [("triangle", triangles)]).write(folder / name, **how)
        made.append((folder / name, read_bodies))
    return made


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    """Some readers look for the end of a file that was cut for ever."""
    monkeypatch.setattr(foreign, "PATIENCE", 0.3)


def refusal(path, read):
    """The one line by which a file is refused, or None."""
    with in_time():
        try:
            read(path)
        except InputError as error:
            assert "\n" not in str(error) and len(str(error)) < 2000
            return str(error)
    return None


def test_every_format_is_read(samples):
    """Two cubes of one, or the surface of one: their volume, to the digits of a text."""
    for path, read in samples:
        found = read(path)
        if read is read_bodies:
            ((_, points, triangles),) = found
            assert surface_volume(points, triangles) == pytest.approx(1.0, rel=1e-6), path.name
        else:
            assert found.volumes.sum() == pytest.approx(2.0, rel=1e-6), path.name


def damage_all(samples, rng, count):
    refused = 0
    for k in range(count):
        path, read = samples[k % len(samples)]
        data = path.read_bytes()
        path.write_bytes(damaged(data, rng))
        try:
            refused += refusal(path, read) is not None
        except Exception as error:
            raise AssertionError(f"damage {k} of {path.name}: {error!r}") from error
        finally:
            path.write_bytes(data)
    return refused


def test_damaged_files_are_read_or_refused_in_one_line(samples, capfd):
    assert damage_all(samples, random.Random(40), 75) > 20
    assert capfd.readouterr().err == ""


@pytest.mark.slow
def test_many_damaged_files(samples, capfd):
    assert damage_all(samples, random.Random(41), 1500) > 500
    assert capfd.readouterr().err == ""


def test_files_cut_short(samples, capfd):
    for path, read in samples:
        data = path.read_bytes()
        for part in (0, 0.3, 0.6, 0.9):
            path.write_bytes(data[: int(part * len(data))])
            assert refusal(path, read) or part  # of a text the rest may be one, of nothing never
        path.write_bytes(data)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("name", [*MESHES, *SURFACES])
def test_pipes_are_not_waited_for(tmp_path, name):
    os.mkfifo(tmp_path / name)
    if name in MESHES:
        assert "is no plain file" in refusal(tmp_path / name, import_grains)
    else:
        assert "no surfaces" in refusal(tmp_path / name, read_bodies)
