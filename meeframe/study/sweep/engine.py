"""Engine of sweeps and studies: solves many cases on shared reduced systems and stores each outcome at once."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from meeframe.common.errors import CaseError
from meeframe.model.threads import limited
from meeframe.study.sweep.points import Outcome, Point, PointStatus, read_outcome, write_outcome
from meeframe.study.sweep.pool import InProcess, Pool
from meeframe.system.reduced import Progress, silent


@contextmanager
def pool_of(
    workers: int | None = 1, scheduler: str | None = None, plugins: Sequence[Path] = (), threads: int | None = None
) -> Iterator[Pool]:
    """Create the pool for a number of workers or a scheduler.

    One worker is this process. Several workers are local processes with one thread each; all threads are used for the
    first reduced systems, for which all processes wait.

    Parameters
    ----------
    workers
        Number of local processes; None for one for each core, or for each thread if `threads` is given.
    scheduler
        Address of the scheduler of a Dask cluster to use instead.
    plugins
        Local plugin files whose classes the cases may contain; they are sent to the workers.
    threads
        Number of threads of this process, or total number for local processes. By default all threads of this process,
        or one for each local process.

    Yields
    ------
    Pool
        The pool, closed on exit.

    Raises
    ------
    CaseError
        If a scheduler is given with workers or threads, for fewer than one worker, for fewer threads than workers, for
        a scheduler that does not answer, or without Dask.
    """
    if scheduler is not None and workers is not None:
        raise CaseError(f"workers = {workers} and scheduler = {scheduler}: allowed: one of them")
    if scheduler is not None and threads is not None:
        raise CaseError(
            f"threads = {threads} and scheduler = {scheduler}: allowed: one of them; workers of a cluster set their "
            "threads"
        )
    if scheduler is not None and not scheduler.strip():
        raise CaseError(
            f"scheduler = {scheduler!r}: allowed: the address of a running scheduler, such as tcp://host:8786"
        )
    count = min(threads or cores(), cores()) if workers is None else workers
    if count < 1:
        raise CaseError(f"workers = {count}: allowed: 1 or more")
    if threads is not None and threads < count:
        raise CaseError(f"threads = {threads} and workers = {count}: allowed: at least one thread for each worker")
    if scheduler is None and count == 1:
        with limited(threads):
            yield InProcess()
        return
    from meeframe.study.sweep.dask import cluster  # an optional dependency, whose import takes long

    with cluster(count, scheduler, plugins, threads or count) as pool:
        yield pool


def cores() -> int:
    """Return the number of cores available to this process."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def solve_points(
    points: Sequence[Point], pool: Pool, systems: Path, store: Path | None = None, progress: Progress = silent
) -> Iterator[tuple[str, Outcome]]:
    """Solve distinct points and yield each outcome when it is available.

    Points with the same key are one point. Progress counts points.

    Parameters
    ----------
    points
        Points to solve.
    pool
        Pool that solves them.
    systems
        Folder of reduced systems.
    store
        Folder in which each outcome is stored at once under the key of its point, and found again.
    progress
        Called with the stage and the fraction of it that is done.

    Yields
    ------
    tuple of str and Outcome
        Key and outcome of each point.

    Raises
    ------
    ResultError
        If a folder cannot be written.
    """
    distinct = {point.key: point for point in points}
    total, done = len(distinct), 0
    waiting = []
    for key, point in distinct.items():
        outcome = _known(point, store)
        if outcome is None:
            waiting.append(point)
            continue
        done += 1
        yield key, outcome
    progress("points", done / max(total, 1))
    for point, outcome in pool.solve(waiting, systems, progress):
        if store is not None:
            write_outcome(store / point.key, outcome)
        done += 1
        yield point.key, outcome
        progress("points", done / total)  # after the outcome has been collected, as progress may be interrupted


def _known(point: Point, store: Path | None) -> Outcome | None:
    """Return the outcome of a point that needs no solution, else None."""
    if point.case is None:
        status = PointStatus.FAILED if point.faulty else PointStatus.REFUSED
        return Outcome(status, "; ".join(map(str, point.problems)))
    return None if store is None else read_outcome(store / point.key)
