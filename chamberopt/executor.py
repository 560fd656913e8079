"""Where replicas run: this machine's cores, as threads (the simulator releases Python's lock), or one after
another.

Everything that takes an executor takes a `concurrent.futures.Executor`, so a process pool or
a Dask client's `get_executor()` fits in the same place.
"""

import os
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from typing import Any


def core_count() -> int:
    """Cores this process may use: an affinity mask or a batch system can leave fewer than there are."""
    if hasattr(os, "sched_getaffinity"):
        return max(1, len(os.sched_getaffinity(0)))
    return max(1, os.cpu_count() or 1)


def local_executor(workers: int | None = None) -> Executor:
    """Threads on this machine, one per core unless `workers` says otherwise; use it in a `with` block."""
    return ThreadPoolExecutor(workers or core_count(), thread_name_prefix="replica")


class SerialExecutor(Executor):
    """Runs each job at once in the calling thread: for tests, debuggers and profilers."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future
