"""Admissibility of problems for projected conjugate gradients."""

from typing import Final

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.contact.nested import has_nodal_data
from meeframe.contact.problem import ContactProblem
from meeframe.fields import Array
from meeframe.laws.base import ContactLaw, is_pure_projection
from meeframe.solvers.cg.normal_modes import NormalModes

_TRIAL_TRACTIONS: Final = tuple(
    pressure * np.array(trial)
    for pressure in (1e-3, 1.0, 1e4, 1e8, 1e12)
    for trial in ([0.5, 0.5, -1.0], [0.5, 0.0, 1.0])
)
"""Trial tractions of pressed and open nodes [Pa], up to pressures beyond any material's, since laws may cap them."""

_ROUND_OFF: Final = 1e-12
"""Largest relative deviation of a traction due to round-off."""

_SAMPLE_NODES: Final = 1_000
"""Number of nodes at which a law without nodal data is tested."""


def check_accepted(problem: ContactProblem) -> None:
    """Raise CaseError if the contact law is not that of frictionless unilateral contact, or as NormalModes.of."""
    _check(problem.contact_law, len(problem.gap))
    NormalModes.of(problem)


def accepts(problem: ContactProblem) -> bool:
    """Return true if ProjectedCG can solve a problem."""
    try:
        check_accepted(problem)
    except CaseError:
        return False
    return True


def _check(law: ContactLaw, n: int) -> None:
    """Raise CaseError unless the law, of n nodes, is p_nu = min(0, p_nu*) without friction."""
    is_frictionless = is_pure_projection(law) and not law.tangential_scaling().any()
    if not is_frictionless or not _is_plain(law, n):
        raise CaseError(
            f"solver 'projected-cg' takes frictionless contact only, rigid and without attraction, not "
            f"{type(law).__name__}; allowed contact law: signorini, or friction with mu = 0. Use 'newton', 'uzawa-bb', "
            "'uzawa-nesterov', 'uzawa' or 'auto' for others"
        )


def _is_plain(law: ContactLaw, n: int) -> bool:
    """Return true if a law projects as frictionless unilateral contact does, at all n nodes if it has nodal data."""
    if n > _SAMPLE_NODES and not has_nodal_data(law, n):
        try:
            return _projects_as_unilateral(law, _SAMPLE_NODES)
        except Exception:  # a law may store nodal data under any name
            pass
    return _projects_as_unilateral(law, n)


def _projects_as_unilateral(law: ContactLaw, n: int) -> bool:
    return all(_is_expected(law.project(np.tile(trial, (n, 1))), trial) for trial in _TRIAL_TRACTIONS)


def _is_expected(traction: Array, trial: Array) -> bool:
    """Return true if tractions (n, 3) are those of frictionless unilateral contact for one trial traction (3,)."""
    expected = np.array([0.0, 0.0, min(trial[2], 0.0)])
    return bool((np.abs(traction - expected) <= _ROUND_OFF * np.abs(expected)).all())
