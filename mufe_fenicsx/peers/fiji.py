"""Labels as a TIFF stack that ImageJ and Fiji open with its voxel size and slices.

ImageJ keeps the lengths of a voxel along x and y as resolutions (pixels a unit, fractions of
whole numbers), that along z as ``spacing``, with ``unit`` and the number of ``slices`` in the
description of the first page. It knows whole numbers of 8 and 16 bits and floating point numbers;
labels beyond 65535 are written as the latter, which is exact up to 2²⁴.
`mufe mesh` and :func:`~mufe_fenicsx.geometry.image.label_files.read_labels` read such files again.
"""

from fractions import Fraction
from pathlib import Path

import numpy as np
import tifffile

from ..errors import InputError
from ..machine.files import new_files

#: Largest label that each type of ImageJ holds exactly.
TYPES = ((2**8 - 1, np.uint8), (2**16 - 1, np.uint16), (2**24, np.float32))
#: The unit in which voxels are stated [m], and its name.
MICRON = 1e-6
#: Largest numerator and denominator of a resolution.
LARGEST = 2**32 - 1


def export_fiji(path, labels, voxel_size, *, overwrite=False):
    """Write labels as an ImageJ TIFF.

    Args:
        path: File to write, .tif or .tiff.
        labels: Shape (z, y, x).
        voxel_size: Edge of a voxel [m].
        overwrite: Replace the file.

    Returns:
        Summary, a dict.

    Raises:
        InputError: labels beyond 2²⁴, more than ImageJ's 4 GB, or a file that cannot be written.
    """
    path, largest = Path(path), int(labels.max(initial=0))
    if path.suffix.lower() not in (".tif", ".tiff"):
        raise InputError(f"output {path}, expected a name that ends with .tif or .tiff")
    kind = next((kind for most, kind in TYPES if largest <= most), None)
    if kind is None:
        raise InputError(f"largest label = {largest}, expected up to {2**24} for ImageJ")
    size = labels.size * np.dtype(kind).itemsize
    if size >= LARGEST - 2**20:
        raise InputError(f"labels take {size} bytes, expected less than 4 GB for ImageJ's TIFF")
    microns = voxel_size / MICRON
    edge = Fraction(f"{microns:.12g}").limit_denominator(10**6)
    if edge == 0 or max(edge.numerator, edge.denominator) > LARGEST:
        raise InputError(f"voxel_size = {voxel_size} m, expected 1e-12 to 1e3 m for ImageJ")
    with new_files(path, overwrite=overwrite) as folder:
        tifffile.imwrite(
            folder / path.name,
            labels.astype(kind),
            imagej=True,
            resolution=((edge.denominator, edge.numerator),) * 2,
            metadata={
                "axes": "ZYX",
                "spacing": float(edge),
                "unit": "um",
                "min": 0.0,
                "max": float(largest),
            },
        )
    return {
        "file": str(path),
        "num_grains": len(np.unique(labels[labels > 0])),
        "slices": labels.shape[0],
        "voxel_size": float(edge) * MICRON,
        "type": np.dtype(kind).name,
    }
