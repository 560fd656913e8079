"""Where replicas and candidates run: threads or processes on this machine, a Dask cluster, or one after another.

Everything that takes an executor takes a `concurrent.futures.Executor`. Those made here also `share`: a task's argument
that is the same for many, such as a chamber, travels once a worker and not with every task.
"""

import os
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from typing import Any, Literal

from chamberopt.common.errors import InputError

WorkerKind = Literal["threads", "processes"]

# Python's lock is held for 14 % of a replica (the gear's, 0.2 s of CPU time: packing the shot, tallies), so that seven
# threads leave it no rest. A process first takes some 2 s of CPU time to import everything and load compiled code.
MAX_THREADS = 8


def core_count() -> int:
    """Cores this process may use: an affinity mask or a batch system can leave fewer than there are."""
    if hasattr(os, "sched_getaffinity"):
        return max(1, len(os.sched_getaffinity(0)))
    return max(1, os.cpu_count() or 1)


def local_executor(workers: int | None = None, kind: WorkerKind = "threads") -> Executor:
    """Workers on this machine, one per core unless `workers` says otherwise; use it in a `with` block.

    Threads share the chamber and start at once, and the simulator releases Python's lock; processes run what holds it
    in parallel too. InputError for no workers.
    """
    if workers is not None and workers < 1:
        raise InputError(
            f"--workers: given {workers}; give at least 1, or leave it out for one per core"
        )
    count = workers or core_count()
    if kind == "threads":
        return ThreadPoolExecutor(count, thread_name_prefix="replica")
    from chamberopt.common.parallel.processes import ProcessExecutor

    return ProcessExecutor(count)


def open_executor(
    workers: int | None, cluster: str | None, kind: WorkerKind | None = None
) -> Executor:
    """The workers of --workers or --cluster: this machine's unless a cluster is named. InputError for both.

    kind: of this machine's; when None threads, or processes where there are too many cores for threads.
    """
    if cluster is None:
        return local_executor(
            workers,
            kind or ("threads" if (workers or core_count()) <= MAX_THREADS else "processes"),
        )
    if workers is not None:
        raise InputError(
            f"--workers: given {workers}, but --cluster has workers of its own; leave one of the two out"
        )
    from chamberopt.common.parallel.dask_cluster import DaskExecutor

    return DaskExecutor(cluster)


def share(executor: Executor, value: Any) -> Any:
    """A value as an argument for many of this executor's tasks, which get the value itself."""
    share = getattr(executor, "share", None)
    return value if share is None else share(value)


class SerialExecutor(Executor):
    """Runs each job at once in the calling thread: for candidates on a worker, tests, debuggers and profilers."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future
