"""Commands that the page started end with its server, and nothing of them is left."""

import os
import re
import signal
import time
from pathlib import Path
from typing import Any

import pytest

from chamberopt.page.started_commands import StartedCommand
from tests.chamberopt.page.conftest import Served

pytestmark = pytest.mark.skipif(not Path("/proc/self").exists(), reason="looks in /proc")
TIME = re.compile("(?<=simulated_time_s = ).*")
SIMULATING = 'replicas"', '"candidates and confirmations"', '"candidates"'  # steps of the commands


def processes_in(folder: Path) -> dict[int, str]:
    """Command lines of the living processes, by id, that work in a folder."""
    found = {}
    for one in Path("/proc").iterdir():
        try:
            is_here = one.name.isdigit() and (one / "cwd").resolve(strict=True) == folder
            is_dead = is_here and (one / "stat").read_text().rpartition(")")[2].split()[0] == "Z"
            if is_here and not is_dead:
                found[int(one.name)] = (one / "cmdline").read_text().replace("\0", " ")
        except OSError:  # it has ended, or is another user's
            continue
    return found


def left_in(folder: Path) -> dict[int, str]:
    """The processes that work in a folder after ten seconds; they are ended."""
    until = time.monotonic() + 10.0
    while processes_in(folder) and time.monotonic() < until:
        time.sleep(0.1)
    left = processes_in(folder)
    for process in left:
        os.kill(process, signal.SIGKILL)
    return left


def served_with_a_running(command: str, folder: Path, is_awaited: bool = True) -> Served:
    """A page whose server has started a command that takes minutes, with processes of its own.

    Args:
        is_awaited: whether the command simulates already.
    """
    page = Served(folder, "design.toml")
    for name in ("design.toml", "study.toml"):
        (folder / name).write_text(TIME.sub("2000", (folder / name).read_text()))
    page.ask("/cavity", {"changes": {}})  # the checks have processes too
    of = "design.toml" if command == "simulate" else "study.toml"
    page.ask("/start", {"command": command, "of": of, "points": 4})
    until = time.monotonic() + 120.0
    while is_awaited and not any(
        step in page.get("/status").read().decode() for step in SIMULATING
    ):
        assert time.monotonic() < until
        time.sleep(0.1)
    return page


@pytest.mark.parametrize(
    ("name", "command"),
    [("SIGKILL", "simulate"), ("SIGINT", "run"),
     pytest.param("SIGTERM", "simulate", marks=pytest.mark.long),
     pytest.param("SIGHUP", "simulate", marks=pytest.mark.long),
     pytest.param("SIGKILL", "sweep", marks=pytest.mark.long)],
)  # fmt: skip
def test_nothing_outlives_the_server(name: str, command: str, tmp_path: Path) -> None:
    page = served_with_a_running(command, tmp_path)
    assert any(command in line for line in processes_in(tmp_path).values())
    page.process.send_signal(signal.Signals[name])
    page.process.communicate(timeout=60)
    assert not left_in(tmp_path)


def ended(command: StartedCommand) -> dict[str, Any]:
    """Its status when it has ended."""
    until = time.monotonic() + 60.0
    while command.status()["exit"] is None:
        assert time.monotonic() < until
        time.sleep(0.05)
    return command.status()


def test_a_result_is_kept_when_its_command_has_ended_and_left_it(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "result.json").write_text("{}")
    good = StartedCommand(["--version"], tmp_path, "out")
    bad = StartedCommand(["check", "none.toml"], tmp_path)
    assert (good.status()["exit"], good.status()["kept"]) == (None, False)
    one, two = ended(good), ended(bad)
    assert (one["exit"], one["kept"], one["fault"], one["at"]) == (0, True, [], {})
    assert one["printed"]
    assert (two["exit"], two["kept"], two["fault"]) == (2, False, two["printed"])
    assert "none.toml" in str(two["fault"])
