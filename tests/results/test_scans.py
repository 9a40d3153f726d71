"""A run beside scans: against its own images, and against a motion that is known."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.tracking.track import track_labels
from mufe_fenicsx.kernels.geometry.voxels import label_cells
from mufe_fenicsx.peers.scan_doubts import (
    about_grains,
    about_lost,
    about_seating,
    about_shift,
    about_walls,
    beyond,
)
from mufe_fenicsx.results import Run
from mufe_fenicsx.results.scans import (
    beside,
    mean_strains,
    moment_at,
    pairs_of,
    shortenings,
    start_of,
    strain_at,
    voxels_of,
)
from tests.made_up_run import write_run

VOXEL = 1e-5


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Twelve lumpy balls of 20 voxels, of which states have strains of 0, 0.05 and 0.1."""
    folder = tmp_path_factory.mktemp("run")
    write_run(folder)
    return Run(folder)


def image(run, strain):
    """Labels of a run at a strain, as a scan has them: with other numbers."""
    labels = voxels_of(moment_at(run, strain), (62, 44, 44), VOXEL)
    return np.where(labels > 0, 40 - labels, 0)


@pytest.fixture(scope="module")
def scans(run):
    return image(run, 0.0), image(run, 0.03)


@pytest.fixture(scope="module")
def track(scans):
    return track_labels(*scans, VOXEL)


def test_voxels_of_a_cell():
    """Middles of voxels within x + y + z <= 3 and nowhere else, each once."""
    labels = np.zeros((4, 4, 4), np.int32)
    x = np.array([[0.0, 0, 0], [3, 0, 0], [0, 3, 0], [0, 0, 3]])
    label_cells(labels, x, np.array([[0, 1, 2, 3]]), np.array([7], np.int32))
    z, y, x = np.indices(labels.shape) + 0.5
    assert np.array_equal(labels == 7, x + y + z <= 3)


def test_between_states_places_are_linear(run):
    found = moment_at(run, 0.03)
    ends = [run.state(k).points for k in (0, 1)]
    assert found.states == (0, 1) and found.weight == pytest.approx(0.6)
    assert np.allclose(found.points, 0.4 * ends[0] + 0.6 * ends[1], rtol=1e-14)
    with pytest.raises(InputError, match=r"strain = 0\.2 of a scan, expected 0 to 0\.1"):
        moment_at(run, 0.2)


def test_a_run_against_its_own_images(run, scans, track):
    """Bounds of the whole method: 0.15 voxels in the mean, and overlaps of 0.95."""
    start = start_of(run, scans[0], VOXEL, "a.tif")
    assert start.grains == {g: 40 - g for g in range(10, 22)}
    found = beside(run, track, start, VOXEL, labels=scans)
    # Balls of 20 voxels are squeezed by 3 % of 600: strain is known to 0.1 voxel of 400.
    assert found.moment.strain == pytest.approx(0.03, abs=1e-3)
    assert found.numbers["num_tracked"] == 12 and found.numbers["num_lost_in_scan"] == 0
    assert found.numbers["mean_difference_voxels"] < 0.15
    assert found.table["dice"].min() > 0.95 and found.numbers["mean_rotation_difference"] < 0.02
    # All cells are squeezed alike, by ln 0.97; 0.15 voxels of 20 between centres are 0.0075.
    for name in ("strain_zz", "run_strain_zz"):
        assert found.table[name].to_numpy() == pytest.approx(-np.log(0.97), abs=7.5e-3)
    given = beside(run, track, start, VOXEL, strain=0.03, labels=scans)
    assert given.table["dice"].min() == 1.0


def known_track(track, shift):
    """A track on which all grains have moved by that much more [m]."""
    return replace(track, displacement=track.displacement + np.array(shift))


def test_what_all_grains_share_is_told_and_taken_out(run, scans, track):
    """A sample mounted anew, 3 voxels off: scan and run differ by it, and by nothing else."""
    start = start_of(run, scans[0], VOXEL, "a.tif")
    shift = np.array([3e-5, -1e-5, 0.0])
    track = known_track(track, shift)
    plain = beside(run, track, start, VOXEL, strain=0.03)
    assert [plain.numbers[f"common_shift_{a}"] for a in "xyz"] == pytest.approx(shift, abs=1e-6)
    # 0.15 voxels beside the shift, as above.
    length = np.linalg.norm(shift)
    assert plain.numbers["mean_displacement_difference"] == pytest.approx(length, abs=1.5e-6)
    moved = np.roll(scans[1], (-1, 3), axis=(1, 2))
    later = (scans[0], moved)
    aligned = beside(run, track, start, VOXEL, strain=0.03, labels=later, align=True)
    assert aligned.numbers["mean_difference_voxels"] < 0.15 and aligned.table["dice"].min() > 0.95


def test_strain_of_a_linear_motion(run):
    """The fit of a linear field is exact; a run's strain is that of the states, linear between."""
    centre = np.random.default_rng(1).random((20, 3))
    moved = centre @ np.array([[0.1, 0, 0], [0, 0, 0.3], [0.2, 0, -0.04]]) + [1, 2, 3]
    moved[3] = np.nan
    assert mean_strains(centre, moved) == pytest.approx([-0.1, 0, 0.04], abs=1e-12)
    grains = np.arange(10, 22)
    ends = [run.state(k) for k in (0, 1)]
    places = [np.array([s.points[np.unique(s.cells[s.grain == g])].mean(axis=0) for g in grains])
              for s in ends]  # fmt: skip
    wanted = mean_strains(places[0], 0.4 * (places[1] - places[0]))[2]
    of_states = shortenings(run, grains, places[0], False)
    # Means of nodes are not centres of volume: to a hundredth of the strain.
    assert strain_at(run, of_states, wanted) == pytest.approx(0.02, rel=0.01)
    with pytest.raises(InputError, match="1 tracked grains, expected 4"):
        mean_strains(centre[:1], moved[:1])


def test_contacts_gained_and_lost(run, scans, track):
    """Of the scan: 10 and 11 touch first, 10 and 13 then. The run has its own."""
    before, now = (np.zeros((4, 4, 6), np.int32) for _ in "ab")
    before[:, :, :2], before[:, :, 2:4] = 1, 2
    now[:, :, :2], now[:, :, 2:4] = 5, 6
    assert pairs_of(before, {1: 10, 2: 11}) == {(10, 11)} and pairs_of(now, {5: 10}) == set()
    start = start_of(run, scans[0], VOXEL, "a.tif")
    cut = scans[1].copy()
    touching = pairs_of(scans[1], {40 - g: g for g in start.grains})
    assert touching
    a, b = min(touching)
    mine = cut == 40 - a
    grown = np.zeros_like(mine)
    for axis in range(3):
        for step in (-1, 1):
            grown |= np.roll(cut == 40 - b, step, axis=axis)
    cut[mine & grown] = 0  # the faces that both share
    found = beside(run, track, start, VOXEL, strain=0.03, labels=(scans[0], cut))
    whole = beside(run, track, start, VOXEL, strain=0.03, labels=scans)
    for other in (found, whole):
        assert other.numbers["run_contacts_now"] == len(touching)
    assert found.numbers["contacts_now"] == len(touching) - 1
    table = found.table.set_index("grain")
    lost = table["contacts_lost"] - whole.table.set_index("grain")["contacts_lost"]
    gained = whole.table.set_index("grain")["contacts_gained"] - table["contacts_gained"]
    assert (lost + gained)[lost + gained > 0].to_dict() == {a: 1, b: 1}


def test_labels_that_are_not_those_of_the_run(run, scans):
    with pytest.raises(InputError, match=r"labels a\.tif: 0 of 12 grains .* lie on a label"):
        start_of(run, np.roll(scans[0], 12, axis=(0, 1, 2)), VOXEL, "a.tif")


@pytest.fixture(scope="module")
def seated_run(tmp_path_factory):
    """The same run, of which 2.5 % are seating: the first stored state is there, with strain 0."""
    folder = tmp_path_factory.mktemp("seated")
    write_run(folder, num_states=5)
    series = folder / "fields" / "states.vtkhdf.series"
    told = json.loads(series.read_text())
    told["files"] = [state | {"strain": state["strain"] - 0.025} for state in told["files"][1:]]
    series.write_text(json.dumps(told))
    return Run(folder)


@pytest.mark.parametrize("seated", [False, True])
def test_motion_counts_from_where_the_first_scan_shows_the_grains(run, seated_run, seated):
    """From the mesh, or from seating, to the same place: 1.5 % of the run's strain for both."""
    pair = image(run, 0.025 if seated else 0.0), image(run, 0.04)
    start = start_of(seated_run, pair[0], VOXEL, "a.tif")
    # Grains lie on their own voxels exactly in one of both places.
    assert start.seated is seated and start.overlaps[seated] == 1.0 > start.overlaps[not seated]
    found = beside(seated_run, track_labels(*pair, VOXEL), start, VOXEL, labels=pair)
    # 0.1 voxels of 40 between the outer layers of balls are 0.0025; the other start is 0.025 off.
    assert found.moment.strain == pytest.approx(0.015, abs=2.5e-3)
    assert found.numbers["mean_difference_voxels"] < 0.15 and found.table["dice"].min() > 0.95
    touching = pairs_of(pair[0], {40 - g: g for g in start.grains})
    assert found.numbers["run_contacts_before"] == len(touching)


@pytest.mark.parametrize(("strain", "said"), [(0.04, ""), (0.015, "less"), (0.14, "more")])
def test_a_scan_beyond_the_run_is_told(run, seated_run, scans, track, strain, said):
    """Of the mesh, the run is pressed by 2.5 to 10 %; all numbers are in the message."""
    track = replace(track, displacement=track.displacement * strain / 0.03)
    start = start_of(seated_run, scans[0], VOXEL, "a.tif")
    numbers = beside(seated_run, track, start, VOXEL).numbers
    told = beyond(numbers, "b.tif", scans[0].shape[0])
    assert len(told) == bool(said)
    if said:
        assert told[0].startswith(f"b.tif is pressed {said} than the run at its")
        shown = [float(x) for x in re.findall(r"0\.\d+", told[0])]
        # Means of all grains to a tenth of the strain: some balls touch, and their labels are cut.
        assert shown == pytest.approx([strain, 0.025, 0.1], rel=0.1)


def test_longer_samples_and_rounding_errors_are_told_in_words():
    numbers = {"shortening": -0.04, "run_shortening_least": -4e-15, "run_shortening_most": 0.05}
    (told,) = beyond(numbers, "b.tif", 100)
    assert "its grains are longer by 0.04" in told and "run shorter by 0 to shorter" in told


def test_a_first_scan_before_the_seating_is_told(seated_run, scans, track):
    """Stages count from the grains as meshed, which seating has pressed by 0.025 since."""
    start = start_of(seated_run, scans[0], VOXEL, "a.tif")
    found = [beside(seated_run, track, start, VOXEL)]
    (told,) = about_seating(start, found, scans[0].shape[0])
    # Means of all grains to a tenth of the strain, as above.
    assert float(re.search(r"0\.\d+", told)[0]) == pytest.approx(0.025, rel=0.1)
    assert about_seating(replace(start, seated=True), found, scans[0].shape[0]) == []


def test_more_than_a_tenth_of_grains_lost_is_told(track):
    """One of twelve is 0.083, two are 0.167."""
    displacement = track.displacement.copy()
    displacement[0] = np.nan
    assert about_lost(replace(track, displacement=displacement), "b.tif") == []
    displacement[5] = np.nan
    (told,) = about_lost(replace(track, displacement=displacement), "b.tif")
    assert told.startswith("2 of 12 grains of the first scan are not found in b.tif: ")


def test_a_shift_of_all_is_told_beyond_two_voxels():
    for z, said in ((1.9, False), (-2.1, True)):
        numbers = {"common_shift_x": 0.0, "common_shift_y": 0.0, "common_shift_z": z * VOXEL}
        told = about_shift(numbers, "b.tif", VOXEL)
        assert len(told) == said and all("0.0, 0.0, -2.1 voxels" in line for line in told)


@pytest.mark.parametrize(
    ("grains", "said"),
    [(0.0488, "0.0293 and 0.0488 along z at b.tif"), (0.0300, ""), (0.0383, "")],
)
def test_walls_that_lack_what_grains_are_flattened(grains, said):
    """Walls 100 voxels apart come nearer by 0.0293: 0.01 is a voxel, a tenth of 0.03 is less."""
    places = [{"side": 1.0, "z_min": 0.0, "z_max": h * VOXEL} for h in (100.0, 97.07)]
    found = [SimpleNamespace(numbers={"sample_strain_z": grains})]
    told = about_walls(places, found, ["b.tif"], VOXEL)
    assert len(told) == bool(said) and all(said in line for line in told)
    # Far apart in voxels, and near to each other: a tenth of 0.0383 is 0.0038.
    fine = about_walls(places, found, ["b.tif"], VOXEL / 100)
    assert len(fine) == (abs(grains - 0.0293) > 0.1 * grains)


def test_voxels_of_another_size_are_told(run, scans):
    """The size that fits is in the message, and how many grains no label has."""
    first = np.where(scans[0] > 28, 0, scans[0])  # grains 10 and 11 have labels 30 and 29
    start = start_of(run, first, VOXEL, "a.tif")
    assert about_grains(start, run, "a.tif", VOXEL) == [
        f"2 of 12 grains of {run.path} lie on no label of a.tif and are left out"
    ]
    told = about_grains(start_of(run, scans[0], 1.06 * VOXEL, "a.tif"), run, "a.tif", 1.06 * VOXEL)
    ratio, right, given = re.search(
        r"are (\S+) times .* voxels of (\S+) m .* of (\S+) m", told[-1]
    ).groups()
    # A volume of 4000 voxels is known to a part of a thousand.
    assert [float(ratio), float(right) / VOXEL] == pytest.approx([1.06, 1.0], rel=0.005)
    assert float(given) == pytest.approx(1.06 * VOXEL)
