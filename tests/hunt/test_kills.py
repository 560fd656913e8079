"""Commands that are killed at random moments: no file is torn, and what resumes ends as it would.

Each command is a process of its own with its drawing process and workers. After each kill every
file with its final name has the bytes of the undisturbed run, or is whole where it holds times.
"""

import io
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
import zipfile
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from chamberopt.common.files import LEFTOVER_PREFIXES, write_text
from chamberopt.design.load import save_design
from tests.chamberopt.cli.test_interrupt import BEGIN
from tests.helpers.synthetic import plate_design

ROOT = Path(__file__).parents[2]
COMMANDS = {
    "simulate": ["simulate", "plate.toml"],
    "run": ["run", "s.toml"],
    "sweep": ["sweep", "s.toml", "--grid", "4", "--workers", "2"],
    "compare": ["compare", "plate.toml", "light.toml"],
    "accuracy": ["accuracy", "plate.toml", "--budget-s", "1"],
    "strip": ["strip", "plate.toml", "--disc-mm", "40"],
}
RESUMES = ("run", "sweep")
# Times and dates, or a budget of time, are in these: they are whole, but not the same each time.
TIMED = ("result.json", "timings.jsonl", "history.csv", "compare.json", "accuracy.json",
         "accuracy.csv", "accuracy.png")  # fmt: skip
WITH_TIMES = ("created", "timings_s", "seconds", "sha256")


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("kills")
    for name, mass in (("plate", 3.0), ("light", 2.0)):
        short = plate_design(
            process__accuracy__simulated_time_s=0.3,
            process__accuracy__warmup_time_s=0.05,
            process__accuracy__replicas=3,
        )
        save_design(short.changed({"shot.mass_g": mass}), folder / f"{name}.toml")
    write_text(
        folder / "s.toml",
        'design = "plate.toml"\n[vary]\n"shot.mass_g" = [1.5, 6.0]\n'
        "[optimizer]\nevaluations = 5\nconfirm = 1\nconfirm_replicas = 3\n",
    )
    return folder


def start(
    place: Path, name: str, out: Path, *program: str, stdout: int = subprocess.DEVNULL
) -> subprocess.Popen[str]:
    """Start a command by a program of Python, such as -m chamberopt, in a session of its own."""
    return subprocess.Popen(
        [sys.executable, *program, *COMMANDS[name], "--out", str(out)],
        cwd=place,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=stdout,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def files(folder: Path) -> dict[str, bytes]:
    """The files with their final names."""
    return {
        one.relative_to(folder).as_posix(): one.read_bytes()
        for one in sorted(folder.rglob("*"))
        if one.is_file() and not one.name.startswith(LEFTOVER_PREFIXES)
    }


def without_times(value: object) -> object:
    """A result without its times, and without the digests of files that hold some."""
    if isinstance(value, dict):
        kept = {name: one for name, one in value.items() if not name.endswith(TIMED)}
        return {k: without_times(v) for k, v in kept.items() if k not in WITH_TIMES}
    return [without_times(one) for one in value] if isinstance(value, list) else value


def torn(name: str, content: bytes, whole: bytes) -> bool:
    """Whether a file is neither that of the undisturbed run nor, if it grows, its beginning."""
    last = name.rpartition("/")[2]
    if last == "history.jsonl":
        return not whole.startswith(content)
    if "confirm/" in name:  # it holds run times
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            return archive.testzip() is not None
    if last not in TIMED:
        return content != whole
    if last.endswith(".json"):
        return not isinstance(json.loads(content), dict)
    return not content.endswith((b"\n", b"IEND\xaeB`\x82"))


def alive(session: int) -> list[str]:
    """Processes of a session that have not ended."""
    found = subprocess.run(
        ["ps", "-o", "stat=,args=", "-s", str(session)], capture_output=True, text=True, check=False
    )
    return [line for line in found.stdout.splitlines() if not line.startswith("Z")]


def kill_and_check(
    place: Path, name: str, out: Path, whole: dict[str, bytes], seconds: float
) -> bool:
    """Start a command and kill it after some seconds; whether it was still running."""
    going = start(place, name, out, "-m", "chamberopt")
    try:
        _, message = going.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        os.kill(going.pid, signal.SIGKILL)
        going.communicate()
    else:
        assert "Traceback" not in message
    until = time.monotonic() + 20.0
    while alive(going.pid) and time.monotonic() < until:
        time.sleep(0.1)
    assert not alive(going.pid), "its workers and its drawing process end with it"
    for file, content in files(out).items():
        assert file in whole
        assert not torn(file, content, whole[file]), file
    return going.returncode == -signal.SIGKILL


def check(place: Path, name: str, kills: int, seed: int) -> None:
    undisturbed = place / "whole" / name  # the name is in the pictures
    if not undisturbed.exists():
        began = time.monotonic()
        first = start(place, name, undisturbed, "-m", "chamberopt")
        assert first.wait(600) == 0
        (place / f"{name}.seconds").write_text(str(time.monotonic() - began))
    whole, seconds = files(undisturbed), float((place / f"{name}.seconds").read_text())
    rng, done, number = np.random.default_rng(seed), 0, 0
    while done < kills:
        out = place / f"{seed}-{number}" / name
        for _ in range(2 if name in RESUMES else 1):
            done += kill_and_check(place, name, out, whole, rng.uniform(0.0, 1.1 * seconds))
        if name in RESUMES:
            last = start(place, name, out, "-m", "chamberopt")
            _, message = last.communicate(timeout=600)
            assert last.returncode == 0, message
            ended = files(out)
            assert set(ended) == set(whole)
            for file, content in ended.items():
                assert not torn(file, content, whole[file]), file
                if file.endswith("result.json"):
                    assert without_times(json.loads(content)) == without_times(
                        json.loads(whole[file])
                    )
            assert ended["history.jsonl"] == whole["history.jsonl"]
        shutil.rmtree(out.parent, ignore_errors=True)
        number += 1
    print(f"{name}: {done} kills in {number} folders")


@pytest.mark.skipif(not hasattr(os, "setsid"), reason="needs sessions of processes")
@pytest.mark.parametrize("name", ["simulate"])  # all of them in the long test
def test_killed_at_a_random_moment(name: str, place: Path) -> None:
    check(place, name, 1, seed=1)


@pytest.mark.long
@pytest.mark.skipif(not hasattr(os, "setsid"), reason="needs sessions of processes")
@pytest.mark.parametrize("name", COMMANDS)
def test_killed_at_thirty_random_moments(name: str, place: Path) -> None:
    check(place, name, 30, seed=2)


def interrupt_and_check(place: Path, name: str, out: Path, seconds: float) -> int:
    """Start a command and press Ctrl-C after some seconds in it; its exit status."""
    going = start(place, name, out, "-c", BEGIN, stdout=subprocess.PIPE)
    assert going.stdout is not None
    assert going.stdout.readline() == "\n"
    time.sleep(seconds)
    os.killpg(going.pid, signal.SIGINT)  # as a terminal does
    _, message = going.communicate(timeout=60)
    assert "Traceback" not in message
    assert going.returncode in (0, 130), message
    assert going.returncode == 0 or "interrupted" in message or "stop" in message, message
    until = time.monotonic() + 20.0
    while alive(going.pid) and time.monotonic() < until:
        time.sleep(0.1)
    assert not alive(going.pid)
    return going.returncode


@pytest.mark.long
@pytest.mark.skipif(not hasattr(os, "setsid"), reason="needs sessions of processes")
def test_ctrl_c_at_fifty_random_moments(place: Path) -> None:
    """Ten of each of five commands; nothing is torn, and at least most were interrupted."""
    rng, ended = np.random.default_rng(3), []
    for name in ("simulate", "run", "sweep", "compare", "accuracy"):
        check(place, name, 0, seed=3)  # the undisturbed run
        whole = files(place / "whole" / name)
        for number in range(10):
            out = place / f"interrupted-{number}" / name
            seconds = rng.uniform(0.0, float((place / f"{name}.seconds").read_text()))
            ended.append(interrupt_and_check(place, name, out, seconds))
            for file, content in files(out).items():
                assert not torn(file, content, whole[file]), file
            shutil.rmtree(out.parent, ignore_errors=True)
    print(f"{ended.count(130)} of {len(ended)} were interrupted")
    assert ended.count(130) > 25


@pytest.mark.long
def test_the_page_is_ended_at_twenty_random_moments(tmp_path: Path) -> None:
    """Of any signal, and any command that it started: nothing is left after seconds."""
    pytest.importorskip("uvicorn", reason="extra `page` is not installed")
    from tests.chamberopt.page.test_started_commands import left_in, served_with_a_running

    rng = np.random.default_rng(4)
    for number in range(20):
        name = str(rng.choice(["SIGTERM", "SIGHUP", "SIGKILL", "SIGINT"]))
        command = str(rng.choice(["simulate", "run", "sweep"]))
        folder = tmp_path / str(number)
        folder.mkdir()
        page = served_with_a_running(command, folder, is_awaited=False)
        time.sleep(rng.uniform(0.0, 6.0))
        page.process.send_signal(signal.Signals[name])
        page.process.communicate(timeout=60)
        left = left_in(folder)
        assert not left, (name, command, left)


@pytest.mark.long
def test_the_page_takes_no_body_beyond_its_limit(tmp_path: Path) -> None:
    """Bodies in chunks of any size, whole, cut off and malformed: the server goes on in bounds."""
    pytest.importorskip("uvicorn", reason="extra `page` is not installed")
    from tests.chamberopt.page.conftest import Served

    rng, page = np.random.default_rng(5), Served(tmp_path, "design.toml")
    resident = Path(f"/proc/{page.process.pid}/statm")
    before = int(resident.read_text().split()[1])
    for _ in range(60):
        address, port = page.host.split(":")
        with socket.create_connection((address, int(port)), timeout=20.0) as connection:
            names = {"host": page.host, "origin": page.origin, "cookie": page.cookie,
                     "x-chamberopt-key": page.key, "transfer-encoding": "chunked"}  # fmt: skip
            head = "".join(f"{name}: {text}\r\n" for name, text in names.items())
            connection.sendall(f"POST /shape HTTP/1.1\r\n{head}\r\n".encode())
            size = int(rng.choice([1, 100, 60_000, 1_000_000]))
            claimed = size if rng.random() < 0.8 else int(rng.choice([0, 2**31, 2**63]))
            with suppress(OSError):
                for _ in range(min(20_000_000 // size, 2_000)):
                    connection.sendall(b"%x\r\n%s\r\n" % (claimed, bytes(size)))
    try:
        assert page.ask("/read", {})["read"] == page.read
        assert int(resident.read_text().split()[1]) - before < 50e6 / os.sysconf("SC_PAGE_SIZE")
    finally:
        page.process.kill()
        page.process.communicate()
