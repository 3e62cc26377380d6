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

MIN_COARSE_NODES: Final = 16
"""Least number of coarse nodes under the indenter, and in overlap; with fewer the problem is a different one."""
ALIKE: Final = 2.0
"""Factor below which two areas, or similar quantities, count as about the same."""


@dataclass(frozen=True, eq=False)
class Coarse:
    """Contact problem on a coarser reduced system, with the relation of its nodes to those of the finer one."""

    problem: ContactProblem
    coarsening: Coarsening


@memoize_by_identity
def coarse_problem(problem: ContactProblem) -> Coarse | None:
    """Return the problem on the coarser reduced system; None if there is none.

    There is none either if the law or the contact edge belongs to these nodes, or if too little of the indenter lies
    above the remaining nodes.
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
    """Return a problem on a reduced system that consists of m of its n nodes, kept: (m,).

    The measure of a prescribed resultant is scaled with the weights, which leaves its density unchanged.
    """
    weights = problem.system.weights[kept]
    share = np.divide(system.weights, weights, out=np.zeros_like(weights), where=weights != 0.0)
    prescribed_resultants = tuple(  # component by component
        PrescribedResultant(f.mode.T.take(kept, axis=1).T, (f.measure.T.take(kept, axis=1) * share).T, f.total)
        for f in problem.prescribed_resultants
    )
    arrays = {name: getattr(problem, name)[kept] for name in ("gap", "translation", "potentials")}
    area_fraction = None if problem.area_fraction is None else problem.area_fraction[kept]
    return replace(
        problem, system=system, prescribed_resultants=prescribed_resultants, area_fraction=area_fraction, **arrays
    )


def alike(one: float, other: float) -> bool:
    """Return whether two numbers >= 0 are about the same; zero is about the same as zero only."""
    return max(one, other) <= ALIKE * min(one, other)


def same_area(system: ReducedSystem, nodes: NDArray[np.bool_], coarsening: Coarsening) -> bool:
    """Return whether a coarser division represents the area of nodes (n,) of a system about correctly."""
    kept = nodes[coarsening.nodes]
    return alike(float(system.weights[nodes].sum()), float(coarsening.system.weights[kept].sum()))


def nested_start(
    problem: ContactProblem, solution: Callable[[ContactProblem], ContactState | Iterate | None]
) -> ContactState | None:
    """Return a start with the interpolated load of the coarse problem; None if there is no such problem.

    solution: returns the solution of a problem, as accurate as is worthwhile, or None; with the signed gap as tension
    (`with_signed_gap`) or without. The displacement is that of the unloaded body: solvers evaluate their own.
    """
    coarse = coarse_problem(problem)
    found = None if coarse is None else solution(coarse.problem)
    if coarse is None or found is None:
        return None
    load = np.zeros((problem.fields.size, len(problem.gap))).T  # field by field
    loaded = np.flatnonzero(found.load.any(axis=0))
    load[:, loaded] = coarse.coarsening.prolong(found.load[:, loaded])
    above = np.isfinite(problem.gap)
    pressed = above & (load[:, 2] < 0.0)
    for field in loaded:
        across = field >= N_MECHANICAL and follows_gap(problem)
        load[:, field] = np.where(above if across else pressed, load[:, field], 0.0)
    return ContactState(load, problem.system.offset, (load[:, 2] < 0.0).astype(float), found.motion)


def with_signed_gap(load: Array, gap: Array, own: Array | float) -> Array:
    """Return a load (n, 5) with a tension proportional to the gap (n,) where the contact is open.

    Between nodes the sum of both locates the contact edge. own: (n,) response of each node to its own pressure.
    """
    open_ = (load[:, 2] == 0.0) & (gap > 0.0) & np.isfinite(gap)
    load = load.copy()
    load[:, 2] = np.where(open_, gap / own, load[:, 2])
    return load


def _still_there(problem: ContactProblem, coarsening: Coarsening) -> bool:
    """Return whether the coarser division resolves the indenter and, unless it moves freely, its overlap."""
    seen = [np.isfinite(problem.gap)]
    if all(resultant.electromagnetic for resultant in problem.prescribed_resultants):
        seen.append(problem.gap < problem.system.offset[:, 2])
    return all(
        nodes[coarsening.nodes].sum() >= MIN_COARSE_NODES and same_area(problem.system, nodes, coarsening)
        for nodes in seen
    )


def same_everywhere(law: ContactLaw, n: int) -> bool:
    """Return whether a law is known to be the same at all of n nodes; False for laws with a memory."""
    return is_pure_projection(law) and not holds_nodes(law, n)


def holds_nodes(part: object, n: int) -> bool:
    """Return whether a law, or an object that it contains, holds an array with one entry for each of n nodes."""
    if isinstance(part, np.ndarray):
        return n in part.shape
    if isinstance(part, tuple | list):
        return any(holds_nodes(item, n) for item in part)
    if isinstance(part, Mapping):
        return any(holds_nodes(item, n) for item in part.values())
    if not is_dataclass(part):
        return False
    named = [getattr(part, field.name, None) for field in fields(part)]  # including attributes in slots
    return any(holds_nodes(item, n) for item in (*named, *getattr(part, "__dict__", {}).values()))
