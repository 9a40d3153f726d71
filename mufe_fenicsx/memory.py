"""Memory of the process: what it holds, and giving back what it no longer needs."""

import ctypes
import resource
import sys
from pathlib import Path

#: Arrays of this size and more [bytes] return to the system as soon as they are freed.
LARGE_ARRAY = 128 * 1024
#: glibc's name of that threshold in mallopt(3).
M_MMAP_THRESHOLD = -3


def return_freed_arrays():
    """Let the C library return large arrays to the system when they are freed. Local.

    By default glibc keeps what a set-up has freed, for later arrays; a run that
    allocates nothing in its steps would hold it to the end. Does nothing where the C
    library has no such threshold.
    """
    if sys.platform == "linux":
        mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
        if mallopt is not None:
            mallopt(M_MMAP_THRESHOLD, LARGE_ARRAY)


def memory_in_use(comm):
    """Memory of all ranks of one machine together now [bytes]. Collective.

    What each rank has of its own is added; the code of libraries, which is mapped from
    files that all ranks share, counts once. Where the system does not tell these apart,
    :func:`peak_memory`.
    """
    status = Path("/proc/self/status")
    sizes = {}
    if status.exists():
        for line in status.read_text().splitlines():
            name, _, value = line.partition(":")
            if name in ("RssAnon", "RssFile", "RssShmem"):
                sizes[name] = int(value.split()[0]) * 1024
    of_ranks = comm.allgather((sizes.get("RssAnon"), sizes.get("RssFile"), sizes.get("RssShmem")))
    if None in of_ranks[0]:
        return peak_memory(comm)
    own, files, shared = zip(*of_ranks, strict=True)
    return sum(own) + max(files) + max(shared)


def peak_memory(comm):
    """Largest resident memory so far, summed over the ranks [bytes]. Collective.

    The libraries' code counts once for each rank, although ranks of one machine share it.
    """
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    # Linux counts in KiB, macOS in bytes.
    return comm.allreduce(peak if sys.platform == "darwin" else peak * 1024)
