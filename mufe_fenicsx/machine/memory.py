"""Memory of the process: what it holds, and giving back what it no longer needs."""

import contextlib
import ctypes
import os
import resource
import sys
from pathlib import Path

from ..errors import InputError

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
    from mpi4py import MPI

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
    from mpi4py import MPI

    machine = comm.Split_type(MPI.COMM_TYPE_SHARED)
    total = machine.allreduce(own) + machine.allreduce(files, op=MPI.MAX)
    total += machine.allreduce(shared, op=MPI.MAX)
    total = comm.allreduce(total if machine.rank == 0 else 0)
    machine.Free()
    return total


def is_first_on_machine(comm):
    """Whether this is the first rank of its machine. Collective."""
    from mpi4py import MPI

    machine = comm.Split_type(MPI.COMM_TYPE_SHARED)
    first = machine.rank == 0
    machine.Free()
    return first


def free_memory():
    """What this process may still take [bytes]. Local.

    Files that are only cached count as free; limits of the control group and of the process
    (``ulimit -v``) count, too.
    """
    free = os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    with contextlib.suppress(OSError), open("/proc/meminfo", encoding="ascii") as file:
        for line in file:
            if line.startswith("MemAvailable:"):
                free = 1024 * int(line.split()[1])
    free = min([free, *_left_to_control_groups()])
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit != resource.RLIM_INFINITY:
        with contextlib.suppress(OSError), open("/proc/self/statm", encoding="ascii") as file:
            taken = int(file.read().split()[0]) * os.sysconf("SC_PAGE_SIZE")
            free = min(free, limit - taken)
    return max(free, 0)


def check_room(num_bytes, what, advice=""):
    """Raise InputError unless so many bytes are free; to be called before they are taken. Local.

    Args:
        num_bytes: Bytes that are wanted.
        what: Begin of the message: what would take them, and its value.
        advice: End of the message.
    """
    free = free_memory()
    if num_bytes > free:
        raise InputError(
            f"{what} takes {num_bytes / 1e9:.3g} GB, expected at most the {free / 1e9:.3g} GB of "
            f"memory that are free{advice}"
        )


def _left_to_control_groups():
    """What each control group of Linux that this process is in leaves it [bytes]."""
    left = []
    with contextlib.suppress(OSError, ValueError):
        for line in Path("/proc/self/cgroup").read_text(encoding="utf-8").splitlines():
            _, kind, name = line.split(":", 2)
            if kind not in ("", "memory"):
                continue
            root = Path("/sys/fs/cgroup") / kind
            names = ("memory.max", "memory.current")
            if kind:
                names = ("memory.limit_in_bytes", "memory.usage_in_bytes")
            folder = root / name.lstrip("/")
            for group in (folder, *folder.parents):
                with contextlib.suppress(OSError, ValueError):
                    limit, used = (int((group / n).read_text()) for n in names)
                    left.append(limit - used + _cached(group))
                if group == root:
                    break
    return left


def _cached(group):
    """Cache of files that a control group gives back when memory gets short [bytes]."""
    for line in (group / "memory.stat").read_text().splitlines():
        name, _, value = line.partition(" ")
        if name in ("inactive_file", "total_inactive_file"):
            return int(value)
    return 0
