"""Pools that solve the points of sweeps and studies, and the pool of this process."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import final

from meeframe.common.errors import MeeframeError
from meeframe.formulations.base import Formulation
from meeframe.mesh.body import Body
from meeframe.model.cache import cached_body, system_key
from meeframe.model.solve import bodies_of
from meeframe.study.sweep.points import Outcome, Point, solved
from meeframe.system.reduced import Progress

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
