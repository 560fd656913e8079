"""Read files with libraries in C++, in a child process.

A damaged file can crash the process that reads it, which is then only the child process. It can
also keep a library busy for ever, so the child's memory and computing time are limited. Computing
time does not count how long other programs use the processor.
"""

from __future__ import annotations

import math
import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from chamberopt.common.child import Child, ChildLostError
from chamberopt.common.errors import InputError
from chamberopt.common.files import private_folder, write_bytes
from chamberopt.common.limits import limit_cpu_time, limit_memory, raise_cpu_time
from chamberopt.common.number_text import plain

# Seconds of computing time. STEP files took 0.5 to 1 s up to 0.5 MB, and large files took 1.4 to
# 4.5 s for each MB (docs/reference/trust.md). A slow machine may take thrice as long, and the
# limits are ten times as long again.
LEAST_SECONDS = 30.0
VARIABLE = "CHAMBEROPT_READER_S"
WALL_CLOCK_S = 1800.0  # limit for a child that waits, and where computing time has no limit


class NativeReader(NamedTuple):
    """Function that reads files of a format in a child process, with its limits.

    Attributes:
        read: function of the path of a file and further arguments, called in the child.
        name: name of the file that the child reads.
        fault: message, without the path, about a file that crashes its reader.
        seconds_per_mb: computing time allowed beside LEAST_SECONDS [s/MB].
    """

    read: Callable[..., Any]
    name: str
    fault: str
    seconds_per_mb: float


def read_in_child(reader: NativeReader, path: Path, content: bytes, *arguments: object) -> Any:
    """Read a file's content in a child process, and return what `reader.read` returns.

    Args:
        path: file of the content, for messages.
        arguments: further arguments of `reader.read`.

    Raises:
        InputError: the reader refused the file, failed, or took too long.
    """
    seconds = given_seconds() or LEAST_SECONDS + reader.seconds_per_mb * 1e-6 * len(content)
    with (
        private_folder() as folder,
        Child(WALL_CLOCK_S, folder, stderr=subprocess.DEVNULL) as child,
    ):
        given = Path(folder) / reader.name
        write_bytes(given, content)
        child.ask(_read_limited, seconds, reader.read, given, *arguments)
        try:
            return child.answer()
        except InputError as error:
            fault = str(error)
        except Exception as error:
            is_late = isinstance(error, ChildLostError) and error.is_late
            fault = _too_long(seconds, content) if is_late else reader.fault
    raise InputError(f"{path}: {fault}")


def _too_long(seconds: float, content: bytes) -> str:
    return (
        f"its reader took longer than a sound file of {plain(1e-6 * len(content), 2)} MB does "
        f"(at least {seconds:.0f} s of computing time): it is damaged, or finer than it need "
        f"be; export it again, or allow more by the environment variable {VARIABLE} (seconds)"
    )


def _read_limited(
    seconds: float, read: Callable[..., object], given: Path, *arguments: Any
) -> object:
    """Limit the memory and computing time of this child process, and return what `read` returns."""
    limit_memory()
    limit_cpu_time(seconds)
    return read(given, *arguments)


def given_seconds() -> float:
    """Return the computing time [s] that the user allows a reader; 0 if the user does not say.

    The user says it by the environment variable CHAMBEROPT_READER_S.
    """
    text = os.environ.get(VARIABLE, "")
    try:
        seconds = float(text or "0")
    except ValueError:
        seconds = -1.0
    if not 0.0 < seconds < math.inf and text:
        raise InputError(f"{VARIABLE}: given {text!r}; give seconds, more than 0, or none")
    return seconds


def allow_more(seconds: float) -> None:
    """Allow this child process more computing time [s], unless the user has set a time."""
    if not given_seconds():
        raise_cpu_time(seconds)
