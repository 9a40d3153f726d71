"""Packing, imaging and the whole chain of a synthetic scan."""

import csv
import dataclasses
import json

import numpy as np
import pytest
import tifffile

from mufe_fenicsx.cli import main as cli
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.image.compare_labels import compare_labels, touching_labels
from mufe_fenicsx.geometry.image.label_files import read_labels
from mufe_fenicsx.kernels.packing import radial
from mufe_fenicsx.materials.sand import SAND
from mufe_fenicsx.scene import load_scene
from mufe_fenicsx.synthetic.imaging import grey_image, ring_pattern, voxelise
from mufe_fenicsx.synthetic.packing import Packing, pack
from mufe_fenicsx.synthetic.pipeline import synthesize
from mufe_fenicsx.synthetic.settings import SynthesisSettings, settings_from
from mufe_fenicsx.synthetic.shapes import make_grains
from mufe_fenicsx.synthetic.triangulated import icosphere, vertex_areas


def balls(diameters, centres, box):
    n = len(diameters)
    rng = np.random.default_rng(1)
    grains = make_grains(rng, diameters, np.ones(n), np.ones(n), 0.0, 1.7, 15)
    return Packing(
        grains, np.array(centres, dtype=float), np.tile(np.eye(3), (n, 1, 1)), np.zeros(3),
        np.array(box, dtype=float),
    )  # fmt: skip


def test_a_ball_has_its_volume_through_partial_volumes():
    packing = balls([17.3], [[10.3, 9.8, 10.1]], [20, 20, 20])
    voxels = voxelise(packing, (20, 20, 20), 1.0, 4)
    exact = np.pi / 6 * 17.3**3
    # About 940 voxels cut by the sphere, each wrong by up to 1/4³ … 1/4 at random: < 5 in 2711.
    assert voxels.solid.sum() == pytest.approx(exact, rel=1e-3)
    assert voxels.volume[0] == pytest.approx(exact, rel=1e-3)
    # The same errors, at a lever of at most 9: 9 · 2e-3.
    assert voxels.centroid[0] == pytest.approx([10.3, 9.8, 10.1], abs=0.02)
    # Blur and grey levels keep the mean: the ball does not reach the border.
    settings = SynthesisSettings(noise=0, shot_noise=0, rings=0, blur=0.5, void_grey=1e4,
                                 solid_grey=3e4)  # fmt: skip
    packing = balls([11.0], [[10, 10, 10]], [20, 20, 20])
    solid = voxelise(packing, (20, 20, 20), 1.0, 4).solid
    grey = grey_image(solid, np.random.default_rng(1), settings)
    # Rounding to whole grey levels.
    assert (grey.mean() - 1e4) / 2e4 == pytest.approx(solid.mean(), abs=1e-5)


def test_a_cut_ball_keeps_what_is_inside():
    """A ball whose centre lies in a face of the image has half of its volume there."""
    packing = balls([10.0], [[15.0, 10.0, 10.0]], [20, 20, 20])
    voxels = voxelise(packing, (10, 10, 10), 1.0, 4)
    assert voxels.volume[0] == pytest.approx(np.pi / 12 * 1000, rel=3e-3)
    # Centre of a half ball: 3/8 r.
    assert voxels.centroid[0, 0] == pytest.approx(10 - 3 / 8 * 5, abs=0.02)


def test_voxels_of_an_overlap_belong_to_the_nearer_grain():
    packing = balls([10.0, 10.0], [[8, 10, 10], [16, 10, 10]], [24, 20, 20])
    voxels = voxelise(packing, (20, 20, 24), 1.0, 4)
    lens = voxels.labels[10, 10, 11:13]
    assert lens.tolist() == [1, 2]
    assert np.bincount(voxels.labels.ravel())[1] == np.bincount(voxels.labels.ravel())[2]
    assert voxels.solid.max() <= 1


def test_contact_forces_balance_and_point_along_the_line_of_centres():
    packing = balls([2.0, 2.0], [[0, 0, 0], [1.2, 1.2, 0.8]], [4, 4, 4])
    directions, triangles = icosphere(3)
    place = packing.grains.surface(directions)
    weight = vertex_areas(place, triangles)
    assert weight.sum(axis=1) == pytest.approx(4 * np.pi, rel=0.01)
    x, (force, torque) = np.empty_like(place), np.zeros((2, 2, 3))
    radial.surface_points(x, place, packing.centre, packing.axes)
    touching, _, deepest = radial.add_contact_forces(
        force, torque, x, weight, np.array([[0, 1]]), *packing.arrays
    )
    line = packing.centre[1] - packing.centre[0]
    distance = np.linalg.norm(line)
    assert touching == 1
    # Edges are 0.16 long, so a point is within 0.093 of the deepest, where the depth falls by the
    # square of the distance (1/2R + 1/2R): 0.0087.
    assert deepest == pytest.approx(2 - distance, abs=9e-3)
    assert force.sum(axis=0) == pytest.approx(0, abs=1e-15)
    # Moments about one point: those of the forces and the torques.
    total = torque.sum(axis=0) + np.cross(packing.centre, force).sum(axis=0)
    assert total == pytest.approx(0, abs=1e-15)
    direction = -force[0] / np.linalg.norm(force[0])
    assert direction == pytest.approx(line / distance, abs=0.05)


@pytest.fixture(scope="module")
def packing():
    rng = np.random.default_rng(5)
    n = 40
    grains = make_grains(rng, np.full(n, 200e-6), np.full(n, 0.8), np.full(n, 0.8), 0.05, 1.7, 12)
    return pack(grains, rng, (1, 1, 1), 0.5e-6)


def test_packing_is_dense_and_hardly_overlaps(packing):
    # Of 40 grains 33 touch a wall, where voids are larger; random loose spheres have 0.55 without
    # walls, ellipsoids without friction about 0.7.
    assert packing.solid_fraction > 0.55
    # It ends when depths have stayed within a tenth of what is asked for.
    assert packing.mean_depth == pytest.approx(0.5e-6, rel=0.1, abs=0.0)
    assert packing.largest_depth < 10 * 0.5e-6
    # All grains within the walls, but for the depth of contacts.
    x = np.empty((40, 642, 3))
    radial.surface_points(x, packing.grains.surface(icosphere(3)[0]), packing.centre, packing.axes)
    assert (x > packing.low - 5e-6).all() and (x < packing.high + 5e-6).all()
    # The part of the volume that two grains share: depth 0.5 um on few contacts of 200 um grains.
    voxels = voxelise(packing, (40, 40, 40), float((packing.high - packing.low).max() / 40), 3)
    union = voxels.solid.sum(dtype=float) * ((packing.high - packing.low).max() / 40) ** 3
    assert voxels.volume.sum() / union - 1 < 2e-3


def test_the_same_seed_gives_the_same_packing():
    def packed(seed):
        rng, n = np.random.default_rng(seed), 6
        form = np.full(n, 200e-6), np.full(n, 0.8), np.full(n, 0.8)
        return pack(make_grains(rng, *form, 0.05, 1.7, 12), rng, (1, 1, 1), 0.5e-6).centre

    assert np.array_equal(packed(5), packed(5))
    assert not np.array_equal(packed(5), packed(6))


def test_rings_do_not_change_along_the_axis_and_noise_has_its_deviation():
    rng = np.random.default_rng(1)
    rings = ring_pattern((41, 41), rng)
    assert rings[20, 5] == pytest.approx(rings[5, 20]) == pytest.approx(rings[35, 20])
    settings = SynthesisSettings(blur=0, rings=0, noise=0.05, shot_noise=0.05)
    contrast = settings.solid_grey - settings.void_grey
    for part, extra in ((0.0, settings.void_grey / settings.solid_grey), (1.0, 1.0)):
        grey = grey_image(np.full((40, 40, 40), part, np.float32), rng, settings).astype(float)
        # 64000 numbers: their deviation to 0.3 %, three times that.
        assert grey.std() / contrast == pytest.approx(0.05 * np.sqrt(1 + extra), rel=0.01)


def test_comparison_of_equal_and_permuted_labels_is_perfect(packing):
    voxels = voxelise(packing, (40, 40, 40), 15e-6, 1)
    true = voxels.labels
    permuted = np.concatenate([[0], 1 + np.random.default_rng(1).permutation(true.max())])[true]
    for found in (true, permuted):
        result = compare_labels(found, true)
        assert result["matched_share"] == 1
        assert result["contact_precision"] == result["contact_recall"] == 1
        assert result["largest_diameter_error"] == result["wrong_voxels"] == 0
        assert result["false_grains"] == result["split"] == result["merged"] == 0


def test_comparison_counts_a_split_and_a_merged_grain():
    true = np.zeros((4, 4, 20), dtype=int)
    for label, (first, last) in enumerate([(0, 4), (4, 8), (8, 12), (14, 18)], start=1):
        true[:, :, first:last] = label
    found = true.copy()
    found[:, :, 16:18] = 5  # halves: neither holds more than half of grain 4
    found[true == 3] = 2
    result = compare_labels(found, true)
    assert (result["num_true"], result["num_matched"]) == (4, 1)
    assert (result["split"], result["merged"]) == (1, 2)
    assert touching_labels(true) == {(1, 2): 16, (2, 3): 16}
    with pytest.raises(InputError, match="shape"):
        compare_labels(found[1:], true)


def test_the_command_writes_what_is_known(tmp_path, capsys):
    folder = tmp_path / "scan"
    with pytest.raises(SystemExit) as ended:
        cli.main(["synthesize", "-o", str(folder), "--shape", "40,44,48", "--set", "d50=120 um",
                  "--seed", "3", "--json", "-"])  # fmt: skip
    assert ended.value.code == 0
    result = json.loads(capsys.readouterr().out)
    labels, voxel_size = read_labels(folder / "truth_labels.tif")
    grey = tifffile.imread(folder / "grey.tif")
    assert voxel_size == 5e-6 and grey.dtype == np.uint16
    assert grey.shape == labels.shape == (40, 44, 48)
    with open(folder / "truth_grains.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["label"]) for row in rows] == list(range(1, labels.max() + 1))
    for row in rows:
        volume = float(row["volume_m3"]) / voxel_size**3
        # A surface of area about 5 V^(2/3) cuts as many voxels, each wrong by at most one half.
        assert abs(volume - int(row["voxels"])) < 0.5 * 5 * max(volume, 1) ** (2 / 3)
    total = sum(float(row["volume_m3"]) for row in rows) / (labels.size * voxel_size**3)
    assert 1 - result["porosity_of_labels"] == pytest.approx(total, rel=5e-3)
    # One number of each, and that of the file which a segmentation is compared with.
    for what in ("porosity", "coordination", "contacts", "solid_fraction"):
        assert len([key for key in result if what in key]) <= 1
    assert result["num_label_contacts"] == compare_labels(labels, labels)["num_true_contacts"]
    with open(folder / "truth_contacts.csv", newline="") as file:
        pairs = {(int(r["label_a"]), int(r["label_b"])): r for r in csv.DictReader(file)}
    assert set(touching_labels(labels)) <= set(pairs)
    with np.load(folder / "surfaces.npz") as data:
        assert len(np.unique(data["grain_of_face"])) == len(rows)
    scene = load_scene(folder / "scene.toml")
    assert scene.material == SAND
    assert scene.image.path == folder / "grey.tif" and scene.image.voxel_size == 5e-6


def test_unusable_settings_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"elongation = 1\.2, expected 0\.3"):
        settings_from({"elongation": 1.2})
    with pytest.raises(InputError, match=r"d5 = 1 is not a known setting, expected d50"):
        settings_from({"d5": 1})
    with pytest.raises(InputError, match=r"seed = 1\.5, expected a whole number"):
        settings_from({"seed": 1.5})
    with pytest.raises(InputError, match=">= 6 voxels"):
        settings_from({"d50": "20 um"})
    (tmp_path / "other").write_text("")
    with pytest.raises(InputError, match="not empty"):
        synthesize(dataclasses.replace(SynthesisSettings(), shape=(20, 20, 20)), tmp_path)
