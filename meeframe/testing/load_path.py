"""Load histories of a rigid indenter on a reduced system, with friction and without a case file."""

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
    """Position of the indenter.

    Attributes
    ----------
    gap
        Gap (n,) to the undeformed body [m]; inf where there is no indenter above.
    translation
        Tangential motion (n, 2) since the beginning [m], for each node so that the indenter can rotate.
    """

    gap: Array
    translation: Array


@dataclass(frozen=True, eq=False)
class PathStep:
    """A converged step.

    Attributes
    ----------
    state
        State at the end of the step.
    force
        Force (3,) of the indenter on the body [N].
    slip
        Slip (n, 2) of the indenter over the body in this step [m].
    dissipation
        Work of friction in this step under the tractions at its end [J].
    """

    state: ContactState
    force: Array
    slip: Array
    dissipation: float


def follow(
    system: ReducedSystem, contact_law: ContactLaw, positions: Iterable[Position], solver: Solver | None = None
) -> Iterator[PathStep]:
    """Yield the steps of a path, each started from the previous one.

    Slip is measured from the end of the previous step (docs/explanation/theory.md, Departures). There are no fluxes.
    The dissipation of a step is the work of its final tractions on its slip: of first order in the step while the
    pressure changes, where that of results is of second order, and nonnegative at every node.

    Parameters
    ----------
    system
        The reduced system.
    contact_law
        The contact law.
    positions
        Positions of the indenter at the end of each step.
    solver
        Solver; by default SemismoothNewton.

    Raises
    ------
    MeeframeError
        If a step does not converge.
    """
    start, total_slip = None, np.zeros((len(system.points), 2))
    for number, position in enumerate(positions):
        problem = ContactProblem(
            system,
            contact_law,
            flux_channels(Insulating(), Insulating()),
            position.gap,
            position.translation - total_slip,
            np.zeros((len(total_slip), 2)),
        )
        solution = solve(problem, solver or SemismoothNewton(), start=start)
        if solution.status is not Status.CONVERGED:
            raise MeeframeError(f"step {number} of the path: {solution.status}: {solution.message}")
        start = solution.state
        slip = contact_gap(problem, start.displacement)[:, :2]
        total_slip = total_slip + slip
        work = float(system.weights @ (start.load[:, :2] * slip).sum(axis=1))
        yield PathStep(start, resultant(system, start.load)[0], slip, work)
