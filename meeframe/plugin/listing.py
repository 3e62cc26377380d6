"""Terminal pages of registered objects: a list of all, and a page for each."""

from collections.abc import Collection, Iterator

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.text import Text

from meeframe.common.literal import LiteralTable
from meeframe.plugin.describe import documentation, find, parameters
from meeframe.plugin.hookspecs import PROJECT
from meeframe.plugin.registry import Entry, Kind, Registry


def plugin_list(registry: Registry, kinds: Collection[Kind] = tuple(Kind)) -> RenderableType:
    """Return the list of names by kind, one line each with the summary and, for plugins, the provider.

    Parameters
    ----------
    registry
        The registry.
    kinds
        Kinds to list.
    """
    width = max((len(entry.record.name) for entry in registry.entries), default=0)
    blocks: list[RenderableType] = []
    for kind in kinds:
        table = LiteralTable(box=None, pad_edge=False, show_header=False)
        table.add_column(no_wrap=True, min_width=width)
        table.add_column()
        for entry in (entry for entry in registry.entries if entry.kind is kind):
            plugin = f" ({entry.provider.name})" if entry.provider.name != PROJECT else ""
            table.add_row(entry.record.name, entry.record.summary + plugin)
        blocks += [Text(f"{kind}s", style="bold"), Padding(table, (0, 0, 1, 2), expand=False)]
    return Group(*blocks, Text("meeframe plugins show NAME: parameters, provider, source"))


def plugin_page(registry: Registry, name: str) -> RenderableType:
    """Return the page of a name: summary, parameters, and documentation with formula and source.

    Raises
    ------
    PluginError
        For an unknown name.
    """
    return Group(*(block for entry in find(registry, name) for block in _page(registry, entry)))


def _page(registry: Registry, entry: Entry) -> Iterator[RenderableType]:
    record, factory = entry.record, entry.record.factory
    yield Text(f"{record.name}: {entry.kind}, {record.summary}", style="bold")
    yield Text(f"provider: {entry.provider}")
    yield Text(f"source: {record.source}")
    yield Text(f"class: {factory.__module__}.{getattr(factory, '__qualname__', factory)}")
    yield Text("")
    keys = parameters(entry, registry)
    if keys:
        table = LiteralTable(box=None, pad_edge=False, header_style="bold")
        for title in ("parameter", "unit", "allowed", "default"):
            table.add_column(title)
        for key in keys:
            table.add_row(key.name, key.unit, key.allowed, key.default)
        yield table
    else:
        yield Text("No parameters.")
    text = documentation(entry)
    yield Text(f"\n{text}\n" if text else "")
