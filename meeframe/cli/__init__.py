"""Command line of meeframe, with a module for each group of commands."""

import gc
import sys

try:
    from meeframe.cli import cases, console, doctor, examples, extensions, fclib, materials, rough, studies
    from meeframe.cli.app import app
except KeyboardInterrupt:  # while modules are imported
    print("interrupted", file=sys.stderr)
    sys.exit(130)

__all__ = ["app", "cases", "doctor", "examples", "extensions", "fclib", "main", "materials", "rough", "studies"]


def _ignore(_: object) -> None:
    """Ignore an error in the finalization of an object."""


def main() -> None:
    """Run the command line.

    This is the entry point of the console script.
    """
    try:
        app()
    except SystemExit as ended:
        if ended.code == console.INTERRUPTED:
            sys.unraisablehook = _ignore  # files that two interruptions left half open cannot be closed properly
            if isinstance(getattr(ended.__context__, "__cause__", None), KeyboardInterrupt):
                print("interrupted", file=sys.stderr)  # before the command, or again while it reported the first
        raise
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(console.INTERRUPTED)
    finally:
        gc.freeze()  # saves the garbage collection of a third of a second at exit
