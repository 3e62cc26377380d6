"""The command line, a module for each group of commands."""

import gc
import sys

try:
    from meeframe.cli import cases, extensions, fclib, studies
    from meeframe.cli.app import app
except KeyboardInterrupt:  # in the first third of a second
    print("interrupted", file=sys.stderr)
    sys.exit(130)

__all__ = ["app", "cases", "extensions", "fclib", "main", "studies"]


def main() -> None:
    """Run the command line; entry point of the console script."""
    try:
        app()
    finally:
        gc.freeze()  # or Python looks through all there is for garbage before it ends, for a third of a second
