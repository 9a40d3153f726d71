"""From a grey image to grain meshes, and nothing half-written when that fails."""

import csv
import errno
import signal

import numpy as np
import pytest
from matplotlib.figure import Figure

from mufe_fenicsx.errors import InputError, Interrupted
from mufe_fenicsx.geometry.grains import load_grains
from mufe_fenicsx.geometry.image.label_files import read_labels, write_labels
from mufe_fenicsx.geometry.image.picture import draw_refusal
from mufe_fenicsx.geometry.image.threshold import NoThreshold, find_threshold
from mufe_fenicsx.geometry.mesh import mesh_labels
from mufe_fenicsx.geometry.segment import segment_image
from mufe_fenicsx.geometry.settings import METHODS, MeshSettings, SegmentSettings
from mufe_fenicsx.machine import memory
from mufe_fenicsx.machine.files import SIGNALS, new_files, new_folder
from tests.geometry.scenes import grey_packing, two_balls


def test_an_image_becomes_grain_meshes(tmp_path, no_workers):
    np.save(tmp_path / "image.npy", grey_packing())
    labels_path, folder = tmp_path / "labels.tif", tmp_path / "grains"
    found = segment_image(tmp_path / "image.npy", SegmentSettings(voxel_size=1e-5), labels_path)
    assert found["num_grains"] == 8 and found["dropped_fragments"] == 0
    # Equal phases would part at 120; they are not equal, and voxels are cut by surfaces.
    assert 100 < found["threshold"] < 140
    labels, voxel_size = read_labels(labels_path)
    assert voxel_size == 1e-5 and labels.max() == 8
    assert (tmp_path / "labels.png").stat().st_size > 10_000

    calls = []
    made = mesh_labels(
        labels_path,
        MeshSettings(size=4e-5),
        folder,
        progress=lambda finished, total: calls.append((finished, total)),
    )
    grains = load_grains(folder)
    assert made["num_grains"] == 8 and made["failed"] == [] and calls[-1] == (8, 8)
    assert made["num_cells"] == len(grains.cells)
    assert np.allclose(grains.box, [[0, 0, 0], [36e-5] * 3], rtol=1e-12, atol=0)
    assert made["volume_ratio"] == pytest.approx(1, abs=0.01)
    with open(folder / "quality.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["label"]) for row in rows] == grains.labels.tolist()
    volumes = [float(row["volume_m3"]) for row in rows]
    assert volumes == pytest.approx(grains.volumes, rel=1e-9)
    assert (folder / "quality.png").exists() and (folder / "grains.xdmf").exists()
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "grains",
        "image.npy",
        "labels.csv",
        "labels.png",
        "labels.tif",
        "labels_contacts.csv",
    ]


def test_results_are_not_overwritten_by_accident(tmp_path):
    write_labels(tmp_path / "labels.tif", two_balls(), 1e-5)
    np.save(tmp_path / "image.npy", grey_packing())
    with pytest.raises(InputError, match=r"labels.tif exists, expected a new file, or --over"):
        segment_image(
            tmp_path / "image.npy", SegmentSettings(voxel_size=1e-5), tmp_path / "labels.tif"
        )
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "notes.txt").write_text("keep me")
    for overwrite, message in ((False, "is not empty"), (True, "holds no grains.h5")):
        with pytest.raises(InputError, match=message):
            mesh_labels(
                tmp_path / "labels.tif", MeshSettings(size=3e-5), folder, overwrite=overwrite
            )
    assert (folder / "notes.txt").read_text() == "keep me"


@pytest.mark.parametrize("image", [np.full((8, 8, 8), 5), np.eye(8), None])
def test_nothing_is_left_of_a_segmentation_that_failed(tmp_path, image):
    if image is not None:
        np.save(tmp_path / "image.npy", image)
    before = sorted(tmp_path.iterdir())
    with pytest.raises(InputError):
        segment_image(
            tmp_path / "image.npy", SegmentSettings(voxel_size=1e-5), tmp_path / "labels.tif"
        )
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("settings", [{"threshold": "gaussians"}, {"min_grain_voxels": 10**6}])
def test_of_a_threshold_that_is_refused_a_picture_is_left(tmp_path, settings):
    """The histogram, the levels of the other methods, and a slice; nothing else."""
    noise = np.random.default_rng(0).normal(100, 10, (20, 20, 20))
    np.save(tmp_path / "image.npy", noise if "threshold" in settings else grey_packing())
    for _ in range(2):  # it is no reason to refuse the next trial
        with pytest.raises(InputError, match=r"; .*labels_threshold.png shows the histogram"):
            segment_image(
                tmp_path / "image.npy",
                SegmentSettings(voxel_size=1e-5, **settings),
                tmp_path / "new" / "labels.tif",
            )
        assert [p.name for p in (tmp_path / "new").iterdir()] == ["labels_threshold.png"]


def test_a_refusal_shows_the_levels_of_all_methods_that_suit(tmp_path, monkeypatch):
    figures = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, path: figures.append(figure))
    image = grey_packing().astype(float)
    draw_refusal(tmp_path / "a.png", NoThreshold("", image, level=200.0))
    legend = [text.get_text() for text in figures[0].axes[0].get_legend().get_texts()]
    known = {method: find_threshold(image, method) for method in METHODS} | {"given": 200.0}
    assert legend == [f'"{name}": {level:.6g}' for name, level in known.items()]
    assert (figures[0].axes[1].images[0].get_array() == image[18]).all()


@pytest.mark.parametrize("place", [new_folder, new_files])
@pytest.mark.parametrize("number", SIGNALS)
def test_nothing_is_left_when_something_ends_the_writing(tmp_path, place, number):
    """No temporary folder, and none of the folders that were made around it."""
    with pytest.raises(Interrupted, match="nothing is left") as caught:
        with place(tmp_path / "some" / "where" / "out") as folder:
            (folder / "half.txt").write_text("half")
            signal.raise_signal(number)
    assert caught.value.signal == number and not list(tmp_path.iterdir())
    assert signal.getsignal(number) == signal.SIG_DFL


def test_nothing_is_left_when_the_disk_is_full(tmp_path, monkeypatch):
    def full(*args):
        raise OSError(errno.ENOSPC, "No space left on device")

    np.save(tmp_path / "image.npy", grey_packing())
    monkeypatch.setattr("mufe_fenicsx.geometry.segment.draw_segmentation", full)
    with pytest.raises(InputError, match="cannot be written: No space left on device"):
        segment_image(
            tmp_path / "image.npy", SegmentSettings(voxel_size=1e-5), tmp_path / "labels.tif"
        )
    assert [p.name for p in tmp_path.iterdir()] == ["image.npy"]


def test_a_size_that_fits_no_grain_is_refused(tmp_path, monkeypatch, no_workers):
    write_labels(tmp_path / "labels.tif", two_balls(), 1e-5)

    def refused(size, said):
        with pytest.raises(InputError, match=said):
            mesh_labels(
                tmp_path / "labels.tif", MeshSettings(size=size, processes=1), tmp_path / "out"
            )
        assert not (tmp_path / "out").exists()

    refused(2e-4, r"size = 0.0002 m: none of 2 grains.*too small")
    monkeypatch.setattr("mufe_fenicsx.geometry.mesh.mesh_grains", None)  # no grain is begun
    refused(1e-3, r"size = 0.001 m: the largest grain is as a ball of 0.000188 m, exp")


@pytest.mark.parametrize("voxel_size", [1e-3, 1.0])
def test_a_mesh_that_cannot_end_is_not_begun(tmp_path, voxel_size):
    """Voxels of a millimetre, edges of micrometres: 10^9 tetrahedra and more."""
    write_labels(tmp_path / "labels.tif", two_balls(), voxel_size)
    with pytest.raises(InputError, match=r"size = 1.4e-05 m: a grain of .* m takes .* tetrahedra"):
        mesh_labels(
            tmp_path / "labels.tif", MeshSettings(size=14e-6, processes=1), tmp_path / "out"
        )
    assert not (tmp_path / "out").exists()


def test_a_segmentation_larger_than_the_memory_is_not_begun(tmp_path, monkeypatch):
    np.save(tmp_path / "image.npy", grey_packing())
    monkeypatch.setattr(memory, "free_memory", lambda: 10 * 2**20)
    settings = SegmentSettings(voxel_size=1e-5, upsample=2)
    message = r"upsample = 2: to segment 373248 voxels takes .* GB, expected at most the .* GB"
    with pytest.raises(InputError, match=message):
        segment_image(tmp_path / "image.npy", settings, tmp_path / "labels.tif")
    flat = SegmentSettings(voxel_size=(1e-3, 1e-5, 1e-5))
    with pytest.raises(InputError, match=r"voxel_size = .*3600 x 36 x 36 cubes takes"):
        segment_image(tmp_path / "image.npy", flat, tmp_path / "labels.tif")


def test_output_below_a_file_is_refused(tmp_path):
    write_labels(tmp_path / "labels.tif", two_balls(), 1e-5)
    with pytest.raises(InputError, match="cannot be written"):
        mesh_labels(
            tmp_path / "labels.tif", MeshSettings(size=3e-5), tmp_path / "labels.tif" / "out"
        )


def test_another_separation_drops_what_only_the_old_one_uses():
    old = SegmentSettings(voxel_size=1e-5, separation="markers", marker_depth=0.75)
    assert old.separated_by(None) is old
    new = old.separated_by("level")
    assert (new.separation, new.marker_depth, new.threshold_and_level) == (
        "level",
        None,
        (0.04, 0.2),
    )


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SegmentSettings(voxel_size=0), "voxel_size = 0"),
        (lambda: SegmentSettings(voxel_size=1e-5, filter="mean"), 'filter = "mean"'),
        (lambda: SegmentSettings(voxel_size=1e-5, threshold="half"), "threshold = 'half'"),
        (
            lambda: SegmentSettings(watershed_level=0.2),
            "watershed_level = 0.2, expected a value only",
        ),
        (lambda: SegmentSettings(voxel_size=(1e-5, -1, 1)), "voxel_size = "),
        (
            lambda: SegmentSettings(upsample=1e9),
            "upsample = 1000000000.0, expected 0 < upsample <= 100",
        ),
        (
            lambda: SegmentSettings(filter_radius=1e9),
            "filter_radius = 1000000000.0, expected 0 <= filter_radius",
        ),
        (lambda: SegmentSettings(filter="median", filter_radius=20), "at most 10 voxels for the"),
        (lambda: SegmentSettings(crop=((5, 2), (0, 1), (0, 1))), "crop = 5 to 2 along z, expected"),
        (lambda: SegmentSettings(shape=(0, 3, 3)), r"shape = \(0, 3, 3\), expected three numbers"),
        (lambda: SegmentSettings(dtype="O"), "dtype = 'O', expected a NumPy type of numbers"),
        (lambda: SegmentSettings(dtype="u2,u2"), "dtype = 'u2,u2', expected a NumPy type"),
        (lambda: MeshSettings(size=1e-5, shape=(1, 0, 1)), r"shape = \(1, 0, 1\)"),
        (lambda: MeshSettings(size=-1.0), "size = -1.0"),
        (lambda: MeshSettings(size=1e-5, smoothing=20), "smoothing = 20"),
    ],
)
def test_settings_out_of_range_are_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()


@pytest.mark.parametrize(("thickness", "size"), [(3, 3e-5), (3, 1.5e-5), (8, 3e-5)])
def test_a_plate_that_became_too_thick_is_told(tmp_path, no_workers, thickness, size):
    """Three voxels, edges as long: a plate of 4.8 voxels, whose volume is right to 0.5 %."""
    np.save(tmp_path / "a.npy", np.pad(np.ones((thickness, 30, 30), dtype=np.int32), 6))
    made = mesh_labels(
        tmp_path / "a.npy", MeshSettings(size=size, voxel_size=1e-5), tmp_path / "grains"
    )
    assert made["volume_ratio"] == pytest.approx(1, abs=0.006)
    height = np.ptp(load_grains(tmp_path / "grains").points[:, 2])
    told = [line for line in made["warnings"] if "of its mean thickness, expected 15%" in line]
    assert bool(told) == (height > 1.3 * thickness * 1e-5)


def test_true_labels_of_other_voxels_are_told(tmp_path):
    np.save(tmp_path / "image.npy", grey_packing())
    settings = SegmentSettings(voxel_size=1e-5)
    segment_image(tmp_path / "image.npy", settings, tmp_path / "a.tif")
    labels, _ = read_labels(tmp_path / "a.tif")
    write_labels(tmp_path / "true.tif", labels, 2e-5)
    found = segment_image(
        tmp_path / "image.npy", settings, tmp_path / "b.tif", truth=tmp_path / "true.tif"
    )
    assert found["compared"]["matched_share"] == 1.0
    assert "true.tif state voxels of 20 µm x 20 µm x 20 µm, the image" in found["notices"][0]
