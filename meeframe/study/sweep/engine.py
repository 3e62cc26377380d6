"""Engine of sweeps and studies: solves many cases on shared reduced systems and stores each outcome at once."""

import os
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import final

from meeframe.common.errors import CaseError, MeeframeError
from meeframe.formulations.base import Formulation
from meeframe.mesh.body import Body
from meeframe.model.cache import cached_body, system_key
from meeframe.model.solve import bodies_of
from meeframe.model.threads import limited
from meeframe.study.sweep.points import Outcome, Point, PointStatus, read_outcome, solved, write_outcome
from meeframe.system.reduced import Progress, silent

Keyed = tuple[tuple[str, tuple[Formulation, Body]], ...]
"""Bodies of a case, each with the key of its reduced system."""


class Pool(ABC):
    """Abstract pool that solves points, in this process or in others."""

    @abstractmethod
    def solve(self, points: Sequence[Point], systems: Path, progress: Progress) -> Iterator[tuple[Point, Outcome]]:
        """Solve points and yield each outcome when it is available.

        Points that share bodies share their reduced systems.

        Parameters
        ----------
        points
            Points to solve.
        systems
            Folder of reduced systems, as in `meeframe.model.cache`.
        progress
            Called with the stage and the fraction of it that is done.

        Yields
        ------
        tuple of Point and Outcome
            Each point with its outcome, in any order.
        """


@final
@dataclass(frozen=True)
class InProcess(Pool):
    """Pool that solves one point after the other in this process with all its threads."""

    def solve(self, points: Sequence[Point], systems: Path, progress: Progress) -> Iterator[tuple[Point, Outcome]]:
        """Solve points as Pool.solve does, and report the progress of reductions."""
        for bodies, group in grouped(points):
            yield from _solve_group(bodies, group, systems, progress)


def _solve_group(
    bodies: Keyed, group: Sequence[Point], systems: Path, progress: Progress
) -> Iterator[tuple[Point, Outcome]]:
    """Solve points that share bodies, then release their reduced systems."""
    try:
        reduced = {key: cached_body(*body, systems, progress, key) for key, body in bodies}
    except (MeeframeError, MemoryError) as error:
        outcome = Outcome.without_result(error)
        yield from ((point, outcome) for point in group)
        return
    for point in group:
        assert point.case is not None
        yield point, solved(point.case, (reduced[key] for key, _ in bodies))


def grouped(points: Sequence[Point]) -> list[tuple[Keyed, list[Point]]]:
    """Group the points that have a case by their bodies, in order of first appearance."""
    groups: dict[tuple[str, ...], tuple[Keyed, list[Point]]] = {}
    for point in points:
        if point.case is not None:
            bodies_by_key = tuple((system_key(*body), body) for body in bodies_of(point.case))
            groups.setdefault(tuple(key for key, _ in bodies_by_key), (bodies_by_key, []))[1].append(point)
    return list(groups.values())


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
    from meeframe.study.sweep.dask import cluster

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
        progress("points", done / total)
        yield point.key, outcome


def _known(point: Point, store: Path | None) -> Outcome | None:
    """Return the outcome of a point that needs no solution, else None."""
    if point.case is None:
        status = PointStatus.FAILED if point.faulty else PointStatus.REFUSED
        return Outcome(status, "; ".join(map(str, point.problems)))
    return None if store is None else read_outcome(store / point.key)
