"""Nested grids: the same contact problem on a coarser division of the zone, and a start from its solution."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from meeframe.common.memory import zeros
from meeframe.contact.conduction import depends_on_gap
from meeframe.contact.problem import ContactProblem, ContactState, Iterate, PrescribedResultant, columns_of
from meeframe.fields import N_MECHANICAL, NORMAL, POTENTIALS, Array, Indices
from meeframe.laws.base import ContactLaw, is_pure_projection
from meeframe.system.capabilities import Coarsening, Multigrid, diagonal
from meeframe.system.reduced import ReducedSystem

T = TypeVar("T")
MIN_COARSE_NODES: Final = 16
"""Least number of coarse nodes under the indenter, and in overlap; with fewer the problem is a different one."""
SAMPLE_NODES: Final = 1_000
"""Number of nodes at which a law without nodal data is tested."""
MAX_RATIO: Final = 2.0
"""Factor below which two areas, or similar quantities, count as about the same."""


@dataclass(frozen=True, eq=False)
class Coarse:
    """Contact problem on a coarser reduced system, with the relation of its nodes to those of the finer one."""

    problem: ContactProblem
    coarsening: Coarsening


def coarse_problem(problem: ContactProblem) -> Coarse | None:
    """Return the problem on the coarser reduced system; None if there is none.

    There is also none if the law or the contact edge belongs to these nodes, or if too little of the indenter lies
    above the remaining nodes.
    """
    law = problem.contact_law
    if not is_uniform(law, len(problem.gap)) or problem.area_fraction is not None:
        return None
    multigrid = problem.system.capability(Multigrid)
    coarsening = None if multigrid is None else multigrid.coarsen()
    if coarsening is None or not _resolves_indenter(problem, coarsening):
        return None
    return Coarse(restrict_problem(problem, coarsening.system, coarsening.nodes), coarsening)


def restrict_problem(problem: ContactProblem, system: ReducedSystem, nodes: Indices) -> ContactProblem:
    """Return a problem on a reduced system of m of its n nodes.

    The prescribed resultants keep their densities and take the weights of the reduced system.

    Parameters
    ----------
    problem : ContactProblem
        Problem on n nodes.
    system : ReducedSystem
        Reduced system of the m nodes.
    nodes : Indices
        (m,), their numbers among the n nodes.
    """
    prescribed_resultants = tuple(
        PrescribedResultant(
            _columns_at(resultant.mode, resultant.mode_fields, nodes),
            _columns_at(resultant.density, resultant.density_fields, nodes),
            system.weights,
            resultant.total,
        )
        for resultant in problem.prescribed_resultants
    )
    area_fraction = None if problem.area_fraction is None else problem.area_fraction[nodes]
    return replace(
        problem,
        system=system,
        gap=problem.gap[nodes],
        translation=_columns_at(problem.translation, columns_of(problem.translation), nodes),
        potentials=_columns_at(problem.potentials, columns_of(problem.potentials), nodes),
        prescribed_resultants=prescribed_resultants,
        area_fraction=area_fraction,
    )


def _columns_at(values: Array, columns: tuple[int, ...], nodes: Indices) -> Array:
    """Return values (n, fields) at some nodes (m,), of the columns that are not zero."""
    if values.strides[0] == 0:  # the same at all nodes
        return np.broadcast_to(values[0], (len(nodes), values.shape[1]))
    if not columns:
        return np.broadcast_to(0.0, (len(nodes), values.shape[1]))
    at_nodes = zeros((len(nodes), values.shape[1]))
    for column in columns:
        at_nodes[:, column] = values[nodes, column]
    return at_nodes


def is_similar(one: float, other: float) -> bool:
    """Return whether two numbers >= 0 are about the same; zero is about the same as zero only."""
    return max(one, other) <= MAX_RATIO * min(one, other)


def has_similar_area(system: ReducedSystem, nodes: NDArray[np.bool_], coarsening: Coarsening) -> bool:
    """Return whether a coarser division represents the area of nodes (n,) of a system about correctly."""
    coarse_nodes = nodes[coarsening.nodes]
    return is_similar(float(system.weights[nodes].sum()), float(coarsening.system.weights[coarse_nodes].sum()))


def nested_start(
    problem: ContactProblem, solution: Callable[[ContactProblem], ContactState | Iterate | None]
) -> ContactState | None:
    """Return a start with the interpolated load of the coarse problem; None if there is no such problem.

    Parameters
    ----------
    problem : ContactProblem
        Problem on the finer system.
    solution : callable
        Returns the solution of a coarse problem, as accurate as is worthwhile, or None.

    Returns
    -------
    ContactState or None
        Start; its displacement is that of the unloaded body, since solvers evaluate the displacement themselves.
    """
    coarse = coarse_problem(problem)
    coarse_state = None if coarse is None else solution(coarse.problem)
    return None if coarse is None or coarse_state is None else prolonged_start(problem, coarse, coarse_state)


def prolonged_start(problem: ContactProblem, coarse: Coarse, coarse_state: ContactState | Iterate) -> ContactState:
    """Return a start with the interpolated load of a state of the coarse problem; see `nested_start`."""
    load = np.zeros((problem.fields.size, len(problem.gap))).T  # field by field
    loaded = np.flatnonzero(coarse_state.load.any(axis=0))
    load[:, loaded] = coarse.coarsening.prolong(coarse_state.load[:, loaded])
    above = np.isfinite(problem.gap)
    pressed = above & (load[:, NORMAL] < 0.0)
    for field in loaded:
        bears_open_flux = field >= N_MECHANICAL and depends_on_gap(problem)
        load[:, field] = np.where(above if bears_open_flux else pressed, load[:, field], 0.0)
    return ContactState(load, problem.system.offset, (load[:, NORMAL] < 0.0).astype(float), coarse_state.motion)


def with_defect(problem: ContactProblem, displacement: Array, imbalance: Array) -> ContactProblem:
    """Return a coarse problem in which a state violates the laws and the balance as it does in the finer one.

    Source: full approximation scheme, Brandt, Math. Comput. 31 (1977) 333.

    Parameters
    ----------
    problem : ContactProblem
        Coarse problem of n nodes.
    displacement : Array
        (n, fields), displacement of the indenter relative to the body in the finer problem less that in the coarse one,
        under the same load.
    imbalance : Array
        (m,), excess of the resultants of that load in the coarse problem over that in the finer one.
    """
    resultants = zip(problem.prescribed_resultants, imbalance, strict=True)
    return replace(
        problem,
        translation=problem.translation + displacement[:, :2],
        gap=problem.gap + displacement[:, NORMAL],
        potentials=problem.potentials - displacement[:, POTENTIALS],
        prescribed_resultants=tuple(replace(one, total=one.total + excess) for one, excess in resultants),
    )


def with_tension(problem: ContactProblem, iterate: Iterate, gap: Array) -> Iterate:
    """Return an iterate with a normal tension where the gap (n,) [m] is open, in proportion to it.

    Where the load of a coarse division is interpolated, its normal part then changes sign at the contact edge.
    """
    is_open = (iterate.load[:, NORMAL] == 0.0) & (gap > 0.0) & np.isfinite(gap)
    load = iterate.load.copy(order="K")
    load[is_open, NORMAL] = gap[is_open] / diagonal(problem.system, (2,))[is_open, 0]
    return replace(iterate, load=load)


def _resolves_indenter(problem: ContactProblem, coarsening: Coarsening) -> bool:
    """Return whether the coarser division resolves the indenter and, unless it moves freely, its overlap."""
    masks = [np.isfinite(problem.gap)]
    if all(resultant.electromagnetic for resultant in problem.prescribed_resultants):
        masks.append(problem.gap < problem.system.offset[:, NORMAL])
    return all(
        nodes[coarsening.nodes].sum() >= MIN_COARSE_NODES and has_similar_area(problem.system, nodes, coarsening)
        for nodes in masks
    )


def is_uniform(law: ContactLaw, n: int) -> bool:
    """Return whether a law is known to be the same at all of n nodes; False for laws with a memory."""
    return is_pure_projection(law) and not has_nodal_data(law, n)


def on_sample(law: ContactLaw, n: int, evaluate: Callable[[int], T]) -> T:
    """Return what a function of the number of nodes returns for a law of n nodes, at few nodes if these are alike.

    Parameters
    ----------
    law : ContactLaw
        The law.
    n : int
        Number of nodes.
    evaluate : callable
        Function of a number of nodes, whose result does not depend on it if the law has no nodal data.
    """
    if n > SAMPLE_NODES and not has_nodal_data(law, n):
        try:
            return evaluate(SAMPLE_NODES)
        except Exception:  # a law may store nodal data under any name
            pass
    return evaluate(n)


def has_nodal_data(data: object, n: int) -> bool:
    """Return whether a law, or an object that it contains, holds an array with one entry for each of n nodes."""
    if isinstance(data, np.ndarray):
        return n in data.shape
    if isinstance(data, tuple | list):
        return any(has_nodal_data(item, n) for item in data)
    if isinstance(data, Mapping):
        return any(has_nodal_data(item, n) for item in data.values())
    if not is_dataclass(data):
        return False
    attributes = [getattr(data, field.name, None) for field in fields(data)]  # including attributes in slots
    return any(has_nodal_data(item, n) for item in (*attributes, *getattr(data, "__dict__", {}).values()))
