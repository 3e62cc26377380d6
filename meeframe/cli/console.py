"""Shared parts of all commands: exit status, messages, progress, the registry."""

import errno
import gc
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from datetime import timedelta
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Final

import typer
from rich.console import Console

from meeframe.common.errors import MeeframeError

if TYPE_CHECKING:
    from meeframe.plugin.registry import Registry
    from meeframe.system.reduced import Progress

CONVERGED: Final = 0
NOT_CONVERGED: Final = 1
BAD_INPUT: Final = 2
INTERRUPTED: Final = 130

_OF_PATHS: Final = (errno.EACCES, errno.EPERM, errno.ENAMETOOLONG, errno.ELOOP)
"""Errors of paths, which users give."""


@contextmanager
def exit_status(no_memory: int = BAD_INPUT, untouched: str = "") -> Iterator[None]:
    """Turn what a user can cause into a message and an exit status; a defect of meeframe keeps its traceback.

    no_memory: status if memory runs out; in reading and assembling it is bad input (CaseError) whatever this says;
    untouched: what to say of an interruption that carries no note, as it came before anything was written.
    """
    try:
        with _ended_as_by_hand(), _warned():
            yield
    except MeeframeError as error:
        print(f"error: {_with_notes(str(error), error)}", file=sys.stderr)
        raise typer.Exit(BAD_INPUT) from None
    except OSError as error:
        if error.errno not in _OF_PATHS or error.filename is None:
            raise
        print(f"error: {error.filename}: {error.strerror}", file=sys.stderr)
        raise typer.Exit(BAD_INPUT) from None
    except RuntimeError as error:
        if "no locator available" not in str(error):  # numba's, of its cache
            raise
        print(
            "error: compiled kernels can be kept neither beside the sources nor in the user's cache folder: set "
            "NUMBA_CACHE_DIR to a folder that can be written",
            file=sys.stderr,
        )
        raise typer.Exit(BAD_INPUT) from None
    except MemoryError as error:
        print(f"error: {_with_notes('not enough memory', error, untouched)}", file=sys.stderr)
        raise typer.Exit(no_memory) from None
    except KeyboardInterrupt as error:
        again = isinstance(error.__context__, KeyboardInterrupt)  # before the first one could say what was written
        print(_with_notes("interrupted", error, "" if again else untouched), file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None


@contextmanager
def _warned() -> Iterator[None]:
    """Print each warning of a library or plugin once, in one line, as meeframe's own warnings."""
    told: set[str] = set()

    def show(message: Warning | str, category: type[Warning], filename: str, lineno: int, *_: object) -> None:
        text = f"{filename}, line {lineno}: {category.__name__}: {' '.join(str(message).split())}"
        if text not in told:
            told.add(text)
            warn(text)

    with warnings.catch_warnings():
        warnings.showwarning = show  # type: ignore[assignment]  # called by position
        yield


@contextmanager
def _ended_as_by_hand() -> Iterator[None]:
    """Return the handle a request to end (SIGTERM) like Ctrl-C, also where Python lets no exception out."""
    if threading.current_thread() is not threading.main_thread():  # only there can it be asked for
        yield
        return
    hook, before = sys.unraisablehook, {signal.SIGTERM: signal.signal(signal.SIGTERM, _interrupt)}
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # a shell's background job is deaf to it
        before[signal.SIGINT] = signal.signal(signal.SIGINT, _interrupt)
    sys.unraisablehook = lambda ignored: _again(ignored) or _told(ignored) or hook(ignored)
    try:
        yield
    finally:
        sys.unraisablehook = hook
        for number, handler in before.items():
            signal.signal(number, handler)


def _interrupt(_number: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt; in a moment where compiled code asks Python to unpickle what it returns, which it does
    at the end of every long call: numba returns all the same, and Python makes a SystemError of it."""
    while frame is not None:
        if frame.f_code.co_name == "_numba_unpickle":
            _soon()
            return
        frame = frame.f_back
    raise KeyboardInterrupt


def _soon() -> None:
    """Ask to end once more in a moment, by a signal, which ends waiting too, unless there is nothing left to end."""

    def ask() -> None:
        if signal.getsignal(signal.SIGTERM) is _interrupt:
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGTERM)

    threading.Timer(0.01, ask).start()


def _again(ignored: "sys.UnraisableHookArgs") -> bool:
    """Return an interruption that came while an object was let go (h5py lets go of many) comes again in a moment."""
    interrupts = issubclass(ignored.exc_type, KeyboardInterrupt)
    if interrupts:
        _soon()
    return interrupts


def _told(ignored: "sys.UnraisableHookArgs") -> bool:
    """Return what h5py meets once more when it lets go of a file that could not be written, which has been told."""
    return issubclass(ignored.exc_type, RuntimeError) and "file write failed" in str(ignored.exc_value)


def _with_notes(what: str, error: BaseException, default: str = "") -> str:
    return "; ".join(filter(None, [what, *getattr(error, "__notes__", (default,))]))


@contextmanager
def loading() -> Iterator[None]:
    """Return the suspend garbage collection while modules and the case of `check` load: it takes a seventh of that
    time.

    Afterwards it is searched for as before, but among what is new.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        if enabled:
            gc.enable()


def stdout() -> Console:
    """Return standard output, on which texts appear literally; as wide as the text wants where it is no terminal."""
    return Console(width=None if sys.stdout.isatty() else 240, markup=False, emoji=False)


def registry(files: list[Path] | None) -> "Registry":
    """Return the registry, with plugins from files; warn of broken plugins."""
    from meeframe.plugin.registry import load

    loaded = load(*(files or ()))
    for broken in loaded.broken:
        warn(str(broken))
    return loaded


def warn(text: str) -> None:
    """Print a warning on standard error."""
    print(f"warning: {text}", file=sys.stderr)


def _compilation(tell: Callable[[str], None]) -> AbstractContextManager[object]:
    """Say so, once, when numba compiles a kernel of meeframe's: only what it does not find is compiled, and kept."""
    from numba.core import event

    from meeframe.plugin.sources import LOCAL

    class Told(event.Listener):
        told = False

        def on_start(self, event: event.Event) -> None:
            kernel = event.data["dispatcher"]
            module = str(kernel.py_func.__module__)  # generated functions have none
            ours = module.startswith("meeframe") and not module.startswith(LOCAL)
            if ours and kernel.stats.cache_path is not None and not self.told:
                self.told = True
                tell("compiling kernels, once: later runs find them (takes up to two minutes)")

        def on_end(self, event: event.Event) -> None:
            pass

    return event.install_listener("numba:compile", Told())


class _Stopwatch:
    """Seconds of each stage, which may begin again."""

    def __init__(self) -> None:
        self._seconds: dict[str, float] = {}
        self._stage, self._mark = "", time.monotonic()

    def begin(self, stage: str) -> None:
        """From here on the time belongs to this stage; '': to none."""
        now = time.monotonic()
        self._seconds[self._stage] = self._seconds.get(self._stage, 0.0) + now - self._mark
        self._stage, self._mark = stage, now

    def seconds(self, stage: str) -> float:
        """Seconds of a stage so far."""
        running = time.monotonic() - self._mark if stage == self._stage else 0.0
        return self._seconds.get(stage, 0.0) + running


@contextmanager
def progress() -> "Iterator[Progress]":
    """Show a bar for each stage on the terminal, with the time that it has taken."""
    from rich.progress import BarColumn, Progress, ProgressColumn, Task, TaskID, TextColumn
    from rich.text import Text

    watch = _Stopwatch()

    class Spent(ProgressColumn):
        """The time of a stage; that of rich runs on while other stages do."""

        def render(self, task: Task) -> Text:
            spent = timedelta(seconds=int(watch.seconds(task.description)))
            return Text(str(spent), style="progress.elapsed")

    columns = (TextColumn("{task.description:22}", markup=False), BarColumn(), Spent())
    tasks: dict[str, TaskID] = {}
    bars = Progress(*columns, console=Console(stderr=True, markup=False, emoji=False), transient=False)
    with ExitStack() as started:

        def show(stage: str, fraction: float) -> None:
            watch.begin(stage)
            if stage not in tasks:
                if not tasks:  # bars that have nothing to show leave an empty line
                    started.enter_context(bars)
                    started.enter_context(_compilation(bars.console.print))
                for task in tasks.values():  # whatever came before is done
                    bars.update(task, completed=1.0)
                tasks[stage] = bars.add_task(stage, total=1.0)
            bars.update(tasks[stage], completed=fraction)

        yield show
        watch.begin("")
        for task in tasks.values():
            bars.update(task, completed=1.0)
