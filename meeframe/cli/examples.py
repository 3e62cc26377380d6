"""Command on example cases: example."""

from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Annotated, Final

import typer

from meeframe.cli import console
from meeframe.cli.app import app

_PLUGINS: Final[Mapping[str, str]] = {
    "adhesion": "meeframe-laws",
    "contact-resistance": "meeframe-halfspace",
    "film": "meeframe-halfspace",
    "rough": "meeframe-halfspace",
}
"""Plugins that examples need."""


def example_texts() -> dict[str, str]:
    """Return the text of each example case by its name."""
    files = (resources.files("meeframe") / "examples").iterdir()
    texts = {file.name.removesuffix(".toml"): file.read_text(encoding="utf-8") for file in files}
    return dict(sorted(texts.items()))


@app.command()
def example(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Name of the example; omit it for a list.")] = None,
    out: Annotated[Path | None, typer.Option(metavar="CASE.toml", help="File; NAME.toml by default.")] = None,
) -> None:
    """Write an example case into the current folder, or list the examples."""
    with console.exit_status():
        from meeframe.common.errors import CaseError
        from meeframe.plugin.validation import choices

        texts = example_texts()
        if name is None:
            _print_list(texts)
            return
        if name not in texts:
            raise CaseError(f"unknown example {name!r}; {choices(name, texts)}")
        target = out or Path(f"{name}.toml")
        try:
            with target.open("x", encoding="utf-8") as file:
                file.write(texts[name])
        except OSError as error:
            raise CaseError(f"{target}: {error.strerror or error}; choose another file with --out") from None
        needs = f", which needs the plugin {_PLUGINS[name]}" if name in _PLUGINS else ""
        print(f"wrote {target}{needs}; run it with: meeframe run {target} --out out/{name}")


def _print_list(texts: Mapping[str, str]) -> None:
    import tomllib

    from meeframe.common.literal import LiteralTable

    table = LiteralTable(box=None, pad_edge=False, header_style="bold")
    for title in ("example", "case", "plugin"):
        table.add_column(title)
    for name, text in texts.items():
        table.add_row(name, tomllib.loads(text)["title"], _PLUGINS.get(name, ""))
    console.stdout().print(table)
    print("meeframe example NAME writes NAME.toml")
