"""A run beside scans: against its own images, and against a motion that is known."""

from dataclasses import replace

import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.tracking.track import track_labels
from mufe_fenicsx.kernels.geometry.voxels import label_cells
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
