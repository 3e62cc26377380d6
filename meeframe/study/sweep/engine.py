"""The engine of sweeps and studies: many cases on shared reduced systems, each solved once and kept at once."""

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
    """A pool that solves points, in this process or in others."""

    @abstractmethod
    def solve(self, points: Sequence[Point], systems: Path, progress: Progress) -> Iterator[tuple[Point, Outcome]]:
        """Solve points and yield the outcome of each as it comes; systems: folder of reduced systems, as in
        meeframe.model.cache. Points that share bodies share their reduced systems."""


@final
@dataclass(frozen=True)
class InProcess(Pool):
    """One point after the other, in this process with all its threads."""

    def solve(self, points: Sequence[Point], systems: Path, progress: Progress) -> Iterator[tuple[Point, Outcome]]:
        """Solve points as Pool.solve does, and report the progress of reductions."""
        for bodies, group in grouped(points):
            yield from _solve_group(bodies, group, systems, progress)


def _solve_group(
    bodies: Keyed, group: Sequence[Point], systems: Path, progress: Progress
) -> Iterator[tuple[Point, Outcome]]:
    """Solve points that share bodies, then release their reduced systems."""
    try:
        made = {key: cached_body(*body, systems, progress, key) for key, body in bodies}
    except (MeeframeError, MemoryError) as error:
        outcome = Outcome.without_result(error)
        yield from ((point, outcome) for point in group)
        return
    for point in group:
        assert point.case is not None
        yield point, solved(point.case, (made[key] for key, _ in bodies))


def grouped(points: Sequence[Point]) -> list[tuple[Keyed, list[Point]]]:
    """Return the points with a case by the bodies that they share, in the order in which these first appear."""
    groups: dict[tuple[str, ...], tuple[Keyed, list[Point]]] = {}
    for point in points:
        if point.case is not None:
            keyed = tuple((system_key(*body), body) for body in bodies_of(point.case))
            groups.setdefault(tuple(key for key, _ in keyed), (keyed, []))[1].append(point)
    return list(groups.values())


@contextmanager
def pool_of(
    workers: int | None = 1, scheduler: str | None = None, plugins: Sequence[Path] = (), threads: int | None = None
) -> Iterator[Pool]:
    """Return this process for one worker, otherwise as many local processes, or the workers of a Dask cluster.

    Local processes have one thread each; they leave theirs to the first reduced systems, for which all of them wait.
    workers: None: one for each core, or for each of the threads; scheduler: address of the cluster's scheduler, in
    place of local processes; plugins: local files whose classes the cases may hold, which the workers get to know;
    threads: of this process, or of the local ones together; None: all that it has, or one for each.
    Raises CaseError if a scheduler is given with workers or threads, for fewer than one worker, for fewer threads than
    workers, for a scheduler that does not answer, or without Dask.
    """
    if scheduler is not None and workers is not None:
        raise CaseError(f"workers = {workers} and scheduler = {scheduler}: allowed: one of them")
    if scheduler is not None and threads is not None:
        raise CaseError(
            f"threads = {threads} and scheduler = {scheduler}: allowed: one of them, its workers have theirs"
        )
    if scheduler is not None and not scheduler.strip():
        raise CaseError(f"scheduler = {scheduler!r}: allowed: the address of a running one, such as tcp://host:8786")
    count = min(threads or cores(), cores()) if workers is None else workers
    if count < 1:
        raise CaseError(f"workers = {count}: allowed: 1 or more")
    if threads is not None and threads < count:
        raise CaseError(f"threads = {threads} and workers = {count}: allowed: a thread or more for each worker")
    if scheduler is None and count == 1:
        with limited(threads):
            yield InProcess()
        return
    from meeframe.study.sweep.dask import cluster

    with cluster(count, scheduler, plugins, threads or count) as pool:
        yield pool


def cores() -> int:
    """Return the cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def solve_points(
    points: Sequence[Point], pool: Pool, systems: Path, store: Path | None = None, progress: Progress = silent
) -> Iterator[tuple[str, Outcome]]:
    """Return the outcome of each point by its key, as it comes; points of the same key are one.

    systems: folder of reduced systems; store: folder in which each outcome is kept as soon as there is one, under its
    key, and found again. Progress counts points. Raises ResultError if either cannot be written.
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
    """Return what is known of a point without solving it."""
    if point.case is None:
        status = PointStatus.FAILED if point.faulty else PointStatus.REFUSED
        return Outcome(status, "; ".join(map(str, point.problems)))
    return None if store is None else read_outcome(store / point.key)
