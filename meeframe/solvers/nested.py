"""Nested grids: the same contact problem on a coarser division of the zone, and a start from its solution."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from meeframe.core.contact import ContactProblem, ContactState, Freedom, Iterate
from meeframe.core.formulation import Coarsening
from meeframe.core.law import ContactLaw, attracts

Found = TypeVar("Found")


@dataclass(frozen=True, eq=False)
class Coarse:
    """A problem on a coarser reduced system, and how its nodes are those of the finer one."""

    problem: ContactProblem
    coarsening: Coarsening


def once_for_each(function: Callable[[ContactProblem], Found]) -> Callable[[ContactProblem], Found]:
    """The function, which remembers what it found for a problem as long as that lives."""
    found: WeakKeyDictionary[ContactProblem, Found] = WeakKeyDictionary()

    @wraps(function)
    def remembering(problem: ContactProblem) -> Found:
        if problem not in found:
            found[problem] = function(problem)
        return found[problem]

    return remembering


@once_for_each
def coarse_problem(problem: ContactProblem) -> Coarse | None:
    """The problem on the coarser reduced system; None if there is none, or if law or edges belong to these nodes.

    A resultant keeps its density: the measure of a freedom is scaled with the weights.
    """
    law = problem.contact_law
    if type(law).resolve is not ContactLaw.resolve or attracts(law) or problem.covered is not None:
        return None
    coarsening = problem.system.coarser()
    if coarsening is None:
        return None
    kept, system = coarsening.kept, coarsening.system
    weights = problem.system.weights[kept]
    share = np.divide(system.weights, weights, out=np.zeros_like(weights), where=weights != 0.0)[:, None]
    freedoms = tuple(Freedom(f.mode[kept], f.measure[kept] * share, f.total) for f in problem.freedoms)
    arrays = {name: getattr(problem, name)[kept] for name in ("gap", "translation", "potentials")}
    return Coarse(replace(problem, system=system, freedoms=freedoms, **arrays), coarsening)


def nested_start(
    problem: ContactProblem, solution: Callable[[ContactProblem], ContactState | Iterate | None]
) -> ContactState | None:
    """A state from which to start, the interpolated load of the coarse problem; None if there is no such problem.

    solution: of a problem, as well as is worth while, or None. The displacement is that of the unloaded body: whoever
    starts there finds his own.
    """
    coarse = coarse_problem(problem)
    found = None if coarse is None else solution(coarse.problem)
    if coarse is None or found is None:
        return None
    load = np.zeros_like(problem.system.offset)
    loaded = np.flatnonzero(found.load.any(axis=0))
    load[:, loaded] = coarse.coarsening.prolong(found.load[:, loaded])
    load[~np.isfinite(problem.gap)] = 0.0
    return ContactState(load, problem.system.offset, (load[:, 2] < 0.0).astype(float), found.motion)
