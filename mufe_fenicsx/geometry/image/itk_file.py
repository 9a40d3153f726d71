"""Images of MetaImage, NRRD and NIfTI, read by SimpleITK."""

import os
import sys
from contextlib import contextmanager

import numpy as np

from ...errors import InputError
from .itk_header import check_bytes, read_header
from .stored_image import Stored, three_axes

ITK = (".mhd", ".mha", ".nrrd", ".nhdr", ".nii", ".nii.gz")


def open_itk(path):
    """The voxels of an image that SimpleITK reads: `Stored`.

    Raises:
        InputError: the header cannot be understood, bytes are missing, or voxels are no numbers.
    """
    header = read_header(path)
    voxels = three_axes(_ItkVoxels(path, header))
    size = header.spacing
    if isinstance(size, tuple):
        size = size[::-1]
        size = tuple(size[axis] for axis in getattr(voxels, "kept", range(len(size))))
    lines = tuple(f"{path} states that {line}" for line in header.lines)
    return Stored(voxels, size, whole=header.encoding != "raw", notices=lines)


class _ItkVoxels:
    """Voxels of which the header is known."""

    def __init__(self, path, header):
        self.path, self.header = path, header
        self.shape, self.dtype = header.sizes[::-1], np.dtype(header.dtype)
        self.letters = header.letters[::-1]

    def __getitem__(self, where):
        check_bytes(self.path, self.header)
        import SimpleITK

        SimpleITK.ProcessObject.SetGlobalWarningDisplay(False)
        reader = SimpleITK.ImageFileReader()
        with _silent(), _plain_errors(self.path):
            reader.SetFileName(str(self.path))
            reader.ReadImageInformation()
            shape = tuple(reader.GetSize()[::-1])
            if shape != self.shape or reader.GetNumberOfComponents() != 1:
                raise InputError(
                    f"image {self.path} has {reader.GetNumberOfComponents()} numbers a voxel and "
                    f"shape {shape} for SimpleITK, expected one and {self.shape} as in its header"
                )
            reader.SetExtractIndex([s.start for s in where][::-1])
            reader.SetExtractSize([s.stop - s.start for s in where][::-1])
            return SimpleITK.GetArrayFromImage(reader.Execute())


@contextmanager
def _plain_errors(path):
    """What ITK says is wrong, without the places in its sources."""
    try:
        yield
    except RuntimeError as error:
        text = " ".join(str(error).split("ERROR:")[-1].split())
        raise InputError(f"image {path} cannot be read by SimpleITK: {text}") from error


@contextmanager
def _silent():
    """What ITK's readers print to standard error themselves goes nowhere: we say it in a line."""
    sys.stderr.flush()
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)
