"""Choose what runs replicas and candidates: threads, processes, a Dask cluster or one thread.

Each of these is a `concurrent.futures.Executor`. `share` sends an argument that many tasks have in
common, such as a chamber, once to each worker and not with every task.
"""

import os
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor, wait
from typing import Any, Literal, ParamSpec, TypeVar

from chamberopt.common.errors import InputError
from chamberopt.common.memory import keep_few_heaps

P = ParamSpec("P")
T = TypeVar("T")

WorkerKind = Literal["threads", "processes"]

# A replica holds Python's lock for 14 % of its time (gear: 0.2 s of CPU time for packing the shot
# and tallies), so seven threads keep the lock busy. Processes share no lock, but each process takes
# some 2 s of CPU time to import modules and load compiled code.
MAX_THREADS = 8
LOOK_S = 0.5  # between looks at what a task has done


def core_count() -> int:
    """Return the number of cores that this process may use; a batch system may allow only some."""
    if hasattr(os, "sched_getaffinity"):
        return max(1, len(os.sched_getaffinity(0)))
    return max(1, os.cpu_count() or 1)


def local_executor(workers: int | None = None, kind: WorkerKind = "threads") -> Executor:
    """Make workers on this computer, for use in a `with` block.

    Threads share the memory with the chamber and start at once. The simulator releases Python's
    global lock, so that threads run it in parallel. Processes also run other Python code in
    parallel.

    Args:
        workers: number of workers; None for one per core.

    Raises:
        InputError: `workers` is less than 1.
    """
    if workers is not None and workers < 1:
        remedy = "give at least 1, or leave it out for one per core"
        raise InputError(f"--workers: given {workers}; {remedy}")
    count = workers or core_count()
    if kind == "threads":
        keep_few_heaps()
        return ThreadExecutor(count, thread_name_prefix="replica")
    from chamberopt.common.processes import ProcessExecutor

    return ProcessExecutor(count)


def open_executor(
    workers: int | None, cluster: str | None, kind: WorkerKind | None = None
) -> Executor:
    """Make workers on this computer, or connect to the workers of a cluster.

    Args:
        workers: number of workers, from the option --workers; None if it is not given.
        cluster: address or scheduler file of a cluster, from the option --cluster; None if it is
            not given.
        kind: kind of workers on this computer. None: threads up to MAX_THREADS workers, processes
            for more.

    Raises:
        InputError: both options are given, or an option cannot be used.
    """
    if cluster is None:
        few = (workers or core_count()) <= MAX_THREADS
        return local_executor(workers, kind or ("threads" if few else "processes"))
    if workers is not None:
        text = "but --cluster has workers of its own; leave one of the two out"
        raise InputError(f"--workers: given {workers}, {text}")
    from chamberopt.common.dask_cluster import DaskExecutor

    return DaskExecutor(cluster)


def share(executor: Executor, value: T) -> T:
    """Return what to pass to many tasks in place of a large value that they all need.

    The tasks receive the value itself. It is sent once to each worker and not with every task.
    """
    share_with_workers = getattr(executor, "share", None)
    shared: T = value if share_with_workers is None else share_with_workers(value)
    return shared


def result_of(future: Future[T], tell: Callable[[], None] | None = None) -> T:
    """Wait for a task, and return its value. Ctrl-C ends the wait within LOOK_S seconds.

    If the operating system gives Ctrl-C to another thread, it wakes nobody who waits without end.

    Args:
        tell: called every LOOK_S seconds meanwhile.
    """
    while not future.done():
        wait([future], LOOK_S)
        if tell:
            tell()
    return future.result()


class ThreadExecutor(ThreadPoolExecutor):
    """Executor with worker threads. An exception in its `with` block cancels the waiting tasks.

    Ctrl-C leaves the block at once. The command line then ends the process, and so the running
    tasks.
    """

    def __exit__(self, *error: Any) -> None:
        wait = error[0] is not KeyboardInterrupt
        self.shutdown(wait, cancel_futures=error[0] is not None)


class SerialExecutor(Executor):
    """Executor that runs each task at once in the calling thread.

    Cluster workers, tests, debuggers and profilers use it.
    """

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        future: Future[T] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future
