"""A small image in every format that is read, as files of bytes."""

import h5py
import numpy as np
import SimpleITK
import tifffile

#: Grey levels that no format changes.
IMAGE = (np.random.default_rng(0).integers(0, 60, (6, 5, 7)).cumsum(axis=2) * 9).astype("<u2")


def write_samples(folder):
    """Write `IMAGE` in every format. Returns a list of (path, options of `read_image`)."""
    made = []

    def file(name, **options):
        made.append((folder / name, options))
        return str(folder / name)

    tifffile.imwrite(file("plain.tif"), IMAGE)
    tifffile.imwrite(file("big.tif"), IMAGE, bigtiff=True, byteorder=">")
    tifffile.imwrite(file("imagej.tif"), IMAGE, imagej=True)
    # One directory for all slices, as ImageJ writes files above 4 GB.
    tifffile.imwrite(file("one_page.tif"), IMAGE, imagej=True, truncate=True)
    tifffile.imwrite(file("ome.tif"), IMAGE, ome=True, metadata={"axes": "ZYX"})
    tifffile.imwrite(file("tiles.tif"), IMAGE, tile=(16, 16), compression="zlib")
    for codec in ("zlib", "lzw", "zstd", "packbits", "lzma"):
        tifffile.imwrite(
            file(f"{codec}.tif"), IMAGE, compression=codec,
            predictor=codec in ("zlib", "lzw"), rowsperstrip=2,
        )  # fmt: skip
    with tifffile.TiffWriter(file("series.tif")) as writer:
        for part in IMAGE:
            writer.write(part, contiguous=False)
    np.save(file("a.npy"), IMAGE)
    np.savez(file("stored.npz"), grey=IMAGE)
    np.savez_compressed(file("packed.npz"), grey=IMAGE, angles=np.arange(3.0))
    IMAGE.tofile(file("a.raw", shape=IMAGE.shape, dtype="<u2"))
    for name, how in (
        ("contiguous.h5", {}),
        ("chunks.h5", {"chunks": (2, 5, 7)}),
        ("packed.h5", {"chunks": (3, 5, 7), "compression": "gzip", "fletcher32": True}),
        ("ilastik.h5", {"chunks": (6, 5, 7, 1)}),
    ):
        with h5py.File(file(name), "w") as out:
            four = IMAGE[..., None] if name == "ilastik.h5" else IMAGE
            out.create_dataset("scan/grey", data=four, **how)
    image = SimpleITK.GetImageFromArray(IMAGE)
    image.SetSpacing((0.005, 0.006, 0.007))
    for name in ("a.mha", "a.mhd", "a.nrrd", "a.nhdr", "a.nii", "a.nii.gz"):
        SimpleITK.WriteImage(image, file(name))
        if name in ("a.mhd", "a.nhdr"):  # both put their voxels into a.raw
            own = folder / f"{name}.raw"
            (folder / "a.raw").rename(own)
            header = (folder / name).read_text().replace("a.raw", own.name)
            (folder / name).write_text(header)
    IMAGE.tofile(folder / "a.raw")
    for name in ("packed.mha", "packed.nrrd"):
        SimpleITK.WriteImage(image, file(name), True)
    return made
