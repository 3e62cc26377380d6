"""Clear errors for misspelt keywords of the classes of which users build cases."""

import difflib
import inspect
from functools import wraps
from typing import Any, TypeVar

from meeframe.common.errors import CaseError

T = TypeVar("T")


def checked_keywords(cls: type[T]) -> type[T]:
    """Return a class that raises CaseError for a keyword that it does not take, naming the near miss and all others."""
    create: Any = cls.__init__
    names = list(inspect.signature(cls).parameters)

    @wraps(create)
    def checked(self: Any, *arguments: Any, **keywords: Any) -> None:
        for name in keywords:
            if name not in names:
                near = difflib.get_close_matches(name, names, n=1)
                hint = f"did you mean {near[0]!r}? " if near else ""
                allowed = ", ".join(names) or "none"
                raise CaseError(f"{cls.__name__}: unknown keyword {name!r}; {hint}allowed: {allowed}")
        create(self, *arguments, **keywords)

    setattr(cls, "__init__", checked)  # noqa: B010 - a type checker refuses the plain assignment
    return cls
