"""Points solved by other processes: local ones, or workers of a Dask cluster. Imported only where they are wanted."""

import logging
import socket
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache, lru_cache, partial
from importlib import import_module
from itertools import accumulate, islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, final
from uuid import uuid4

from meeframe.common.errors import CaseError, MeeframeError
from meeframe.fields import Array
from meeframe.model.cache import cached_body, code_key
from meeframe.model.solve import reduce_body, reduce_for_contact
from meeframe.model.threads import limited
from meeframe.plugin.sources import load_source, source_name
from meeframe.study.sweep.engine import Keyed, Pool, grouped
from meeframe.study.sweep.points import Outcome, Point, PointStatus, solved
from meeframe.study.sweep.processes import environment, undisturbed
from meeframe.system.dense import DenseSystem
from meeframe.system.reduced import NodalFields, Progress, ReducedSystem

try:
    dask, distributed = import_module("dask"), import_module("distributed")
    pickling = import_module("distributed.protocol.pickle")
except ImportError as error:
    raise CaseError(
        f"workers and schedulers need Dask ({error}); install the extra: pip install 'meeframe[sweep]'"
    ) from None

AHEAD: Final = 2
"""Points handed out for each thread of the cluster."""
_WAIT: Final = "10s"
"""For a scheduler to answer."""
_END: Final = "30s"
"""For local processes to end: Dask kills those that compute after four seconds, and waits five more."""
_WARNINGS: Final = "meeframe-warnings"
"""Topic of events by which workers pass on what code there warns of."""
_BLAS_THREADS: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class Sealed:
    """An object on its way to another process. plugins: path and content of the local files whose classes it may hold,
    which that process need not see; data: the object, pickled; code: code_key of it where it
    comes from, empty for what was made of something checked."""

    plugins: tuple[tuple[str, bytes], ...]
    data: bytes
    code: str = ""

    @classmethod
    def of(cls, content: object, plugins: tuple[tuple[str, bytes], ...], code: str = "") -> "Sealed":
        """Return the pickle an object; raises as pickle."""
        return cls(plugins, pickling.dumps(content), code)

    def open(self) -> Any:
        """Return the object. Raises CaseError where code would compute other results with it than where it comes
        from."""
        for path, source in self.plugins:
            if source_name(Path(path), source) not in sys.modules:
                load_source(Path(path), source)
        try:
            content = pickling.loads(self.data)
        except (ImportError, AttributeError) as error:
            raise _other_code(str(error)) from None
        if self.code and code_key(content) != self.code:
            raise _other_code("sources or versions differ")
        return content


def _other_code(what: str) -> CaseError:
    return CaseError(
        f"worker on {socket.gethostname()} runs other code than this command: {what}; allowed: the same meeframe, "
        "plugins, numpy, scipy and numba on all workers"
    )


@dataclass(frozen=True)
class Carried:
    """A reduced system on its way to those who share it, known by its key. instead: what their points become if
    there is none."""

    key: str
    sealed: Sealed | None = field(default=None, compare=False, repr=False)
    instead: Outcome | None = field(default=None, compare=False)


@contextmanager
def _passed_on() -> Iterator[None]:
    """Return what plugins and libraries warn of goes to where the command runs, but for what Python leaves out by
    itself."""
    try:
        send = distributed.get_worker().log_event  # beside other threads it may outlive the task
    except ValueError:  # no worker's task: it is shown here
        yield
        return

    def show(message: Warning | str, category: type[Warning], filename: str, lineno: int, *_: object) -> None:
        send(_WARNINGS, [str(message), category.__name__, filename, lineno])

    with warnings.catch_warnings():
        warnings.simplefilter("default")
        for category in (DeprecationWarning, PendingDeprecationWarning, ImportWarning, ResourceWarning):
            warnings.simplefilter("ignore", category)
        warnings.showwarning = show  # type: ignore[assignment]  # called by position
        yield


def _teller() -> Callable[[Any], None]:
    """Tell of an event that _passed_on sent, each once, as if it had been here."""

    @cache
    def tell(message: str, category: str, filename: str, lineno: int) -> None:
        warnings.showwarning(message, type(category, (Warning,), {}), filename, lineno)

    return lambda event: tell(*event[1])


def reduced(key: str, bodies: Sealed, folder: str, threads: int | None = None) -> Carried:
    """Return the reduced system of a sealed formulation and body; from files in `folder` where that can be seen from
    here."""
    formulation, body = bodies.open()
    try:
        with limited(threads), _passed_on():
            if Path(folder).is_dir():
                system = cached_body(formulation, body, Path(folder), key=key)
            else:
                system = reduce_for_contact(formulation, body)
        return _carried(key, system, bodies)
    except (MeeframeError, MemoryError) as error:
        return Carried(key, instead=Outcome.without_result(error))


def _carried(key: str, system: ReducedSystem, bodies: Sealed) -> Carried:
    matrix = system.dense()
    if matrix is not None:  # whatever it was made with stays here
        parts = system.points, system.frames, system.weights, system.cells, system.offset
        return Carried(key, Sealed.of(DenseSystem(*parts, matrix, partial(_recovered, bodies)), bodies.plugins))
    try:
        return Carried(key, Sealed.of(system, bodies.plugins))
    except MemoryError:
        raise
    except Exception:  # it is made of what cannot be pickled: whoever needs it makes it
        return Carried(key, bodies)


def _recovered(bodies: Sealed, load: Array) -> NodalFields:
    return reduce_body(*bodies.open()).recover(load)


@lru_cache(maxsize=2)
def _opened(carried: Carried) -> ReducedSystem:
    """Return the system, unpacked once in each process."""
    assert carried.sealed is not None
    content = carried.sealed.open()
    return content if isinstance(content, ReducedSystem) else reduce_for_contact(*content)


def solved_there(case: Sealed, *systems: Carried, threads: int | None = None) -> Outcome:
    """Return the outcome of a sealed case on the systems of its bodies."""
    instead = next((carried.instead for carried in systems if carried.instead is not None), None)
    with limited(threads), _passed_on():
        return instead or solved(case.open(), map(_opened, systems))


@final
@dataclass(frozen=True, eq=False)
class Cluster(Pool):
    """The workers of a Dask cluster. connect: gives a client, the same each time; address: of its scheduler; plugins:
    as in Sealed; processes: local ones that share the machine, None for workers that have theirs; threads: of all of
    them together."""

    connect: Callable[[], Any]
    address: str
    plugins: tuple[tuple[str, bytes], ...]
    processes: int | None = None
    threads: int = 1

    def solve(self, points: Sequence[Point], systems: Path, progress: Progress) -> Iterator[tuple[Point, Outcome]]:
        """Solve points as Pool.solve does. Unfinished points of a lost worker go to others.

        Raises CaseError if the scheduler does not answer or is lost.
        """
        if not points:
            return
        progress("workers", 0.0)
        client = self.connect()
        try:
            yield from self._solve(client, self._submitted(client, points, str(systems)))
        except OSError as error:
            raise self._lost() from error

    def _solve(self, client: Any, waiting: Iterator[tuple[Any, Point]]) -> Iterator[tuple[Point, Outcome]]:
        running: dict[Any, Point] = {}
        finished = distributed.as_completed(loop=client.loop)
        while True:
            ahead = AHEAD * max(sum(client.nthreads().values()), 1) - len(running)
            for future, point in islice(waiting, max(ahead, 0)):
                running[future] = point
                finished.add(future)
            if not running:
                return
            future = next(finished)
            point, outcome = running.pop(future), self._outcome(future)
            future.release()  # or it is solved again if its worker dies while others are waited for
            yield point, outcome

    def _submitted(self, client: Any, points: Sequence[Point], folder: str) -> Iterator[tuple[Any, Point]]:
        """Return the points handed out one after the other, group by group, each with its future."""
        run = uuid4().hex[:8]  # others on the same scheduler have keys of their own
        submit = partial(client.submit, pure=False)
        alone = None if self.processes is None else 1
        groups = grouped(points)
        for (bodies, group), threads in zip(groups, self._threads_of_reductions(groups), strict=True):
            systems = {
                key: submit(reduced, key, self._sealed(body), folder, threads, key=f"reduced-{key[:16]}-{run}")
                for key, body in bodies
            }
            for point in group:
                case = self._sealed(point.case)
                shared = [systems[key] for key, _ in bodies]
                yield submit(solved_there, case, *shared, threads=alone, key=f"solved-{point.key[:16]}-{run}"), point

    def _threads_of_reductions(self, groups: Sequence[tuple[Keyed, list[Point]]]) -> Sequence[int | None]:
        """Return the threads of each group: the first ones, for which all processes wait, share their threads; later
        ones are made beside points."""
        if self.processes is None:
            return [None] * len(groups)
        places = accumulate((len(group) for _, group in groups[:-1]), initial=0)
        first = sum(place < AHEAD * self.processes for place in places)
        systems = {key for bodies, _ in groups[:first] for key, _ in bodies}
        return [max(self.threads // len(systems), 1)] * first + [1] * (len(groups) - first)

    def _sealed(self, content: object) -> Sealed:
        return Sealed.of(content, self.plugins, code_key(content))

    def _outcome(self, future: Any) -> Outcome:
        if future.cancelled():
            raise self._lost()
        error = future.exception()  # waits if it was lost with its worker, until another has made it again
        if isinstance(error, distributed.KilledWorker):
            return Outcome(PointStatus.FAILED, f"every worker that tried it died: {error}")
        if isinstance(error, MemoryError):
            return Outcome.without_result(error)
        if isinstance(error, ImportError):
            raise CaseError(f"a worker lacks what this command has: {error}; allowed: the same code on all") from None
        outcome: Outcome = future.result()
        return outcome

    def _lost(self) -> CaseError:
        return CaseError(f"scheduler {self.address} was lost; allowed: one that runs; the same command then goes on")


@contextmanager
def cluster(workers: int, scheduler: str | None, plugins: Sequence[Path], threads: int) -> Iterator[Cluster]:
    """Return the local processes, so many threads in all, not before they are needed; or, at an address, the workers
    there.

    Raises CaseError if the scheduler does not answer.
    """
    sources = tuple((str(path), path.read_bytes()) for path in plugins)
    variables = {**dict.fromkeys(_BLAS_THREADS, "1"), "NUMBA_NUM_THREADS": str(threads)}
    variables["PYTHONWARNINGS"] = "ignore"  # but where reductions and points pass them on
    settings = {
        "distributed.comm.timeouts.connect": _WAIT,
        "distributed.deploy.lost-worker-timeout": "1d",  # a worker that died is started again, however long that takes
        "distributed.scheduler.worker-ttl": None,  # nor is one lost that does not answer for a long computation
        "distributed.admin.large-graph-warning-threshold": "1TB",  # meshes may be large
    }
    with ExitStack() as stack:
        stack.enter_context(environment(variables))
        scratch = stack.enter_context(TemporaryDirectory(prefix="meeframe-", ignore_cleanup_errors=True))
        stack.enter_context(dask.config.set({**settings, "temporary-directory": scratch}))
        # what users can mend is said by errors
        stack.enter_context(distributed.utils.silence_logging_cmgr(logging.CRITICAL))

        @cache
        def connect() -> Any:
            client = stack.enter_context(_client(stack, workers, scheduler))
            client.subscribe_topic(_WARNINGS, _teller())
            return client

        if scheduler is not None:
            connect()
        address, processes = (scheduler, None) if scheduler else ("of the local processes", workers)
        yield Cluster(connect, address, sources, processes, threads)


def _client(stack: ExitStack, workers: int, scheduler: str | None) -> Any:
    """Return a client of new local processes, or of a scheduler. Raises CaseError if it does not answer."""
    if scheduler is None:
        options = {"threads_per_worker": 1, "memory_limit": 0, "dashboard_address": ":0"}
        with undisturbed():
            place = distributed.LocalCluster(n_workers=workers, silence_logs=logging.CRITICAL, **options)
            stack.callback(_close, place)
        return distributed.Client(place)
    try:
        return distributed.Client(scheduler, timeout=_WAIT)
    except (OSError, ValueError, TypeError) as error:
        raise CaseError(
            f"scheduler {scheduler} does not answer ({error}); allowed: the address of a running Dask scheduler, such "
            "as tcp://host:8786"
        ) from None


def _close(place: Any) -> None:
    """End local processes; those that do not listen end with this one."""
    with suppress(TimeoutError, OSError):
        place.close(timeout=_END)
