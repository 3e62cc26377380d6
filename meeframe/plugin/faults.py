"""Checks of the records that hooks return, before anything uses them."""

import inspect
import re
from collections.abc import Sequence
from importlib import metadata
from typing import Any, Final

from meeframe.elements.base import SurfaceElement
from meeframe.plugin.hookspecs import PROJECT, Record

NAME: Final = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")
"""Names that case files may write."""
NAME_RULE: Final = "small letters, digits and hyphens, beginning with a letter: my-law"
"""The same in words."""


def fault(kind: str, contract: type, record: Any) -> str:
    """Return what is wrong with what a hook of a kind returned, or ''. contract: the abstract class of the kind."""
    if not isinstance(record, Record):
        return f"a hook returns records, not {record!r}"
    if not (isinstance(record.name, str) and NAME.fullmatch(record.name)):
        return f"{kind} with the name {record.name!r}; allowed: {NAME_RULE}"
    for key in ("summary", "source"):
        text = getattr(record, key)
        if not (isinstance(text, str) and text.strip()):
            return f"{kind} {record.name!r}: {key} = {text!r}; allowed: a text that is not empty"
    wrong = _fault_of_class(contract, record.factory)
    return f"{kind} {record.name!r}: {wrong}" if wrong else ""


def _fault_of_class(contract: type, factory: Any) -> str:
    """Return what keeps a factory from being a class of a contract, or ''."""
    if not isinstance(factory, type):
        return f"its factory is {factory!r}; allowed: a class"
    if not issubclass(factory, contract):
        return f"class {factory.__name__} is no {contract.__module__}.{contract.__name__}"
    missing = ", ".join(sorted(getattr(factory, "__abstractmethods__", ())))
    if missing:
        return f"class {factory.__name__} lacks {missing}, {_asks()}"
    for name, method in vars(contract).items():
        if not inspect.isfunction(method) or name.startswith("_"):
            continue
        arguments = list(inspect.signature(method).parameters.values())[1:]
        if not _takes(factory, name, arguments):
            shown = ", ".join(argument.name for argument in arguments)
            return f"{factory.__name__}.{name} does not take ({shown}), {_asks()}"
    # a class inherits that it is a dataclass, without its own fields being any: only the decorator makes them so
    own = vars(factory).get("__dataclass_params__")
    if contract is not SurfaceElement and not (own and own.frozen):
        return f"class {factory.__name__} is no frozen dataclass; allowed: classes under @dataclass(frozen=True)"
    return ""


def _asks() -> str:
    return f"which {PROJECT} {metadata.version(PROJECT)} asks for"


def _takes(factory: type, name: str, arguments: Sequence[inspect.Parameter]) -> bool:
    """Return whether a method can be called with a contract's arguments, by position, each where the contract has
    it."""
    method = inspect.getattr_static(factory, name)
    if isinstance(method, property) or not callable(getattr(factory, name)):
        return False
    try:
        signature = inspect.signature(method.__get__(object(), factory) if hasattr(method, "__get__") else method)
        taken = signature.bind(*arguments).arguments
        signature.bind(*(argument for argument in arguments if argument.default is argument.empty))
    except ValueError:  # compiled, without a signature
        return True
    except TypeError:
        return False
    # other names for arguments are as good; the contract's name of another argument is an exchange of the two
    names = {argument.name for argument in arguments}
    return all(
        not isinstance(given, inspect.Parameter) or own == given.name or own not in names
        for own, given in taken.items()
    )
