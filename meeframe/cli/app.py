"""The application, and arguments that several commands have."""

from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",  # joins the lines of a paragraph
    help="Three-dimensional frictional contact of anisotropic magneto-electro-elastic solids.",
)

CaseFile = Annotated[Path, typer.Argument(metavar="CASE.toml", help="The case file (docs/case-files.md).")]
Choices = Annotated[list[str] | None, typer.Option(metavar="NAME", help="Name or inline table; repeatable.")]
PluginFiles = Annotated[
    list[Path] | None, typer.Option("--plugin", metavar="FILE.py", help="Load a plugin from a file; repeatable.")
]
Threads = Annotated[
    int | None, typer.Option(metavar="N", min=1, max=1024, help="Of this command; by default those of all processors.")
]


def _print_version(wanted: bool) -> None:
    if wanted:
        from meeframe import __version__

        print(f"meeframe {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", metavar="", callback=_print_version, is_eager=True, help="Print the version and exit."
        ),
    ] = False,
) -> None:
    pass
