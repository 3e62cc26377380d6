"""Functions of a contact problem that are evaluated once for each."""

from collections.abc import Callable
from functools import wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

from meeframe.core.contact import ContactProblem

Found = TypeVar("Found")


def once_for_each(function: Callable[[ContactProblem], Found]) -> Callable[[ContactProblem], Found]:
    """The function, which remembers what it found for a problem as long as that lives."""
    found: WeakKeyDictionary[ContactProblem, Found] = WeakKeyDictionary()

    @wraps(function)
    def remembering(problem: ContactProblem) -> Found:
        if problem not in found:
            found[problem] = function(problem)
        return found[problem]

    return remembering
