"""The application and the arguments that several commands share."""

import os
import resource
import sys
from pathlib import Path
from typing import Annotated, Final

import typer

MIN_ADDRESS_SPACE: Final = 2**30
"""Smallest limit of the address space [bytes]. Within less, OpenBLAS waits without end for memory, and Python hangs."""

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",  # lines of a paragraph are joined
    help="Solve three-dimensional frictional contact of anisotropic magneto-electro-elastic solids.",
)

CaseFile = Annotated[Path, typer.Argument(metavar="CASE.toml", help="The case file (docs/reference/case-files.md).")]
Choices = Annotated[list[str] | None, typer.Option(metavar="NAME", help="A name or an inline table; repeatable.")]
PluginFiles = Annotated[
    list[Path] | None, typer.Option("--plugin", metavar="FILE.py", help="Load a plugin from a file; repeatable.")
]
Threads = Annotated[
    int | None, typer.Option(metavar="N", min=1, max=1024, help="Number of threads; by default one for each core.")
]
PictureFormat = Annotated[
    str, typer.Option("--format", metavar="FORMAT", help="Format of figures: png, or for vector graphics pdf or svg.")
]


def _print_version(requested: bool) -> None:
    if requested:
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
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit != resource.RLIM_INFINITY and limit < MIN_ADDRESS_SPACE:
        print(
            f"error: the address space is limited to {limit >> 20} MiB (ulimit -v); allowed: at least "
            f"{MIN_ADDRESS_SPACE >> 20} MiB, in which the libraries start",
            file=sys.stderr,
        )
        raise typer.Exit(2)
    threads = os.environ.get("NUMBA_NUM_THREADS", "1")
    if not (threads.isdecimal() and int(threads) > 0):
        print(f"error: environment variable NUMBA_NUM_THREADS = {threads!r}; allowed: an integer > 0", file=sys.stderr)
        raise typer.Exit(2)
