"""Progress bars in terminals and notebooks."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from datetime import timedelta
from importlib.util import find_spec
from typing import TYPE_CHECKING

from meeframe.system.reduced import Progress, silent

if TYPE_CHECKING:
    from rich.console import Console

Show = bool | Progress | None
"""True or False for bars or none, None for bars in terminals and notebooks, or a function that receives progress."""


@contextmanager
def shown(progress: Show) -> Iterator[Progress]:
    """Provide the function that reports progress as a caller wants it."""
    if callable(progress):
        yield progress
    elif progress or (progress is None and (sys.stderr.isatty() or _in_notebook())):
        with bars() as report:
            yield report
    else:
        yield silent


def _in_notebook() -> bool:
    shell = sys.modules.get("IPython")
    return shell is not None and type(shell.get_ipython()).__name__ == "ZMQInteractiveShell"


def console() -> "Console":
    """Return the console for bars: the standard error, or the output of the notebook's cell."""
    from rich.console import Console

    # rich draws in notebooks by ipywidgets; without them it writes as into a file
    notebook = _in_notebook() and find_spec("ipywidgets") is not None
    return Console(stderr=True, markup=False, emoji=False, force_jupyter=notebook)


def _report_compilation(report: Callable[[str], None]) -> AbstractContextManager[object]:
    """Report once that numba compiles a kernel of meeframe; later runs load it from the cache."""
    from numba.core import event

    from meeframe.plugin.sources import LOCAL

    class CompilationListener(event.Listener):
        reported = False

        def on_start(self, event: event.Event) -> None:
            kernel = event.data["dispatcher"]
            module = str(kernel.py_func.__module__)  # generated functions have none
            ours = module.startswith("meeframe") and not module.startswith(LOCAL)
            if ours and kernel.stats.cache_path is not None and not self.reported:
                self.reported = True
                report("compiling kernels once for all later runs (takes up to two minutes)")

        def on_end(self, event: event.Event) -> None:
            pass

    return event.install_listener("numba:compile", CompilationListener())


class _Stopwatch:
    """Time of each stage; stages can alternate."""

    def __init__(self) -> None:
        self._seconds: dict[str, float] = {}
        self._stage, self._mark = "", time.monotonic()

    def begin(self, stage: str) -> None:
        """Count the time from now on for this stage, or for none if ''."""
        now = time.monotonic()
        self._seconds[self._stage] = self._seconds.get(self._stage, 0.0) + now - self._mark
        self._stage, self._mark = stage, now

    def seconds(self, stage: str) -> float:
        """Return the time of a stage so far [s]."""
        running = time.monotonic() - self._mark if stage == self._stage else 0.0
        return self._seconds.get(stage, 0.0) + running


@contextmanager
def bars() -> Iterator[Progress]:
    """Show a bar for each stage, with the time that it has taken."""
    from rich.progress import BarColumn, ProgressColumn, Task, TaskID, TextColumn
    from rich.progress import Progress as Bars
    from rich.text import Text

    watch = _Stopwatch()

    class StageTime(ProgressColumn):
        """Time of a stage; the column of rich also counts the time of other stages."""

        def render(self, task: Task) -> Text:
            spent = timedelta(seconds=int(watch.seconds(task.description)))
            return Text(str(spent), style="progress.elapsed")

    columns = (TextColumn("{task.description:22}", markup=False), BarColumn(), StageTime())
    tasks: dict[str, TaskID] = {}
    display = Bars(*columns, console=console(), transient=False)
    with ExitStack() as started:

        def show(stage: str, fraction: float) -> None:
            watch.begin(stage)
            if stage not in tasks:
                if not tasks:  # bars without tasks leave an empty line
                    started.enter_context(display)
                    started.enter_context(_report_compilation(display.console.print))
                for task in tasks.values():  # earlier stages are complete
                    display.update(task, completed=1.0)
                tasks[stage] = display.add_task(stage, total=1.0)
            display.update(tasks[stage], completed=fraction)

        yield show
        watch.begin("")
        for task in tasks.values():
            display.update(task, completed=1.0)
