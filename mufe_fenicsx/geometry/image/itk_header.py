"""Headers of MetaImage, NRRD and NIfTI: sizes, units, and where the voxels' bytes are.

SimpleITK reads the voxels. It fills up with zeros what a NIfTI file lacks, takes every length as
millimetres and one where none is stated; so that is looked at here first.

Sources: https://itk.org/Wiki/MetaIO/Documentation, https://teem.sourceforge.net/nrrd/format.html,
https://nifti.nimh.nih.gov/nifti-1.
"""

import bz2
import gzip
import itertools
import math
import struct
import zlib
from dataclasses import dataclass, field

import numpy as np
import scipy.spatial.transform

from ...errors import InputError
from .stored_image import check_regular
from .voxel_size import metres

#: Longest header that is read [bytes], and the block in which bytes are counted.
LONGEST, BLOCK = 2**20, 2**20

META_TYPES = {
    **{"CHAR": "i1", "UCHAR": "u1", "SHORT": "i2", "USHORT": "u2", "INT": "i4", "UINT": "u4"},
    **{"LONG": "i4", "ULONG": "u4", "LONG_LONG": "i8", "ULONG_LONG": "u8"},
    **{"FLOAT": "f4", "DOUBLE": "f8"},
}
NRRD_TYPES = {
    **dict.fromkeys(("signed char", "int8", "int8_t"), "i1"),
    **dict.fromkeys(("uchar", "unsigned char", "uint8", "uint8_t"), "u1"),
    **dict.fromkeys(("short", "short int", "signed short", "signed short int"), "i2"),
    **dict.fromkeys(("int16", "int16_t"), "i2"),
    **dict.fromkeys(("ushort", "unsigned short", "unsigned short int"), "u2"),
    **dict.fromkeys(("uint16", "uint16_t"), "u2"),
    **dict.fromkeys(("int", "signed int", "int32", "int32_t"), "i4"),
    **dict.fromkeys(("uint", "unsigned int", "uint32", "uint32_t"), "u4"),
    **dict.fromkeys(("longlong", "long long", "int64", "int64_t"), "i8"),
    **dict.fromkeys(("ulonglong", "unsigned long long", "uint64", "uint64_t"), "u8"),
    **{"float": "f4", "double": "f8"},
}
NIFTI_TYPES = {
    **{2: "u1", 4: "i2", 8: "i4", 16: "f4", 64: "f8", 256: "i1"},
    **{512: "u2", 768: "u4", 1024: "i8", 1280: "u8"},
}


@dataclass
class Header:
    """What a header says, axes as in the file, the fastest first."""

    sizes: tuple
    dtype: str
    files: list  #: (path, first byte, or None: its end, bytes of voxels that belong there)
    encoding: str = "raw"  #: or "gzip", "zlib", "bzip2", "text"
    spacing: tuple | str | None = None  #: lengths of voxels [m], if stated, or what is stated
    exact: bool = field(default=False)  #: the file of voxels holds nothing else
    letters: str = ""  #: of the directions that axes run along, "" where none are stated
    lines: tuple = ()  #: on directions that are taken otherwise

    def run_along(self, directions, path):
        """Take a direction for each axis, a vector (x, y, z), or None of one that has none.

        Axes that run along z, y, x instead of x, y, z are said by ``letters``; those that run
        backwards, or at an angle, by ``lines``.

        Raises:
            InputError: they are not at right angles to each other: voxels are no bricks.
        """
        given = [k for k, vector in enumerate(directions) if vector is not None]
        if len(given) != 3 or len(directions) != len(self.sizes):
            return
        D = np.array([directions[k] for k in given], dtype=float)
        lengths = np.linalg.norm(D, axis=1)
        if not (np.isfinite(D).all() and D.shape == (3, 3) and lengths.all()):
            return
        D /= lengths[:, None]
        if np.abs(D @ D.T - np.eye(3)).max() > 1e-3:
            raise InputError(
                f"image {path} has axes that are not at right angles to each other "
                f"({_vectors(D)}), expected an image resampled to bricks"
            )
        order = max(itertools.permutations(range(3)), key=lambda p: np.abs(D[range(3), p]).sum())
        letters = ["?"] * len(self.sizes)
        for k, axis in zip(given, order, strict=True):
            letters[k] = "xyz"[axis]
        self.letters = "".join(letters)
        along = D[range(3), order]
        back = sorted("xyz"[axis] for axis, cosine in zip(order, along, strict=True) if cosine < 0)
        if back not in ([], ["x", "y"]):  # both: half a turn about z, by which conventions differ
            self.lines += (f"voxels run backwards along {' and '.join(back)}: taken as stored",)
        if np.abs(along).min() < math.cos(math.radians(1)):
            self.lines += (f"axes run along {_vectors(D)}: taken along the voxels",)


def _vectors(D):
    return ", ".join("(" + ", ".join(f"{x:.3g}" for x in row) + ")" for row in D)


def read_header(path):
    """The header of a .mhd, .mha, .nrrd, .nhdr, .nii or .nii.gz file: `Header`.

    Raises:
        InputError: it cannot be understood, or voxels are no single numbers.
    """
    name = path.name.lower()
    try:
        if name.endswith((".nii", ".nii.gz")):
            header = _nifti(path)
        elif name.endswith((".nrrd", ".nhdr")):
            header = _nrrd(path)
        else:
            header = _meta(path)
    except InputError:
        raise
    except (ValueError, KeyError, IndexError, struct.error) as error:
        text = f"{type(error).__name__}: {' '.join(str(error).split())}"
        raise InputError(f"image {path}: header cannot be understood: {text}") from error
    if not 1 <= len(header.sizes) <= 16 or min(header.sizes) < 1:
        raise InputError(f"image {path} has shape {header.sizes[::-1]}, expected (z, y, x)")
    return header


def check_bytes(path, header):
    """Raise InputError unless all bytes are there that the header speaks of.

    What is compressed is unpacked in blocks, and not kept.
    """
    for file, first, expected in header.files:
        check_regular(file, path)
        size = file.stat().st_size
        if header.encoding == "raw":
            found = size - (first or 0)
            wrong = found != expected if header.exact and first is not None else found < expected
        else:
            found = _num_unpacked(file, first or 0, header, expected)
            wrong = found < expected
        if wrong:
            raise InputError(
                f"image {path}: {file.name} has {found} bytes of voxels, expected {expected} = "
                f"{' x '.join(map(str, header.sizes[::-1]))} voxels of "
                f"{np.dtype(header.dtype)}{'' if len(header.files) == 1 else ' in all files'}"
            )


def _num_unpacked(file, first, header, expected):
    """Bytes that a compressed file unpacks to, no more than some beyond ``expected``."""
    if header.encoding == "text":
        with open(file, "rb") as stream:
            stream.seek(first)
            words, last = 0, b""
            while block := stream.read(BLOCK):
                text = last + block
                cut = max(text.rfind(b" "), text.rfind(b"\n")) + 1
                words += len(text[:cut].split())
                last = text[cut:]
        return (words + len(last.split())) * np.dtype(header.dtype).itemsize
    found = 0
    with open(file, "rb") as stream:
        stream.seek(first)
        if header.encoding == "zlib":
            unpack = zlib.decompressobj()
            while not unpack.eof and found <= expected:
                block = unpack.unconsumed_tail or stream.read(BLOCK)
                if not block:
                    break
                found += len(unpack.decompress(block, BLOCK))
            return found
        with (gzip if header.encoding == "gzip" else bz2).open(stream) as unpacked:
            # A little beyond: the end of the stream holds its checksum.
            while found <= expected + BLOCK and (block := unpacked.read(BLOCK)):
                found += len(block)
    return found


def _text(line):
    try:
        return line.decode("utf-8")
    except UnicodeDecodeError:
        return line.decode("latin-1")


# --- MetaImage ----------------------------------------------------------------------------


def _meta(path):
    with open(path, "rb") as file:
        values, first = {}, 0
        while line := file.readline(LONGEST):
            first += len(line)
            key, equals, value = _text(line).partition("=")
            if not equals or first > LONGEST:
                raise ValueError(f"a line without = after {first} bytes")
            values[key.strip()] = value.strip()
            if key.strip() == "ElementDataFile":
                break
        else:
            raise ValueError("no ElementDataFile")
        rest = _text(file.read(LONGEST)).splitlines()
    if int(values.get("ElementNumberOfChannels", 1)) != 1:
        number = values["ElementNumberOfChannels"]
        raise InputError(f"image {path} has {number} numbers a voxel, expected one")
    sizes = tuple(map(int, values["DimSize"].split()))
    if len(sizes) != int(values["NDims"]):
        raise ValueError(f"NDims = {values['NDims']}, DimSize = {values['DimSize']}")
    dtype = META_TYPES[values["ElementType"].removeprefix("MET_")]
    encoding = "raw"
    if values.get("BinaryData", "True").lower()[:1] in "f0":
        encoding = "text"
    elif values.get("CompressedData", "False").lower()[:1] in "t1":
        encoding = "zlib"
    total, where = math.prod(sizes) * np.dtype(dtype).itemsize, values["ElementDataFile"]
    skip = int(values.get("HeaderSize", 0))
    if where.upper() == "LOCAL":
        files, exact = [(path, first, total)], False
    else:
        names, exact = [where], True
        if where.upper().startswith("LIST"):
            names = [line.strip() for line in rest if line.strip()]
        elif "%" in where:
            words = where.split()
            numbers = [int(word) for word in words[1:]] + [1][len(words) - 3 :]
            names = [words[0] % k for k in range(numbers[0], numbers[1] + 1, numbers[2])]
        start = None if skip < 0 else skip
        files = [(path.parent / name, start, total // len(names)) for name in names]
    spacing = None
    for key in ("ElementSpacing", "ElementSize"):
        if key in values and spacing is None:
            unit = values.get("DistanceUnits", "mm")
            spacing = _known([float(word) for word in values[key].split()], [unit] * len(sizes),
                             "DistanceUnits" in values)  # fmt: skip
    header = Header(sizes, dtype, files, encoding, spacing, exact)
    for key in ("TransformMatrix", "Orientation", "Rotation"):
        if len(matrix := [float(word) for word in values.get(key, "").split()]) == 9:
            header.run_along([matrix[k : k + 3] for k in (0, 3, 6)], path)
            break
    else:
        names = values.get("AnatomicalOrientation", "").upper()
        sides = [side for name in names for side in range(3) if name in ("RL", "AP", "IS")[side]]
        if len(names) == 3 and sorted(sides) == [0, 1, 2]:
            header.run_along(np.eye(3)[sides], path)
    return header


# --- NRRD ---------------------------------------------------------------------------------


def _nrrd(path):
    with open(path, "rb") as file:
        first = len(line := file.readline(LONGEST))
        if not line.startswith(b"NRRD"):
            raise ValueError(f"begins with {line[:8]!r}")
        values, names = {}, None
        while (line := file.readline(LONGEST)).strip():
            first += len(line)
            if first > LONGEST:
                raise ValueError(f"no end after {first} bytes")
            text = _text(line).strip()
            if names is not None:
                names.append(text)
                continue
            key, colon, value = text.partition(":")
            if text.startswith("#") or not colon or value.startswith("="):
                continue
            values[key.strip().lower()] = value.strip()
            if key.strip().lower() in ("data file", "datafile") and value.split()[0] == "LIST":
                names = []
        first += len(line)
    sizes = tuple(map(int, values["sizes"].split()))
    if len(sizes) != int(values["dimension"]):
        raise ValueError(f"dimension: {values['dimension']}, sizes: {values['sizes']}")
    dtype = NRRD_TYPES[values["type"]]
    encoding = {
        **{"raw": "raw", "gzip": "gzip", "gz": "gzip", "bzip2": "bzip2", "bz2": "bzip2"},
        **dict.fromkeys(("text", "txt", "ascii"), "text"),
    }[values["encoding"].lower()]
    total = math.prod(sizes) * np.dtype(dtype).itemsize
    skip = int(values.get("byte skip", values.get("byteskip", 0)))
    lines = int(values.get("line skip", values.get("lineskip", 0)))
    if lines:
        raise InputError(f"image {path}: line skip: {lines}, expected none")
    where = values.get("data file", values.get("datafile"))
    start = None if skip < 0 else skip
    if where is None:
        files = [(path, None if skip < 0 else first + skip, total)]
    else:
        if names is None:
            names, words = [where], where.split()
            if "%" in where:
                begin, end, step = map(int, words[1:4])
                names = [words[0] % k for k in range(begin, end + 1, step)]
        files = [(path.parent / name, start, total // len(names)) for name in names]
    vectors = _nrrd_vectors(values)
    spacing = _nrrd_spacing(values, vectors, len(sizes))
    header = Header(sizes, dtype, files, encoding, spacing)
    names = [name.strip().lower() for name in _quoted(values.get("labels", ""))]
    if vectors is not None:
        header.run_along([vector or None for vector in vectors], path)
    elif len(names) == len(sizes) and all(len(name) == 1 for name in names):
        header.letters = "".join(names)
    return header


def _nrrd_vectors(values):
    """Vectors along the axes; [] of one without a direction; None where there are none."""
    if "space directions" not in values:
        return None
    vectors = values["space directions"].replace("none", "()").split(")")[:-1]
    return [[float(x) for x in vector.strip(" (").split(",") if x] for vector in vectors]


def _nrrd_spacing(values, vectors, num_axes):
    """Lengths of voxels [m], a text, or None."""
    stated = [part.strip().strip('"').strip() for part in _quoted(values.get("units", ""))]
    if vectors is not None:
        lengths = [math.hypot(*vector) or math.nan for vector in vectors]
        if "space units" in values:
            stated = [part.strip().strip('"').strip() for part in _quoted(values["space units"])]
            # Units are those of the space, which has no axis for what has no direction.
            units = iter(stated)
            stated = ["" if math.isnan(x) else next(units, "") for x in lengths]
    elif "spacings" in values:
        lengths = [float(word) for word in values["spacings"].split()]
    else:
        return None
    if len(lengths) != num_axes:
        return None
    stated = [text for text in stated if text] and stated
    if not stated:
        return _known(lengths, ["mm"] * num_axes, False)
    return _known(lengths, stated, True)


def _quoted(text):
    """Texts in quotes, or words where there are none."""
    return text.split('"')[1::2] if '"' in text else text.split()


# --- NIfTI --------------------------------------------------------------------------------


def _nifti(path):
    packed = path.name.lower().endswith(".gz")
    try:
        with (gzip.open if packed else open)(path, "rb") as file:
            data = file.read(540)
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"image {path} cannot be read: {error}") from error
    order = "<" if data[:4] in (struct.pack("<i", 348), struct.pack("<i", 540)) else ">"
    kind = struct.unpack(f"{order}i", data[:4])[0]
    if kind == 348:
        dim = struct.unpack(f"{order}8h", data[40:56])
        code = struct.unpack(f"{order}h", data[70:72])[0]
        pixdim = struct.unpack(f"{order}8f", data[76:108])
        first, unit, magic = int(struct.unpack(f"{order}f", data[108:112])[0]), data[123], b"n+1"
        found = data[344:347]
    elif kind == 540:
        dim = struct.unpack(f"{order}8q", data[16:80])
        code = struct.unpack(f"{order}h", data[12:14])[0]
        pixdim = struct.unpack(f"{order}8d", data[104:168])
        first = struct.unpack(f"{order}q", data[168:176])[0]
        unit, magic = struct.unpack(f"{order}i", data[500:504])[0], b"n+2"
        found = data[4:7]
    else:
        raise ValueError(f"length of the header is {kind}")
    if found != magic or first < kind:
        raise ValueError(f"begins with {found!r}, voxels from byte {first}")
    if code not in NIFTI_TYPES:
        raise InputError(f"image {path} has voxels of type {code}, expected single numbers")
    if not 1 <= dim[0] <= 7:
        raise ValueError(f"{dim[0]} axes")
    sizes = dim[1 : 1 + dim[0]]
    if min(sizes) < 1:
        raise InputError(f"image {path} has shape {sizes[::-1]}, expected (z, y, x)")
    total = math.prod(sizes) * np.dtype(NIFTI_TYPES[code]).itemsize
    known = {1: "m", 2: "mm", 3: "um"}.get(unit & 7, "")
    spacing = _known([abs(x) for x in pixdim[1 : 1 + dim[0]]], [known] * dim[0], (unit & 7) != 2)
    encoding = "gzip" if packed else "raw"
    start, expected = (0, first + total) if packed else (first, total)
    header = Header(sizes, NIFTI_TYPES[code], [(path, start, expected)], encoding, spacing)
    none = [None] * (dim[0] - 3)
    if kind == 348:
        codes = struct.unpack(f"{order}2h", data[252:256])
        quaternion, rows = struct.unpack(f"{order}3f", data[256:268]), data[280:328]
        rows = np.frombuffer(rows, f"{order}f4").reshape(3, 4)
    else:
        codes = struct.unpack(f"{order}2i", data[344:352])
        quaternion, rows = struct.unpack(f"{order}3d", data[352:376]), data[400:496]
        rows = np.frombuffer(rows, f"{order}f8").reshape(3, 4)
    if codes[1] > 0:
        header.run_along([*rows[:, :3].T, *none], path)
    elif codes[0] > 0:
        header.run_along([*_turned(quaternion, pixdim[0]), *none], path)
    return header


def _turned(bcd, hand):
    """Directions of the axes by the quaternion of a NIfTI header; a negative hand turns z round."""
    a = math.sqrt(max(0.0, 1.0 - sum(x * x for x in bcd)))
    matrix = scipy.spatial.transform.Rotation.from_quat([*bcd, a]).as_matrix()
    return (matrix * [1, 1, -1 if hand < 0 else 1]).T


def _known(lengths, units, stated):
    """Lengths in metres; a text where a unit is not known; None where one was "no spacing".

    Args:
        lengths: Along each axis; those along further axes may be anything.
        units: Their units by name; "" of axes that have none.
        stated: Whether the file names the unit itself.
    """
    if len(lengths) != len(units) or not (stated or set(lengths[:3]) != {1.0}):
        return None
    factors = [metres(unit) for unit in units]
    if None in factors[:3]:
        words = (f"{x:.6g} {u}".strip() for x, u in zip(lengths[:3], units[:3], strict=True))
        return " x ".join(words) if any(units[:3]) else None
    return tuple(x * (1e-3 if f is None else f) for x, f in zip(lengths, factors, strict=True))
