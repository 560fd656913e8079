"""Worker processes on this machine.

What the simulator leaves to Python runs in parallel too, and a task that crashes its process fails
alone. The process pool of concurrent.futures cannot do that: it breaks as a whole when one of its
processes dies, and does not tell which task caused it. Here each worker process is fed by a thread
of its own, one task at a time.
"""

from __future__ import annotations

import os
import pickle
import signal
import tempfile
import threading
import weakref
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import suppress
from functools import lru_cache
from multiprocessing import get_context
from typing import TYPE_CHECKING, Any

from chamberopt.common.errors import WorkerLostError
from chamberopt.common.lifetime import end_with_parent
from chamberopt.common.memory import MEMORY

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

# A process may die by chance, for example when another program takes all memory. If two die of the
# same task, the task is the cause.
MAX_ATTEMPTS = 2
MAX_SHARED = 4  # shared values that a worker keeps, of candidates that are evaluated at a time


class SharedFile:
    """A value that each worker reads once from a file; its pickle holds the file's name alone."""

    def __init__(self, value: Any) -> None:
        handle, self.path = tempfile.mkstemp(prefix="chamberopt-", suffix=".pickle")
        weakref.finalize(self, _remove, self.path)
        with os.fdopen(handle, "wb") as file:
            pickle.dump(value, file, pickle.HIGHEST_PROTOCOL)

    def __reduce__(self) -> tuple[Callable[[str], Any], tuple[str]]:
        return _load, (self.path,)


@lru_cache(maxsize=MAX_SHARED)
def _load(path: str) -> Any:
    with open(path, "rb") as file:
        return pickle.load(file)


def _remove(path: str) -> None:
    with suppress(OSError):
        os.unlink(path)


class ProcessExecutor(Executor):
    """Worker processes, each started by its first task.

    A task whose process dies runs once more, in a new process. If that dies too, the task raises
    WorkerLostError. An exception that leaves the `with` block ends the processes at once.
    """

    def __init__(self, workers: int) -> None:
        self._feeders = ThreadPoolExecutor(workers, thread_name_prefix="worker")
        self._of_thread = threading.local()
        self._workers: list[_Worker] = []
        self._ended, self._count = False, workers

    def share(self, value: Any) -> SharedFile:
        return SharedFile(value)

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        return self._feeders.submit(self._run, fn, args, kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes after their tasks, or, without waiting, together with this program."""
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
        """Process ids of the living workers."""
        processes = (worker.process for worker in self._workers)
        return [process.pid for process in processes if process.pid and process.is_alive()]

    def _run(self, fn: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
        """Run a task in this thread's process, starting one if need be."""
        task = pickle.dumps((fn, args, kwargs), pickle.HIGHEST_PROTOCOL)
        for _ in range(MAX_ATTEMPTS):
            if self._ended:
                break
            worker = getattr(self._of_thread, "worker", None)
            if worker is None:
                worker = self._of_thread.worker = _Worker(self._count)
                self._workers.append(worker)
            try:
                answer = worker.run(task)
            except (EOFError, OSError):
                self._of_thread.worker = None
                code = worker.end()
                continue
            succeeded, value = pickle.loads(answer)
            if succeeded:
                return value
            raise value
        if self._ended:
            raise WorkerLostError("the worker processes were ended")
        text = f"its worker process died {MAX_ATTEMPTS} times ({_cause_of_death(code)})"
        raise WorkerLostError(f"{text}; give fewer --workers, or look at the machine's log")

    def _end(self) -> None:
        self._ended = True
        for worker in self._workers:
            worker.end()


class _Worker:
    """A process and the pipe to it."""

    def __init__(self, count: int) -> None:
        context = get_context("spawn")
        self._pipe, worker_end = context.Pipe()
        # Daemon processes end with this program; `_serve` sees to it where it is killed.
        self.process = context.Process(target=_serve, args=(worker_end, count), daemon=True)
        self.process.start()
        worker_end.close()

    def run(self, task: bytes) -> bytes:
        """Run a pickled task; see `_answer`. Raises EOFError or OSError if the process died."""
        self._pipe.send_bytes(task)
        return self._pipe.recv_bytes()

    def end(self) -> int | None:
        """End the process if it still runs, and return its exit code."""
        self.process.terminate()
        self.process.join()
        return self.process.exitcode


def _serve(pipe: Connection, count: int) -> None:
    """Run tasks in one of so many worker processes until the other end of the pipe closes."""
    # A terminal sends Ctrl-C to all of its processes. Only the main program reacts to it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
    MEMORY.processes = count
    with suppress(EOFError, OSError):
        while True:
            pipe.send_bytes(_answer(pipe.recv_bytes()))


def _answer(task: bytes) -> bytes:
    """Pickle of (True, the task's result) or (False, its exception)."""
    try:
        fn, args, kwargs = pickle.loads(task)
        return pickle.dumps((True, fn(*args, **kwargs)), pickle.HIGHEST_PROTOCOL)
    except Exception as error:
        return pickle.dumps((False, _picklable(error)), pickle.HIGHEST_PROTOCOL)


def _picklable(error: Exception) -> Exception:
    """The error, or its text if its class takes other arguments than it stores."""
    try:
        return pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")


def _cause_of_death(code: int | None) -> str:
    if code is None or code >= 0:
        return f"exit status {code}"
    killed = ", as when memory runs out" if -code == getattr(signal, "SIGKILL", None) else ""
    return f"signal {-code}{killed}"
