"""Load histories of a rigid indenter on a reduced system: contact with friction, step by step, without a case file."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from meeframe.common.errors import MeeframeError
from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, ContactState, Solver, Status, contact_gap, resultant
from meeframe.fields import Array
from meeframe.laws import Insulating
from meeframe.laws.base import ContactLaw
from meeframe.solvers import SemismoothNewton, solve
from meeframe.system.reduced import ReducedSystem


@dataclass(frozen=True, eq=False)
class Position:
    """Position of the indenter: gap (n,) [m] to the undeformed body, inf where there is no indenter above; translation
    (n, 2) [m], its tangential motion since the beginning, one for each node so that it may turn."""

    gap: Array
    translation: Array


@dataclass(frozen=True, eq=False)
class PathStep:
    """A converged step: its state; force (3,) [N] of the indenter on the body; slip (n, 2) [m] of the indenter over the
    body in this step; dissipation [J], friction's work in this step under the tractions at its end."""

    state: ContactState
    force: Array
    slip: Array
    dissipation: float


def follow(
    system: ReducedSystem, contact_law: ContactLaw, positions: Iterable[Position], solver: Solver | None = None
) -> Iterator[PathStep]:
    """Return the steps of a path, each started from the one before; slip is measured from there (docs/theory.md,
    Departures).

    No fluxes enter. A step's dissipation is the work of its own tractions on its slip: of first order in the step while
    the pressure changes, where that of results is of second, and never negative at any node. Raises MeeframeError if a
    step does not converge.
    """
    start, slipped = None, np.zeros((len(system.points), 2))
    for number, position in enumerate(positions):
        problem = ContactProblem(
            system,
            contact_law,
            flux_channels(Insulating(), Insulating()),
            position.gap,
            position.translation - slipped,
            np.zeros((len(slipped), 2)),
        )
        solution = solve(problem, solver or SemismoothNewton(), start=start)
        if solution.status is not Status.CONVERGED:
            raise MeeframeError(f"step {number} of the path: {solution.status}: {solution.message}")
        start = solution.state
        slip = contact_gap(problem, start.displacement)[:, :2]
        slipped = slipped + slip
        work = float(system.weights @ (start.load[:, :2] * slip).sum(axis=1))
        yield PathStep(start, resultant(system, start.load)[0], slip, work)
