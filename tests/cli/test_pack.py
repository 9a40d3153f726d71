"""`mufe pack` writes grains and a scene that `mufe run` takes, and refuses what makes none."""

import csv
import json

import numpy as np
import pytest
from scipy.spatial import cKDTree

from mufe_fenicsx.cli.main import main
from mufe_fenicsx.geometry.grains import load_grains, save_grains
from mufe_fenicsx.geometry.image.label_files import read_labels
from mufe_fenicsx.geometry.measure import boundary_triangles, tet_volumes
from mufe_fenicsx.scene import load_scene
from mufe_fenicsx.synthetic.starter_scenes import column_of_balls
from mufe_fenicsx.units import lengths_text

SPHERES = ("pack", "--spheres", "--count", "12", "--element-size", "120 um")


def pack(*words):
    with pytest.raises(SystemExit) as ended:
        main([str(word) for word in words])
    assert ended.value.code in (0, None)


@pytest.fixture(scope="module")
def packed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("packed")
    pack(*SPHERES, "-o", folder / "a", "--voxel-size", "20 um", "--json", folder / "a" / "a.json")
    return folder


def test_grains_have_the_volumes_and_the_void_ratio_that_are_told(packed):
    told = json.loads((packed / "a" / "a.json").read_text())
    grains = load_grains(packed / "a" / "grains")
    assert grains.num_grains == told["num_grains"] == 12
    assert told["next"] == f"mufe run {packed}/a/scene.toml -o {packed}/a/results"
    box = np.prod(np.ptp(grains.box, axis=0))
    # Walls cut corners of coarse balls off, a few per cent of their volume here.
    assert box / grains.volumes.sum() - 1 == pytest.approx(told["void_ratio"], rel=0.1)
    rows = list(csv.DictReader((packed / "a" / "packing.csv").open()))
    diameters = np.array([float(row["equivalent_diameter_m"]) for row in rows])
    assert grains.volumes == pytest.approx(np.pi / 6 * diameters**3, rel=0.1)
    assert (grains.volumes <= np.pi / 6 * diameters**3 * (1 + 1e-6)).all()
    contacts = sum(int(row["contacts"]) for row in rows)
    assert contacts / 12 == pytest.approx(told["coordination_number"])
    assert (grains.points >= -1e-12).all()
    assert (grains.points <= grains.box[1] + 1e-12).all()


@pytest.mark.parametrize(
    ("words", "kept"),
    [(("--way", "compression"), "about its proportions"), (("--way", "gravity"), "its base")],
)
def test_the_size_taken_is_told_where_it_is_not_that_asked_for(words, kept, tmp_path, capsys):
    """A cylinder that 12 balls do not fill: compression leaves its size, gravity its height."""
    pack(*SPHERES, *words, "--cylinder", "1.5 mm,3 mm", "-o", tmp_path / "a")
    low, high = load_grains(tmp_path / "a" / "grains").box
    diameter, height = (high - low)[1:]
    lines = [line for line in capsys.readouterr().out.splitlines() if "size of the con" in line]
    assert len(lines) == 1
    assert lines[0].endswith(f" for cylinder = 1.5 mm,3 mm: {words[1]} keeps {kept}, no more")
    assert f"  {lengths_text([diameter, height])} for" in lines[0]
    assert (diameter == pytest.approx(1.5e-3)) == (words[1] == "gravity")
    assert height < 3e-3


def test_labels_are_those_of_the_grains(packed):
    labels, voxel = read_labels(packed / "a" / "labels.tif")
    grains = load_grains(packed / "a" / "grains")
    volumes = np.bincount(labels.ravel(), minlength=13)[1:] * voxel**3
    # A voxel of 20 um in balls of some 300 um: 3 %.
    assert volumes == pytest.approx(grains.volumes, rel=0.05)


def test_labels_of_a_sample_that_is_cut_out(packed, tmp_path):
    """Of the same packing: those of the whole, less as many voxels at each side."""
    pack(*SPHERES, "-o", tmp_path / "b", "--voxel-size", "20 um", "--cut", "0.5")
    whole, voxel = read_labels(packed / "a" / "labels.tif")
    inner, _ = read_labels(tmp_path / "b" / "labels.tif")
    told = json.loads((packed / "a" / "a.json").read_text())
    off = 0.5 * told["mean_diameter"] / voxel
    assert np.abs(np.array(whole.shape) - inner.shape - 2 * off).max() <= 1.0
    # Grids are apart by less than a voxel: solid voxels of the same part agree to its surface.
    first = round(off)
    part = whole[tuple(slice(first, first + n) for n in inner.shape)]
    assert ((part > 0) == (inner > 0)).mean() > 0.9
    # Caps of a sphere lower than an eighth of its diameter, 5 % of its volume, are void.
    volume = load_grains(packed / "a" / "grains").volumes / voxel**3
    left = np.bincount(inner.ravel(), minlength=volume.size + 1)[1:] / volume
    assert (left[left > 0] > 0.04).all()  # voxels of 20 um in balls of some 300 um: 3 %


def test_the_scene_runs_and_a_seed_repeats_the_packing(packed, tmp_path):
    scene = load_scene(packed / "a" / "scene.toml")
    assert scene.oedometer.strain > 0
    pack("run", packed / "a" / "scene.toml", "-o", tmp_path / "run", "--max-steps", "3", "--quiet")
    pack(*SPHERES, "-o", tmp_path / "again")
    first = load_grains(packed / "a" / "grains").points
    assert (load_grains(tmp_path / "again" / "grains").points == first).all()


def test_a_packing_under_a_stress_is_fine_at_contacts_and_goes_on_from_it(tmp_path):
    """Contacts of the packing just touch, and the first stage of the scene has its stresses."""
    sizes = "--element-size", "120 um", "--contact-size", "40 um"
    pack("pack", "--spheres", "--count", "5", "--stress", "4 MPa", "--k0", "0.5", *sizes,
         "--cylinder", "1 mm,1 mm", "-o", tmp_path / "a")  # fmt: skip
    grains, scene = (
        load_grains(tmp_path / "a" / "grains"),
        load_scene(tmp_path / "a" / "scene.toml"),
    )
    first, second = scene.stages
    assert (first.zero, first.r.stress, first.z.stress) == (True, 2e6, 4e6)
    assert (second.r.speed, second.z.strain, second.z.walls) == (0.0, 0.06, "max")
    near, far = [], []  # lengths of edges at contacts, and the longest of each grain
    for g in range(grains.num_grains):
        points, cells = grains.grain(g)
        facets = boundary_triangles(cells)
        edges = np.linalg.norm(points[facets] - points[np.roll(facets, 1, axis=1)], axis=2)
        others = [grains.grain(k)[0] for k in range(grains.num_grains) if k != g]
        gap, _ = cKDTree(np.concatenate(others)).query(points[facets].mean(axis=1))
        near.append(edges[gap < 20e-6])
        far.append(edges.max())
    near = np.concatenate(near).mean()
    assert near < 52e-6
    assert min(far) > 1.25 * near  # none is far from all contacts


def test_one_grain_of_a_size(tmp_path):
    """Walls meet it on all sides, and cut no more of it than they need to bear."""
    pack("pack", "--spheres", "--count", "1", "--points", "50", "--d50", "0.6 mm",
         "--element-size", "150 um", "-o", tmp_path / "one")  # fmt: skip
    grains = load_grains(tmp_path / "one" / "grains")
    assert grains.num_grains == 1 and grains.volumes[0] <= np.pi / 6 * 0.6e-3**3
    assert (np.ptp(grains.box, axis=0) > 0.9 * 0.6e-3).all()


def test_given_meshes_are_turned_and_scaled(tmp_path):
    """Volumes follow the sizes asked for, and the mesh is that given but where walls touch it."""
    save_grains(tmp_path / "given", column_of_balls(1))
    given = load_grains(tmp_path / "given")
    pack("pack", tmp_path / "given", "--count", "3", "--points", "50", "--d50", "2 mm",
         "--uniformity", "1", "-o", tmp_path / "out")  # fmt: skip
    grains = load_grains(tmp_path / "out" / "grains")
    assert grains.volumes == pytest.approx(np.full(3, np.pi / 6 * 2e-3**3), rel=0.01)
    ratios = tet_volumes(*grains.grain(2)) / tet_volumes(given.points, given.cells)
    assert np.median(ratios) == pytest.approx(8 * np.pi / 6 * 1e-9 / given.volumes[0], rel=1e-6)


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("--spheres",), "--count is missing, expected a number of grains, or a --box"),
        (("--spheres", "--count", "5", "--elongation", "0.7"), "elongation = 0.7 beside spheres"),
        (("--spheres", "--count", "5", "--scale", "1 mm"), "scale = 0.001 beside spheres"),
        (("nowhere",), "SOURCE nowhere does not exist"),  # whatever else is missing
        (("--count", "5", "--void-ratio", "0.6", "--way", "gravity"), "--void-ratio = 0.6, exp"),
        (("--spheres", "--count", "5", "--k0", "0.5"), "--k0 = 0.5, expected stress beside it"),
        (
            ("--spheres", "--count", "5", "--stress", "1 MPa", "--way", "gravity"),
            "--stress = 1000000.0, expected none with way",
        ),
        (("--spheres", "--count", "5", "--contact-size", "1 m"), "contact_size = 1.0, expected 1."),
        (("--spheres", "--count", "5", "--cut", "1"), "--cut = 1.0, expected voxel_size beside it"),
        (("--spheres", "--count", "5", "--void-ratio", "0.1"), "--void-ratio = 0.1, expected 0.2"),
        (("--spheres", "--box", "1 um,1 um,1 um"), "box = 1 µm,1 µm,1 µm, expected room for"),
        (("--spheres", "--box", "2,2,3"), "expected room for 2 to 5e+04 grains, which is for 6.1"),
        (("--spheres", "--cylinder", "2 um,4 um"), "cylinder = 2 µm,4 µm, expected room"),
        (
            ("--spheres", "--cylinder", "2 mm,4 mm", "--box", "1 mm,1 mm,1 mm"),
            "cylinder = 2 mm,4 mm beside box = 1 mm,1 mm,1 mm, expected one of them",
        ),
        (("--spheres", "--cylinder", "0,4 mm"), "--cylinder = 0 m,4 mm, expected lengths > 0"),
        (("--spheres", "--cylinder", "1 mm"), "expected a list of 2 numbers (diameter,height)"),
        (("--spheres", "--count", "5", "--d50", "300"), "--d50 = 300.0, expected 1e-07 <= d50"),
        (("--spheres", "--count", "5", "--element-size", "1 m"), "element_size = 1.0, expected 1."),
        (("--spheres", "--count", "5", "--voxel-size", "1 nm"), "voxel_size = 1e-09, expected 3."),
        (
            ("--spheres", "--count", "9", "--way", "gravity", "--box", "0.1 mm,1 mm,1 mm"),
            "base of the container 0.0001 m, expected more than the largest grain",
        ),
        (
            ("--spheres", "--count", "10", "--cylinder", "0.1 mm,10 mm", "--uniformity", "1"),
            "cylinder = 100 µm,10 mm: 144.2 µm wide around 10 grains, expected more",
        ),
        (("meshes:none", "--count", "5"), 'SOURCE = "meshes:none", expected'),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(words, line, tmp_path, capsys):
    refused(words, line, tmp_path, capsys)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "text", "line"),
    [
        ("a.txt", "grains", "a.txt, expected a folder of grains, meshes:NAME, surfaces"),
        ("a.stl", "solid nothing", "a.stl holds no triangle"),
        ("a.csv", "x,y\n1,2\n", "a.csv has no column equivalent_diameter_m"),
        ("a.csv", "{head}", "a.csv has no row, expected one a grain"),
        ("a.csv", "{head}3e-4,0.7,0.8\n-3e-4,0.7,0.8\n", "row 2: equivalent_diameter_m = -3e-4"),
        ("a.csv", "{head}3e-4,0.7,nan\n", "row 1: flatness = nan, expected a number > 0 and at"),
    ],
)
def test_files_that_are_no_grains_are_named_before_what_else_is_missing(
    name, text, line, tmp_path, capsys
):
    head = "equivalent_diameter_m,elongation,flatness\n"
    (tmp_path / name).write_text(text.format(head=head))
    refused([tmp_path / name], line, tmp_path, capsys)
    assert [path.name for path in tmp_path.iterdir()] == [name]


def refused(words, line, folder, capsys):
    """`mufe pack` ends with status 2 and one line that holds ``line``."""
    with pytest.raises(SystemExit) as ended:
        main(["pack", *map(str, words), "-o", str(folder / "out")])
    assert ended.value.code == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert line in lines[0]
