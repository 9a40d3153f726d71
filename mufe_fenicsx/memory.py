"""Memory of the process: what it holds, and giving back what it no longer needs."""

import ctypes
import resource
import sys
from pathlib import Path

from mpi4py import MPI

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
    """Memory of all ranks together now [bytes]. Collective.

    What each rank has of its own is added; what ranks of one machine share, the code of libraries
    above all, counts once for each machine. Where the system does not tell these apart,
    :func:`peak_memory`.
    """
    resident = _resident()
    if comm.allreduce(resident is None, op=MPI.LOR):
        return peak_memory(comm)
    return _together(comm, *resident)


def peak_memory(comm):
    """Largest resident memory of the ranks so far, together [bytes]. Collective.

    Ranks need not be largest at one moment. What they share counts once for each machine, as it is
    now; where the system does not tell, once for each rank.
    """
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    # Linux counts in KiB, macOS in bytes.
    peak = peak if sys.platform == "darwin" else peak * 1024
    _, files, shared = _resident() or (0, 0, 0)
    return _together(comm, peak - files - shared, files, shared)


def _resident():
    """Memory of its own, mapped from files and shared of this rank [bytes], or None. Local."""
    status = Path("/proc/self/status")
    if not status.exists():
        return None
    sizes = {}
    for line in status.read_text().splitlines():
        name, _, value = line.partition(":")
        if name in ("RssAnon", "RssFile", "RssShmem"):
            sizes[name] = int(value.split()[0]) * 1024
    return tuple(sizes[name] for name in ("RssAnon", "RssFile", "RssShmem")) if sizes else None


def _together(comm, own, files, shared):
    machine = comm.Split_type(MPI.COMM_TYPE_SHARED)
    total = machine.allreduce(own) + machine.allreduce(files, op=MPI.MAX)
    total += machine.allreduce(shared, op=MPI.MAX)
    total = comm.allreduce(total if machine.rank == 0 else 0)
    machine.Free()
    return total
