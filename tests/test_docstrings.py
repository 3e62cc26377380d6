"""Public classes, functions and methods name their arguments in numpydoc sections."""

import ast
import inspect
import re
from collections.abc import Iterator
from enum import Enum
from importlib import import_module
from pathlib import Path
from typing import Any

from meeframe.contact.problem import SelectiveSolver
from meeframe.laws.base import OPTIONAL_METHODS

API_PAGES = Path(__file__).parents[1] / "docs" / "api_pages.py"
OPTIONAL_CONTRACTS = (*OPTIONAL_METHODS, SelectiveSolver)
"""Contracts that classes satisfy without inheriting them."""


def page_lists() -> dict[str, Any]:
    """Return the lists of packages and modules that the API pages show, without an import of mkdocs."""
    lists: dict[str, Any] = {}
    for node in ast.parse(API_PAGES.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.AnnAssign) and node.target.id in ("PACKAGES", "EXPORTING", "MODULES", "PLUGINS"):
            lists[node.target.id] = eval(ast.unparse(node.value), {}, lists)
    return lists


def exported(module: Any) -> Iterator[Any]:
    yield from (getattr(module, name) for name in getattr(module, "__all__", ()))


def defined(module: Any) -> Iterator[Any]:
    for name, value in vars(module).items():
        if not name.startswith("_") and getattr(value, "__module__", "") == module.__name__:
            yield value


def registered(package: Any) -> Iterator[Any]:
    for hook in exported(package):
        if hasattr(hook, "meeframe_impl"):
            yield from (record.factory for record in hook())


def public_objects() -> Iterator[Any]:
    """Yield the classes and functions on the API pages, each once."""
    lists = page_lists()
    names = ("meeframe" if name == "meeframe" else f"meeframe.{name}" for name in lists["EXPORTING"])
    objects = [value for name in names for value in exported(import_module(name))]
    objects += [value for name in lists["MODULES"] for value in defined(import_module(f"meeframe.{name}"))]
    for package in map(import_module, lists["PLUGINS"]):
        objects += [*exported(package), *registered(package)]
    for value in {id(value): value for value in objects}.values():
        if (inspect.isclass(value) or is_function(value)) and value.__module__.startswith("meeframe"):
            yield value


def is_function(value: Any) -> bool:
    """Return True for functions, also for compiled, cached and checked ones."""
    return inspect.isfunction(inspect.unwrap(value))


def documented(docstring: str | None, *titles: str) -> list[str]:
    """Return the names in sections of a docstring, whose titles are underlined in lines of their own."""
    assert not re.search(r"\w -{4,} \w", docstring or ""), docstring
    titles = "|".join(titles)
    sections = re.findall(
        rf"^(?:{titles})\n-+\n(.*?)(?=\n\n[^\n]+\n---|\Z)", inspect.cleandoc(docstring or ""), re.M | re.S
    )
    entries = re.findall(r"^(\*{0,2}\w+(?:, \w+)*)(?: : .*)?$", "\n".join(sections), re.MULTILINE)
    return [name.lstrip("*") for entry in entries for name in entry.split(", ")]


def arguments(function: Any) -> list[str]:
    """Return the public arguments of a function or class."""
    names = inspect.signature(function).parameters
    return [name for name in names if name not in ("self", "cls") and not name.startswith("_")]


def function_faults(function: Any, contracts: tuple[Any, ...] = ()) -> Iterator[str]:
    """Yield a fault unless the docstring, or that of a contract, names exactly the arguments."""
    function = inspect.unwrap(function)
    needed, names = sorted(arguments(function)), sorted(documented(function.__doc__, "Parameters"))
    inherited = [sorted(documented(contract.__doc__, "Parameters")) for contract in contracts]
    if names != needed and (names or needed not in inherited):
        yield f"{function.__module__}.{function.__qualname__}: Parameters {names}, not {needed}"


def class_faults(cls: type) -> Iterator[str]:
    """Yield the faults of a class and its public methods."""
    has_arguments = hasattr(cls, "__dataclass_fields__") or hasattr(cls, "_fields") or "__init__" in vars(cls)
    if has_arguments and not (issubclass(cls, Enum | BaseException) or getattr(cls, "_is_protocol", False)):
        needed = arguments(cls)
        missing = set(needed) - set(documented(cls.__doc__, "Parameters", "Attributes"))
        if missing:
            yield f"{cls.__module__}.{cls.__qualname__}: no Parameters or Attributes for {', '.join(sorted(missing))}"
        unknown = set(documented(cls.__doc__, "Parameters")) - set(needed)
        if unknown:
            yield f"{cls.__module__}.{cls.__qualname__}: no arguments {', '.join(sorted(unknown))}"
    for name, member in vars(cls).items():
        method = member.__func__ if isinstance(member, classmethod | staticmethod) else member
        if not name.startswith("_") and is_function(method):
            contracts = (getattr(base, name, None) for base in (*cls.__mro__[1:], *OPTIONAL_CONTRACTS))
            yield from function_faults(method, tuple(filter(None, contracts)))


def faults_of(value: Any) -> list[str]:
    return list(class_faults(value) if inspect.isclass(value) else function_faults(value))


def test_checks_detect_faults():
    class Contract:
        def step(self, gap):
            """Step.

            Parameters
            ----------
            gap : Array
                Gap [m].
            """

    class Method(Contract):
        def __init__(self, mu, tolerance):
            """Make it."""

        def step(self, gap):
            """Make one step."""

        def limit(self, gap):
            """Return the limit of a gap."""

    def function(gap, *others):
        """Return a gap.

        Parameters
        ----------
        gap : Array
            Gap [m].

        Returns
        -------
        others : Array
        """

    assert len(faults_of(function)) == 1
    assert not faults_of(Contract)
    arguments_fault, limit_fault = faults_of(Method)
    assert "no Parameters or Attributes for mu, tolerance" in arguments_fault
    assert "limit: Parameters [], not ['gap']" in limit_fault
    Method.__doc__ = "A method.\n\nAttributes\n----------\nmu, tolerance : float\n    Numbers."
    assert faults_of(Method) == [limit_fault]
    Method.__doc__ = "A method.\n\nParameters\n----------\nmu, tolerance, gap : float\n    Numbers."
    assert "no arguments gap" in faults_of(Method)[0]


def test_sections_name_arguments():
    objects = list(public_objects())
    assert len(objects) > 300
    faults = "\n".join(sorted(fault for value in objects for fault in faults_of(value)))
    assert not faults, faults
