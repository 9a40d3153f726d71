"""Grains tracked from a synthetic scan to a second one, against the motion that was put in."""

import math

import numpy as np
from scipy.spatial.transform import Rotation

from ..geometry.image.compare_labels import matched_grains
from ..geometry.image.segmentation import segment
from ..geometry.settings import SegmentSettings
from ..geometry.tracking.track import track_labels
from ..synthetic.second_scan import two_scans
from ..synthetic.settings import SynthesisSettings
from ..synthetic.shapes import make_grains, sizes
from .case import at_least, case, compare


@case("tracking", num_bodies=1)
def tracking(comm, number=300, d50=32.0, angle=20.0, shift=0.5, strain=0.03, noise=0.06, seed=1):
    """Synthetic scan and a second one: grains found again, their displacements and rotations.

    Both scans are segmented by the default settings, each with noise of its own. Between them
    the packing is pressed, and each grain moves and turns by chance. The centre of a tracked grain
    is that of its label; the true displacement is that of the body's point there.

    Args:
        comm: MPI communicator.
        number: Grains.
        d50: Median diameter by mass [voxels].
        angle: Largest rotation [degrees].
        shift: Largest displacement of a grain along each axis, by chance [voxels].
        strain: By which the packing is pressed along z.
        noise: Deviation of the noise over the contrast.
        seed: Of the random numbers.
    """
    settings = SynthesisSettings(d50=d50 * 5e-6, noise=noise, margin=0.0)
    rng = np.random.default_rng(seed)
    scans = two_scans(
        _grains(settings, number, rng), settings, rng, strain=strain, shift=shift, angle=angle
    )
    asked = SegmentSettings(voxel_size=settings.voxel_size)
    labels = [segment(grey, asked)[0] for grey in scans.grey]
    track = track_labels(*labels, settings.voxel_size, names=("the first", "the second"))
    right, error, turned = errors_of(track, scans, labels)
    error = error / settings.voxel_size
    lines = {
        "grains seen in both scans": compare(right.size / number, 1.0, 0.02),
        "grains tracked right": at_least(right.mean(), 0.99),
        "error of displacement, root mean square (voxels)": compare(_rms(error), 0.0, 0.1, 1.0),
        "error of rotation, root mean square (degrees)": compare(_rms(turned), 0.0, 0.5, 1.0),
    }
    for part in (95, 100):
        name = "largest" if part == 100 else f"{part} % of grains"
        for what, values in (("displacement", error), ("rotation", turned)):
            unit = "voxels" if what == "displacement" else "degrees"
            lines[f"error of {what}, {name} ({unit})"] = compare(
                np.percentile(values, part), 0.0, math.inf
            )
    return lines, []


def errors_of(track, scans, labels):
    """How right a track is.

    Args:
        track: :class:`~mufe_fenicsx.geometry.tracking.track.Track`.
        scans: :class:`~mufe_fenicsx.synthetic.second_scan.TwoScans`.
        labels: Of both scans, as tracked.

    Returns:
        Whether each grain that is a label in both scans was tracked to it, shape (num_seen,); of
        those the errors of displacement [m], shape (num_right,), and of rotation [degrees], without
        round grains.
    """
    ours, later = (matched_grains(x, true) for x, true in zip(labels, scans.grain, strict=True))
    seen = [grain for grain in ours if grain in later]
    at = np.searchsorted(track.label, [ours[grain] for grain in seen])
    right = track.label_now[at] == [later[grain] for grain in seen]
    at, grain = at[right], np.array(seen)[right] - 1
    turn = scans.rotation[grain]
    off = track.centre[at] - scans.centre[grain]
    true = scans.displacement[grain] + turn.apply(off) - off
    error = np.linalg.norm(track.displacement[at] - true, axis=1)
    told = np.isfinite(track.rotation[at]).all(axis=(1, 2))
    angle = (Rotation.from_matrix(track.rotation[at][told]) * turn[told].inv()).magnitude()
    return right, error, np.degrees(angle)


def _rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def _grains(settings, number, rng):
    """Random grains of the settings' sizes and forms."""
    form = [
        np.clip(rng.normal(mean, settings.form_spread, number), 0.3, 1.0)
        for mean in (settings.elongation, settings.flatness)
    ]
    return make_grains(
        rng, sizes(rng, number, settings.d50, settings.uniformity), *form, settings.roughness,
        settings.falloff, settings.max_degree,
    )  # fmt: skip
