"""Memoization of functions by the identity of their first argument."""

from collections.abc import Callable
from functools import wraps
from typing import TypeVar, TypeVarTuple
from weakref import WeakKeyDictionary

Given = TypeVar("Given")
More = TypeVarTuple("More")
Found = TypeVar("Found")


def memoize_by_identity(function: Callable[[Given, *More], Found]) -> Callable[[Given, *More], Found]:
    """Memoize a function by the identity of its first argument, such as a mesh or a contact problem.

    A result is kept as long as that object lives. Further arguments must be hashable; one result is kept for each
    combination of them.
    """
    found: WeakKeyDictionary[Given, dict[tuple[*More], Found]] = WeakKeyDictionary()

    @wraps(function)
    def remembering(given: Given, *more: *More) -> Found:
        of_given = found.setdefault(given, {})
        if more not in of_given:
            of_given[more] = function(given, *more)
        return of_given[more]

    return remembering
