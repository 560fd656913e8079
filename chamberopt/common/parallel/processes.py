"""Worker processes on this machine: what the simulator leaves to Python runs in parallel too, and a task that takes its
process down costs itself alone.

Each worker is fed by a thread of its own, one task at a time: concurrent.futures' process pool breaks as a whole when
one of its processes dies, and says not which task did it.
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
from types import TracebackType
from typing import TYPE_CHECKING, Any

from chamberopt.common.errors import WorkerLostError

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

ATTEMPTS = 2  # a process may be lost by chance, such as to the memory of another program; twice is the task's doing
KEPT = 2  # parcels a worker keeps open: of this candidate, and of the one before it


class SharedFile:
    """A value that travels once a worker: its pickle is the name of a file, which opens as the value itself."""

    def __init__(self, value: Any) -> None:
        handle, self.path = tempfile.mkstemp(prefix="chamberopt-", suffix=".parcel")
        weakref.finalize(self, _remove, self.path)
        with os.fdopen(handle, "wb") as file:
            pickle.dump(value, file, pickle.HIGHEST_PROTOCOL)

    def __reduce__(self) -> tuple[Callable[[str], Any], tuple[str]]:
        return _opened, (self.path,)


@lru_cache(maxsize=KEPT)
def _opened(path: str) -> Any:
    with open(path, "rb") as file:
        return pickle.load(file)


def _remove(path: str) -> None:
    with suppress(OSError):
        os.unlink(path)


class ProcessExecutor(Executor):
    """So many processes, each started by its first task. A task whose process dies is run once more in a new one.

    Its second death raises WorkerLostError. Leaving the `with` block by an exception ends the processes at once.
    """

    def __init__(self, workers: int) -> None:
        self._feeders = ThreadPoolExecutor(workers, thread_name_prefix="worker")
        self._own = threading.local()
        self._workers: list[_Worker] = []
        self._ended = False

    def share(self, value: Any) -> SharedFile:
        return SharedFile(value)

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        return self._feeders.submit(self._run, fn, args, kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self._feeders.shutdown(wait, cancel_futures=cancel_futures)
        if wait:  # else they end with this program
            self._end()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is not None:
            self._feeders.shutdown(wait=False, cancel_futures=True)
            self._end()
        self.shutdown()

    @property
    def pids(self) -> list[int]:
        """Of the processes that are there."""
        return [
            worker.process.pid
            for worker in self._workers
            if worker.process.pid and worker.process.is_alive()
        ]

    def _run(self, fn: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
        task = pickle.dumps((fn, args, kwargs), pickle.HIGHEST_PROTOCOL)
        for _ in range(ATTEMPTS):
            if self._ended:
                break
            worker = getattr(self._own, "worker", None)
            if worker is None:
                worker = self._own.worker = _Worker()
                self._workers.append(worker)
            try:
                answer = worker.answer(task)
            except (EOFError, OSError):
                self._own.worker = None
                code = worker.end()
                continue
            done, value = pickle.loads(answer)
            if done:
                return value
            raise value
        if self._ended:
            raise WorkerLostError("the worker processes were ended")
        text = f"its worker process died {ATTEMPTS} times ({_cause(code)})"
        raise WorkerLostError(f"{text}; give fewer --workers, or look at the machine's log")

    def _end(self) -> None:
        self._ended = True
        for worker in self._workers:
            worker.end()


class _Worker:
    """One process and the pipe to it."""

    def __init__(self) -> None:
        context = get_context("spawn")
        self._pipe, theirs = context.Pipe()
        # A daemon: should this program end without a farewell, its workers end with it.
        self.process = context.Process(target=_serve, args=(theirs,), daemon=True)
        self.process.start()
        theirs.close()

    def answer(self, task: bytes) -> bytes:
        """See _answered. EOFError or OSError when the process is gone."""
        self._pipe.send_bytes(task)
        return self._pipe.recv_bytes()

    def end(self) -> int | None:
        """Ends the process, if it has not ended; its exit code."""
        self.process.terminate()
        self.process.join()
        return self.process.exitcode


def _serve(pipe: Connection) -> None:
    """A worker's life: task after task until the other end closes."""
    # Ctrl-C goes to all processes of a terminal; what becomes of it is the program's to say, not a worker's.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with suppress(EOFError, OSError):
        while True:
            pipe.send_bytes(_answered(pipe.recv_bytes()))


def _answered(task: bytes) -> bytes:
    """(True, what the task returns) or (False, what it raises)."""
    try:
        fn, args, kwargs = pickle.loads(task)
        return pickle.dumps((True, fn(*args, **kwargs)), pickle.HIGHEST_PROTOCOL)
    except Exception as error:
        return pickle.dumps((False, _portable(error)), pickle.HIGHEST_PROTOCOL)


def _portable(error: Exception) -> Exception:
    """The error as it can travel: one whose class takes other arguments than it keeps cannot be unpickled."""
    try:
        return pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")


def _cause(code: int | None) -> str:
    if code is None or code >= 0:
        return f"exit status {code}"
    killed = ", as when memory runs out" if -code == getattr(signal, "SIGKILL", None) else ""
    return f"signal {-code}{killed}"
