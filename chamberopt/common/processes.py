"""Run tasks in worker processes on this computer.

Python code runs in parallel in the processes, and a task that crashes its process fails alone. The
process pool of concurrent.futures breaks as a whole when one process dies, and does not tell which
task crashed. Here each worker process has a thread that gives it one task at a time.
"""

from __future__ import annotations

import pickle
import signal
import threading
import weakref
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import ExitStack, suppress
from functools import cached_property, lru_cache
from itertools import count
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from chamberopt.common.child import Child, ChildLostError
from chamberopt.common.errors import WorkerLostError
from chamberopt.common.files import private_folder, read_file, remove_file, write_bytes
from chamberopt.common.memory import MEMORY

P = ParamSpec("P")
T = TypeVar("T")

# A process may die by chance, for example when another program takes all memory. If two processes
# die of the same task, the task is the cause.
MAX_ATTEMPTS = 2
MAX_SHARED = 4  # shared values that a worker keeps, one for each candidate in progress


class SharedFile:
    """Stand-in for a large value, which is written to a file once.

    The pickle of the stand-in holds only the path of the file. A worker that unpickles it gets the
    large value, and reads the file only the first time.
    """

    def __init__(self, value: object, path: Path) -> None:
        self.path = path
        write_bytes(path, pickle.dumps(value, pickle.HIGHEST_PROTOCOL))
        weakref.finalize(self, _remove, path)

    def __reduce__(self) -> tuple[Callable[[Path], object], tuple[Path]]:
        return _load, (self.path,)


@lru_cache(maxsize=MAX_SHARED)
def _load(path: Path) -> object:
    return pickle.loads(read_file(path))


def _remove(path: Path) -> None:
    with suppress(OSError):
        remove_file(path)


class ProcessExecutor(Executor):
    """Executor with worker processes, each started by its first task.

    A task whose process dies runs once more, in a new process. If this process dies too, the task
    raises WorkerLostError. An exception that leaves the `with` block ends the processes at once.
    """

    def __init__(self, workers: int) -> None:
        self._feeders = ThreadPoolExecutor(workers, thread_name_prefix="worker")
        self._of_thread = threading.local()
        self._workers: list[Child] = []
        self._ended, self._count = False, workers
        self._resources, self._numbers = ExitStack(), count()

    @cached_property
    def _folder(self) -> str:
        return self._resources.enter_context(private_folder())

    def share(self, value: object) -> SharedFile:
        """Write a value that many tasks need to a file, and return a stand-in to pass to the tasks.

        The file is removed when the stand-in is freed, at the latest when the executor ends.
        """
        return SharedFile(value, Path(self._folder, f"{next(self._numbers)}.pickle"))

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        return self._feeders.submit(self._run, fn, args, kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the worker processes.

        If `wait` is true, this waits for their tasks. Otherwise they end with this program.
        """
        self._feeders.shutdown(wait, cancel_futures=cancel_futures)
        if wait:
            self._end()

    def __exit__(self, *error: Any) -> None:
        if error[0] is not None:
            self._feeders.shutdown(wait=False, cancel_futures=True)
            self._end()
        self.shutdown()

    @property
    def pids(self) -> list[int]:
        """Process numbers (PIDs) of the living worker processes."""
        return [pid for worker in self._workers if (pid := worker.pid) is not None]

    def _run(self, fn: Callable[..., T], args: tuple[object, ...], kwargs: dict[str, object]) -> T:
        """Return the value of a task, run in the worker process of this thread.

        Raises the exception of the task, or WorkerLostError if the process dies at each attempt.
        """
        for _ in range(MAX_ATTEMPTS):
            if self._ended:
                break
            try:
                worker = self._worker()
                worker.ask(_do, self._count, fn, args, kwargs)
                answer: T = worker.answer()
                return answer
            except ChildLostError as lost:
                self._of_thread.worker, status = None, lost.status
        if self._ended:
            raise WorkerLostError("the worker processes were ended")
        text = f"its worker process died {MAX_ATTEMPTS} times ({_cause_of_death(status)})"
        raise WorkerLostError(f"{text}; give fewer --workers, or look at the machine's log")

    def _worker(self) -> Child:
        """Return the worker process of this thread. Start it if there is none."""
        worker: Child | None = getattr(self._of_thread, "worker", None)
        if worker is None:
            worker = self._of_thread.worker = Child(folder=self._folder)
            self._workers.append(worker)
        return worker

    def _end(self) -> None:
        self._ended = True
        for worker in self._workers:
            worker.end()
        self._resources.close()


def _do(count: int, fn: Callable[..., T], args: tuple[object, ...], kwargs: dict[str, object]) -> T:
    """Do a task in a worker process, and return its value.

    Args:
        count: number of worker processes, which divide the memory among them.
    """
    MEMORY.processes = count
    return fn(*args, **kwargs)


def _cause_of_death(status: int) -> str:
    if status >= 0:
        return f"exit status {status}"
    killed = ", as when memory runs out" if -status == getattr(signal, "SIGKILL", None) else ""
    return f"signal {-status}{killed}"
