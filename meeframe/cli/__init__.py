"""Command line of meeframe, with a module for each group of commands."""

import errno
import gc
import os
import sys
from io import TextIOWrapper

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
    _prepare_output()
    try:
        _run()
    except SystemExit as ended:
        if ended.code == console.INTERRUPTED:
            sys.unraisablehook = _ignore  # files that two interruptions left half open cannot be closed properly
            if isinstance(getattr(ended.__context__, "__cause__", None), KeyboardInterrupt):
                print("interrupted", file=sys.stderr)  # before the command, or again while it reported the first
        raise
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(console.INTERRUPTED)
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EPIPE) or error.filename is not None:  # files have names
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # Python writes the rest at its end
        if error.errno == errno.EPIPE:
            sys.exit(1)
        print("error: the standard output cannot be written: no space is left on its device", file=sys.stderr)
        sys.exit(console.BAD_INPUT)
    finally:
        gc.freeze()  # saves the garbage collection of a third of a second at exit


def _prepare_output() -> None:
    """Let the standard output take any text, also where it is closed."""
    if sys.stdout is None:
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115  # until the process ends
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # titles may have characters that its encoding lacks


def _run() -> None:
    """Run a command and write everything that it printed."""
    try:
        app()
    finally:
        sys.stdout.flush()
