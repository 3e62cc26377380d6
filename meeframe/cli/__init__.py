"""The command line, a module for each group of commands."""

from meeframe.cli import cases, extensions, fclib, studies
from meeframe.cli.app import app

__all__ = ["app", "cases", "extensions", "fclib", "main", "studies"]


def main() -> None:
    """Entry point of the console script."""
    app()
