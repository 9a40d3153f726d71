"""Folders for what is compiled once and used again, where they can be written to.

The C kernels, the forms of DOLFINx and the fonts of figures are kept under XDG_CACHE_HOME, by
default ~/.cache; the loops of numba beside their sources, or where NUMBA_CACHE_DIR says. Where
these cannot be written, as in a container or without a home, a folder of this program and the ones
that it starts takes their place until it ends.
"""

import atexit
import os
import shutil
import sys
import tempfile
from pathlib import Path

#: By one of these an MPI process knows its rank.
RANKS = ("PMI_RANK", "PMIX_RANK", "OMPI_COMM_WORLD_RANK", "SLURM_PROCID")


def use_writable_caches():
    """Let caches be in folders that can be written to; says so once where another is taken."""
    temporary = None
    base = _base()
    if base is None or not _writable(base):
        temporary = _temporary(base)
        os.environ["XDG_CACHE_HOME"] = str(temporary)
        os.environ.setdefault("MPLCONFIGDIR", str(temporary / "matplotlib"))
        base = temporary
    stated = os.environ.get("NUMBA_CACHE_DIR")
    if stated:
        if not _writable(Path(stated)):
            temporary = temporary or _temporary(stated)
            os.environ["NUMBA_CACHE_DIR"] = str(temporary / "numba")
        return
    kernels = Path(__file__).resolve().parents[1] / "kernels"
    if not all(_may_write(p) for p in (kernels, kernels / "__pycache__") if p.exists()):
        os.environ["NUMBA_CACHE_DIR"] = str(base / "mufe_fenicsx" / "numba")


def _base():
    if stated := os.environ.get("XDG_CACHE_HOME"):
        return Path(stated)
    try:
        return Path.home() / ".cache"
    except RuntimeError:  # a user without a home
        return None


def _writable(folder):
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError:
        return False
    return _may_write(folder)


def _may_write(folder):
    return os.access(folder, os.W_OK | os.X_OK)


def _temporary(instead_of):
    made = Path(tempfile.mkdtemp(prefix="mufe_fenicsx-"))
    process = os.getpid()
    atexit.register(lambda: os.getpid() == process and shutil.rmtree(made, ignore_errors=True))
    if all(os.environ.get(name, "0") == "0" for name in RANKS):
        print(
            f"mufe: cache folder {instead_of or '~/.cache'} cannot be written: compiled parts are "
            f"made anew for this run, in {made}",
            file=sys.stderr,
            flush=True,
        )
    return made
