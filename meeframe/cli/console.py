"""Exit status, messages, progress and the registry of all commands."""

import errno
import gc
import os
import signal
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Final

import typer

from meeframe.common.errors import MeeframeError
from meeframe.common.literal import LiteralConsole, printable

if TYPE_CHECKING:
    from meeframe.plugin.registry import Registry
    from meeframe.system.reduced import Progress

CONVERGED: Final = 0
NOT_CONVERGED: Final = 1
BAD_INPUT: Final = 2
INTERRUPTED: Final = 130

_HDF5: Final = ("meeframe.results.hdf5", "meeframe.common.hdf5")
"""Modules that HDF5 calls to write a file, and to visit what it contains."""
_PATH_ERRORS: Final = (errno.EACCES, errno.EPERM, errno.ENAMETOOLONG, errno.ELOOP)
"""Error numbers caused by the paths that users give."""


@contextmanager
def exit_status(memory_status: int = BAD_INPUT, interruption_note: str = "") -> Iterator[None]:
    """Report errors that users can cause by a message and an exit status.

    Defects of meeframe keep their traceback.

    Parameters
    ----------
    memory_status
        Exit status if memory runs out during a solution. Memory that runs out while a case is read and assembled raises
        CaseError, which is invalid input.
    interruption_note
        Text for an interruption that carries no note because it came before anything was written.
    """
    try:
        with _handle_termination(), _print_warnings(), _report_plugins():
            yield
    except MeeframeError as error:
        print(f"error: {printable(_with_notes(str(error), error))}", file=sys.stderr)
        raise typer.Exit(BAD_INPUT) from None
    except OSError as error:
        if error.errno not in _PATH_ERRORS or error.filename is None:
            raise
        print(printable(f"error: {error.filename}: {error.strerror}"), file=sys.stderr)
        raise typer.Exit(BAD_INPUT) from None
    except RuntimeError as error:
        if "no locator available" not in str(error):  # raised by numba for its cache
            raise
        print(
            "error: compiled kernels can be cached neither next to the sources nor in the user's cache folder: set "
            "NUMBA_CACHE_DIR to a writable folder",
            file=sys.stderr,
        )
        raise typer.Exit(BAD_INPUT) from None
    except ValueError as error:
        if "threading layer" not in str(error):  # raised by numba when it starts its threads
            raise
        layer = os.environ.get("NUMBA_THREADING_LAYER", "")
        print(
            f"error: environment variable NUMBA_THREADING_LAYER = {printable(repr(layer))}: numba cannot load it; "
            "allowed: default, workqueue, or omp and tbb if they are installed",
            file=sys.stderr,
        )
        raise typer.Exit(BAD_INPUT) from None
    except MemoryError as error:
        print(f"error: {_with_notes('not enough memory', error, interruption_note)}", file=sys.stderr)
        raise typer.Exit(memory_status) from None
    except KeyboardInterrupt as error:
        repeated = isinstance(error.__context__, KeyboardInterrupt)  # the first had no time to report what was written
        print(_with_notes("interrupted", error, "" if repeated else interruption_note), file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None


@contextmanager
def _report_plugins() -> Iterator[None]:
    """Report an exception from the code of a plugin wherever it is raised, also as the code of an attribute."""
    try:
        yield
    except (MeeframeError, MemoryError, KeyboardInterrupt, typer.Exit):
        raise
    except BaseException as error:
        from meeframe.plugin.sources import fault_in

        fault = fault_in(error)
        if fault is None:
            raise
        print(f"error: {printable(_with_notes(str(fault), error))}", file=sys.stderr)
        raise typer.Exit(BAD_INPUT) from None


@contextmanager
def _print_warnings() -> Iterator[None]:
    """Print each warning of a library or plugin once, in one line, like the warnings of meeframe."""
    reported: set[str] = set()

    def show(message: Warning | str, category: type[Warning], filename: str, lineno: int, *_: object) -> None:
        text = f"{filename}, line {lineno}: {category.__name__}: {' '.join(str(message).split())}"
        if text not in reported:
            reported.add(text)
            warn(text)

    with warnings.catch_warnings():
        warnings.showwarning = show  # type: ignore[assignment]  # called by position
        yield


@contextmanager
def _handle_termination() -> Iterator[None]:
    """Handle a request to end (SIGTERM) like Ctrl-C, also where Python cannot raise an exception."""
    if threading.current_thread() is not threading.main_thread():  # signal handlers can be set in the main thread only
        yield
        return
    hook, numbers = sys.unraisablehook, (signal.SIGTERM, signal.SIGALRM)
    handlers = {number: signal.signal(number, _interrupt) for number in numbers}
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # background jobs of a shell ignore it
        handlers[signal.SIGINT] = signal.signal(signal.SIGINT, _interrupt)
    sys.unraisablehook = lambda ignored: (
        _repeat_interrupt(ignored) or _is_reported_write_error(ignored) or hook(ignored)
    )
    try:
        yield
    finally:
        sys.unraisablehook = hook
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, handler in handlers.items():
            signal.signal(number, handler)


def _interrupt(_number: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt, or raise it later while numba unpickles a return value or HDF5 calls Python.

    At the end of every long call compiled code asks Python to unpickle what it returns. An exception raised there is
    lost: numba returns all the same, and Python turns it into a SystemError. HDF5 calls Python to write, and takes an
    exception for an error of the file; h5py turns one that is raised while HDF5 visits links into a SystemError, too.
    """
    while frame is not None:
        if frame.f_code.co_name == "_numba_unpickle" or frame.f_globals.get("__name__") in _HDF5:
            _interrupt_soon()
            return
        frame = frame.f_back
    raise KeyboardInterrupt


def _interrupt_soon() -> None:
    """Interrupt again in a moment by a signal, which also ends waiting calls, unless the command has ended by then.

    No thread may start here: it may collect garbage, which waits for h5py, which waits for this function.
    """
    if signal.getsignal(signal.SIGALRM) is _interrupt:
        signal.setitimer(signal.ITIMER_REAL, 0.01)


def _repeat_interrupt(ignored: "sys.UnraisableHookArgs") -> bool:
    """Repeat an interruption that arrived while an object was finalized; h5py finalizes many."""
    interrupts = issubclass(ignored.exc_type, KeyboardInterrupt)
    if interrupts:
        _interrupt_soon()
    return interrupts


def _is_reported_write_error(ignored: "sys.UnraisableHookArgs") -> bool:
    """Return whether h5py repeats, on closing a file that could not be written, an error that has been reported."""
    return issubclass(ignored.exc_type, RuntimeError) and "file write failed" in str(ignored.exc_value)


def _with_notes(message: str, error: BaseException, default: str = "") -> str:
    return "; ".join(filter(None, [message, *getattr(error, "__notes__", (default,))]))


@contextmanager
def loading() -> Iterator[None]:
    """Suspend garbage collection while modules and the case of `check` load, which saves a seventh of the time.

    Afterwards the collection runs as before, over newer objects only.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        if enabled:
            gc.enable()


def stdout() -> LiteralConsole:
    """Return the standard output, on which text appears literally and is not wrapped unless it is a terminal."""
    return LiteralConsole(width=None if sys.stdout.isatty() else 240, markup=False, emoji=False)


def registry(files: list[Path] | None) -> "Registry":
    """Return the registry with the plugins of the given files, and warn about plugins that cannot be loaded."""
    from meeframe.plugin.registry import load

    loaded = load(*(files or ()))
    for broken in loaded.broken:
        warn(str(broken))
    return loaded


def warn(text: str) -> None:
    """Print a warning on standard error."""
    print(printable(f"warning: {text}"), file=sys.stderr)


def progress() -> "AbstractContextManager[Progress]":
    """Show a bar for each stage, with the time that it has taken, on the standard error."""
    from meeframe.api.progress import bars

    return bars()
