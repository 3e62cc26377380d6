"""Contracts of contact: laws, the contact problem on the reduced system, solvers and their honest status."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from meeframe.core.fields import Array
from meeframe.core.formulation import ReducedSystem


class Status(StrEnum):
    """How an iteration ended. Only CONVERGED is a solution; the others hand over the last state as it is."""

    CONVERGED = "converged"
    STALLED = "stalled"
    DIVERGED = "diverged"
    CYCLING = "cycling"
    ITERATION_LIMIT = "iteration-limit"


@dataclass(frozen=True)
class ContactLaw(ABC):
    """Normal and tangential contact as a projection of augmented tractions (eqs. 11, 15).

    With the gap (translation - u_tau, gap - u_nu) in the local frame, positive along the axis in which the indenter is
    ahead of the body, the solutions of the law are the fixed points of
        traction = project(traction + r * step_scaling * gap),  r > 0.
    The law owns its metric: `step_scaling` is its square, scaled to at most one.
    """

    @abstractmethod
    def project(self, trial: Array) -> Array:
        """Admissible traction nearest to a trial one in the law's own metric, (n, 3) from (n, 3) [Pa].

        Columns (t.e1, t.e2, t.nu) in the local frame; t.nu <= 0 in compression.
        """

    @abstractmethod
    def step_scaling(self) -> Array:
        """Dimensionless factors (3,) in (0, 1] on (e1, e2, nu) components of the gap in the augmented traction."""


@dataclass(frozen=True)
class ConductivityLaw(ABC):
    """Surface conductivity kappa(p_nu) of the flux law flux = +kappa (potential - potential_o) (notes, section 1)."""

    @abstractmethod
    def conductivity(self, normal_traction: Array) -> Array:
        """kappa >= 0, (n,), of the normal traction (n,) [Pa], <= 0 in compression; 0 insulates, inf conducts perfectly.

        Units: F/m^2 for the electric law, H/m^2 for the magnetic one.
        """


@dataclass(frozen=True, eq=False)
class ContactProblem:
    """One load step: find the load on the contact zone that satisfies the laws.

    gap: (n,) initial normal gap between body and indenter at this step [m], negative where they overlap;
    translation: (n, 2) tangential motion of the indenter in the local frame [m];
    potentials: (n, 2) electric [V] and magnetic [A] potential of the indenter.
    """

    system: ReducedSystem
    contact_law: ContactLaw
    electric_law: ConductivityLaw
    magnetic_law: ConductivityLaw
    gap: Array
    translation: Array
    potentials: Array


@dataclass(frozen=True, eq=False)
class ContactState:
    """A state of the contact zone.

    load: (n, 5); displacement: (n, 5), both as in ReducedSystem; conduction: (n, 2) in [0, 1], the fraction of the
    law's electric and magnetic conductivity in force: 1 or 0 but at nodes that graze (zero traction and zero gap).
    """

    load: Array
    displacement: Array
    conduction: Array


@dataclass(frozen=True, eq=False)
class ContactSolution:
    """What the driver loop hands over: the last state, its status, and the history.

    residual: dimensionless violation of the laws, computed from the state alone; history: (iterations,) residuals.
    """

    state: ContactState
    status: Status
    iterations: int
    residual: float
    history: Array
    message: str = ""


@dataclass(frozen=True)
class Solver(ABC):
    """An iteration on a ContactProblem; the fields of a concrete class are its case-file keys.

    A solver is `init` and `step`, nothing else: limits, history, the non-finite guard and the status belong to the
    driver loop in meeframe.solvers.
    """

    @abstractmethod
    def init(self, problem: ContactProblem, start: ContactState | None) -> ContactState:
        """First state; start is the converged state of the previous load step, or None."""

    @abstractmethod
    def step(self, problem: ContactProblem, state: ContactState) -> ContactState:
        """Next state. Must not change its arguments."""


def resultant(system: ReducedSystem, load: Array) -> tuple[Array, float, float]:
    """Force on the body (3,) [N] in global axes, charge [C] and magnetic flux [Wb] of a load (n, 5)."""
    tractions = np.einsum("na,nai->ni", load[:, :3], system.frames)
    force: Array = system.weights @ tractions
    return force, float(system.weights @ load[:, 3]), float(system.weights @ load[:, 4])
