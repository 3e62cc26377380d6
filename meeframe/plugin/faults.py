"""Checks of the records that hooks return, before they are used."""

import inspect
import re
from collections.abc import Mapping, Sequence
from importlib import metadata
from itertools import chain
from typing import Any, Final

from meeframe.contact.problem import SelectiveSolver, Solver
from meeframe.elements.base import SurfaceElement
from meeframe.laws.base import OPTIONAL_METHODS, ContactLaw
from meeframe.plugin.hookspecs import PROJECT, Record

NAME: Final = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")
"""Pattern of the names allowed in case files."""
NAME_RULE: Final = "lower-case letters, digits and hyphens, beginning with a letter: my-law"
"""Description of this pattern."""
_OPTIONAL: Final[Mapping[type, Sequence[type]]] = {ContactLaw: OPTIONAL_METHODS, Solver: (SelectiveSolver,)}
"""Protocols of the optional methods of a contract."""


def fault(kind: str, contract: type, record: Any) -> str:
    """Return what is wrong with a record of a hook, or ''.

    Parameters
    ----------
    kind
        Kind of the hook.
    contract
        Abstract class of the kind.
    record
        The record.
    """
    if not isinstance(record, Record):
        return f"a hook returns records, not {record!r}"
    if not (isinstance(record.name, str) and NAME.fullmatch(record.name)):
        return f"{kind} with the name {record.name!r}; allowed: {NAME_RULE}"
    for key in ("summary", "source"):
        text = getattr(record, key)
        if not (isinstance(text, str) and text.strip()):
            return f"{kind} {record.name!r}: {key} = {text!r}; allowed: a non-empty text"
    problem = _fault_of_class(contract, record.factory)
    return f"{kind} {record.name!r}: {problem}" if problem else ""


def _fault_of_class(contract: type, factory: Any) -> str:
    """Return the reason why a factory is not a valid subclass of the abstract class, or ''."""
    if not isinstance(factory, type):
        return f"its factory is {factory!r}; allowed: a class"
    if not issubclass(factory, contract):
        return f"class {factory.__name__} is not a {contract.__module__}.{contract.__name__}"
    missing = ", ".join(sorted(getattr(factory, "__abstractmethods__", ())))
    if missing:
        return f"class {factory.__name__} lacks {missing}, {_required_by()}"
    protocols = contract, *_OPTIONAL.get(contract, ())
    for name, method in chain.from_iterable(vars(protocol).items() for protocol in protocols):
        if not inspect.isfunction(method) or name.startswith("_") or not hasattr(factory, name):
            continue
        arguments = list(inspect.signature(method).parameters.values())[1:]
        if not _accepts(factory, name, arguments):
            names = ", ".join(argument.name for argument in arguments)
            return f"{factory.__name__}.{name} does not accept ({names}), {_required_by()}"
    # a subclass of a dataclass appears to be one although its fields are not: look for the decorator
    parameters = vars(factory).get("__dataclass_params__")
    if contract is not SurfaceElement and not (parameters and parameters.frozen):
        return f"class {factory.__name__} is not a frozen dataclass; allowed: classes with @dataclass(frozen=True)"
    return ""


def _required_by() -> str:
    return f"which {PROJECT} {metadata.version(PROJECT)} requires"


def _accepts(factory: type, name: str, arguments: Sequence[inspect.Parameter]) -> bool:
    """Return whether a method accepts the arguments of the abstract method by position, each at the same index."""
    method = inspect.getattr_static(factory, name)
    if isinstance(method, property) or not callable(getattr(factory, name)):
        return False
    try:
        signature = inspect.signature(method.__get__(object(), factory) if hasattr(method, "__get__") else method)
        bound = signature.bind(*arguments).arguments
        signature.bind(*(argument for argument in arguments if argument.default is argument.empty))
    except ValueError:  # compiled code without a signature
        return True
    except TypeError:
        return False
    # arguments can have other names, but not the name of another argument, which would exchange the two
    names = {argument.name for argument in arguments}
    return all(
        not isinstance(argument, inspect.Parameter) or name_here == argument.name or name_here not in names
        for name_here, argument in bound.items()
    )
