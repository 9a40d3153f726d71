"""The meshes that come with the program: they are what their page says, and can be made anew."""

import importlib.util
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.grains import load_grains
from mufe_fenicsx.geometry.tets.foreign_meshes import import_grains
from mufe_fenicsx.scene import load_scene
from mufe_fenicsx.scene.shipped import shipped_mesh, shipped_meshes
from tests.scene.scene_files import SMALLEST

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "meshes"
LARGEST = 8_000_000  #: bytes of all files

#: Volume of each grain [m³] where a formula has it, and its relative error: facets of a ball keep
#: its volume but for the next order in h/R, up to 1/3, and the polygon of a rim.
VOLUMES = {
    "two_spheres": (4 / 3 * np.pi * 0.5e-3**3, 0.002),
    "cube_on_cube": (1e-9, 1e-12),
    "hemisphere_graded": (2 / 3 * np.pi * 1e-9, 0.008),
}


def recipes():
    """The module `meshes/make.py`."""
    spec = importlib.util.spec_from_file_location("make_meshes", FOLDER / "make.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


MAKE = recipes()


def test_the_page_has_their_numbers():
    row = re.compile(r"^\| `(\w+)` \|[^|]*\| (\d+) \| (\d+) \| (\d+) \| (\d+) \|$", re.MULTILINE)
    page = (FOLDER / "README.md").read_text(encoding="utf-8")
    said = {name: tuple(map(int, numbers)) for name, *numbers in row.findall(page)}
    found = {}
    for name in MAKE.MESHES:
        grains = load_grains(FOLDER / name)
        files = [*(FOLDER / name).iterdir(), *FOLDER.glob(f"{name}.*")]
        size = sum(path.stat().st_size for path in files)
        counts = grains.num_grains, len(grains.cells), len(grains.points), round(size / 1000)
        found[name] = counts
    assert said == found
    assert sum(path.stat().st_size for path in FOLDER.rglob("*") if path.is_file()) < LARGEST


@pytest.mark.parametrize("name", VOLUMES)
def test_volumes(name):
    volume, error = VOLUMES[name]
    np.testing.assert_allclose(load_grains(FOLDER / name).volumes, volume, rtol=error)


@pytest.mark.parametrize("ending", [".msh", ".inp", ".vtu"])
def test_formats_of_other_programs_hold_the_same(ending):
    (name,) = (path.stem for path in FOLDER.glob(f"*{ending}"))
    own, other = load_grains(FOLDER / name), import_grains(FOLDER / f"{name}{ending}")
    assert (other.labels == own.labels).all() and (other.cells == own.cells).all()
    assert (other.points == own.points).all()


def test_grains_of_sand_touch_their_neighbours():
    """Nodes of surfaces are nearer to another grain than half an edge, of three grains at least."""
    grains = load_grains(FOLDER / "twelve_grains")
    trees = [cKDTree(grains.grain(g)[0]) for g in range(grains.num_grains)]
    near = [
        sum(a.count_neighbors(b, 0.5 * grains.element_size) > 0 for b in trees if b is not a)
        for a in trees
    ]
    assert min(near) >= 3


def test_scenes_name_them(tmp_path):
    def grains(text):
        (tmp_path / "scene.toml").write_text(SMALLEST + f'[sample]\ngrains = "{text}"\n')
        return load_scene(tmp_path / "scene.toml").sample.grains

    assert grains("meshes:two_spheres") == shipped_mesh("meshes:two_spheres")
    assert shipped_mesh("meshes:two_spheres") == FOLDER / "two_spheres"
    for wrong, near in (("meshes:two_sphere", "meshes:two_spheres"), ("meshes:../demos", "one of")):
        with pytest.raises(InputError, match=rf'grains = "{wrong}", expected {near}'):
            grains(wrong)


def test_the_wheel_has_them():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    included = settings["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"]
    for path in shipped_meshes().values():
        assert included[f"meshes/{path.name}"] == f"mufe_fenicsx/meshes/{path.name}"


@pytest.mark.slow
@pytest.mark.parametrize("name", MAKE.MESHES)
def test_they_can_be_made_anew(name, tmp_path):
    """With the gmsh of then: another one may mesh otherwise. Coordinates to rounding."""
    MAKE.make(name, tmp_path)
    new, kept = load_grains(tmp_path / name), load_grains(FOLDER / name)
    assert (new.cells == kept.cells).all() and (new.labels == kept.labels).all()
    size = np.ptp(kept.points, axis=0).max()
    np.testing.assert_allclose(new.points, kept.points, rtol=0, atol=1e-12 * size)
    for path in tmp_path.glob("*.*"):
        assert path.stat().st_size == pytest.approx((FOLDER / path.name).stat().st_size, rel=0.01)
