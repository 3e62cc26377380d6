"""Checks of laws before anything is computed; further requirements are left to their conformance kits."""

from collections.abc import Callable
from typing import Final

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.contact.nested import on_sample
from meeframe.fields import Array
from meeframe.laws.base import (
    ConductivityLaw,
    ContactLaw,
    attraction,
    for_increment,
    has_resolvent,
    is_adhesive,
    resolve,
)

_STEPS: Final = (1e12, 1e12)
"""Normal and tangential steps of the augmented tractions with which laws are tested [Pa/m]."""
_TRIALS: Final = np.array([[1e6, -2e6, -3e6], [1e5, 0.0, -3e6], [0.0, 0.0, -3e6], [1e6, 0.0, 1e6], [0.0, 0.0, 0.0]])
"""Trial tractions of nodes that slip, stick, are pressed, are apart, and are unloaded [Pa]."""

_PLAIN: Final = {"tangential_scaling": "", "adhesion": " at a gap of 0 m"}
"""Methods that take no trial tractions, with the words for their arguments."""


def gap_of_law(law: ContactLaw, points: Array) -> Array:
    """Return the gap that the contact law adds at points (n, 3), (n,) [m]; raise CaseError if it is not finite."""
    gap = law.initial_gap(points)
    what = f"the initial gap of the contact law {type(law).__name__}"
    _check_array(what, gap, (len(points),))
    if not np.isfinite(gap).all():
        node = int(np.flatnonzero(~np.isfinite(gap))[0])
        raise CaseError(f"{what} is {gap[node]} at {points[node]} [m]; allowed: finite numbers")
    return gap


def check_tractions(law: ContactLaw, n: int) -> None:
    """Raise CaseError unless the contact law returns valid arrays for n nodes.

    It must return one traction for each node, with the quantities that belong to it; leave its arguments unchanged; and
    return finite tractions for finite trial ones. Further requirements are left to its conformance kit.
    """

    def check(count: int) -> None:
        for first in range(0, len(_TRIALS), count):  # small zones have too few nodes for all at once
            _check_tractions(law, np.resize(np.roll(_TRIALS, -first, axis=0), (count, 3)))

    on_sample(law, n, check)


def _check_tractions(law: ContactLaw, trial: Array) -> None:
    """Apply check_tractions to trial tractions (n, 3)."""
    n, gap = len(trial), np.zeros(trial.shape)
    calls: dict[str, tuple[Callable[[Array, Array], object], tuple[int, ...]]] = {
        "project": (lambda trial, _: law.project(trial), (n, 3)),
        "tangential_scaling": (lambda _trial, _gap: law.tangential_scaling(), (2, 2)),
        "resolve": (lambda trial, gap: resolve(law, trial, gap, _STEPS), (n, 3)),
        "adhesion": (lambda _, gap: attraction(law, gap[:, 2]), (n,)),
        "tangent": (lambda trial, _: law.tangent(trial), (n, 3, 3)),
        "tangents": (lambda trial, gap: law.tangents(trial, gap, _STEPS), (n, 3, 3)),
    }
    implemented = {"resolve": has_resolvent(law), "adhesion": is_adhesive(law)}
    for method, (ask, shape) in calls.items():
        if not implemented.get(method, True):
            continue
        what, arguments = f"{method} of the contact law {type(law).__name__}", (trial.copy(), gap.copy())
        tried = _PLAIN.get(method, trial)
        with np.errstate(all="ignore"):
            answer = ask(*arguments)
        if not all(map(np.array_equal, arguments, (trial, gap))):
            raise CaseError(f"{what} changes its argument; allowed: a new array")
        if method != "tangents":
            _check_array(what, answer, shape, tried)
        elif not isinstance(answer, tuple) or len(answer) != 2:
            raise CaseError(f"{what} returns {_kind(answer)}; allowed: two arrays, by trial and by gap")
        else:
            for way, array in zip(("by trial", "by gap"), answer, strict=True):
                _check_array(f"{what}, {way},", array, shape, tried)


def _check_array(what: str, array: object, shape: tuple[int, ...], tried: Array | str | None = None) -> None:
    """Raise CaseError unless a value is an array of real numbers of this shape, and finite if it was tested.

    tried: trial tractions (n, 3), or words for the argument.
    """
    if type(array) is not np.ndarray or array.dtype.kind not in "fiu":  # masked arrays have other methods
        raise CaseError(f"{what} returns {_kind(array)}; allowed: an array of real numbers of shape {shape}")
    if array.shape != shape:
        raise CaseError(f"{what} has shape {array.shape}; allowed: {shape}")
    wrong = np.argwhere(~np.isfinite(array))
    if tried is None or not wrong.size:
        return
    if not isinstance(tried, str):
        tried = f" at a trial traction of ({', '.join(f'{traction:g}' for traction in tried[wrong[0][0]])}) Pa"
    raise CaseError(f"{what} is {array[tuple(wrong[0])]}{tried}; allowed: finite numbers")


def _kind(answer: object) -> str:
    """Return words for the type of a returned value: 'None', 'list', 'an array of complex128'."""
    if type(answer) is np.ndarray:
        return f"an array of {answer.dtype}"
    return "None" if answer is None else f"a {type(answer).__name__}"


def check_conductivity(law: ConductivityLaw, n: int) -> None:
    """Raise CaseError unless the law returns n conductivities, and leaves its arguments unchanged.

    check_conduction of meeframe.model.conduction checks the values where the case needs them.
    """
    arguments = np.linspace(-1e6, 0.0, n), np.zeros(n), np.ones(n)
    copies = tuple(array.copy() for array in arguments)
    with np.errstate(all="ignore"):
        kappa = law.conductivity(*copies)
    what = f"conductivity of the conductivity law {type(law).__name__}"
    if not all(map(np.array_equal, copies, arguments)):
        raise CaseError(f"{what} changes its arguments; allowed: new arrays")
    _check_array(what, kappa, (n,))


def law_of_increment(law: ContactLaw, slip_path: Array, duration: float | None) -> ContactLaw:
    """Return the contact law for an increment of a duration [s] that follows slip_path (n,) [m].

    Raises CaseError unless that law passes check_tractions.
    """
    made = for_increment(law, slip_path, duration)
    if not isinstance(made, ContactLaw):
        raise CaseError(
            f"for_increment of the contact law {type(law).__name__} returns {made!r}; allowed: a contact law"
        )
    check_tractions(made, len(slip_path))
    return made
