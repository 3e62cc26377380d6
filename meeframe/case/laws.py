"""What a run asks of laws before anything is computed; what else they owe is for their conformance kits."""

from collections.abc import Callable
from typing import Final

import numpy as np

from meeframe.core.errors import CaseError
from meeframe.core.fields import Array
from meeframe.core.law import ConductivityLaw, ContactLaw

_STEPS: Final = (1e12, 1e12)
"""Of augmented tractions with which laws are tried [Pa/m]."""


def gap_of_law(law: ContactLaw, points: Array) -> Array:
    """What the contact law adds to the gap at points (n, 3), (n,) [m]. Raises CaseError unless that is finite."""
    gap = law.initial_gap(points)
    name = type(law).__name__
    if np.shape(gap) != (len(points),):
        raise CaseError(
            f"the initial gap of the contact law {name} has shape {np.shape(gap)}; allowed: ({len(points)},), a number "
            "for each node of the contact zone"
        )
    if not np.isfinite(gap).all():
        node = int(np.flatnonzero(~np.isfinite(gap))[0])
        raise CaseError(
            f"the initial gap of the contact law {name} is {gap[node]} at {points[node]} [m]; allowed: finite numbers"
        )
    return gap


def check_tractions(law: ContactLaw, n: int) -> None:
    """Raises CaseError unless the contact law has one traction for each of n nodes, and the scaling that belongs to it.

    Or if it changes the tractions that it is given.
    What else is asked of a law is for its conformance kit; without these shapes a run ends in the middle.
    """
    name = type(law).__name__
    trial, gap = np.tile([1e6, -2e6, -3e6], (n, 1)), np.zeros((n, 3))
    asked: dict[str, tuple[Callable[[Array, Array], Array], tuple[int, ...]]] = {
        "project": (lambda trial, _: law.project(trial), (n, 3)),
        "tangential_scaling": (lambda _trial, _gap: law.tangential_scaling(), (2, 2)),
    }
    if type(law).resolve is not ContactLaw.resolve:
        asked["resolve"] = (lambda trial, gap: law.resolve(trial, gap, _STEPS), (n, 3))
    if type(law).tangent is not ContactLaw.tangent:
        asked["tangent"] = (lambda trial, _: law.tangent(trial), (n, 3, 3))
    for method, (ask, shape) in asked.items():
        given = trial.copy(), gap.copy()
        array = ask(*given)
        if not all(map(np.array_equal, given, (trial, gap))):
            raise CaseError(
                f"{method} of the contact law {name} changes the array that it is given; allowed: a new one"
            )
        if np.shape(array) != shape:
            raise CaseError(f"{method} of the contact law {name} has shape {np.shape(array)}; allowed: {shape}")


def check_conductivity(law: ConductivityLaw, n: int) -> None:
    """Raises CaseError unless the law has a conductivity for each of n nodes, and leaves alone what it is given.

    Whether it is one shows where the case needs it: check_conduction of meeframe.case.mechanism.
    """
    asked = np.linspace(-1e6, 0.0, n), np.zeros(n), np.ones(n)
    given = tuple(array.copy() for array in asked)
    with np.errstate(all="ignore"):
        kappa = law.conductivity(*given)
    name = type(law).__name__
    if not all(map(np.array_equal, given, asked)):
        raise CaseError(
            f"conductivity of the conductivity law {name} changes the arrays that it is given; allowed: new ones"
        )
    if np.shape(kappa) != (n,):
        raise CaseError(f"conductivity of the conductivity law {name} has shape {np.shape(kappa)}; allowed: ({n},)")


def law_of_increment(law: ContactLaw, slip_path: Array, duration: float | None) -> ContactLaw:
    """The contact law during an increment of a duration [s], before which nodes have slipped slip_path (n,) [m].

    Raises CaseError unless that is one, as check_tractions.
    """
    made = law.for_increment(slip_path, duration)
    if not isinstance(made, ContactLaw):
        raise CaseError(
            f"for_increment of the contact law {type(law).__name__} returns {made!r}; allowed: a contact law"
        )
    check_tractions(made, len(slip_path))
    return made
