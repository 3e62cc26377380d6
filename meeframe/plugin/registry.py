"""Registry of everything that case files can name, from meeframe and from plugins."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import lru_cache
from importlib import metadata
from pathlib import Path
from typing import Any, Final

import pluggy
from pydantic import ValidationInfo

from meeframe.common.errors import PluginError
from meeframe.contact.problem import Solver
from meeframe.elements.base import SurfaceElement
from meeframe.fields import MEE, OPTIONAL_FIELDS, FieldSet, ScalarField
from meeframe.formulations.base import Formulation
from meeframe.greens.base import FundamentalSolution
from meeframe.indenters.base import Indenter
from meeframe.laws.base import ConductivityLaw, ContactLaw
from meeframe.laws.wear import WearLaw
from meeframe.plugin.faults import fault
from meeframe.plugin.hookspecs import PROJECT, HookSpecs, Record
from meeframe.plugin.sources import Broken, Provider, file_fault, installed, line_in, load_file, reason
from meeframe.plugin.validation import Problem, TableError, build, choices


class Kind(StrEnum):
    """Kinds of objects that can be registered, with one hook each."""

    FUNDAMENTAL_SOLUTION = "fundamental solution"
    ELEMENT = "element"
    FORMULATION = "formulation"
    CONTACT_LAW = "contact law"
    CONDUCTIVITY_LAW = "conductivity law"
    WEAR_LAW = "wear law"
    SOLVER = "solver"
    INDENTER = "indenter"

    @property
    def hook(self) -> str:
        """Name of the hook, such as meeframe_contact_laws."""
        return f"{PROJECT}_{self.value.replace(' ', '_')}s"


CONTRACTS: Final[Mapping[type, Kind]] = {
    FundamentalSolution: Kind.FUNDAMENTAL_SOLUTION,
    SurfaceElement: Kind.ELEMENT,
    Formulation: Kind.FORMULATION,
    ContactLaw: Kind.CONTACT_LAW,
    ConductivityLaw: Kind.CONDUCTIVITY_LAW,
    WearLaw: Kind.WEAR_LAW,
    Solver: Kind.SOLVER,
    Indenter: Kind.INDENTER,
}


def contract_of(kind: Kind) -> type:
    """Return the abstract class of a kind."""
    return next(contract for contract, kind_of_contract in CONTRACTS.items() if kind_of_contract is kind)


@dataclass(frozen=True)
class Entry:
    """A registered object and its provider."""

    kind: Kind
    record: Record[Any]
    provider: Provider


@dataclass(frozen=True)
class Registry:
    """Everything that is registered, and the plugins that failed; created by `load` or `from_plugins`.

    Attributes
    ----------
    entries
        Registered objects.
    broken
        Plugins that failed.
    folder
        Folder that relative paths in tables refer to.
    unit
        Units of keys whose dimension depends on their use, separated by blanks.
    scalar_fields
        Further scalar fields that materials may have.
    """

    entries: tuple[Entry, ...]
    broken: tuple[Broken, ...] = ()
    folder: Path = Path()
    unit: str = ""
    scalar_fields: tuple[ScalarField, ...] = OPTIONAL_FIELDS

    @property
    def fields(self) -> FieldSet:
        """Field set with all scalar fields that materials may have."""
        return FieldSet((*MEE.scalars, *self.scalar_fields))

    @classmethod
    def from_plugins(cls, plugins: Iterable[tuple[Provider, object]], broken: Iterable[Broken] = ()) -> "Registry":
        """Create the registry of plugins, which are modules or objects with hook implementations.

        Plugins that fail are recorded as broken. Raises PluginError if two of them register the same name.
        """
        entries: list[Entry] = []
        failed = list(broken)
        for provider, plugin in plugins:
            valid, faults = _collect(provider, plugin)
            entries += valid
            failed += faults
        _refuse_duplicates(entries)
        return cls(tuple(entries), tuple(failed))

    @property
    def providers(self) -> tuple[Provider, ...]:
        """Providers that registered something, each once."""
        return tuple(dict.fromkeys(entry.provider for entry in self.entries))

    def names(self, kind: Kind) -> tuple[str, ...]:
        """Return the sorted names of a kind."""
        return tuple(sorted(entry.record.name for entry in self.entries if entry.kind is kind))

    def get(self, kind: Kind, name: str) -> Record[Any]:
        """Return the record of a name.

        Raises
        ------
        PluginError
            For an unknown name; the message lists the choices and the broken plugins.
        """
        for entry in self.entries:
            if entry.kind is kind and entry.record.name == name:
                return entry.record
        raise PluginError(f"unknown {kind} {name!r}; {self._choices(kind, name)}")

    def create(self, kind: Kind, table: Any, other_keys: tuple[str, ...] = ()) -> Any:
        """Create an object from its description in a case file.

        Parameters
        ----------
        kind
            Kind of the object.
        table
            A table {name = ..., key = ...}, a name, or an object of this kind, which is returned.
        other_keys
            As for `meeframe.plugin.validation.build`.

        Raises
        ------
        TableError
            With the location of each problem.
        """
        if isinstance(table, contract_of(kind)):
            return table
        if isinstance(table, str):
            table = {"name": table}
        if not isinstance(table, Mapping):
            raise TableError(Problem((), f"should be a name or a table with a name ({kind})", table))
        name = table.get("name")
        if not isinstance(name, str):
            names = ", ".join(self.names(kind))
            if "name" in table:
                raise TableError(Problem(("name",), f"should be a text, one of {names}", name))
            raise TableError(Problem(("name",), f"missing key; one of {names}"))
        try:
            record = self.get(kind, name)
        except PluginError as error:
            raise TableError(Problem(("name",), str(error), unknown=True)) from None
        options = {key: value for key, value in table.items() if key != "name"}
        return build(record.factory, options, _converter, other_keys, self.unit, self)

    def _choices(self, kind: Kind, name: str) -> str:
        hint = "; load a local plugin with --plugin FILE.py"
        return choices(name, self.names(kind)) + hint + "".join(f"; {broken}" for broken in self.broken)


def registry_of(info: ValidationInfo) -> Registry:
    """Return the registry that is the context of the validation, in which names are looked up."""
    registry: Registry = info.context  # type: ignore[assignment]
    return registry


def _converter(hint: Any) -> Callable[[Any, ValidationInfo], Any] | None:
    """Return the converter of table values to abstract classes and paths, by the registry that is the context."""
    if hint is Path:
        return lambda value, info: registry_of(info).folder / value if isinstance(value, str) else value
    kind = CONTRACTS.get(hint) if isinstance(hint, type) else None
    return None if kind is None else lambda value, info: registry_of(info).create(kind, value)


def _hooks(plugin: object) -> Any:
    """Return the hooks of one plugin, on a separate manager so that it cannot affect others.

    Any error of the plugin raises an exception.
    """
    manager = pluggy.PluginManager(PROJECT)
    manager.add_hookspecs(HookSpecs)
    manager.register(plugin)
    _check_names(manager)
    if not manager.get_hookcallers(plugin):
        raise PluginError("it implements no hook of meeframe")
    return manager.hook


def _check_names(manager: pluggy.PluginManager) -> None:
    """Raise PluginError for an implementation of an unknown hook."""
    try:
        manager.check_pending()
    except pluggy.PluginValidationError as error:
        message = str(error).partition(" in plugin ")[0]
        name = message.partition("'")[2].rstrip("'")
        raise PluginError(f"{message}; {choices(name, [kind.hook for kind in Kind])}") from None


def _collect(provider: Provider, plugin: object) -> tuple[list[Entry], list[Broken]]:
    """Return the valid entries of a plugin and its broken hooks and records; the valid ones remain usable."""
    file = getattr(plugin, "__file__", None)
    entries: list[Entry] = []
    broken: list[Broken] = []
    try:
        hooks = _hooks(plugin)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # plugins may also raise SystemExit and the like
        return [], [Broken(provider, reason(error), line_in(error, file))]
    for kind in Kind:
        try:
            records = [record for result in getattr(hooks, kind.hook)() for record in result]
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            broken.append(Broken(provider, f"{kind.hook}: {reason(error)}", line_in(error, file)))
            continue
        for record in records:
            problem = fault(kind, contract_of(kind), record)
            if problem:
                broken.append(Broken(provider, f"{kind.hook}: {problem}"))
            else:
                entries.append(Entry(kind, record, provider))
    return entries, broken


def _refuse_duplicates(entries: list[Entry]) -> None:
    seen: dict[tuple[Kind, str], Entry] = {}
    for entry in entries:
        key = (entry.kind, entry.record.name)
        if key in seen:
            raise PluginError(
                f"{entry.kind} {entry.record.name!r} is provided twice: by {seen[key].provider} and by "
                f"{entry.provider}; rename or uninstall one of them"
            )
        seen[key] = entry


def load(*files: Path) -> Registry:
    """Return the registry of the built-in objects, of installed plugins and of local plugin files.

    Installed plugins (entry points of the group 'meeframe') that fail are recorded as broken.

    Parameters
    ----------
    *files
        Local plugin files.

    Raises
    ------
    PluginError
        If a local file fails, with the file, the line and the cause, or if two plugins register the same name.
    """
    registry = _without_files()
    if not files:
        return registry
    local = Registry.from_plugins(load_file(file) for file in dict.fromkeys(files))
    for broken in local.broken:
        raise PluginError(file_fault(broken.provider.name, broken.reason, broken.line))
    entries = [*registry.entries, *local.entries]
    _refuse_duplicates(entries)
    return replace(registry, entries=tuple(entries))


@lru_cache(maxsize=1)
def _without_files() -> Registry:
    from meeframe.plugin import builtins

    plugins, broken = installed()
    provider = Provider(PROJECT, metadata.version(PROJECT))
    return Registry.from_plugins([(provider, builtins), *plugins], broken)
