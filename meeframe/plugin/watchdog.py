"""Time limit of calls into plugins: a thread looks at the stack of the calling one, and interrupts calls that hang.

Python can interrupt Python code only. A compiled loop that keeps the lock of the interpreter is not even noticed before
it ends.
"""

import ctypes
import math
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Final

from meeframe.common.errors import PluginFault
from meeframe.common.timed import TimeLimited

INTERVAL: Final = 0.25
"""Time between two looks at the stack, and between attempts to interrupt a call [s]."""
_watched: Final = threading.local()


class _Hanging(BaseException):
    """A call into a plugin has been interrupted; code of plugins that catches every Exception lets it pass."""


@contextmanager
def time_limit(is_plugin_code: Callable[[FrameType], bool]) -> Iterator[None]:
    """Raise a PluginFault in the block if a method of a TimeLimited object in a plugin exceeds its `time_limit`.

    is_plugin_code: whether a frame belongs to a plugin; called by another thread. Nested blocks have no effect.
    """
    if getattr(_watched, "here", False):
        yield
        return
    watchdog = _Watchdog(threading.current_thread(), is_plugin_code)
    _watched.here = True
    try:
        watchdog.start()
        try:
            yield
        finally:
            watchdog.end()  # may be interrupted itself
    except (_Hanging, KeyboardInterrupt):
        if not watchdog.message:
            raise
        raise PluginFault(watchdog.message) from None
    finally:
        watchdog.ended.set()
        _watched.here = False


class _Watchdog(threading.Thread):
    """Thread that watches another one until `ended` is set.

    message: describes the call that was interrupted, '' if there is none.
    """

    def __init__(self, thread: threading.Thread, is_plugin_code: Callable[[FrameType], bool]) -> None:
        super().__init__(name="meeframe-watchdog", daemon=True)
        self.message = ""
        self._thread, self._is_plugin_code = thread, is_plugin_code
        self.ended, self._lock = threading.Event(), threading.Lock()

    def run(self) -> None:
        """Look at the stack until the block ends."""
        call, begin, attempts = None, 0.0, 0
        while not self.ended.wait(INTERVAL):
            last, (call, limit) = call, self._call()
            if call is None or call is not last:  # as the last frame is still referenced, no other has its place
                begin, attempts = time.monotonic(), 0
            elif time.monotonic() - begin >= limit:
                with self._lock:
                    if not self.ended.is_set():
                        self.message = self.message or _describe(call, limit)
                        self._interrupt(attempts)
                attempts += 1

    def end(self) -> None:
        """Stop watching; afterwards the thread is not interrupted any more."""
        with self._lock:
            self.ended.set()
        if self.message:
            self._absorb()

    def _absorb(self) -> None:
        """Raise the exception that the thread may not have raised yet, and catch it.

        Taking it back instead would leave Python 3.11 with a sign that one is due, and traced code would never end.
        """
        try:
            _raise_in(self._thread, _Hanging)  # in the place of an earlier one
            while True:
                pass
        except _Hanging:
            pass

    def _call(self) -> tuple[FrameType | None, float]:
        """Return the outermost frame of a method of a plugin with a time limit, and the limit."""
        frame = sys._current_frames().get(self._thread.ident or 0)
        outermost, limit = None, math.inf
        while frame is not None:
            if self._is_plugin_code(frame) and frame.f_code.co_argcount:
                first = frame.f_locals.get(frame.f_code.co_varnames[0])
                if isinstance(first, TimeLimited):
                    outermost, limit = frame, first.time_limit
            frame = frame.f_back
        return outermost, limit

    def _interrupt(self, attempts: int) -> None:
        """Interrupt the call by Ctrl-C, which also ends waiting, where that is possible, else by an exception."""
        is_main = self._thread is threading.main_thread()
        if is_main and not attempts and callable(signal.getsignal(signal.SIGINT)):
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
        else:
            _raise_in(self._thread, _Hanging)


def _describe(frame: FrameType, limit: float) -> str:
    return (
        f"plugin file {frame.f_code.co_filename}, line {frame.f_lineno}, in {frame.f_code.co_name}: hangs, has not "
        f"returned within {limit:g} s; allowed: the time_limit of its class"
    )


def _raise_in(thread: threading.Thread, error: type[BaseException]) -> None:
    """Raise an exception in a thread as soon as it runs Python code."""
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread.ident or 0), ctypes.py_object(error))
