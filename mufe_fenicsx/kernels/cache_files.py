"""What is compiled once and kept: files with a checksum, made beside, synced and renamed.

A file ends with its checksum. One that is torn, empty or changed is none, and what it held is made
again. The caches of numba are kept in the same way.
"""

import contextlib
import hashlib
import io
import os
import tempfile
from pathlib import Path

from numba.core import caching

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


class SealedCacheFile(caching.IndexDataCacheFile):
    """Index and compiled loops of a function, as numba keeps them, each file sealed.

    The index names the version of numba and the state of the source; its keys name the processor.
    Where nothing can be written, loops are compiled and not kept.
    """

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
