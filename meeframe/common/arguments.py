"""Arguments of the classes and functions with which users build cases: clear errors, and numbers of NumPy."""

import difflib
import inspect
from collections.abc import Callable, Collection
from functools import wraps
from typing import Any, Final, TypeVar

import numpy as np

from meeframe.common.errors import CaseError

Target = TypeVar("Target", bound=Callable[..., Any])

_SIMILARITY_CUTOFF: Final = 0.7  # cutoff of difflib: 'form' is similar to 'from', 'friction' is not to 'rotation'


def most_similar(name: str, names: Collection[str]) -> str | None:
    """Return the name that is most similar to one that is not allowed; None if none is similar."""
    return next(iter(difflib.get_close_matches(name, names, n=1, cutoff=_SIMILARITY_CUTOFF)), None)


def near_miss(name: str, names: Collection[str]) -> str:
    """Return 'did you mean ...? ' with the most similar of the allowed names, or nothing if none is similar."""
    similar = most_similar(name, names)
    return "" if similar is None else f"did you mean {similar!r}? "


def checked_arguments(target: Target) -> Target:
    """Return a class or function that refuses keywords that it does not have, and takes NumPy numbers as Python's.

    Parameters
    ----------
    target : class or function
        The class, whose constructor is replaced in place, or the function. Its signature stays.

    Returns
    -------
    class or function
        The same class, or the function with these checks. For an unknown keyword it raises CaseError, which names the
        near miss and all allowed keywords.
    """
    call: Any = target.__init__ if isinstance(target, type) else target  # type: ignore[misc]
    names = [name for name in inspect.signature(target).parameters if name != "cls"]

    @wraps(call)
    def checked(*arguments: Any, **keywords: Any) -> Any:
        for name in keywords:
            if name not in names:
                allowed = ", ".join(names) or "none"
                raise CaseError(
                    f"{target.__qualname__}: unknown keyword {name!r}; {near_miss(name, names)}allowed: {allowed}"
                )
        return call(*map(python_numbers, arguments), **{name: python_numbers(keywords[name]) for name in keywords})

    if not isinstance(target, type):
        return checked  # type: ignore[return-value]
    setattr(target, "__init__", checked)  # noqa: B010 - a type checker refuses the plain assignment
    return target


def python_numbers(value: Any, *, arrays: bool = False) -> Any:
    """Return a value with NumPy numbers, also those in lists, tuples and dictionaries, as numbers of Python.

    Parameters
    ----------
    value : object
        The value.
    arrays : bool, optional
        True to turn arrays into lists of numbers; by default they are left as they are.
    """
    if isinstance(value, np.generic):
        return value.item()
    if arrays and isinstance(value, np.ndarray):
        return value.tolist()
    if type(value) is dict:
        return {key: python_numbers(entry, arrays=arrays) for key, entry in value.items()}
    if type(value) in (list, tuple):
        return type(value)(python_numbers(entry, arrays=arrays) for entry in value)
    return value
