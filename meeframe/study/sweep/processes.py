"""Starting of processes: signals that wait meanwhile, an environment that stays."""

import os
import signal
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from multiprocessing import resource_tracker


@contextmanager
def environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Return the variables for processes that are started in the block, unless they have other values already."""
    added = {name: value for name, value in variables.items() if name not in os.environ}
    os.environ.update(added)
    try:
        yield
    finally:
        for name in added:
            os.environ.pop(name, None)


@contextmanager
def undisturbed() -> Iterator[None]:
    """Return the ctrl-C and a request to end come after the block: Dask cannot end processes that it has half started.

    Ctrl-C on the terminal comes to none of these, which inherit what is blocked from the thread that Dask starts here.
    """
    if threading.current_thread() is not threading.main_thread():  # only there can it be asked for
        yield
        return
    resource_tracker.ensure_running()  # it would lift the block when it starts
    asked: list[int] = []
    heard = [number for number in (signal.SIGINT, signal.SIGTERM) if callable(signal.getsignal(number))]
    handlers = {number: signal.signal(number, lambda number, _: asked.append(number)) for number in heard}
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        for number, handler in handlers.items():
            signal.signal(number, handler)
        if asked:
            signal.raise_signal(asked[0])
