"""What is compiled once and kept: files with a checksum, made beside, synced and renamed.

A file ends with its checksum. One that is torn, empty or changed is none, and what it held is made
again. The caches of numba are kept in the same way.
"""

import contextlib
import hashlib
import io
import os
import re
import tempfile
from functools import cache
from pathlib import Path

from numba.core import caching

from .turns import end_turn, take_turn

#: Stands between the content and its checksum.
SIGN = b"\nmufe blake2b "
_LENGTH = len(SIGN) + 2 * 32


def seal(data):
    """Content with its checksum."""
    return data + SIGN + hashlib.blake2b(data, digest_size=32).hexdigest().encode()


def unseal(data):
    """The content, or None where the checksum is not its own."""
    content = data[:-_LENGTH]
    return content if seal(content) == data else None


def write_sealed(path, data):
    """Write content with its checksum, so that others see all of it or nothing.

    Raises:
        OSError: It cannot be written.
    """
    path = Path(path)
    handle, made = tempfile.mkstemp(prefix=path.name + ".", suffix=".part", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(seal(data))
            file.flush()
            os.fsync(file.fileno())
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(made, 0o666 & ~mask)  # as of any new file: mkstemp lets nobody else read
        os.replace(made, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(made)
        raise


def read_sealed(path):
    """The content of a file that is whole, or None."""
    try:
        return unseal(Path(path).read_bytes())
    except OSError:
        return None


#: How a file of loops names another one, in its room or in another.
_IMPORT = re.compile(
    r"^\s*from \.+(?:\w+\.)*(\w*) import (\(.*?\)|[^(\n]*)", re.MULTILINE | re.DOTALL
)


@cache
def stamp(folder, module):
    """What the loops of a module are made of: its source, and that of all that it imports.

    A compiled loop has the loops that it calls within it, and numba looks at its own file alone.

    Args:
        folder: That of the sources, in rooms.
        module: Name of a file there; of any other name, all files count.

    Returns:
        A checksum.
    """
    sources = _sources(folder)
    found, waiting = set(), [module] if module in sources else list(sources)
    while waiting:
        name = waiting.pop()
        if name in found or name not in sources:
            continue
        found.add(name)
        for parent, names in _IMPORT.findall(sources[name]):
            waiting += [parent] if parent else re.findall(r"\w+", names)
    whole = hashlib.blake2b(digest_size=16)
    for name in sorted(found):
        whole.update(f"{name}\0{sources[name]}\0".encode())
    return whole.hexdigest()


@cache
def _sources(folder):
    return {path.stem: path.read_text(encoding="utf-8") for path in Path(folder).rglob("*.py")}


class SealedCacheFile(caching.IndexDataCacheFile):
    """Index and compiled loops of a function, as numba keeps them, each file sealed.

    The index names the version of numba and the state of the source and of the loops that it may
    call; its keys name the processor. Where nothing can be written, loops are compiled and not
    kept. One process after the other compiles a function.
    """

    #: Of each function, by its module and name.
    files = {}

    def __init__(self, cache_path, filename_base, source_stamp):
        self.files[filename_base.partition("-")[0]] = self
        module = filename_base.partition(".")[0]
        own = stamp(str(Path(__file__).parents[1]), module)
        super().__init__(cache_path, filename_base, (source_stamp, own))

    def load(self, key):
        """What is kept; None, and it is this process's turn to compile, where nothing is."""
        found = super().load(key)
        if found is None:
            take_turn(self._index_path)  # until it is saved
            found = super().load(key)
            if found is not None:
                end_turn(self._index_path)
        return found

    def save(self, key, data):
        """Keep it, and let others have their turn."""
        try:
            super().save(key, data)
        finally:
            end_turn(self._index_path)

    def is_empty(self):
        """Whether nothing of the present source is kept."""
        return not self._load_index()

    def _load_index(self):
        return {} if read_sealed(self._index_path) is None else super()._load_index()

    def _load_data(self, name):
        if read_sealed(self._data_path(name)) is None:
            raise OSError(f"{name} is damaged")  # which numba takes for absent
        return super()._load_data(name)

    @contextlib.contextmanager
    def _open_for_write(self, filepath):
        content = io.BytesIO()
        yield content
        with contextlib.suppress(OSError):
            write_sealed(filepath, content.getvalue())


def seal_numba():
    """Let numba keep its caches in sealed files."""
    caching.IndexDataCacheFile = SealedCacheFile
