"""Run Python functions in child processes, which end when this process, their parent, ends.

The standard input of a child is a pipe from its parent. The operating system closes the pipe when
the parent ends, also when the parent is killed. A thread of the child waits for the pipe to close.
"""

from __future__ import annotations

import _thread
import json
import math
import os
import pickle
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from inspect import isgenerator
from queue import SimpleQueue
from typing import Any, Self

from chamberopt.common.errors import InputError

ENDED = 130  # exit status of a child whose parent has ended, as after Ctrl-C
GRACE_S = 2.0  # in which an interrupted command removes what it has not finished
TOO_MUCH_CPU = -getattr(signal, "SIGXCPU", math.inf)  # exit status at limits.limit_cpu_time
# Errors at a pipe whose other end has closed, perhaps in the midst of a pickle, or that was closed.
CLOSED = (EOFError, OSError, ValueError, pickle.UnpicklingError)
BEGIN = "import json, signal, sys; sys.path[:] = json.loads(sys.argv.pop(1)); "
# A terminal sends Ctrl-C to all of its processes, and only the parent reacts to it.
SERVE = (
    "signal.signal(signal.SIGINT, signal.SIG_IGN); "
    "from chamberopt.common.child import serve; serve(*sys.argv[1:])"
)


def start_python(code: str, *arguments: str, **options: Any) -> subprocess.Popen[Any]:
    """Start a Python process with pipes at its standard input and output.

    Args:
        code: Python code, which must end the process when its standard input closes; `signal` and
            `sys` are imported before.
        arguments: sys.argv[1:] of the child.
        options: further arguments of subprocess.Popen.
    """
    path = json.dumps([str(one) for one in sys.path if one])
    # -P: the child imports no json.py that lies in its working folder
    command = [sys.executable, "-P", "-c", BEGIN + code, path, *arguments]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, **options)


class ChildLostError(Exception):
    """Error for a child process that ended before it answered.

    Attributes:
        status: exit status of the child, negative for the signal that ended it.
        is_late: True if a limit of time ended the child.
    """

    def __init__(self, status: int, is_late: bool) -> None:
        super().__init__(status, is_late)
        self.status, self.is_late = status, is_late


class Child:
    """Child process that does one job (a function call) after another, for use in a `with` block.

    The end of the block kills the child.
    """

    def __init__(self, seconds: float = math.inf, folder: str = "", **options: Any) -> None:
        """Start the child process.

        Args:
            seconds: time after which the child is killed.
            folder: path of a folder that the child removes if its parent ends first.
            options: further arguments of subprocess.Popen.
        """
        self._process = start_python(SERVE, folder, **options)
        self._timer, self._is_late = threading.Timer(seconds, self._end_late), False
        self._timer.daemon = True
        if seconds < math.inf:
            self._timer.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    @property
    def pid(self) -> int | None:
        """Process number (PID) of the child; None after its end."""
        return self._process.pid if self._process.poll() is None else None

    def ask(self, function: Callable[..., object], *arguments: Any) -> None:
        """Send a job: a function that the child can import, and the function's arguments.

        The job has one answer, the function's value. A generator has an answer for each value that
        it yields.
        """
        job = pickle.dumps((function, arguments), pickle.HIGHEST_PROTOCOL)
        with suppress(*CLOSED):  # the child has ended, as `answer` tells
            _send(job, self._process.stdin)

    def answer(self) -> Any:
        """Wait for the next answer of the job that was asked, and return it.

        An exception that the job raises is its last answer.

        Raises:
            ChildLostError: the child has ended.
            Exception: the job's exception.
        """
        try:
            answer = pickle.load(self._process.stdout)  # type: ignore[arg-type]
        except CLOSED:
            status = self.end()
            is_late = self._is_late or status == TOO_MUCH_CPU
            raise ChildLostError(status, is_late) from None
        succeeded, value = pickle.loads(answer)
        if not succeeded:
            raise value
        return value

    def end(self) -> int:
        """Kill the child if it still runs, and return its exit status."""
        self._timer.cancel()
        self._process.kill()
        status = self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            with suppress(OSError):
                pipe.close()  # type: ignore[union-attr]
        return status

    def _end_late(self) -> None:
        self._is_late = True
        self._process.kill()


def serve(folder: str) -> None:
    """Do the jobs that the parent sends, in the child process, until the parent ends.

    Args:
        folder: path of a folder to remove when the parent has ended.
    """
    if hasattr(signal, "SIGHUP"):  # a terminal that closes ends the parent, which ends this
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
    questions, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(2, 1)  # what a library prints is no answer
    sys.stdout = sys.stderr
    jobs: SimpleQueue[bytes] = SimpleQueue()

    def receive() -> bool:
        jobs.put(pickle.load(questions))
        return True

    _end_with_parent(receive, lambda: shutil.rmtree(folder, ignore_errors=True))
    with suppress(OSError):
        while True:
            for answer in _answers(jobs.get()):
                _send(answer, answers)
    os._exit(ENDED)


def interrupt_with_parent() -> None:
    """Wait in a thread for the end of the parent, then interrupt this process as Ctrl-C does.

    If the process still runs GRACE_S seconds later, it is ended.
    """

    def interrupt() -> None:
        if sys.platform != "win32":
            os.kill(os.getpid(), signal.SIGINT)
        else:
            _thread.interrupt_main()
        time.sleep(GRACE_S)

    _end_with_parent(lambda: os.read(0, 1), interrupt)


def _end_with_parent(receive: Callable[[], object], last_act: Callable[[], None]) -> None:
    """Wait in a thread for the end of the parent, then call `last_act` and end this process.

    Args:
        receive: function that reads from the parent's pipe, called again and again. At the end of
            the pipe it returns a false value or raises an error of CLOSED.
        last_act: function without arguments.
    """

    def watch() -> None:
        with suppress(*CLOSED):
            while receive():
                pass
        last_act()
        os._exit(ENDED)

    threading.Thread(target=watch, daemon=True).start()


def _answers(job: bytes) -> Iterator[bytes]:
    """Do a pickled job, a function call, and yield the pickle of (True, answer) for each answer.

    If the job raises an exception, the last item is the pickle of (False, exception).
    """
    try:
        function, arguments = pickle.loads(job)
        answer = function(*arguments)
        for one in answer if isgenerator(answer) else (answer,):
            yield pickle.dumps((True, one), pickle.HIGHEST_PROTOCOL)
    except Exception as error:
        yield pickle.dumps((False, _picklable(error)), pickle.HIGHEST_PROTOCOL)


def _send(content: bytes, pipe: Any) -> None:
    pickle.dump(content, pipe, pickle.HIGHEST_PROTOCOL)  # a pickle tells where its bytes end
    pipe.flush()


def _picklable(error: Exception) -> Exception:
    """Return the error, or an error with the same text if it cannot be pickled."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        if isinstance(error, InputError):
            return InputError(str(error))
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error
