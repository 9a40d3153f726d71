"""C sources of the kernels, compiled at their first use for the processor at hand.

A compiler is there wherever DOLFINx works, since it compiles forms. What it made is kept in
the user's cache folder, one file for each state of source, options and processor: another compiler
later changes no results, and nodes without one share what was made.
"""

import contextlib
import ctypes
import hashlib
import json
import os
import shutil
import subprocess
import tempfile
from functools import cache
from operator import is_
from pathlib import Path

import llvmlite.binding
import numpy as np

from ...errors import InputError
from .cache_files import read_sealed, write_sealed
from .pair_rows import HEADER
from .turns import end_turn, take_turn

#: What there is to load, with options of its own.
SOURCES = {
    "tets": (),
    "tets_stiffness": (),
    "pairs": (),
    "walls": (),
    # What pierces what hangs on products that cancel.
    "edges": ("-ffp-contract=off",),
    "tangents": (),
    "cracks": (),
    # A product that is added in one rounding would give other bits than kernels of numba do.
    "kick_drift": ("-ffp-contract=off",),
}
#: Not one that changes results between two runs on one processor.
OPTIONS = (
    "-O2",
    "-march=native",
    "-ffp-contract=fast",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fno-schedule-insns2",
)


@cache
def load(name, *more_options):
    """The library made of the C source ``name``. Local.

    Args:
        name: File name without its ending.
        more_options: For the compiler, after :data:`OPTIONS` and those of the source.

    Raises:
        InputError: There is no C compiler, or it fails.
    """
    options = [*OPTIONS, *SOURCES[name], *more_options]
    library, made_for = _place(name, options)
    found = _opened(library, made_for)
    if found is None:
        take_turn(library)
        try:
            found = _opened(library, made_for) or _made(_source(name), options, library, made_for)
        finally:
            end_turn(library)
    return found


def are_kept():
    """Whether the libraries of all sources have been made."""
    return all(_place(name, [*OPTIONS, *SOURCES[name]])[0].exists() for name in SOURCES)


def _folder():
    """Of all sources, in rooms."""
    return Path(__file__).parents[1]


def _source(name):
    return next(_folder().rglob(f"{name}.c"))


def _place(name, options):
    """File of a library, and what it says at its end that it was made for."""
    source = _source(name)
    read = [source, *sorted(_folder().rglob("*.h"))]
    texts = (path.read_text(encoding="utf-8") for path in read)
    state = [*texts, HEADER, *options, _processor()]
    key = hashlib.sha256("\0".join(state).encode()).hexdigest()[:20]
    made_for = json.dumps({"library": f"{name}-{key}", "processor": _processor()}).encode()
    return cache_folder() / f"{name}-{key}.so", made_for


def _made(source, options, library, made_for):
    """A library that is compiled, and kept where that is possible."""
    code, found = _compiled(source, options) + _NOTE + made_for, None
    try:
        # Where processes make one each, the last to rename it wins: all are alike.
        write_sealed(library, code)
        found = _opened(library, made_for)
    except OSError:  # a disk that is full: it is kept for this process alone
        pass
    if found is None:
        with tempfile.TemporaryDirectory(prefix="mufe_fenicsx-") as folder:
            write_sealed(Path(folder) / library.name, code)
            found = ctypes.CDLL(str(Path(folder) / library.name))
    return found


#: Stands between a library and what it was made for, at the end of its file.
_NOTE = b"\nmufe made for "


def _opened(library, made_for):
    """A library that is whole and was made for this source and processor, or None."""
    content = read_sealed(library)
    if content is None or not content.endswith(_NOTE + made_for):
        return None
    try:
        return ctypes.CDLL(str(library))
    except OSError:  # made with another C library
        return None


def _compiled(source, options):
    """Bytes of the library that the compiler makes of a source."""
    compiler = _compiler()
    with tempfile.TemporaryDirectory(prefix="mufe_fenicsx-") as folder:
        made = Path(folder) / "made.so"
        (Path(folder) / "pair_rows.h").write_text(HEADER, encoding="utf-8")
        rooms = sorted({str(path.parent) for path in _folder().rglob("*.h")})
        places = [word for place in (folder, *rooms) for word in ("-I", place)]
        command = [compiler, *options, *places, "-shared", "-fPIC", str(source)]
        command += ["-o", str(made), "-lm"]
        done = subprocess.run(  # noqa: S603  the user's compiler and our own words, no shell
            command, capture_output=True, text=True, errors="replace"
        )
        if done.returncode or not made.is_file():
            raise InputError(
                f"{' '.join(command)} failed: {done.stderr.strip()[-400:]}; expected GCC or clang "
                "in PATH or in the variable CC"
            )
        return made.read_bytes()


def _compiler():
    for name in os.environ.get("CC", "").split()[:1] or ["cc", "gcc", "clang"]:
        if found := shutil.which(name):
            return found
    raise InputError("C compiler = none in PATH, expected GCC or clang, which DOLFINx needs too")


def _processor():
    features = llvmlite.binding.get_host_cpu_features().flatten()
    return f"{llvmlite.binding.get_host_cpu_name()} {features}"


def cache_folder():
    """The user's own folder of what the program compiles; it is made."""
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = base / "mufe_fenicsx"
    with contextlib.suppress(OSError):
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    return folder


class Pointers:
    """Addresses of arrays, as a C function that takes a struct of pointers wants them.

    Args:
        *arrays: Contiguous arrays and their types, in the order of the struct: (array, dtype); None
            for a pointer to nothing. Kept, for what C holds on to must stay where it is.

    Raises:
        ValueError: An array is of another type, or not contiguous.
    """

    def __init__(self, *arrays):
        self._arrays = arrays
        self.table = (ctypes.c_void_p * len(arrays))(
            *(None if pair is None else address(*pair) for pair in arrays)
        )


def address(array, dtype=np.float64):
    """Address of the numbers of a contiguous array of that type."""
    if array.dtype != dtype or not array.flags.c_contiguous:
        raise ValueError(f"array of {array.dtype}, expected contiguous {np.dtype(dtype)}")
    return array.ctypes.data


class Addresses:
    """Addresses of the arrays of one call after another, looked up only where these change.

    Args:
        *dtypes: Their types.
    """

    def __init__(self, *dtypes):
        self._dtypes = dtypes
        self._arrays, self._addresses = (None,) * len(dtypes), ()

    def __call__(self, *arrays):
        """Addresses of contiguous arrays of those types; ValueError as of :func:`address`."""
        if not all(map(is_, arrays, self._arrays)):
            self._addresses = tuple(map(address, arrays, self._dtypes))
            self._arrays = arrays
        return self._addresses
