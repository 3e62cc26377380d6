"""Pool of other processes: local ones, or workers of a Dask cluster; imported only if requested."""

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
from meeframe.study.sweep.points import Outcome, Point, PointStatus, solved
from meeframe.study.sweep.pool import Keyed, Pool, grouped
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

POINTS_PER_THREAD: Final = 2
"""Number of points submitted for each thread of the cluster."""
_CONNECT_TIMEOUT: Final = "10s"
"""Time for a scheduler to answer."""
_CLOSE_TIMEOUT: Final = "30s"
"""Time for local processes to end; Dask kills busy ones after four seconds and waits five more."""
_WARNINGS: Final = "meeframe-warnings"
"""Topic of events by which workers forward warnings."""
_BLAS_THREADS: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class PickledObject:
    """A pickled object for another process.

    Attributes
    ----------
    plugins
        Path and content of local plugin files whose classes the object may contain; the other process need not have
        access to the files.
    data
        The pickled object.
    code
        `code_key` of the object where it was pickled; empty for objects derived from a checked one.
    """

    plugins: tuple[tuple[str, bytes], ...]
    data: bytes
    code: str = ""

    @classmethod
    def of(cls, content: object, plugins: tuple[tuple[str, bytes], ...], code: str = "") -> "PickledObject":
        """Pickle an object. Raises as pickle."""
        return cls(plugins, pickling.dumps(content), code)

    def open(self) -> Any:
        """Unpickle the object. Raises CaseError if the code here would compute different results."""
        for path, source in self.plugins:
            if source_name(Path(path), source) not in sys.modules:
                load_source(Path(path), source)
        try:
            content = pickling.loads(self.data)
        except (ImportError, AttributeError) as error:
            raise _code_mismatch(str(error)) from None
        if self.code and code_key(content) != self.code:
            raise _code_mismatch("sources or versions differ")
        return content


def _code_mismatch(reason: str) -> CaseError:
    return CaseError(
        f"worker on {socket.gethostname()} runs other code than this command: {reason}; allowed: the same meeframe, "
        "plugins, numpy, scipy and numba on all workers"
    )


@dataclass(frozen=True)
class SystemReference:
    """A reduced system for the workers that use it, identified by its key.

    Attributes
    ----------
    key
        Key of the reduced system.
    pickled
        The pickled system, or the pickled formulation and body.
    instead
        Outcome of all points of the system if it could not be computed.
    """

    key: str
    pickled: PickledObject | None = field(default=None, compare=False, repr=False)
    instead: Outcome | None = field(default=None, compare=False)


@contextmanager
def _forward_warnings() -> Iterator[None]:
    """Forward warnings of plugins and libraries to the calling process, except those that Python ignores by default."""
    try:
        send = distributed.get_worker().log_event  # may be called after the end of the task by other threads
    except ValueError:  # not the task of a worker: warnings are shown here
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


def _warning_handler() -> Callable[[Any], None]:
    """Return a handler that shows the warnings of `_forward_warnings`, each once, as if they were raised here."""

    @cache
    def show(message: str, category: str, filename: str, lineno: int) -> None:
        warnings.showwarning(message, type(category, (Warning,), {}), filename, lineno)

    return lambda event: show(*event[1])


def reduced(key: str, bodies: PickledObject, folder: str, threads: int | None = None) -> SystemReference:
    """Return the reduced system of a pickled formulation and body, from files in `folder` if it is accessible here."""
    formulation, body = bodies.open()
    try:
        with limited(threads), _forward_warnings():
            if Path(folder).is_dir():
                system = cached_body(formulation, body, Path(folder), key=key)
            else:
                system = reduce_for_contact(formulation, body)
        return _refer_to(key, system, bodies)
    except (MeeframeError, MemoryError) as error:
        return SystemReference(key, instead=Outcome.without_result(error))


def _refer_to(key: str, system: ReducedSystem, bodies: PickledObject) -> SystemReference:
    matrix = system.dense()
    if matrix is not None:  # the intermediate data of the reduction are not sent
        arrays = system.points, system.frames, system.weights, system.cells, system.offset
        return SystemReference(
            key, PickledObject.of(DenseSystem(*arrays, matrix, partial(_recover, bodies)), bodies.plugins)
        )
    try:
        return SystemReference(key, PickledObject.of(system, bodies.plugins))
    except MemoryError:
        raise
    except Exception:  # it cannot be pickled: each process reduces the body itself
        return SystemReference(key, bodies)


def _recover(bodies: PickledObject, load: Array) -> NodalFields:
    return reduce_body(*bodies.open()).recover(load)


@lru_cache(maxsize=2)
def _open_system(reference: SystemReference) -> ReducedSystem:
    """Return the system, unpickled once in each process."""
    assert reference.pickled is not None
    content = reference.pickled.open()
    return content if isinstance(content, ReducedSystem) else reduce_for_contact(*content)


def solve_in_worker(case: PickledObject, *systems: SystemReference, threads: int | None = None) -> Outcome:
    """Return the outcome of a pickled case on the systems of its bodies."""
    instead = next((reference.instead for reference in systems if reference.instead is not None), None)
    with limited(threads), _forward_warnings():
        return instead or solved(case.open(), map(_open_system, systems))


@final
@dataclass(frozen=True, eq=False)
class Cluster(Pool):
    """Workers of a Dask cluster.

    Attributes
    ----------
    connect
        Function that returns a client, the same one at every call.
    address
        Address of the scheduler, for messages.
    plugins
        As in PickledObject.
    processes
        Number of local processes that share the machine; None for workers that have their resources to themselves.
    threads
        Total number of threads of local processes.
    """

    connect: Callable[[], Any]
    address: str
    plugins: tuple[tuple[str, bytes], ...]
    processes: int | None = None
    threads: int = 1

    def solve(self, points: Sequence[Point], systems: Path, progress: Progress) -> Iterator[tuple[Point, Outcome]]:
        """Solve points as Pool.solve does.

        Unfinished points of a lost worker are submitted to others. Raises CaseError if the scheduler does not answer or
        is lost.
        """
        if not points:
            return
        progress("workers", 0.0)
        client = self.connect()
        try:
            yield from self._solve(client, self._submit(client, points, str(systems.absolute())))
        except OSError as error:
            raise self._lost_error() from error

    def _solve(self, client: Any, waiting: Iterator[tuple[Any, Point]]) -> Iterator[tuple[Point, Outcome]]:
        running: dict[Any, Point] = {}
        finished = distributed.as_completed(loop=client.loop)
        while True:
            free = POINTS_PER_THREAD * max(sum(client.nthreads().values()), 1) - len(running)
            for future, point in islice(waiting, max(free, 0)):
                running[future] = point
                finished.add(future)
            if not running:
                return
            future = next(finished)
            point, outcome = running.pop(future), self._outcome(future)
            future.release()  # otherwise it would be solved again if its worker died
            yield point, outcome

    def _submit(self, client: Any, points: Sequence[Point], folder: str) -> Iterator[tuple[Any, Point]]:
        """Yield the submitted points, group by group, each with its future."""
        run = uuid4().hex[:8]  # keys differ from those of other runs on the same scheduler
        submit = partial(client.submit, pure=False)
        threads_per_point = None if self.processes is None else 1
        groups = grouped(points)
        for (bodies, group), threads in zip(groups, self._reduction_threads(groups), strict=True):
            systems = {
                key: submit(reduced, key, self._pickle(body), folder, threads, key=f"reduced-{key[:16]}-{run}")
                for key, body in bodies
            }
            for point in group:
                case = self._pickle(point.case)
                shared = [systems[key] for key, _ in bodies]
                yield (
                    submit(
                        solve_in_worker, case, *shared, threads=threads_per_point, key=f"solved-{point.key[:16]}-{run}"
                    ),
                    point,
                )

    def _reduction_threads(self, groups: Sequence[tuple[Keyed, list[Point]]]) -> Sequence[int | None]:
        """Return the number of threads for the reduction of each group.

        All processes wait for the first groups, which share all threads; later reductions run at the same time as
        points and have one.
        """
        if self.processes is None:
            return [None] * len(groups)
        starts = accumulate((len(group) for _, group in groups[:-1]), initial=0)
        first = sum(start < POINTS_PER_THREAD * self.processes for start in starts)
        systems = {key for bodies, _ in groups[:first] for key, _ in bodies}
        return [max(self.threads // len(systems), 1)] * first + [1] * (len(groups) - first)

    def _pickle(self, content: object) -> PickledObject:
        return PickledObject.of(content, self.plugins, code_key(content))

    def _outcome(self, future: Any) -> Outcome:
        if future.cancelled():
            raise self._lost_error()
        error = future.exception()  # if lost with its worker, waits until another one has solved it
        if isinstance(error, distributed.KilledWorker):
            return Outcome(PointStatus.FAILED, f"every worker that tried it died:  {error}")
        if isinstance(error, MemoryError):
            return Outcome.without_result(error)
        if isinstance(error, ImportError):
            raise CaseError(
                f"a worker lacks code that this command has: {error}; allowed: the same code on all workers"
            ) from None
        outcome: Outcome = future.result()
        return outcome

    def _lost_error(self) -> CaseError:
        return CaseError(
            f"scheduler {self.address} was lost; restart it and repeat the command, which continues the sweep"
        )


@contextmanager
def cluster(workers: int, scheduler: str | None, plugins: Sequence[Path], threads: int) -> Iterator[Cluster]:
    """Start a pool of local processes, or connect to the workers of a scheduler.

    Local processes start when they are first needed. Raises CaseError if the scheduler does not answer.
    """
    sources = tuple((str(path), path.read_bytes()) for path in plugins)
    variables = {**dict.fromkeys(_BLAS_THREADS, "1"), "NUMBA_NUM_THREADS": str(threads)}
    variables["PYTHONWARNINGS"] = "ignore"  # warnings are forwarded during reductions and solutions only
    settings = {
        "distributed.comm.timeouts.connect": _CONNECT_TIMEOUT,
        "distributed.deploy.lost-worker-timeout": "1d",  # a worker that died is restarted, however long that takes
        "distributed.scheduler.worker-ttl": None,  # a worker may not answer during a long computation
        "distributed.admin.large-graph-warning-threshold": "1TB",  # meshes may be large
    }
    with ExitStack() as stack:
        stack.enter_context(environment(variables))
        scratch = stack.enter_context(TemporaryDirectory(prefix="meeframe-", ignore_cleanup_errors=True))
        stack.enter_context(dask.config.set({**settings, "temporary-directory": scratch}))
        # errors report everything that users can act on
        stack.enter_context(distributed.utils.silence_logging_cmgr(logging.CRITICAL))

        @cache
        def connect() -> Any:
            client = stack.enter_context(_client(stack, workers, scheduler))
            client.subscribe_topic(_WARNINGS, _warning_handler())
            return client

        if scheduler is not None:
            connect()
        address, processes = (scheduler, None) if scheduler else ("of the local processes", workers)
        yield Cluster(connect, address, sources, processes, threads)


def _client(stack: ExitStack, workers: int, scheduler: str | None) -> Any:
    """Return a client of new local processes or of a scheduler. Raises CaseError if the scheduler does not answer."""
    if scheduler is None:
        options = {"threads_per_worker": 1, "memory_limit": 0, "host": "127.0.0.1", "dashboard_address": "127.0.0.1:0"}
        with undisturbed():
            local = distributed.LocalCluster(n_workers=workers, silence_logs=logging.CRITICAL, **options)
            stack.callback(_close, local)
        return distributed.Client(local)
    try:
        return distributed.Client(scheduler, timeout=_CONNECT_TIMEOUT)
    except (OSError, ValueError, TypeError) as error:
        raise CaseError(
            f"scheduler {scheduler} does not answer ({error}); allowed: the address of a running Dask scheduler, such "
            "as tcp://host:8786"
        ) from None


def _close(local: Any) -> None:
    """Close local processes; unresponsive ones end with this process."""
    with suppress(TimeoutError, OSError):
        local.close(timeout=_CLOSE_TIMEOUT)
