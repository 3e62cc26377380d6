"""Memoization of functions by the identity of their first argument."""

from collections.abc import Callable
from functools import wraps
from typing import TypeVar, TypeVarTuple
from weakref import WeakKeyDictionary

Key = TypeVar("Key")
Arguments = TypeVarTuple("Arguments")
Result = TypeVar("Result")


def memoize_by_identity(function: Callable[[Key, *Arguments], Result]) -> Callable[[Key, *Arguments], Result]:
    """Memoize a function by the identity of its first argument, such as a mesh or a contact problem.

    Parameters
    ----------
    function : callable
        Function of one object that can be referenced weakly, and any number of further, hashable arguments.

    Returns
    -------
    callable
        The function, which stores one result for each combination of arguments for as long as the first of them lives.
    """
    results: WeakKeyDictionary[Key, dict[tuple[*Arguments], Result]] = WeakKeyDictionary()

    @wraps(function)
    def memoized(key: Key, *arguments: *Arguments) -> Result:
        cache = results.setdefault(key, {})
        if arguments not in cache:
            cache[arguments] = function(key, *arguments)
        return cache[arguments]

    return memoized
