"""Labels by ITK's own watershed filter, to compare with: `python tests/geometry/itk_reference.py`.

ITK (`pip install itk-segmentation`) takes 1.3 GB, so the labels of a small volume are kept beside
this file; nothing else needs it.
"""

from pathlib import Path

import numpy as np
import scipy.ndimage

FILE = Path(__file__).with_name("itk_watershed.npz")

#: Thresholds and levels of the kept labels: the paper's, none, and one between.
CASES = ((0.04, 0.2), (0.0, 0.0), (0.1, 0.5))


def itk_watershed(height, threshold, level):
    """Labels of itk::WatershedImageFilter."""
    import itk

    image = itk.image_view_from_array(np.ascontiguousarray(height, dtype=np.float32))
    watershed = itk.WatershedImageFilter[itk.Image[itk.F, 3]].New(image)
    watershed.SetThreshold(threshold)
    watershed.SetLevel(level)
    watershed.Update()
    return itk.array_from_image(watershed.GetOutput()).astype(np.int64)


def balls(size=36, number=40, seed=2):
    """True in balls of 4 to 8 voxels radius at random places."""
    rng = np.random.default_rng(seed)
    solid = np.zeros((size,) * 3, dtype=bool)
    at = np.moveaxis(np.indices(solid.shape), 0, -1)
    centres, radii = rng.uniform(0, size, (number, 3)), rng.uniform(4, 8, number)
    for centre, radius in zip(centres, radii, strict=True):
        solid |= ((at - centre) ** 2).sum(axis=-1) < radius**2
    return solid


def height_of(solid):
    """The inverted distance map, smoothed a little: among equals ITK's choice is an accident."""
    distance = scipy.ndimage.distance_transform_edt(solid).astype(np.float32)
    return -scipy.ndimage.gaussian_filter(distance, 0.5) * solid


if __name__ == "__main__":
    solid = balls()
    labels = [itk_watershed(height_of(solid), *case).astype(np.uint16) for case in CASES]
    np.savez_compressed(FILE, solid=solid, labels=np.array(labels))
