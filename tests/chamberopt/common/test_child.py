"""A child answers its jobs one after another, and ends with its parent, which leaves no file."""

import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from chamberopt.common.child import ENDED, Child, ChildLostError, start_python
from chamberopt.common.errors import InputError
from tests.helpers import worker_jobs

ROOT = Path(__file__).parents[3]
posix = pytest.mark.skipif(os.name != "posix", reason="needs signals")


@pytest.fixture(scope="module")
def child() -> Iterator[Child]:
    with Child() as started:
        yield started


def test_each_value_that_a_job_yields_is_an_answer(child: Child) -> None:
    child.ask(worker_jobs.count_to, 3)
    child.ask(worker_jobs.square, 3)
    assert [child.answer() for _ in range(4)] == [1, 2, 3, 9]


def test_an_error_of_a_job_is_its_last_answer(child: Child) -> None:
    child.ask(worker_jobs.count_to, -3)
    assert child.answer() == 1
    with pytest.raises(InputError, match=r"^counts upwards only$"):
        child.answer()
    child.ask(worker_jobs.square, 3)
    assert child.answer() == 9


def test_what_a_job_prints_is_no_answer(child: Child) -> None:
    child.ask(worker_jobs.print_much)
    assert child.answer() == "answer"


@posix
@pytest.mark.parametrize("name", ["SIGINT", "SIGHUP"])
def test_a_child_leaves_signals_of_the_terminal_to_its_parent(name: str, child: Child) -> None:
    child.ask(worker_jobs.signal_oneself, signal.Signals[name])
    assert child.answer() == "alive"


@posix
def test_a_dead_child_is_told_with_its_signal() -> None:
    with Child() as child:
        child.ask(worker_jobs.signal_oneself, signal.SIGKILL)
        for _ in range(2):
            with pytest.raises(ChildLostError) as lost:
                child.answer()
            assert (lost.value.status, lost.value.is_late) == (-signal.SIGKILL, False)
            child.ask(worker_jobs.square, 3)  # nobody hears it
        assert child.pid is None


@pytest.mark.parametrize(
    ("seconds", "cpu_s"), [(2.0, None), pytest.param(math.inf, 1.0, marks=posix)]
)
def test_a_child_over_its_limit_of_time_is_late(seconds: float, cpu_s: float | None) -> None:
    with Child(seconds) as child:
        child.ask(worker_jobs.keep_busy, cpu_s)
        with pytest.raises(ChildLostError) as lost:
            child.answer()
    assert lost.value.is_late


@posix
@pytest.mark.parametrize(
    "name",
    [
        "SIGKILL",
        "SIGINT",
        *(pytest.param(x, marks=pytest.mark.long) for x in ("SIGTERM", "SIGHUP")),
    ],
)
def test_children_end_with_their_parent_and_leave_no_file(name: str, tmp_path: Path) -> None:
    # Started in the background, as by a shell's &, tests hand it an interrupt that is ignored.
    heard = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    code = f"{heard}from tests.helpers.worker_jobs import be_parent; be_parent()"
    parent = subprocess.Popen(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env={**os.environ, "TMPDIR": str(tmp_path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    assert parent.stdout is not None
    children = [int(pid) for pid in parent.stdout.readline().split()]
    assert len(children) == 2
    assert any(tmp_path.iterdir())
    parent.send_signal(signal.Signals[name])
    parent.wait()
    until = time.monotonic() + 10.0
    while any(map(lives, children)) or any(tmp_path.iterdir()):
        assert time.monotonic() < until
        time.sleep(0.05)


def lives(pid: int) -> bool:
    """Whether a process runs; one that nobody waits for has ended too."""
    command = ["ps", "-o", "stat=", "-p", str(pid)]
    state = subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()
    return bool(state) and not state.startswith("Z")


@posix
def test_a_command_that_ignores_its_interrupt_ends_with_its_parent_all_the_same() -> None:
    code = (
        "from chamberopt.common.child import interrupt_with_parent; interrupt_with_parent(); "
        "signal.signal(signal.SIGINT, signal.SIG_IGN); print(sys.argv[1], flush=True); "
        "import time; time.sleep(60)"
    )
    with start_python(code, "ready") as going:
        assert going.stdout is not None
        assert going.stdin is not None
        assert going.stdout.readline() == b"ready\n"
        going.stdin.close()
        assert going.wait(20) == ENDED
