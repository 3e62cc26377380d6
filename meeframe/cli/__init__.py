"""Command line of meeframe, with a module for each group of commands."""

import sys


def _ignore_signals() -> None:
    """Ignore interruptions while Python ends: its status and its message are settled."""
    import signal  # which may have been interrupted below

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)


try:  # before anything that takes time
    import signal
    import threading

    _is_main = threading.current_thread() is threading.main_thread()  # others cannot handle signals
    _before = signal.signal(signal.SIGTERM, signal.default_int_handler) if _is_main else None
    import errno
    import gc
    import os
    from io import TextIOWrapper
    from typing import Any

    from meeframe.cli import cases, console, doctor, examples, extensions, fclib, materials, rough, studies
    from meeframe.cli.app import app

    if _is_main:
        signal.signal(signal.SIGTERM, _before or signal.SIG_DFL)  # None: set by other than Python code
except KeyboardInterrupt:  # while modules are imported
    _ignore_signals()
    print("interrupted", file=sys.stderr)
    sys.exit(130)

__all__ = ["app", "cases", "doctor", "examples", "extensions", "fclib", "main", "materials", "rough", "studies"]


def _ignore(_: object) -> None:
    """Ignore an error in the finalization of an object."""


def main() -> None:
    """Run the command line.

    This is the entry point of the console script. After an interruption the process is to end: it ignores further
    signals.
    """
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        _prepare_output()
        _run()
    except SystemExit as ended:
        if ended.code == console.INTERRUPTED:
            _ignore_signals()
            sys.unraisablehook = _ignore  # files that two interruptions left half open cannot be closed properly
            if isinstance(getattr(ended.__context__, "__cause__", None), KeyboardInterrupt):
                print("interrupted", file=sys.stderr)  # before the command, or again while it reported the first
        raise
    except KeyboardInterrupt:
        _ignore_signals()
        print("interrupted", file=sys.stderr)
        sys.exit(console.INTERRUPTED)
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EPIPE) or error.filename is not None:  # files have names
            raise
        _discard(sys.stdout)  # Python writes the rest at its end
        if error.errno == errno.EPIPE:
            sys.exit(1)
        print("error: the standard output cannot be written: no space is left on its device", file=sys.stderr)
        sys.exit(console.BAD_INPUT)
    finally:
        if signal.getsignal(signal.SIGTERM) is signal.default_int_handler:
            signal.signal(signal.SIGTERM, before or signal.SIG_DFL)
        gc.freeze()  # saves the garbage collection of a third of a second at exit


class _Messages:
    """Standard error that loses what it cannot take, as on a full disk; commands go on and keep their status."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        """Return any other attribute of the stream."""
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write a text and return its length."""
        try:
            self._stream.write(text)
        except OSError:
            _discard(self._stream)
        return len(text)


def _discard(stream: Any) -> None:
    """Let a stream write nowhere from now on."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _prepare_output() -> None:
    """Let the standard output take any text, also where it is closed, and the standard error where it is full."""
    if sys.stdout is None:
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115  # until the process ends
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # titles may have characters that its encoding lacks
    if sys.stderr is not None and not isinstance(sys.stderr, _Messages):
        sys.stderr = _Messages(sys.stderr)


def _run() -> None:
    """Run a command and write everything that it printed."""
    try:
        app()
    finally:
        sys.stdout.flush()
