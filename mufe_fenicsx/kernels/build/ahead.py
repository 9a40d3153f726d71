"""What a first run needs is compiled by a second process beside it: C sources and late loops.

A run with empty caches compiles what it needs where it meets it, for most of a minute. The second
process begins at the end, and they meet: who is first at a loop or source makes it, and the other
one waits and finds it made (:mod:`.turns`). Whatever happens to the second process, the run makes
itself what is missing.
"""

import atexit
import contextlib
import gc
import importlib
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path
from threading import Thread

import numba

from .cache_files import SealedCacheFile
from .native import SOURCES, are_kept, load

#: Loops by their modules, and types of their arguments: d and f are floating-point numbers of 8 and
#: 4 bytes, l and i integers, b whether; with a digit arrays of so many dimensions, with an s parts
#: of other arrays; with a star tuples. From the last that the set-up of a test needs to the first;
#: below, those of its first steps and of its results. What is not here is compiled by the run.
LOOPS = {
    "element_step.add_nodal_stiffness": "d1 d2 i2 l1 l1 d1",
    "lanczos.add": "d2 d d2",
    "lanczos.subtract": "d2 d d2 d",
    "lanczos.weigh": "d2 d2 d2 d2 d",
    "springs.add_springs": "d2 d2 i2 d2 d2 d1 d1",
    "lanczos.square": "d2 d2",
    "lanczos.begin": "d2 d2 d2",
    "spring_lists.list_pairs": ("i2 d2 d2 d1 d1 l1 i1 i1 l1 i2 d2s d2s b1s d1s d1 d1 d1 d1 d1 d1"),
    "motion.moments": "d2 d2 d2",
    "motion_bounds.advance_bounds": "d1 d1 i1 i1 d1 d d",
    "motion.largest_move": "d2 d2",
    "points.place_points": "d2 i1 i2 d2",
    "edge_compliance.add_edge_compliance": ("d1 d2 d2 l1 l1 l1 l1 i2 d2 d2 i2 l1 i1 i1 d1 d1 d1 b"),
    "edge_compliance.largest_patch": "l1 l1 i2 i2 l1 i1 b",
    "edge_compliance.cells_around": "i2 l",
    "rigid.set_axes": "d3 d2",
    "element_step.element_time_step": "d2 i2 l1 l1 d1",
    "gaps.find_gaps": "d1 d2 d2 d2 l1 i1 i2 d2 i2 l1 i1",
    "boxes.boxes_of_groups": "d2 i1 i1 l",
    "walls.farthest": "d2 d2",
    "walls.find_wall_candidates": "d2 b2 d2 d2 d1 d",
    "edge_search.find_edge_pairs": "d2 i2 i1 i1 l d d1 d l*3 l1 i1",
    # After the set-up.
    "energy.kinetic_energy": "d2 d2 d d d1 l2",
    "energy.elastic_energy": "d1 d2 d2 i2 d1 l1 l1 i1 l1 d1 d1 d1 d1 d1 l",
    "neo_hooke.add_neo_hookean_energy": "d1 d2 d2 i2 d1 l1 l1 d1",
    "patches.join_points": "l1 l1 l2 l",
    "patches.heights_over_facets": "d2 d2 i2 d2 i2",
    "patches.terms_of_points": "d2 b1 b1 d1 d1 d2 i2 d2 d2 i1 l1 i2 d2",
    "motion.half_kick_and_drift": "d2 d2 d2 d2 d2 d2 l2 d d d2 d1",
    "motion.advance": "d2 d2 d2 d2 d2 d",
    "walls.motion_to_walls": "d1 d2 d2 d2 d1 d2 d3 d1 d",
}
_KINDS = {
    "d": numba.float64, "f": numba.float32, "l": numba.int64, "i": numba.int32, "b": numba.boolean
}  # fmt: skip


@cache
def compile_ahead():
    """Begin to compile in a second process what is not kept yet; once in a process. Local.

    Returns:
        The process, or None where all is kept, or no process can begin.
    """
    if numba.config.DISABLE_JIT or is_kept():
        return None
    folders = [str(Path(__file__).parents[3]), os.environ.get("PYTHONPATH", "")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, folders))}
    nothing = subprocess.DEVNULL
    try:
        scratch = tempfile.mkdtemp(prefix="mufe_fenicsx-")
        process = subprocess.Popen(  # noqa: S603  this Python and our own words, no shell
            [sys.executable, "-m", __name__], env=environment | {"TMPDIR": scratch},
            stdin=nothing, stdout=nothing, stderr=nothing, start_new_session=True,
        )  # fmt: skip
    except OSError:  # too many processes, a full disk: the run compiles alone
        return None
    atexit.register(_end, process, scratch)
    return process


def is_kept():
    """Whether all that is listed here has been compiled."""
    return are_kept() and not any(map(_is_absent, LOOPS))


def _end(process, scratch):
    """End the process, the compilers that it started, and what they left."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    shutil.rmtree(scratch, ignore_errors=True)


def _is_absent(name):
    _loop(name)
    return SealedCacheFile.files[name].is_empty()


def _loop(name):
    module, function = name.split(".")
    room = next(Path(__file__).parents[1].rglob(f"{module}.py")).parent.name
    kernels = __package__.rpartition(".")[0]
    return getattr(importlib.import_module(f"{kernels}.{room}.{module}"), function)


def types_of(words):
    """Types of numba in the words of :data:`LOOPS`."""
    return tuple(map(_type_of, words.split()))


def _type_of(word):
    kind, dimensions, is_part, count = re.fullmatch(r"(\w)(\d?)(s?)(?:\*(\d))?", word).groups()
    if count:
        return numba.types.UniTuple(_KINDS[kind], int(count))
    if dimensions:
        return numba.types.Array(_KINDS[kind], int(dimensions), "A" if is_part else "C")
    return _KINDS[kind]


def _compile_all():
    """The second process: sources at once, loops in their order, while the first one lives."""
    gc.disable()  # numba leaves little behind, and it ends soon
    first = os.getppid()
    sources = [Thread(target=_load, args=(name,)) for name in SOURCES]
    for source in sources:
        source.start()
    for name, words in LOOPS.items():
        if os.getppid() != first:
            break
        _loop(name).compile(types_of(words))
    for source in sources:
        source.join()


def _load(name):
    with contextlib.suppress(Exception):  # the run says what is wrong
        load(name)


if __name__ == "__main__":
    _compile_all()
