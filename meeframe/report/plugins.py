"""What is registered, for the terminal: the list of everything, and a page on each thing."""

from collections.abc import Iterator

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from meeframe.plugin.describe import documentation, find, parameters
from meeframe.plugin.registry import Entry, Registry


def plugin_list(registry: Registry) -> RenderableType:
    """A line for each thing with who provides it."""
    table = Table(box=None, pad_edge=False, header_style="bold")
    for title in ("kind", "name", "provider", "version"):
        table.add_column(title, no_wrap=True)
    table.add_column("summary")
    table.add_column("source")
    for entry in registry.entries:
        record, provider = entry.record, entry.provider
        table.add_row(entry.kind, record.name, provider.name, provider.version, record.summary, record.source)
    return table


def plugin_page(registry: Registry, name: str) -> RenderableType:
    """Everything of a name: what it is, its parameters, its documentation with formula and source.

    Raises PluginError if there is nothing of that name.
    """
    return Group(*(part for entry in find(registry, name) for part in _page(registry, entry)))


def _page(registry: Registry, entry: Entry) -> Iterator[RenderableType]:
    record, factory = entry.record, entry.record.factory
    yield Text(f"{record.name}: {entry.kind}, {record.summary}", style="bold")
    yield Text(f"provider: {entry.provider}")
    yield Text(f"source: {record.source}")
    yield Text(f"class: {factory.__module__}.{getattr(factory, '__qualname__', factory)}")
    yield Text("")
    keys = parameters(entry, registry)
    if keys:
        table = Table(box=None, pad_edge=False, header_style="bold")
        for title in ("parameter", "unit", "allowed", "default"):
            table.add_column(title)
        for key in keys:
            table.add_row(key.name, key.unit, Text(key.allowed), Text(key.default))
        yield table
    else:
        yield Text("It has no parameters.")
    text = documentation(entry)
    yield Text(f"\n{text}\n" if text else "")
