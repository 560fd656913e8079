"""Read files with libraries in C++ in a process of its own: a damaged file can end the process.

The process has limits on memory and on computing time, which do not count what other programs take
of the processor. A damaged file can keep such a library busy for ever.
"""

from __future__ import annotations

import math
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from chamberopt.common.errors import InputError
from chamberopt.common.files import private_folder, write_bytes
from chamberopt.common.lifetime import end_with_stdin
from chamberopt.common.limits import limit_cpu_time, raise_cpu_time

# Of computing time. The shipped and other STEP files took 0.5 to 1 s up to 0.5 MB, and 1.4 to 4.5 s
# for each MB of large ones (docs/trust.md); a slow machine may take thrice that, and this is ten
# times as much again.
LEAST_SECONDS = 30.0
VARIABLE = "CHAMBEROPT_READER_S"
WALL_CLOCK_S = 1800.0  # for a process that waits, and where computing time cannot be limited
BEGIN = (
    "import sys; from chamberopt.common.limits import limit_memory; limit_memory(); "
    "from chamberopt.geometry.meshes.native_reader import begin; begin(*sys.argv[1:3]); "
    "del sys.argv[1]; "
)


class NativeReader(NamedTuple):
    """How a format is read in a process of its own.

    Attributes:
        source, target: names of the file that is read and of the one that is made.
        code: Python code that finds the paths of both, then the arguments, in sys.argv[1:].
        seconds_per_mb: of computing time, beside LEAST_SECONDS.
    """

    source: str
    target: str
    code: str
    seconds_per_mb: float


@contextmanager
def converted(
    reader: NativeReader, path: Path, content: bytes, *arguments: object
) -> Iterator[Path | None]:
    """Yield the file that a reader makes of the content of a path, or None if it fails.

    Raises:
        InputError: it took too long.
    """
    seconds = given_seconds() or LEAST_SECONDS + reader.seconds_per_mb * 1e-6 * len(content)
    with private_folder() as folder:
        given, made = Path(folder) / reader.source, Path(folder) / reader.target
        write_bytes(given, content)
        words = map(str, (seconds, given, made, *arguments))
        watched, held = os.pipe()  # it is closed when this process ends, however it ends
        try:
            run = subprocess.run(
                [sys.executable, "-P", "-c", BEGIN + reader.code, *words],
                stdin=watched,
                capture_output=True,
                timeout=WALL_CLOCK_S,
                check=False,
            )
            is_late = run.returncode == -getattr(signal, "SIGXCPU", math.inf)
        except subprocess.TimeoutExpired:
            is_late = True
        finally:
            os.close(watched)
            os.close(held)
        if is_late:
            raise InputError(
                f"{path}: its reader took longer than a sound file of "
                f"{1e-6 * len(content):.2g} MB does (at least {seconds:.0f} s of computing time): "
                "it is damaged, or finer than it need be; export it again, or allow more by the "
                f"environment variable {VARIABLE} (seconds)"
            )
        yield made if run.returncode == 0 and made.is_file() else None


def given_seconds() -> float:
    """Seconds of computing time that the user allows a reader; 0 if none are given."""
    text = os.environ.get(VARIABLE, "")
    try:
        seconds = float(text or "0")
    except ValueError:
        seconds = -1.0
    if not 0.0 < seconds < math.inf and text:
        raise InputError(f"{VARIABLE}: given {text!r}; give seconds, more than 0, or none")
    return seconds


def begin(seconds: str, source: str) -> None:
    """Limit this process's computing time, and let it end with the one that started it.

    Then the folder of the file that it reads is removed.
    """
    limit_cpu_time(float(seconds))
    end_with_stdin(lambda: shutil.rmtree(Path(source).parent, ignore_errors=True))


def allow_more(seconds: float) -> None:
    """Allow this process more computing time, for work that was asked for, unless one is given."""
    if not given_seconds():
        raise_cpu_time(seconds)
