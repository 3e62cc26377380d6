"""The command line, a module for each group of commands."""

import gc

from meeframe.cli import cases, extensions, fclib, studies
from meeframe.cli.app import app

__all__ = ["app", "cases", "extensions", "fclib", "main", "studies"]


def main() -> None:
    """Entry point of the console script."""
    try:
        app()
    finally:
        gc.freeze()  # or Python looks through all there is for garbage before it ends, for a third of a second
