"""Tracks of SPAM and of iDVC are read as these write them, and mean what they say."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.ndimage
import tifffile
from scipy.spatial.transform import Rotation

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.tracking.bodies import bodies_of
from mufe_fenicsx.kernels.geometry.voxels import label_cells
from mufe_fenicsx.peers.tracks import read_track
from tests.made_up_run import ball

VOXEL = 2e-6
#: As `spam-ddic` 0.9.1 wrote it in `test_ddic_itself`.
DDIC = """\
Label\tZpos\tYpos\tXpos\tZdisp\tYdisp\tXdisp\tFzz\tFzy\tFzx\tFyz\tFyy\tFyx\tFxz\tFxy\tFxx\t\
PSCC\terror\titerations\treturnStatus\tdeltaPhiNorm\tLabelDilate
0.0000000\t0.0000000\t0.0000000\t0.0000000\t0.0000000\t0.0000000\t0.0000000\t1.0000000\t\
0.0000000\t0.0000000\t0.0000000\t1.0000000\t0.0000000\t0.0000000\t0.0000000\t1.0000000\t\
0.0000000\t0.0000000\t0.0000000\t0.0000000\t0.0000000\t0.0000000
1.0000000\t17.3013229\t17.3336391\t16.6566296\t1.2999824\t-0.4434159\t0.6721447\t0.9947428\t\
0.0858338\t0.0558515\t-0.0895210\t0.9937116\t0.0672551\t-0.0497276\t-0.0719014\t0.9961714\t\
0.0000000\t9.8288774\t4.0000000\t2.0000000\t0.0000384\t2.0000000
2.0000000\t42.5409088\t17.4931812\t16.4973488\t0.3049707\t0.7458440\t-0.6233331\t0.9939827\t\
-0.1029139\t-0.0375105\t0.1046951\t0.9932917\t0.0490963\t0.0322062\t-0.0527280\t0.9980894\t\
0.0000000\t10.3101511\t4.0000000\t2.0000000\t0.0000381\t2.0000000
"""
#: Motion of both balls (x, y, z) [voxels], and their centres (x, y, z) from the image's corner.
TURNS = Rotation.from_rotvec(np.radians([[5, -3, 4], [-6, 2, 3]]))
MOVED = np.array([[0.7, -0.4, 1.3], [-0.6, 0.8, 0.3]])
CENTRES = np.array([[17.0, 18, 17], [17, 18, 43]])


def two_balls(shape=(60, 36, 34), times=1):
    """Labels of both scans, `times` finer."""
    rng, images = np.random.default_rng(0), []
    bodies = [ball(6, 11.0, rng) for _ in CENTRES]
    for k in range(2):
        image = np.zeros(tuple(times * n for n in shape), np.int32)
        for g, (x, cells) in enumerate(bodies):
            y = CENTRES[g] + (TURNS[g].apply(x) + MOVED[g] if k else x)
            number = np.full(len(cells), g + 1, np.int32)
            label_cells(image, np.ascontiguousarray(times * y), cells.astype(np.int64), number)
        images.append(image)
    return images


@pytest.fixture(scope="module")
def bodies():
    return bodies_of(two_balls()[0])


def angle(track, k):
    """Between the rotation of a track and the true one [degrees]."""
    return np.degrees((Rotation.from_matrix(track.rotation[k]) * TURNS[k].inv()).magnitude())


def true_displacement(track, k):
    """Of the place that the track is about [m]."""
    off = track.centre[k] / VOXEL - CENTRES[k]
    return VOXEL * (MOVED[k] + TURNS[k].apply(off) - off)


def test_a_result_of_ddic(tmp_path, bodies):
    """SPAM is right to 0.1 voxels and 0.1 degrees here; what has not converged is lost."""
    path = tmp_path / "x-ddic.tsv"
    path.write_text(DDIC)
    track = read_track(path, bodies, VOXEL)
    assert track.found.tolist() == [True, True] and track.label.tolist() == [1, 2]
    assert np.allclose(track.centre[0] / VOXEL, [17.1566296, 17.8336391, 17.8013229])
    assert np.allclose(track.displacement[0] / VOXEL, [0.6721447, -0.4434159, 1.2999824])
    for k in range(2):
        assert np.abs(track.displacement[k] - true_displacement(track, k)).max() < 0.1 * VOXEL
        assert angle(track, k) < 0.1
    path.write_text(DDIC.replace("4.0000000\t2.0000000\t0.0000381", "50.0000000\t1.0000000\t0.1"))
    assert read_track(path, bodies, VOXEL).found.tolist() == [True, False]


@pytest.mark.slow
def test_spam_reads_the_same(tmp_path, bodies):
    """The motions that `spam.helpers.readCorrelationTSV` finds in this table."""
    if importlib.util.find_spec("spam") is None:
        pytest.skip("needs the package spam")
    path = tmp_path / "x-ddic.tsv"
    path.write_text(DDIC)
    code = (
        "import sys, numpy, spam.helpers as h; "
        "f = h.readCorrelationTSV(sys.argv[1], verbose=False); "
        "numpy.savez(sys.argv[2], phi=f['PhiField'], at=f['fieldCoords'], status=f['returnStatus'])"
    )
    subprocess.run([sys.executable, "-c", code, path, tmp_path / "a.npz"], check=True)
    theirs = np.load(tmp_path / "a.npz")
    track = read_track(path, bodies, VOXEL)
    assert theirs["status"].tolist() == [0, 2, 2]
    assert np.allclose(theirs["phi"][1, :3, 3], track.displacement[0, ::-1] / VOXEL, atol=1e-12)
    assert np.allclose(theirs["at"][1] + 0.5, track.centre[0, ::-1] / VOXEL, atol=1e-12)
    # F is a rotation but for a stretch of a thousandth.
    gradient = theirs["phi"][1, :3, :3][::-1, ::-1]
    assert np.abs(gradient - track.rotation[0]).max() < 5e-3


def grain(image, k):
    """Grey levels inside of the balls that move with them: waves of 7 voxels."""
    place = (np.indices(image.shape)[::-1].reshape(3, -1).T + 0.5) / 2
    levels = np.zeros(image.size)
    for g in range(2):
        x = place - CENTRES[g]
        x = TURNS[g].inv().apply(x - MOVED[g]) if k else x
        mine = image.ravel() == g + 1
        levels[mine] = 4000 * np.sin(0.9 * x[mine]).sum(axis=1)
    return levels.reshape(image.shape)


@pytest.mark.slow
def test_ddic_itself(tmp_path):
    """`spam-ddic` tracks two balls in noise; its table has the motions that were put in."""
    program = Path(sys.executable).with_name("spam-ddic")
    if not program.is_file():
        pytest.skip("needs the package spam")
    rng, fine = np.random.default_rng(1), two_balls(times=2)
    for k, image in enumerate(fine):
        grey = scipy.ndimage.gaussian_filter((image > 0) * (20000.0 + grain(image, k)), 2.0) + 10000
        grey = grey.reshape(60, 2, 36, 2, 34, 2).mean((1, 3, 5))
        grey += 300 * rng.standard_normal(grey.shape)
        tifffile.imwrite(tmp_path / f"{k}.tif", grey.astype(np.uint16))
    labels = two_balls()[0]
    tifffile.imwrite(tmp_path / "labels.tif", labels.astype(np.uint16))
    words = "0.tif labels.tif 1.tif -np 1 -od . -pre t -ld 2 -it 200".split()
    subprocess.run([program, *words], cwd=tmp_path, check=True, capture_output=True)
    track = read_track(tmp_path / "t-ddic.tsv", bodies_of(labels), VOXEL)
    assert track.found.any()
    for k in np.flatnonzero(track.found):
        assert np.abs(track.displacement[k] - true_displacement(track, k)).max() < 0.1 * VOXEL
        assert angle(track, k) < 0.2


def cloud(bodies, spacing=5):
    """A result of iDVC: points of a grid in the labels, as they truly move."""
    rows = ["n\tx\ty\tz\tstatus\tobjmin\tu\tv\tw\tphi\tthe\tpsi"]
    at = np.argwhere(bodies.image[::spacing, ::spacing, ::spacing] > 0) * spacing
    for n, place in enumerate(at[:, ::-1].astype(float), start=1):
        k = bodies.image[tuple(place[::-1].astype(int))] - 1
        off = place + 0.5 - CENTRES[k]
        moved = MOVED[k] + TURNS[k].apply(off) - off
        numbers = [*place, 0, 0.01, *moved, 0, 0, 0]
        rows.append("\t".join([str(n), *(f"{v:.6f}" for v in numbers)]))
    return rows


def test_a_result_of_idvc(tmp_path, bodies):
    """Exact points give the exact motion, to the six digits that are written."""
    path, rows = tmp_path / "x.disp", cloud(bodies)
    failed = rows[1].split("\t")
    failed[4:9] = ["-1", "9", "99", "99", "99"]
    rows[2] = rows[2].replace(rows[2].split("\t")[1], "nan", 1)
    path.write_text("\n".join([rows[0], "\t".join(failed), *rows[2:]]) + "\n")
    track = read_track(path, bodies, VOXEL)
    for k in range(2):
        assert np.allclose(track.displacement[k], true_displacement(track, k), atol=1e-5 * VOXEL)
        assert angle(track, k) < 1e-3
    # One point a grain: no rotation.
    path.write_text("\n".join([rows[0], rows[len(rows) // 4], rows[-2]]) + "\n")
    track = read_track(path, bodies, VOXEL)
    assert track.found.all() and np.isnan(track.rotation).all()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a\tb\n1\t2\n", r"has columns a, b, expected those of SPAM \(Zpos, Ypos, Xpos … are"),
        ("1\t2.0\t3.0\t4.0\n2\t3.0\t4.0\t5.0\n", "has columns 1, 2.0, 3.0, 4.0, expected those"),
        ("n\tx\n", "has 1 lines, expected names of columns and rows"),
        (DDIC.replace("\t9.8288774", ""), "line 3 has 21 values, expected 22 as names"),
        (DDIC.replace("9.8288774", "much"), "is no table of numbers"),
        (
            DDIC.replace("2.0000000\t0.0000381", "1.0\t0").replace("\t17.3013229", "\t97.5"),
            "0 of 2 labels lie where the table has them",
        ),
        (None, "cannot be read"),
    ],
)
def test_what_is_no_track_is_refused(tmp_path, bodies, text, said):
    path = tmp_path / "x.tsv"
    if text is not None:
        path.write_text(text)
    with pytest.raises(InputError, match=said) as refused:
        read_track(path, bodies, VOXEL)
    assert "\n" not in str(refused.value)


def test_points_beside_all_labels_are_refused(tmp_path, bodies):
    path, rows = tmp_path / "x.disp", cloud(bodies)
    path.write_text(rows[0] + "\n1\t900\t0\t0\t0\t0\t0\t0\t0\t0\t0\t0\n")
    with pytest.raises(InputError, match="none of 1 found points lies in a label"):
        read_track(path, bodies, VOXEL)
