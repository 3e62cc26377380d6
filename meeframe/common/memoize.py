"""Functions of an object that lives for a while, such as a mesh or a contact problem, evaluated once for each."""

from collections.abc import Callable
from functools import wraps
from typing import TypeVar, TypeVarTuple
from weakref import WeakKeyDictionary

Given = TypeVar("Given")
More = TypeVarTuple("More")
Found = TypeVar("Found")


def memoize_by_identity(function: Callable[[Given, *More], Found]) -> Callable[[Given, *More], Found]:
    """The function, which remembers what it found for an object, known by its identity, as long as that lives.

    What else it is given must be hashable: something is remembered for each.
    """
    found: WeakKeyDictionary[Given, dict[tuple[*More], Found]] = WeakKeyDictionary()

    @wraps(function)
    def remembering(given: Given, *more: *More) -> Found:
        of_given = found.setdefault(given, {})
        if more not in of_given:
            of_given[more] = function(given, *more)
        return of_given[more]

    return remembering
