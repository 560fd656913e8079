"""Commands that are killed at random moments: no file is torn, and what resumes ends as it would.

Each command is a process of its own with its drawing process and workers. After each kill every
file with its final name has the bytes of the undisturbed run, or is whole where it holds times.
"""

import io
import json
import os
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest

from chamberopt.common.files import LEFTOVER_PREFIXES, write_text
from chamberopt.design.load import save_design
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


def start(place: Path, name: str, out: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "chamberopt", *COMMANDS[name], "--out", str(out)],
        cwd=place,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.DEVNULL,
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
    going = start(place, name, out)
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
        first = start(place, name, undisturbed)
        assert first.wait(600) == 0
        (place / f"{name}.seconds").write_text(str(time.monotonic() - began))
    whole, seconds = files(undisturbed), float((place / f"{name}.seconds").read_text())
    rng, done, number = np.random.default_rng(seed), 0, 0
    while done < kills:
        out = place / f"{seed}-{number}" / name
        for _ in range(2 if name in RESUMES else 1):
            done += kill_and_check(place, name, out, whole, rng.uniform(0.0, 1.1 * seconds))
        if name in RESUMES:
            last = start(place, name, out)
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
def test_killed_at_twenty_random_moments(name: str, place: Path) -> None:
    check(place, name, 20, seed=2)
