"""Which problems projected conjugate gradients take."""

import numpy as np

from meeframe.core.contact import ContactProblem
from meeframe.core.errors import CaseError
from meeframe.core.law import ContactLaw, attracts
from meeframe.solvers.normal_modes import NormalModes
from meeframe.solvers.scales import problem_scales


def check_taken(problem: ContactProblem) -> None:
    """Raises CaseError if the contact law is not that of frictionless unilateral contact, or as NormalModes.of."""
    _check(problem.contact_law, problem_scales(problem).pressure)
    NormalModes.of(problem)


def takes(problem: ContactProblem) -> bool:
    """Whether ProjectedCG takes a problem."""
    try:
        check_taken(problem)
    except CaseError:
        return False
    return True


def _check(law: ContactLaw, pressure: float) -> None:
    """Raises CaseError unless the law is p_nu = min(0, p_nu*) without friction."""
    trial = pressure * np.array([[0.5, 0.5, -1.0], [0.0, 0.0, -1e-3], [0.5, 0.0, 1.0], [0.0, 0.0, 1e-3]])
    expected = np.zeros_like(trial)
    expected[:2, 2] = trial[:2, 2]
    plain = type(law).resolve is ContactLaw.resolve and not attracts(law) and not law.tangential_scaling().any()
    if not plain or not np.allclose(law.project(trial), expected, rtol=1e-12, atol=0.0):
        raise CaseError(
            f"solver 'projected-cg' takes frictionless contact only, rigid and without attraction, not "
            f"{type(law).__name__}; allowed contact law: signorini, or friction with mu = 0. Use 'newton', 'uzawa-bb', "
            "'uzawa-nesterov', 'uzawa' or 'auto' for others"
        )
