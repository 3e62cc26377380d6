"""The registry: everything that has a name in a case file, whoever provides it."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from importlib import metadata
from pathlib import Path
from typing import Any, Final

import pluggy

from meeframe.core.contact import ConductivityLaw, ContactLaw, Solver
from meeframe.core.element import SurfaceElement
from meeframe.core.errors import PluginError
from meeframe.core.formulation import Formulation
from meeframe.core.fundamental import FundamentalSolution
from meeframe.core.indenter import Indenter
from meeframe.plugin.hookspecs import PROJECT, HookSpecs, Record
from meeframe.plugin.validation import Problem, TableError, build, choices


class Kind(StrEnum):
    """Kinds of things that can be registered, one hook each."""

    FUNDAMENTAL_SOLUTION = "fundamental solution"
    ELEMENT = "element"
    FORMULATION = "formulation"
    CONTACT_LAW = "contact law"
    CONDUCTIVITY_LAW = "conductivity law"
    SOLVER = "solver"
    INDENTER = "indenter"

    @property
    def hook(self) -> str:
        """Name of the hook: meeframe_contact_laws."""
        return f"{PROJECT}_{self.value.replace(' ', '_')}s"


CONTRACTS: Final[Mapping[type, Kind]] = {
    FundamentalSolution: Kind.FUNDAMENTAL_SOLUTION,
    SurfaceElement: Kind.ELEMENT,
    Formulation: Kind.FORMULATION,
    ContactLaw: Kind.CONTACT_LAW,
    ConductivityLaw: Kind.CONDUCTIVITY_LAW,
    Solver: Kind.SOLVER,
    Indenter: Kind.INDENTER,
}


@dataclass(frozen=True)
class Provider:
    """Who registers: name and version of the distribution."""

    name: str
    version: str

    def __str__(self) -> str:
        return f"{self.name} {self.version}".strip()


@dataclass(frozen=True)
class Entry:
    """One registered thing and who provides it."""

    kind: Kind
    record: Record[Any]
    provider: Provider


@dataclass(frozen=True)
class Broken:
    """A plugin, or one hook of it, that failed."""

    provider: Provider
    reason: str

    def __str__(self) -> str:
        return f"plugin {self.provider} is broken: {self.reason}"


@dataclass(frozen=True)
class Registry:
    """What is registered, and the plugins that failed. Made by `load` or `from_plugins`.

    folder: where relative paths in tables start; unit: that of keys whose dimension depends on where they are used.
    """

    entries: tuple[Entry, ...]
    broken: tuple[Broken, ...] = ()
    folder: Path = Path()
    unit: str = ""

    @classmethod
    def from_plugins(cls, plugins: Iterable[tuple[Provider, object]], broken: Iterable[Broken] = ()) -> "Registry":
        """Registry of plugins (modules or objects with hook implementations).

        Plugins that fail are recorded as broken. Raises PluginError if two of them register the same name.
        """
        failed = list(broken)
        entries: list[Entry] = []
        for provider, plugin in plugins:
            try:
                hooks = _hooks(plugin)
            except (Exception, SystemExit) as error:
                failed.append(_broken(provider, error))
                continue
            for kind in Kind:
                try:
                    entries += _collect(hooks, kind, provider)
                except (Exception, SystemExit) as error:
                    failed.append(_broken(provider, error, f"{kind.hook}: "))
        _refuse_duplicates(entries)
        return cls(tuple(entries), tuple(failed))

    @property
    def providers(self) -> tuple[Provider, ...]:
        """Whoever registered something, each once."""
        return tuple(dict.fromkeys(entry.provider for entry in self.entries))

    def names(self, kind: Kind) -> tuple[str, ...]:
        """Sorted names of a kind."""
        return tuple(sorted(entry.record.name for entry in self.entries if entry.kind is kind))

    def get(self, kind: Kind, name: str) -> Record[Any]:
        """The record of a name; raises PluginError that lists the choices (and broken plugins) if there is none."""
        for entry in self.entries:
            if entry.kind is kind and entry.record.name == name:
                return entry.record
        raise PluginError(f"unknown {kind} {name!r}; {self._choices(kind, name)}")

    def create(self, kind: Kind, table: Any, other_keys: tuple[str, ...] = ()) -> Any:
        """The object that a case file describes by a table {name = ..., key = ...} or by its name alone.

        Objects of the kind itself pass through. other_keys: as of meeframe.plugin.validation.build. Raises TableError
        with located problems.
        """
        contract = next(contract for contract, its_kind in CONTRACTS.items() if its_kind is kind)
        if isinstance(table, contract):
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
            raise TableError(Problem(("name",), str(error))) from None
        options = {key: value for key, value in table.items() if key != "name"}
        return build(record.factory, options, self._convert, other_keys, self.unit)

    def _convert(self, hint: Any) -> Callable[[Any], Any] | None:
        """How tables give a value of a type that pydantic does not know: a contract, or a path."""
        if hint is Path:
            return lambda value: self.folder / value if isinstance(value, str) else value
        kind = CONTRACTS.get(hint) if isinstance(hint, type) else None
        return None if kind is None else lambda value: self.create(kind, value)

    def _choices(self, kind: Kind, name: str) -> str:
        return choices(name, self.names(kind)) + "".join(f"; {broken}" for broken in self.broken)


def _hooks(plugin: object) -> Any:
    """The hooks of one plugin, on a manager of its own so that it cannot touch the others.

    Whatever the plugin does wrong comes out as an exception.
    """
    manager = pluggy.PluginManager(PROJECT)
    manager.add_hookspecs(HookSpecs)
    manager.register(plugin)
    manager.check_pending()
    if not manager.get_hookcallers(plugin):
        raise PluginError("it implements no hook of meeframe")
    return manager.hook


def _collect(hooks: Any, kind: Kind, provider: Provider) -> list[Entry]:
    records = [record for answer in getattr(hooks, kind.hook)() for record in answer]
    for record in records:
        if not (isinstance(record, Record) and isinstance(record.name, str) and callable(record.factory)):
            raise TypeError(f"a hook returns records, not {record!r}")
    return [Entry(kind, record, provider) for record in records]


def _broken(provider: Provider, error: BaseException, where: str = "") -> Broken:
    return Broken(provider, f"{where}{type(error).__name__}: {error}")


def _refuse_duplicates(entries: list[Entry]) -> None:
    seen: dict[tuple[Kind, str], Entry] = {}
    for entry in entries:
        key = (entry.kind, entry.record.name)
        if key in seen:
            raise PluginError(
                f"{entry.kind} {entry.record.name!r} is provided twice: by {seen[key].provider} and by "
                f"{entry.provider}; uninstall one of them"
            )
        seen[key] = entry


def _installed() -> tuple[list[tuple[Provider, object]], list[Broken]]:
    plugins: list[tuple[Provider, object]] = []
    broken: list[Broken] = []
    for point in metadata.entry_points(group=PROJECT):
        provider = Provider(point.dist.name, point.dist.version) if point.dist else Provider(point.name, "")
        try:
            plugins.append((provider, point.load()))
        except (Exception, SystemExit) as error:
            broken.append(_broken(provider, error))
    return plugins, broken


@lru_cache(maxsize=1)
def load() -> Registry:
    """The registry of the built-ins and of all installed plugins (entry points of the group 'meeframe')."""
    from meeframe.plugin import builtins

    plugins, broken = _installed()
    own = Provider(PROJECT, metadata.version(PROJECT))
    return Registry.from_plugins([(own, builtins), *plugins], broken)
