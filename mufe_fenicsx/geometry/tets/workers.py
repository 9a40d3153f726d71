"""Run one function over many jobs in worker processes, some of which may die or hang."""

import contextlib
import multiprocessing
import os
import sys
import time
import types
from multiprocessing import forkserver
from multiprocessing.connection import wait

#: Workers are copies of one process that does nothing else: a copy of this one would have the
#: state of gmsh, VTK and MPI half-way.
_PROCESSES = multiprocessing.get_context("forkserver")


class WorkerError(RuntimeError):
    """Why a job has no result: its worker died or was stopped."""


def run_jobs(function, jobs, processes=0, progress=None, *, limit=None, again=None):
    """Results of ``function(job)`` in the order of the jobs.

    gmsh is one session a process; it may take its process down with it, or never come back.
    A worker that dies, or works on one job for longer than ``limit``, is replaced; its job is run
    once more, and if that fails too its result is a `WorkerError`.

    Args:
        function: Of a module that workers can import.
        jobs: Iterable; only a few jobs are held at a time.
        processes: Number of workers, at most one a job; 0: one a core.
        progress: Called with the number of finished jobs.
        limit: Time for one job [s]; None: none.
        again: Called with a job that failed; returns the job to run in its place.

    Raises:
        RuntimeError: workers die before they have loaded what they need.
        Exception: one that ``function`` raised.
    """
    processes = processes or len(os.sched_getaffinity(0))
    results, second, deaths, waiting = {}, [], 0, enumerate(jobs)
    workers = []
    try:
        while True:
            idle = [worker for worker in workers if worker.number is None]
            while idle or len(workers) < processes:
                first = not second
                number, job = second.pop() if second else next(waiting, (None, None))
                if number is None:  # no more workers than jobs
                    break
                if not idle:
                    idle = [_Worker(function)]
                    workers += idle
                idle.pop(0).start(number, job, first)
            busy = [worker for worker in workers if worker.number is not None]
            if not busy:
                return [results[number] for number in sorted(results)]
            ready = wait([worker.connection for worker in busy], _soonest(busy, limit))
            for worker in busy:
                number, error = worker.number, None
                if worker.connection in ready:
                    error = worker.collect(results)
                elif limit is not None and worker.seconds > limit:
                    error = WorkerError(f"stopped after {limit:g} s")
                if error is not None:
                    deaths += not worker.loaded
                    if deaths > processes and not any(other.loaded for other in workers):
                        raise RuntimeError(
                            f"{deaths} worker processes died while they were started, expected "
                            f"that they can import {function.__module__}"
                        )
                    if worker.first:
                        second.append((number, again(worker.job) if again else worker.job))
                    else:
                        results[number] = error
                    worker.stop()
                    workers.remove(worker)
                if progress and number in results:
                    progress(len(results))
    finally:
        for worker in workers:
            worker.stop()


def load_ahead(module):
    """Begin to load a module for the workers, beside what this process does meanwhile.

    It is loaded once, by the process that all workers are copies of. Where there is one already,
    and it loaded something else, workers load what they need.

    Args:
        module: Its full name. To import it starts no threads.
    """
    _PROCESSES.set_forkserver_preload([module])
    with _no_main_module():
        forkserver.ensure_running()


class _Worker:
    """A process and the job that it runs."""

    def __init__(self, function):
        self.connection, other = _PROCESSES.Pipe()
        self.process = _PROCESSES.Process(target=_serve, args=(function, other), daemon=True)
        with _no_main_module():
            self.process.start()
        other.close()
        self.number = self.job = None
        #: When the job began; while the process still loads its libraries: None.
        self.started = None
        self.loaded = False

    def start(self, number, job, first):
        self.number, self.job, self.first = number, job, first
        self.started = time.monotonic() if self.loaded else None
        with contextlib.suppress(OSError):  # it has died already, which `collect` will find
            self.connection.send(job)

    @property
    def seconds(self):
        return 0.0 if self.started is None else time.monotonic() - self.started

    def collect(self, results):
        """Put the result of the job into its place; an error if the process has died."""
        try:
            kind, value = self.connection.recv()
        except (EOFError, OSError):
            return WorkerError("the worker process died")
        if kind == "error":
            raise value
        if kind == "loaded":
            self.loaded, self.started = True, time.monotonic()
        else:
            results[self.number] = value
            self.number = self.job = None
        return None

    def stop(self):
        self.process.kill()
        self.process.join()
        self.connection.close()


@contextlib.contextmanager
def _no_main_module():
    """Workers do not run the user's script again, which may be without a guard for that."""
    main = sys.modules["__main__"]
    sys.modules["__main__"] = types.ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


def _soonest(busy, limit):
    """Time until the first of the busy workers has used its time up [s]."""
    if limit is None:
        return None
    return max(0.0, limit - max(worker.seconds for worker in busy)) + 0.01


def _serve(function, connection):
    """What a worker does: job after job until the pipe closes."""
    # gmsh's mesh generators write to the terminal themselves; errors arrive as exceptions.
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    with contextlib.suppress(EOFError, OSError):  # the pipe closes when nobody waits any more
        connection.send(("loaded", None))
        while True:
            job = connection.recv()
            try:
                answer = ("done", function(job))
            except Exception as error:
                answer = ("error", error)
            connection.send(answer)
