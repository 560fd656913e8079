"""Choose where replicas and candidates run: threads or processes here, a Dask cluster, or serially.

Everything that takes an executor takes a `concurrent.futures.Executor`. `share` sends an argument
that many tasks have in common, such as a chamber, once to each worker and not with every task.
"""

import os
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from typing import Any, Literal

from chamberopt.common.errors import InputError

WorkerKind = Literal["threads", "processes"]

# A replica holds Python's lock for 14 % of its time (gear: 0.2 s of CPU time for packing the shot
# and tallies), so that seven threads already keep the lock busy. Processes do not share a lock, but
# each takes some 2 s of CPU time to import everything and load compiled code.
MAX_THREADS = 8


def core_count() -> int:
    """Cores that this process may use; an affinity mask or a batch system can leave fewer."""
    if hasattr(os, "sched_getaffinity"):
        return max(1, len(os.sched_getaffinity(0)))
    return max(1, os.cpu_count() or 1)


def local_executor(workers: int | None = None, kind: WorkerKind = "threads") -> Executor:
    """Make workers on this machine, for use in a `with` block.

    Threads share the chamber and start at once, and the simulator releases Python's lock. Processes
    also run in parallel what needs the lock. There is one worker per core if their number is None.
    """
    if workers is not None and workers < 1:
        remedy = "give at least 1, or leave it out for one per core"
        raise InputError(f"--workers: given {workers}; {remedy}")
    count = workers or core_count()
    if kind == "threads":
        return ThreadExecutor(count, thread_name_prefix="replica")
    from chamberopt.common.processes import ProcessExecutor

    return ProcessExecutor(count)


def open_executor(
    workers: int | None, cluster: str | None, kind: WorkerKind | None = None
) -> Executor:
    """Make the workers of --workers, or connect to those of --cluster.

    `kind` is that of workers on this machine; if None, processes where threads would be too many.
    """
    if cluster is None:
        few = (workers or core_count()) <= MAX_THREADS
        return local_executor(workers, kind or ("threads" if few else "processes"))
    if workers is not None:
        text = "but --cluster has workers of its own; leave one of the two out"
        raise InputError(f"--workers: given {workers}, {text}")
    from chamberopt.common.dask_cluster import DaskExecutor

    return DaskExecutor(cluster)


def share(executor: Executor, value: Any) -> Any:
    """Prepare an argument for many tasks of an executor; the tasks receive the value itself."""
    share_with_workers = getattr(executor, "share", None)
    return value if share_with_workers is None else share_with_workers(value)


class ThreadExecutor(ThreadPoolExecutor):
    """Worker threads; an exception that leaves the `with` block cancels the tasks that wait.

    Ctrl-C does not wait for the tasks that run either: the command line ends their process.
    """

    def __exit__(self, *error: Any) -> None:
        wait = error[0] is not KeyboardInterrupt
        self.shutdown(wait, cancel_futures=error[0] is not None)


class SerialExecutor(Executor):
    """Runs each task in the calling thread: on cluster workers, in tests, debuggers, profilers."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future
