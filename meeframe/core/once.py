"""Functions of an object that lives for a while, such as a mesh or a contact problem, evaluated once for each."""

from collections.abc import Callable
from functools import wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

Given = TypeVar("Given")
Found = TypeVar("Found")


def once_for_each(function: Callable[[Given], Found]) -> Callable[[Given], Found]:
    """The function, which remembers what it found for an object, known by its identity, as long as that lives."""
    found: WeakKeyDictionary[Given, Found] = WeakKeyDictionary()

    @wraps(function)
    def remembering(given: Given) -> Found:
        if given not in found:
            found[given] = function(given)
        return found[given]

    return remembering
