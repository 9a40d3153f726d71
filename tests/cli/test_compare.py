"""`mufe compare` holds a run against its own images, and refuses what does not belong to it."""

import json
import re
from pathlib import Path

import numpy as np
import pandas
import pytest
from matplotlib.figure import Figure

from mufe_fenicsx.cli.main import main
from mufe_fenicsx.geometry.image.label_files import read_labels, write_labels
from mufe_fenicsx.loading.measured import read_measured
from mufe_fenicsx.loading.measured_paths import columns_of
from mufe_fenicsx.peers.scans import compare_scans
from mufe_fenicsx.results import Run
from mufe_fenicsx.results.scans import moment_at, voxels_of
from tests.made_up_run import write_run

VOXEL = 1.25e-5


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A made-up run of eight balls of 16 voxels, and images of it at strains of 0 and 0.02."""
    folder = tmp_path_factory.mktemp("compare")
    (folder / "run").mkdir()
    write_run(folder / "run", counts=(2, 2, 2))
    run = Run(folder / "run")
    for k in range(2):
        labels = voxels_of(moment_at(run, 0.02 * k), (34, 34, 34), VOXEL)
        write_labels(folder / f"scan{k}.tif", labels, VOXEL)
    labels = labels.astype(np.int32)
    np.savez(folder / "scan0.npz", labels=labels)
    write_labels(folder / "small.tif", labels[1:], VOXEL)
    write_labels(folder / "coarse.tif", labels, 2 * VOXEL)
    write_labels(folder / "empty.tif", 0 * labels, VOXEL)
    (folder / "wrong.tsv").write_text("Label\tZpos\n1\t2\n")
    return folder


@pytest.fixture
def mufe(place, monkeypatch, capfd):
    """Run a command in the folder; its status, standard output and error."""
    monkeypatch.chdir(place)

    def run(*words):
        with pytest.raises(SystemExit) as ended:
            main([str(word) for word in words])
        told = capfd.readouterr()
        return ended.value.code or 0, told.out, told.err

    return run


def test_a_run_against_its_images(mufe, place):
    status, out, _ = mufe(
        "compare", "run", "--labels", "scan0.tif", "scan1.tif", "--json", "a.json"
    )
    assert status == 0 and "scan1.tif:" in out and "report: run-scans/report.html" in out
    told = json.loads((place / "a.json").read_text())
    (scan,) = told["scans"]
    # The bounds of the whole method. Centres are 16 voxels apart, a tenth of which is 0.006.
    assert scan["scan"] == "scan1.tif" and scan["strain"] == pytest.approx(0.02, abs=6e-3)
    assert scan["mean_difference_voxels"] < 0.15 and scan["mean_dice"] > 0.95
    table = pandas.read_csv(place / "run-scans" / "compare.csv")
    assert table["grain"].tolist() == list(range(10, 18))
    made = {p.name for p in (place / "run-scans" / "figures").iterdir()}
    assert {f"scan-1-{n}.png" for n in ("scatter", "maps", "slices", "differences")} <= made
    page = (place / "run-scans" / "report.html").read_text()
    assert "Overlap of grains with their labels (Dice), mean" in page and page.count("<figure") == 4
    assert '"sources": [{"kind": "run", "stage": 0}' in page and "Surfaces of 6 grains" in page
    assert (place / "run-scans" / "surfaces" / "scan_0001.vtp").is_file()
    # Stages can follow the ends of the sample, pressed evenly by 0.02: in one half balls come
    # nearer, in the other they are flattened. 0.1 voxels of 32 at both ends are 0.006.
    motion = read_measured(
        place / "run-scans" / "motion.csv", columns_of(Run(place / "run").container)
    )
    height = motion.columns["z_max"] - motion.columns["z_min"]
    assert 1 - height[1] / height[0] == pytest.approx(0.02, abs=6e-3)
    assert told["stages"] == "run-scans/stages.toml"
    assert set(told["walls"].values()) == {"surfaces"} and len(told["walls"]) == 6
    ways = (
        "Walls of motion.csv go: x_min, x_max, y_min, y_max, z_min, z_max with surfaces of grains"
    )
    assert ways in out and ways in (place / "run-scans" / "stages.toml").read_text()


def test_a_scan_mounted_anew_with_a_grain_lost(mufe, place, monkeypatch):
    """Walls stand where they stood without the shift of 4 voxels, to 0.2: 0.1 a track.

    The file of the later scan states no size of voxels: it has that of the first.
    """
    monkeypatch.setattr(Figure, "savefig", lambda figure, path, **options: Path(path).touch())
    images = [read_labels(place / f"scan{k}.tif")[0] for k in range(2)]
    first, later = (np.pad(image, (0, 6)) for image in images)
    later[later == 12] = 0
    write_labels(place / "wide.tif", first, VOXEL)
    moved = []
    for name, image, options in (
        ("fixed", later, ()),
        ("free", np.roll(later, 4, axis=0), ()),
        ("aligned", np.roll(later, 4, axis=0), ("--align",)),
    ):
        np.savez(place / f"{name}.npz", labels=image)
        status, out, _ = mufe("compare", "run", "--labels", "wide.tif", f"{name}.npz", "-o", name,
                              "--json", "b.json", *options)  # fmt: skip
        assert status == 0 and "labels lost: 12\n" in out
        assert "1 of 8 grains of the first scan are not found in " + f"{name}.npz" in out
        told = json.loads((place / "b.json").read_text())
        assert told["scans"][0]["lost_in_scan"] == [12]
        assert any("--align" in line for line in told["notices"]) == (name == "free")
        path = place / name / "motion.csv"
        columns = read_measured(path, columns_of(Run(place / "run").container)).columns
        moved.append(np.array([columns[w][1] - columns[w][0] for w in ("z_min", "z_max")]) / VOXEL)
    assert moved[1] - moved[0] == pytest.approx([4, 4], abs=0.2)
    assert moved[2] == pytest.approx(moved[0], abs=0.2)


def test_labels_beside_the_grains_are_told(mufe, place, monkeypatch):
    """Both scans moved by three voxels along z, of which 0.1 are printed."""
    monkeypatch.setattr(Figure, "savefig", lambda figure, path, **options: Path(path).touch())
    for k in range(2):
        image = np.pad(read_labels(place / f"scan{k}.tif")[0], (3, 3))
        write_labels(place / f"beside{k}.tif", np.roll(image, (0, -3, -3), (0, 1, 2)), VOXEL)
    status, out, _ = mufe("compare", "run", "--labels", "beside0.tif", "beside1.tif", "-o", "off")
    assert status == 0
    told = re.search(r"labels of beside0.tif lie (.*) voxels .x, y, z. beside the grains", out)
    assert [float(v) for v in told[1].split(", ")] == pytest.approx([0.0, 0.0, 3.0], abs=0.1)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("scan0.npz", "scan1.tif"), "voxel_size of scan0.npz is not stated, expected a length"),
        (("scan0.tif",), "1 of the labels given, expected two at least: before"),
        (("scan0.tif", "small.tif"), "labels small.tif have shape (33, 34, 34), expected (34,"),
        (
            ("scan0.tif", "coarse.tif"),
            "labels coarse.tif have voxels of 2.5e-05 m, expected 1.25e-05",
        ),
        (("scan0.tif", "empty.tif"), "labels empty.tif: no grain, all voxels are 0, expected"),
        (("scan0.tif", "none.tif"), "none.tif"),
        (("coarse.tif", "coarse.tif"), "labels coarse.tif: 0 of 8 grains of run lie on a label"),
        (
            ("scan0.tif", "--tracks", "wrong.tsv"),
            "track wrong.tsv has columns Label, Zpos, expected",
        ),
        (
            ("scan0.tif", "scan1.tif", "--strain", "0.5"),
            "strain = 0.5 of a scan, expected 0 to 0.1",
        ),
        (
            ("scan0.tif", "scan1.tif", "--strain", "1,2"),
            "2 strains of 1 later scans, expected as many",
        ),
        (
            ("scan0.tif", "scan1.tif", "--grains", "3,12"),
            "grain 3 is not compared, expected one of",
        ),
        (
            ("scan0.tif", "scan1.tif", "--grains", "a"),
            '--grains = "a", expected whole numbers such as 3,12',
        ),
        (("scan0.tif", "scan1.tif", "--strain", "a"), '--strain = "a", expected a number'),
    ],
)
def test_what_does_not_belong_to_a_run_is_refused(mufe, place, words, said):
    status, _, err = mufe("compare", "run", "--labels", *words, "-o", "x")
    (line,) = [line for line in err.splitlines() if not line.startswith("mufe: tracking")]
    assert status == 2 and said in line and not (place / "x").exists()


def test_a_table_of_others_stands_for_the_later_scan(place, tmp_path, monkeypatch):
    """The run's own motion as a table of SPAM: no labels are needed, and there is no overlap."""
    monkeypatch.setattr(Figure, "savefig", lambda figure, path, **options: Path(path).touch())
    run = Run(place / "run")
    state, first = run.state(1), run.state(0)
    rows = ["Label\tZpos\tYpos\tXpos\tZdisp\tYdisp\tXdisp"]
    for label in state.labels:
        nodes = np.unique(state.cells[state.grain == label])
        at = first.points[nodes].mean(axis=0) / VOXEL - 0.5
        moved = (state.points - first.points)[nodes].mean(axis=0) / VOXEL
        rows.append("\t".join([str(label), *(f"{v:.7f}" for v in (*at[::-1], *moved[::-1]))]))
    (tmp_path / "t.tsv").write_text("\n".join(rows) + "\n")
    told = compare_scans(
        place / "run", [place / "scan0.tif"], tmp_path / "out", tracks=[tmp_path / "t.tsv"]
    )
    (scan,) = told["scans"]
    # Means of nodes are not centres of volume, and grains are squeezed by 5 %.
    assert scan["strain"] == pytest.approx(0.05, abs=1e-3) and "mean_dice" not in scan
    assert scan["mean_difference_voxels"] < 0.05
