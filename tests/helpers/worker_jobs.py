"""Small functions for worker processes to import; some count their calls in files of a folder.

Few need the packages of the simulator, which take a process two seconds of CPU time to import.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.executor import local_executor, result_of, share
from chamberopt.common.limits import limit_cpu_time

if TYPE_CHECKING:
    from chamberopt.design.design import Design
    from chamberopt.simulation.evaluation import Evaluation


def mark(folder: Path, name: object) -> None:
    """Add a byte to the file of that name, to count events over all processes."""
    with open(folder / str(name), "ab") as file:
        file.write(b".")


def marks(folder: Path) -> dict[str, int]:
    return {path.name: path.stat().st_size for path in folder.iterdir()}


def square(number: int, folder: Path | None = None, seconds: float = 0.0) -> int:
    if folder is not None:
        mark(folder, number)
    time.sleep(seconds)
    return number * number


def count_to(number: int) -> Iterator[int]:
    """Give the numbers from 1 on; below 0, raise InputError after 1."""
    for one in range(1, abs(number) + 1):
        yield one
        if number < 0:
            raise InputError("counts upwards only")


def print_much() -> str:
    print("printed", flush=True)
    os.write(1, b"written")
    return "answer"


def signal_oneself(number: int) -> str:
    os.kill(os.getpid(), number)
    time.sleep(0.1)
    return "alive"


def keep_busy(cpu_s: float | None = None) -> None:
    """Compute for ever, within a limit of computing time if one is given."""
    if cpu_s is not None:
        limit_cpu_time(cpu_s)
    while True:
        pass


def wait_beside(file: Path) -> None:
    """Make a file `waiting` beside another and wait for long."""
    mark(file.parent, "waiting")
    time.sleep(60.0)


def be_parent() -> None:
    """Start two workers, with a value that they share, print their numbers and wait for long."""
    with local_executor(2, "processes") as executor:
        shared = share(executor, np.zeros(1000))
        print(*executor.map(pid_with, [shared] * 2), flush=True)
        result_of(executor.submit(square, 3, None, 60.0))


def pid_with(shared: np.ndarray) -> int:
    time.sleep(0.5)
    return os.getpid()


def pid_of(_: object) -> int:
    time.sleep(0.05)
    return os.getpid()


def die(folder: Path, times: int = 1) -> str:
    """Kill the own process some times, then answer."""
    mark(folder, "die")
    if marks(folder)["die"] <= times:
        os.kill(os.getpid(), signal.SIGKILL)
    return "alive"


def refuse(text: str) -> None:
    raise InputError(text)


def open_nothing(folder: Path) -> bytes:
    mark(folder, "tried")
    return (folder / "nothing").read_bytes()


class AwkwardError(Exception):
    """Cannot be unpickled: its class takes two arguments and stores one."""

    def __init__(self, text: str, more: int) -> None:
        super().__init__(text)
        self.more = more


class AwkwardInputError(AwkwardError, InputError):
    pass


def refuse_awkwardly(kind: type[AwkwardError]) -> None:
    raise kind("open edges", 3)


class Counted:
    """Counts in a folder in which processes it is unpickled."""

    def __init__(self, folder: Path, size: int) -> None:
        self.folder, self.ballast = folder, np.zeros(size)

    def __setstate__(self, state: dict) -> None:
        self.__dict__.update(state)
        mark(self.folder, os.getpid())


def size_of(counted: Counted, _: int) -> int:
    time.sleep(0.02)
    return counted.ballast.size


def hill(design: Design, stream: str, replicas: int | None) -> Evaluation:
    """An evaluator for which heavier shot is better up to 6 g; above 9 g it raises InputError."""
    from tests.helpers.synthetic import judged

    mass = design.shot.mass_g
    if mass > 9.0:
        raise InputError(f"shot: {mass:g} g do not fit")
    time.sleep(0.02)
    return judged(
        0.5 - 0.01 * (mass - 6.0) ** 2 + np.linspace(-0.01, 0.01, 4), mean_coverage=mass / 10.0
    )


def deadly(design: Design, stream: str, replicas: int | None) -> Evaluation:
    """An evaluator that kills its process at 6 g."""
    if abs(design.shot.mass_g - 6.0) < 1e-9:
        os.kill(os.getpid(), signal.SIGKILL)
    return hill(design, stream, replicas)
