"""Nested grids: the same contact problem on a coarser division of the zone, and a start from its solution."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.common.memoize import memoize_by_identity
from meeframe.contact.conduction import follows_gap
from meeframe.contact.problem import ContactProblem, ContactState, Iterate, PrescribedResultant
from meeframe.fields import N_MECHANICAL, Array, Indices
from meeframe.laws.base import ContactLaw, is_pure_projection
from meeframe.system.capabilities import Coarsening, Multigrid
from meeframe.system.reduced import ReducedSystem

FEWEST: Final = 16
"""Nodes of a coarser division that must be under the indenter, and overlap: on fewer a problem is another one."""
ALIKE: Final = 2.0
"""Areas and the like that differ by a smaller factor are about the same."""


@dataclass(frozen=True, eq=False)
class Coarse:
    """A problem on a coarser reduced system, and how its nodes are those of the finer one."""

    problem: ContactProblem
    coarsening: Coarsening


@memoize_by_identity
def coarse_problem(problem: ContactProblem) -> Coarse | None:
    """The problem on the coarser reduced system; None if there is none, if law or edges belong to these nodes, or if
    too little of the indenter is above the nodes that are left.
    """
    law = problem.contact_law
    if not same_everywhere(law, len(problem.gap)) or problem.area_fraction is not None:
        return None
    multigrid = problem.system.capability(Multigrid)
    coarsening = None if multigrid is None else multigrid.coarsen()
    if coarsening is None or not _still_there(problem, coarsening):
        return None
    return Coarse(on_nodes(problem, coarsening.system, coarsening.nodes), coarsening)


def on_nodes(problem: ContactProblem, system: ReducedSystem, kept: Indices) -> ContactProblem:
    """A problem on a reduced system that has m of its n nodes alone, kept: (m,).

    A resultant keeps its density: the measure of a freedom is scaled with the weights.
    """
    weights = problem.system.weights[kept]
    share = np.divide(system.weights, weights, out=np.zeros_like(weights), where=weights != 0.0)
    prescribed_resultants = tuple(  # components one after another
        PrescribedResultant(f.mode.T.take(kept, axis=1).T, (f.measure.T.take(kept, axis=1) * share).T, f.total)
        for f in problem.prescribed_resultants
    )
    arrays = {name: getattr(problem, name)[kept] for name in ("gap", "translation", "potentials")}
    area_fraction = None if problem.area_fraction is None else problem.area_fraction[kept]
    return replace(
        problem, system=system, prescribed_resultants=prescribed_resultants, area_fraction=area_fraction, **arrays
    )


def alike(one: float, other: float) -> bool:
    """Whether two numbers >= 0 are about the same; zero is like zero alone."""
    return max(one, other) <= ALIKE * min(one, other)


def same_area(system: ReducedSystem, nodes: NDArray[np.bool_], coarsening: Coarsening) -> bool:
    """Whether nodes (n,) of a system cover about the same area as those of them that a coarser division keeps."""
    kept = nodes[coarsening.nodes]
    return alike(float(system.weights[nodes].sum()), float(coarsening.system.weights[kept].sum()))


def nested_start(
    problem: ContactProblem, solution: Callable[[ContactProblem], ContactState | Iterate | None]
) -> ContactState | None:
    """A state from which to start, the interpolated load of the coarse problem; None if there is no such problem.

    solution: of a problem, as well as is worth while, or None; with tension (`tensed`) or without. The displacement is
    that of the unloaded body: whoever starts there finds his own.
    """
    coarse = coarse_problem(problem)
    found = None if coarse is None else solution(coarse.problem)
    if coarse is None or found is None:
        return None
    load = np.zeros((problem.fields.size, len(problem.gap))).T  # one field after another
    loaded = np.flatnonzero(found.load.any(axis=0))
    load[:, loaded] = coarse.coarsening.prolong(found.load[:, loaded])
    above = np.isfinite(problem.gap)
    pressed = above & (load[:, 2] < 0.0)
    for field in loaded:
        across = field >= N_MECHANICAL and follows_gap(problem)
        load[:, field] = np.where(above if across else pressed, load[:, field], 0.0)
    return ContactState(load, problem.system.offset, (load[:, 2] < 0.0).astype(float), found.motion)


def tensed(load: Array, gap: Array, own: Array | float) -> Array:
    """A load (n, 5) with a tension like the gap (n,) where contact is open: between nodes the sum of both tells where
    the contact ends. own: (n,) what nodes respond to their own pressure."""
    open_ = (load[:, 2] == 0.0) & (gap > 0.0) & np.isfinite(gap)
    load = load.copy()
    load[:, 2] = np.where(open_, gap / own, load[:, 2])
    return load


def _still_there(problem: ContactProblem, coarsening: Coarsening) -> bool:
    """Whether the coarser division sees the indenter, and how it overlaps the body unless it moves freely."""
    seen = [np.isfinite(problem.gap)]
    if all(freedom.electromagnetic for freedom in problem.prescribed_resultants):
        seen.append(problem.gap < problem.system.offset[:, 2])
    return all(
        nodes[coarsening.nodes].sum() >= FEWEST and same_area(problem.system, nodes, coarsening) for nodes in seen
    )


def same_everywhere(law: ContactLaw, n: int) -> bool:
    """Whether a law is known to be the same at all of n nodes: what laws with a memory are made of does not show."""
    return is_pure_projection(law) and not holds_nodes(law, n)


def holds_nodes(part: object, n: int) -> bool:
    """Whether a law, or what it is made of, holds an array with one entry for each of n nodes."""
    if isinstance(part, np.ndarray):
        return n in part.shape
    if isinstance(part, tuple | list):
        return any(holds_nodes(item, n) for item in part)
    if isinstance(part, Mapping):
        return any(holds_nodes(item, n) for item in part.values())
    if not is_dataclass(part):
        return False
    named = [getattr(part, field.name, None) for field in fields(part)]  # those in slots, too
    return any(holds_nodes(item, n) for item in (*named, *getattr(part, "__dict__", {}).values()))
