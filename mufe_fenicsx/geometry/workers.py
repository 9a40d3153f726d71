"""Run one function over many jobs in worker processes, some of which may die."""

import multiprocessing
import os
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool


def run_jobs(function, jobs, processes=0, progress=None):
    """Results of ``function(job)`` in the order of the jobs.

    gmsh is one session a process and may take its process down with it. The
    jobs that were running when a worker died are run again, each alone; one
    that kills its worker again has the result None.

    Args:
        function: Of a module that workers can import.
        jobs: Iterable; only a few jobs are held at a time.
        processes: Number of workers; 0: one a core.
        progress: Called with the number of finished jobs.
    """
    processes = processes or len(os.sched_getaffinity(0))
    results, suspects, running, finished, num_broken = {}, {}, {}, 0, 0
    waiting = enumerate(jobs)
    pool = _pool(processes)
    try:
        while True:
            while len(running) < 2 * processes:
                number, job = next(waiting, (None, None))
                if job is None:
                    break
                running[pool.submit(function, job)] = (number, job)
            if not running:
                break
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            broken = False
            for future in done:
                number, job = running.pop(future)
                try:
                    results[number] = future.result()
                    finished += 1
                except BrokenProcessPool:
                    suspects[number], broken = job, True
            if progress and not broken:
                progress(finished)
            if broken:
                suspects.update(running.values())
                running.clear()
                pool.shutdown(wait=False, cancel_futures=True)
                num_broken += 1
                if num_broken > 2 and not results:
                    raise RuntimeError(
                        "every worker process died; a script that starts workers has to do so "
                        'below if __name__ == "__main__":'
                    )
                pool = _pool(processes)
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
    for number, job in suspects.items():
        with _pool(1) as alone:
            try:
                results[number] = alone.submit(function, job).result()
            except BrokenProcessPool:
                results[number] = None
        finished += 1
        if progress:
            progress(finished)
    return [results[number] for number in sorted(results)]


def _pool(processes):
    # "spawn": a fork would inherit gmsh's, VTK's and MPI's state half-way.
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(processes, mp_context=context, initializer=_silence)


def _silence():
    # gmsh's mesh generators write to the terminal themselves; errors arrive as exceptions.
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
