"""Workers for trials: processes of this machine, or workers of a Dask cluster; results arrive as they finish."""

import multiprocessing
import os
import platform
import signal
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import CancelledError, ProcessPoolExecutor, as_completed
from concurrent.futures import Future as ProcessFuture
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from itertools import islice
from multiprocessing import connection
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar
from unittest.mock import patch

from cell.lab.arguments import advancing
from cell.records.provenance import versions
from drivers.errors import CellError, ConfigError

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    from distributed import Client, Future

Row = TypeVar("Row")
P = ParamSpec("P")
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Environment variables that make a worker single-threaded: one trial per core, and the same order of sums everywhere."""
BLAS = "OPENBLAS_NUM_THREADS"
"""The variable of `THREADS` that can change a sum; a Dask nanny sets it to 1."""
CONNECT = 10.0
"""Longest wait for a scheduler's answer, s."""
_TAKE_UP = "repeat the command to continue from the finished trials"


def on_processes(
    task: Callable[[int], Row], seeds: Sequence[int], workers: int, is_enough: Callable[[], bool] = lambda: False
) -> Generator[Row, None, None]:
    """Yield the result of `task` for each seed, as it finishes, from `workers` processes of one thread each.

    The next call with the same number of processes reuses them, already loaded, unless this call is interrupted.

    Args:
        task: Function, pickled by its name.
        seeds: Seeds, one call each, started in this order.
        workers: Number of processes.
        is_enough: Function called after each result; if it returns True, the call ends. The results of tasks in progress, at
            most `workers`, are lost.

    Raises:
        CellError: A worker was killed.
    """
    if not seeds:
        return
    pool, waiting = _waiting.pop(workers, None) or Pool(workers), iter(seeds)
    running: set[ProcessFuture[Row]] = set()
    try:
        while not is_enough():
            running |= {pool.submit(task, seed) for seed in islice(waiting, workers - len(running))}
            if not running:
                break
            finished = next(as_completed(running))
            running.remove(finished)
            yield finished.result()
    except BrokenProcessPool:
        pool.leave()
        raise CellError(f"trials: a worker process was killed; {_TAKE_UP}") from None
    except BaseException:  # an interrupted call does not wait for running trials; the same command runs them again
        pool.leave()
        raise
    if _waiting.setdefault(workers, pool) is not pool:
        pool.leave()


def each_of(task: Callable[..., Row], jobs: Sequence[tuple[Any, ...]], workers: int, name: str) -> list[Row]:
    """Return `task(*job)` of every job, in the order of the jobs, and show a bar of progress with this name."""
    found: dict[int, Row] = {}
    with advancing(name, len(jobs)) as done:
        for number, row in on_processes(partial(_numbered, task, jobs), range(len(jobs)), workers):
            found[number] = row
            done(1)
    return [found[number] for number in range(len(jobs))]


def _numbered(task: Callable[..., Row], jobs: Sequence[tuple[Any, ...]], number: int) -> tuple[int, Row]:
    return number, task(*jobs[number])


class Pool(ProcessPoolExecutor):
    """Single-threaded processes that start on demand and always end with their parent."""

    def __init__(self, workers: int) -> None:
        """Store the number of workers; no process starts yet."""
        context = multiprocessing.get_context("spawn")
        self._lifeline, self._held = context.Pipe(duplex=False)
        super().__init__(workers, context, initializer=_leave_with_parent, initargs=(self._lifeline,))

    def __exit__(self, *_: object) -> None:
        """End the processes; an interrupted pool does not wait for them."""
        self.leave()

    def submit(self, fn: Callable[P, Row], /, *args: P.args, **kwargs: P.kwargs) -> "ProcessFuture[Row]":
        """Submit a task, and start one more process if all are busy and the limit allows it."""
        with patch.dict(os.environ, dict.fromkeys(THREADS, "1")), _deaf_children():
            return super().submit(fn, *args, **kwargs)

    def leave(self) -> None:
        """End the processes, even busy ones."""
        self._held.close()
        self.shutdown(cancel_futures=True)
        self._lifeline.close()


_waiting: dict[int, Pool] = {}
"""Pools of completed calls, kept for the next call, by their number of processes."""


def _leave_with_parent(lifeline: "Connection") -> None:
    """End this process if its parent is killed or interrupted; a pool's workers would otherwise wait forever."""
    parent = multiprocessing.parent_process()
    assert parent is not None

    def wait() -> None:
        connection.wait([parent.sentinel, lifeline])
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


@contextmanager
def _deaf_children() -> Iterator[None]:
    """Make processes started within this context ignore Ctrl-C; their parent handles it."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def on_cluster(
    task: Callable[[int], Row],
    seeds: Sequence[int],
    address: str,
    is_enough: Callable[[], bool] = lambda: False,
    patience: float = 30.0,
) -> Generator[Row, None, None]:
    """Yield the result of `task` for each seed, as it finishes, from the workers of a Dask cluster.

    If a worker dies, another one runs its seed again.

    Args:
        task: Function, pickled by its name; the workers need this program with the same code and packages.
        seeds: Seeds, one call each.
        address: Address of the scheduler, as in tcp://192.0.2.1:8786.
        is_enough: Function called after each result; if it returns True, the call ends.
        patience: Longest time without any worker, s.

    Raises:
        ConfigError: The packages of the extra `cluster` are missing.
        CellError: The scheduler does not answer, there is no worker, or a worker cannot reproduce the same rows.
    """
    if not seeds:
        return
    client = _connected(address)
    try:
        finished: SimpleQueue[Future] = SimpleQueue()
        for future in client.map(partial(_on_worker, task, versions()), seeds, pure=False):
            future.add_done_callback(finished.put)
        for _ in seeds:
            yield _result(_next(client, finished, address, patience), address)
            if is_enough():
                break
    finally:
        client.close(timeout=CONNECT)


def _connected(address: str) -> "Client":
    try:
        import dask.config

        # Errors are reported here, once; distributed reads this setting on import.
        dask.config.set(
            {"logging": dict.fromkeys(("distributed", "distributed.client", "tornado.application"), "critical")}
        )
        from distributed import Client
    except ImportError:
        raise ConfigError("--scheduler: Dask is not installed; pip install 'tactile-insertion-cell[cluster]'") from None
    try:
        return Client(address, timeout=CONNECT, set_as_default=False)
    except (OSError, ValueError):
        raise CellError(
            f"scheduler {address}: no answer within {CONNECT:g} s; a running Dask scheduler needed"
        ) from None


def _next(client: "Client", finished: "SimpleQueue[Future]", address: str, patience: float) -> "Future":
    """Return the next completed future; wait as long as workers exist, and without a worker for at most `patience`, s."""
    while True:
        try:
            return finished.get(timeout=patience)
        except Empty:
            if client.status != "running":
                raise CellError(f"scheduler {address}: lost; {_TAKE_UP}") from None
            if not client.nthreads():
                raise CellError(
                    f"scheduler {address}: no worker for {patience:g} s; one or more needed: dask worker {address} --nthreads 1"
                ) from None


def _result(future: "Future", address: str) -> Any:
    try:
        return future.result()
    except CellError:
        raise
    except CancelledError:
        raise CellError(f"scheduler {address}: lost; {_TAKE_UP}") from None
    except Exception as error:  # a worker's error can have any type; the calling program needs one line
        raise CellError(f"scheduler {address}: {type(error).__name__}: {_first_line(error)}; {_TAKE_UP}") from error


def _on_worker(task: Callable[[int], Row], wanted: dict[str, str], seed: int) -> Row:
    """Run one seed on a cluster's worker.

    Raises:
        CellError: The rows of this worker would differ from those of the other workers.
    """
    here, found = f"worker on {platform.node()}", versions()
    for name, value in wanted.items():
        if found.get(name) != value:
            raise CellError(
                f"{here}: {name} {found.get(name)}; {value}, as on the computer that requested the trials, allowed"
            )
    if os.environ.get(BLAS) != "1":
        raise CellError(f"{here}: {BLAS} = {os.environ.get(BLAS, 'not set')}; 1 allowed, as a nanny of Dask sets it")
    return task(seed)


def _first_line(error: Exception) -> str:
    return (str(error) or type(error).__name__).splitlines()[0]
