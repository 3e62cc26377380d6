"""Checks that the conductivity laws of a case return valid conductivities in the states that the case reaches."""

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from meeframe.common.errors import CaseError
from meeframe.contact.problem import ContactProblem, ContactSolution, Status, indenter_field
from meeframe.contact.residual import node_blocks
from meeframe.contact.scales import problem_scales
from meeframe.fields import N_MECHANICAL, Array
from meeframe.laws.base import GAPS, PRESSURES, ConductivityLaw, contact_traction
from meeframe.results.records import join_sentences

_FAILED_PRESSURE_RATIO: Final = 10.0
"""Multiple of the characteristic pressure from which on an iteration is known to have failed earlier."""


@dataclass(frozen=True)
class LawEvaluation:
    """Conductivity kappa returned by a law under a normal traction [Pa], a gap [m] and a drop [V or A]."""

    kappa: float
    traction: float
    gap: float
    drop: float


@final
@dataclass(eq=False)
class _Watch:
    """Conductivity of a law that records invalid values under finite tractions, gaps and drops.

    Of several such values the one under the least traction is recorded. Calls that test whether a law conducts at all
    (meeframe.laws.base.is_conducting) do not count.
    """

    law: ConductivityLaw
    evaluations: list[LawEvaluation] = field(default_factory=list)

    def __call__(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        """Return the conductivity of the law."""
        kappa = self.law.conductivity(normal_traction, gap, drop)
        wrong = ~(kappa >= 0.0)
        if wrong.any() and not _tried(normal_traction, gap):
            finite = np.isfinite(normal_traction) & np.isfinite(gap) & np.isfinite(drop)
            result = _evaluations(kappa, normal_traction, gap, drop, wrong & finite)
            self.evaluations = sorted([*self.evaluations, *result], key=lambda answer: -answer.traction)[:1]
        return kappa


def watched(law: ConductivityLaw) -> ConductivityLaw:
    """Return a copy of the law that records its invalid values.

    Its class and fields, by which solvers may recognise it, are unchanged.
    """
    copied = copy(law)
    object.__setattr__(copied, "conductivity", _Watch(law))  # replaces the method on this instance only
    return copied


def _tried(traction: Array, gap: Array) -> bool:
    """Return whether these tractions and gaps (n,) are those with which `is_conducting` tests a law."""
    across = not traction.any() and bool(np.isin(gap, GAPS).all())
    return across or np.array_equal(traction, PRESSURES) or bool((traction == PRESSURES[-1]).all())


def _evaluations(
    kappa: Array, traction: Array, gap: Array, drop: Array, which: NDArray[np.bool_]
) -> Iterator[LawEvaluation]:
    """Yield the answer under the least traction among the selected ones (n,), if any."""
    nodes = np.flatnonzero(which)
    if nodes.size:
        node = nodes[traction[nodes].argmax()]
        yield LawEvaluation(*(float(values[node]) for values in (kappa, traction, gap, drop)))


def check_conduction(problem: ContactProblem, solution: ContactSolution) -> ContactSolution:
    """Raise CaseError if a conductivity is negative or NaN in a converged state; else return the solution.

    CaseError is also raised if the state is not finite, or has no residual because a conductivity is NaN, and a
    conductivity was invalid under a traction of the size of the problem's, which may be the cause. A valid law need not
    cover intermediate states and larger tractions: the message then says so.
    """
    state = solution.state
    finite = bool(np.isfinite(state.load).all() and np.isfinite(state.displacement).all())
    most = _FAILED_PRESSURE_RATIO * problem_scales(problem).pressure
    for column, channel in enumerate(problem.channels, N_MECHANICAL):
        law, field = channel.law, channel.field
        if finite:
            result = list(_wrong_in_state(problem, solution, law, column))
        else:
            watch = vars(law).get("conductivity")
            result = watch.evaluations if isinstance(watch, _Watch) else []
        for answer in result:
            drop = f" and a drop of {answer.drop:g} {field.value_unit}"
            across = f", a gap of {answer.gap:g} m{drop}" if law.across_gap else ""
            message = (
                f"conductivity.{field.name}: conductivity of the conductivity law {type(law).__name__} is "
                f"{answer.kappa:g} under a normal traction of {answer.traction:g} Pa{across}; "
                "allowed: numbers >= 0 and inf"
            )
            spoilt = not finite or np.isnan(answer.kappa)
            if solution.status is Status.CONVERGED or (spoilt and -answer.traction <= most):
                raise CaseError(message)
            solution = replace(solution, message=join_sentences(solution.message, message))
    return solution


def _wrong_in_state(
    problem: ContactProblem, solution: ContactSolution, law: ConductivityLaw, column: int
) -> Iterator[LawEvaluation]:
    """Yield the first invalid conductivity of a law in a finite state, if there is one."""
    state, evaluations = solution.state, list[LawEvaluation]()
    position = {field: indenter_field(problem, field, state.motion) for field in (2, column)}
    for nodes in node_blocks(problem.contact_law, len(state.load)):
        gap, drop = (position[field][nodes] - state.displacement[nodes, field] for field in (2, column))
        traction = np.minimum(contact_traction(problem.contact_law, state.load[nodes, 2], gap), 0.0)
        gap = np.where(traction < 0.0, 0.0, np.maximum(gap, 0.0))
        mask = np.isfinite(gap) & ((traction < 0.0) | (gap > 0.0))
        arguments = traction[mask], gap[mask], drop[mask]
        with np.errstate(all="ignore"):
            kappa = law.conductivity(*arguments)
        evaluations += _evaluations(kappa, *arguments, ~(kappa >= 0.0))
    yield from sorted(evaluations, key=lambda answer: -answer.traction)[:1]
