"""Registered objects by name, and the names and entries of objects for case files."""

import dataclasses
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from meeframe.common.arguments import python_numbers
from meeframe.common.errors import CaseError
from meeframe.contact.problem import Solver
from meeframe.formulations.base import Formulation
from meeframe.indenters.base import Indenter
from meeframe.laws.base import ConductivityLaw, ContactLaw
from meeframe.laws.wear import WearLaw
from meeframe.mesh.surface import SurfaceMesh
from meeframe.plugin import registry as plugins
from meeframe.plugin.registry import CONTRACTS, Registry
from meeframe.plugin.validation import TableError

T = TypeVar("T")


def law(name: str, **keys: Any) -> ContactLaw:
    """Return a registered contact law by its name in case files.

    Parameters
    ----------
    name : str
        Its name, such as 'dmt'; `meeframe plugins --kind contact-law` lists all.
    **keys
        Its keys in case files; quantities are SI numbers or texts with units.

    Returns
    -------
    ContactLaw
        The law.

    Raises
    ------
    CaseError
        For an unknown name or key, or a value that is not allowed.
    """
    return _create(ContactLaw, name, keys)


def conductivity(name: str, **keys: Any) -> ConductivityLaw:
    """Return a registered conductivity law by its name in case files.

    Parameters
    ----------
    name : str
        Its name; `meeframe plugins --kind conductivity-law` lists all.
    **keys
        Its keys in case files, as for `law`.

    Returns
    -------
    ConductivityLaw
        The law.

    Raises
    ------
    CaseError
        As `law`.
    """
    return _create(ConductivityLaw, name, keys)


def wear(name: str, **keys: Any) -> WearLaw:
    """Return a registered wear law by its name in case files.

    Parameters
    ----------
    name : str
        Its name; `meeframe plugins --kind wear-law` lists all.
    **keys
        Its keys in case files, as for `law`.

    Returns
    -------
    WearLaw
        The law.

    Raises
    ------
    CaseError
        As `law`.
    """
    return _create(WearLaw, name, keys)


def indenter(name: str, **keys: Any) -> Indenter:
    """Return a registered indenter by its name in case files, without its placement.

    Parameters
    ----------
    name : str
        Its name; `meeframe plugins --kind indenter` lists all.
    **keys
        Its keys in case files, as for `law`.

    Returns
    -------
    Indenter
        The indenter.

    Raises
    ------
    CaseError
        As `law`.
    """
    return _create(Indenter, name, keys)


def solver(name: str, **keys: Any) -> Solver:
    """Return a registered solver by its name in case files, without its stopping criteria.

    Parameters
    ----------
    name : str
        Its name; `meeframe plugins --kind solver` lists all.
    **keys
        Its keys in case files, as for `law`.

    Returns
    -------
    Solver
        The solver.

    Raises
    ------
    CaseError
        As `law`.
    """
    return _create(Solver, name, keys)


def formulation(name: str, **keys: Any) -> Formulation:
    """Return a registered formulation by its name in case files.

    Parameters
    ----------
    name : str
        Its name; `meeframe plugins --kind formulation` lists all.
    **keys
        Its keys in case files, as for `law`.

    Returns
    -------
    Formulation
        The formulation.

    Raises
    ------
    CaseError
        As `law`.
    """
    return _create(Formulation, name, keys)


def _create(contract: type[T], name: str, keys: dict[str, Any]) -> T:
    kind = CONTRACTS[contract]
    try:
        made: T = plugins.load().create(kind, {**python_numbers(keys), "name": name})
    except TableError as error:
        lines = (f"{kind} {name!r}: {problem}" for problem in error.problems)
        raise CaseError("\n".join(lines)) from error.__cause__
    return made


def described(value: Any, registry: Registry) -> Any:
    """Return the entry of a case file for a value: a table with name and keys for a registered object.

    Raises CaseError for an object that has no name in case files.
    """
    if isinstance(value, Mapping):
        table = {key: described(entry, registry) for key, entry in value.items()}
        made = table.get("name")  # of an object whose table has further keys
        return {**made, **table, "name": made["name"]} if isinstance(made, Mapping) else table
    if isinstance(value, list | tuple):
        return [described(entry, registry) for entry in value]
    if isinstance(value, SurfaceMesh):
        raise CaseError("mesh: case files do not hold points; allowed: meeframe.mesh.block, half_space or file")
    contract = next((one for one in CONTRACTS if isinstance(value, one)), None)
    if contract is None:
        return keys_of(value, registry) if dataclasses.is_dataclass(value) else value
    names = {entry.record.factory: entry.record.name for entry in registry.entries}
    if type(value) not in names:
        raise CaseError(
            f"{value!r}: its class has no name in case files; allowed: objects of registered classes "
            "(docs/howto/plugins.md)"
        )
    return {"name": names[type(value)], **keys_of(value, registry)}


def keys_of(value: Any, registry: Registry) -> dict[str, Any]:
    """Return the fields of a dataclass that differ from their defaults, as entries of a case file."""
    if not dataclasses.is_dataclass(value):
        return {}
    table = {}
    for entry in dataclasses.fields(value):
        if not entry.init:
            continue
        argument = getattr(value, entry.name)
        default = entry.default
        if entry.default_factory is not dataclasses.MISSING:
            default = entry.default_factory()
        if argument is not None and not _same(argument, default):
            table[entry.name] = described(argument, registry)
    return table


def _same(one: Any, other: Any) -> bool:
    return type(one) is type(other) and bool(one == other)


def relative(value: Any, folder: Path) -> Any:
    """Return entries of a case file with paths as texts, relative to the folder of the file."""
    if isinstance(value, Mapping):
        return {key: relative(entry, folder) for key, entry in value.items()}
    if isinstance(value, list):
        return [relative(entry, folder) for entry in value]
    if isinstance(value, Path):
        return os.path.relpath(value, folder)
    return value
