"""Which problems projected conjugate gradients take."""

from typing import Final

import numpy as np

from meeframe.core.contact import ContactProblem
from meeframe.core.errors import CaseError
from meeframe.core.law import ContactLaw, attracts
from meeframe.solvers.normal_modes import NormalModes

_PRESSURES: Final = (1.0, 1e4, 1e8)
"""With which laws are tried [Pa]."""


def check_taken(problem: ContactProblem) -> None:
    """Raises CaseError if the contact law is not that of frictionless unilateral contact, or as NormalModes.of."""
    _check(problem.contact_law, len(problem.gap))
    NormalModes.of(problem)


def takes(problem: ContactProblem) -> bool:
    """Whether ProjectedCG takes a problem."""
    try:
        check_taken(problem)
    except CaseError:
        return False
    return True


def _check(law: ContactLaw, n: int) -> None:
    """Raises CaseError unless the law, of n nodes, is p_nu = min(0, p_nu*) without friction."""
    trial = np.array([[0.5, 0.5, -1.0], [0.0, 0.0, -1e-3], [0.5, 0.0, 1.0], [0.0, 0.0, 1e-3]])
    trial = np.resize(np.concatenate([pressure * trial for pressure in _PRESSURES]), (n, 3))
    expected = np.minimum(trial, 0.0) * [0.0, 0.0, 1.0]
    plain = type(law).resolve is ContactLaw.resolve and not attracts(law) and not law.tangential_scaling().any()
    if not plain or not np.allclose(law.project(trial), expected, rtol=1e-12, atol=0.0):
        raise CaseError(
            f"solver 'projected-cg' takes frictionless contact only, rigid and without attraction, not "
            f"{type(law).__name__}; allowed contact law: signorini, or friction with mu = 0. Use 'newton', 'uzawa-bb', "
            "'uzawa-nesterov', 'uzawa' or 'auto' for others"
        )
