"""Slices as PNG, JPEG or BMP pictures: of grey levels, be they stored as equal colours."""

import numpy as np

from ...errors import InputError
from .stored_image import check_regular, errors_of_readers

PICTURES = (".png", ".jpg", ".jpeg", ".bmp")
#: Types of voxels by the modes of Pillow.
TYPES = {"1": bool, "I;16": np.uint16, "I;16B": np.uint16, "I": np.int32, "F": np.float32}


class Picture:
    """One picture of a folder of slices, read when it is asked for."""

    white_is_zero, voxel_size = False, None

    def __init__(self, path, folder):
        from PIL import Image

        check_regular(path, folder)
        self.path = path
        with errors_of_readers(path), Image.open(path) as picture:
            self.shape = picture.size[::-1]
            self.dtype = np.dtype(TYPES.get(picture.mode, np.uint8))

    def __getitem__(self, where):
        from PIL import Image

        with errors_of_readers(self.path), Image.open(self.path) as picture:
            if picture.mode in TYPES or picture.mode == "L":
                return np.asarray(picture)[where].astype(self.dtype, copy=False)
            colours = np.asarray(picture.convert("RGB"))
            if (colours != colours[..., :1]).any():
                raise InputError(f"slice {self.path.name} has colours, expected grey levels")
            return colours[..., 0][where]
