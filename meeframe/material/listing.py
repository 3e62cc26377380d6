"""Terminal pages of the material library: a list of all materials, and a page for each."""

from typing import Final

from rich.console import Group, RenderableType
from rich.text import Text

from meeframe.common.literal import LiteralTable
from meeframe.material.components import UNITS, material_components, parse_component
from meeframe.material.library import CONFIDENCE, LibraryEntry, library, library_entry, library_heat
from meeframe.material.material import Material

_COUPLINGS: Final = (
    ("piezoelectric", "piezoelectric"),
    ("piezomagnetic", "piezomagnetic"),
    ("magnetoelectric", "magneto-electric"),
)


def material_list() -> RenderableType:
    """Return the table of the library: name, symmetry, couplings, confidence and source of each material."""
    table = LiteralTable(box=None, pad_edge=False, header_style="bold")
    for title in ("name", "symmetry", "fields", "confidence", "source"):
        table.add_column(title)
    for entry in library():
        table.add_row(entry.name, entry.symmetry, couplings(_made(entry)), entry.confidence or "-", entry.source)
    levels = [Text(f"{level}: {meaning}") for level, meaning in CONFIDENCE.items()]
    return Group(table, Text(""), *levels, Text("meeframe materials show NAME: constants, options, notes"))


def material_page(name: str) -> RenderableType:
    """Return the page of a material: constants with units, options, source and confidence.

    Raises
    ------
    MaterialError
        For an unknown name; the message lists those that exist.
    """
    entry = library_entry(name)
    lines = [
        Text(f"{entry.name}: {entry.summary}", style="bold"),
        Text(f"symmetry: {entry.symmetry}; fields: {couplings(_made(entry))}"),
        Text(f"source: {entry.source}"),
        Text("; ".join(filter(None, [f"confidence: {entry.confidence}" * bool(entry.confidence), entry.note]))),
    ]
    if entry.options:
        needed = {key: " (required)" if key in entry.required else "" for key in entry.options}
        lines.append(Text("options: " + ", ".join(f"{k} [{u or '1'}]{needed[k]}" for k, u in entry.options.items())))
    if entry.required:
        return Group(*lines)
    table = LiteralTable(box=None, pad_edge=False, header_style="bold")
    for title in ("component", "unit"):
        table.add_column(title)
    table.add_column("value", justify="right")
    for component, value in material_components(_made(entry)).items():
        table.add_row(component, UNITS[parse_component(component)[0]], f"{value:.6g}")
    heat = library_heat(entry.name)
    if heat is None:
        return Group(*lines, Text(""), table)
    thermal = LiteralTable(box=None, pad_edge=False, header_style="bold")
    for title in ("thermal constant, with thermal = true", "value"):
        thermal.add_column(title)
    for key, value in heat.items():
        thermal.add_row(key, str(value))
    return Group(*lines, Text(""), table, Text(""), thermal)


def couplings(material: Material) -> str:
    """Return the couplings of a material in words, 'elastic' if it has none."""
    return ", ".join(word for name, word in _COUPLINGS if getattr(material, name).any()) or "elastic"


def _made(entry: LibraryEntry) -> Material:
    """Return the material of an entry, with an arbitrary value of options that have no default."""
    return entry.make(**dict.fromkeys(entry.required, 0.25))
