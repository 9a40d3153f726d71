"""A synthetic scan through the segmentation, held against its grains and contacts."""

import csv
import tempfile
from pathlib import Path

import numpy as np
import tifffile

from ..geometry.image.compare_labels import compare_labels
from ..geometry.image.label_files import read_labels
from ..geometry.image.segmentation import segment
from ..geometry.settings import SegmentSettings
from ..synthetic.pipeline import synthesize
from ..synthetic.settings import SynthesisSettings
from .case import case, compare

#: Of the volume of a grain of median size: smaller ones are slivers that the border cuts off.
SLIVER = 0.01
#: A gap up to this is a contact of the surfaces [voxels].
TOLERANCE = 0.05


@case("segmentation", num_bodies=1)
def segmentation(comm, edge=120, d50=225e-6, noise=0.06, blur=0.8, seed=1):
    """Synthetic scan: grains found one-to-one, contacts, sizes, with the default settings.

    Contacts are held against pairs of true labels that share faces of voxels: grains nearer
    than about a voxel. Those whose surfaces touch are fewer; they must be found as well.

    Args:
        comm: MPI communicator.
        edge: Voxels of 5 um along each edge of the image.
        d50: Median diameter of grains by mass [m].
        noise: Deviation of the noise over the contrast.
        blur: Deviation of the point-spread function [voxels].
        seed: Of the scan.
    """
    scan = SynthesisSettings(shape=(edge,) * 3, d50=d50, noise=noise, blur=blur, seed=seed)
    grey, true, contacts = synthetic_scan(scan)
    smallest = sliver(scan)
    settings = SegmentSettings(voxel_size=scan.voxel_size, min_grain_voxels=smallest)
    labels, _, _ = segment(grey, settings)
    found = compare_labels(labels, true, min_voxels=smallest)
    touching = compare_labels(labels, true, min_voxels=smallest, true_contacts=contacts)
    whole = compare_labels(labels, without_cut_grains(true))
    results = {
        # What is lost are slivers at the border, of a tenth of a grain at most.
        "grains found one-to-one": compare(found["matched_share"], 1.0, 0.05),
        "grains within the image found one-to-one": compare(whole["matched_share"], 1.0, 0.0),
        "false grains": compare(found["false_grains"] / found["num_true"], 0.0, 0.02, scale=1.0),
        "contacts found that are true": compare(found["contact_precision"], 1.0, 0.05),
        "true contacts found": compare(found["contact_recall"], 1.0, 0.05),
        "touching surfaces found": compare(touching["contact_recall"], 1.0, 0.05),
        "mean diameter": compare(1 + found["mean_diameter_error"], 1.0, 0.005),
        "diameter of the worst of 95 % of grains": compare(
            1 + found["diameter_error_95"], 1.0, 0.05
        ),
        "solid fraction": compare(
            np.count_nonzero(labels) / labels.size, np.count_nonzero(true) / true.size, 0.01
        ),
    }
    return results, []


def synthetic_scan(settings):
    """Grey image and true labels (z, y, x), and the pairs of labels whose surfaces touch."""
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder) / "scan"
        synthesize(settings, folder)
        grey = tifffile.imread(folder / "grey.tif")
        true, _ = read_labels(folder / "truth_labels.tif")
        with open(folder / "truth_contacts.csv", newline="", encoding="utf-8") as file:
            touching = {
                (int(row["label_a"]), int(row["label_b"]))
                for row in csv.DictReader(file)
                if float(row["gap_m"]) <= TOLERANCE * settings.voxel_size
            }
    return grey, true.astype(np.int32), touching


def sliver(settings):
    """Voxels of the smallest grain that is asked for."""
    return max(8, int(SLIVER * 0.5 * (settings.d50 / settings.voxel_size) ** 3))


def without_cut_grains(labels):
    """Labels without the grains that the border of the image cuts."""
    cut = np.zeros(int(labels.max()) + 1, dtype=bool)
    for axis in range(3):
        for end in (0, -1):
            cut[np.unique(labels.take(end, axis=axis))] = True
    return np.where(cut[labels], 0, labels)
